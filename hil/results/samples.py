"""Conversion of a user's positions, velocities, accelerations and warmth to a common shape."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.errors import InvalidArray, NotEnoughData
from hil.friction.warmth import History, warmth_at

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from hil.arrays import Array
    from hil.friction.warmth import Warmth
    from hil.results.identified_robot import IdentifiedRobot


def samples(n_joints: int, **given: ArrayLike) -> tuple[Array, ...]:
    """Check arrays and broadcast to a common shape.

    Parameters
    ----------
    **given : scalar, or array_like of shape (n_joints,) or (n_samples, n_joints)
        Arrays with names for messages. A scalar applies to all joints; for a robot with one joint,
        shape (n_samples,) is accepted.

    Returns
    -------
    tuple of ndarray, shape (n_joints,) or (n_samples, n_joints)

    Raises
    ------
    InvalidArray
        Wrong shape, different numbers of samples, or values that are not finite.
    """
    arrays = [_array(name, values, n_joints) for name, values in given.items()]
    try:
        shape = np.broadcast_shapes(*(array.shape for array in arrays), (n_joints,))
    except ValueError as error:
        shapes = ", ".join(f"{name} {a.shape}" for name, a in zip(given, arrays, strict=True))
        raise InvalidArray(f"{shapes}: all must have the same number of samples") from error
    return tuple(np.broadcast_to(array, shape) for array in arrays)


def _array(name: str, values: ArrayLike, n_joints: int) -> Array:
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidArray(f"{name}: {error}; {_wanted(n_joints)}") from error
    if n_joints == 1 and array.ndim == 1:
        array = array.reshape(-1, 1) if array.size != 1 else array
    if array.ndim > 2 or (array.ndim and array.shape[-1] != n_joints):
        raise InvalidArray(f"{name} has shape {array.shape}; {_wanted(n_joints)}")
    if not np.isfinite(array).all():
        bad = int(np.count_nonzero(~np.isfinite(array)))
        raise InvalidArray(f"{name} has {bad} values that are NaN or infinite; omit these samples")
    return array


def _wanted(n_joints: int) -> str:
    return f"it must be a number, or an array of shape ({n_joints},) or (n_samples, {n_joints})"


def known_warmth(model: IdentifiedRobot) -> tuple[Warmth | None, ...]:
    """Return the dependence of friction on warmth by axis; None if not identified."""
    return tuple(None if law is None else law.warmth for law in model.friction_law.axes)


def warmth_of(model: IdentifiedRobot, warmth: ArrayLike | None, q: Array) -> Array | None:
    """Return the stated warmth in the shape of `q`; None if not stated.

    Raises
    ------
    InvalidArray
        Wrong shape, or outside 0 to 1 on an axis with identified warmth.
    NotEnoughData
        No axis has an identified warmth.
    """
    if warmth is None:
        return None
    identified = np.array([each is not None for each in known_warmth(model)])
    if not identified.any():
        raise NotEnoughData(
            f"warmth is given, but in the model of {model.robot.name} no friction depends on "
            "warmth: omit warmth, or identify longer runs together (hil identify RUN --with RUN)"
        )
    try:
        found = np.broadcast_to(np.asarray(warmth, dtype=np.float64), q.shape)
    except ValueError as error:
        raise InvalidArray(
            f"warmth of shape {np.shape(warmth)} must be one value, or one for each of"
            f" {model.robot.n_joints} joints, or of the shape of q, {q.shape}"
        ) from error
    _refuse_outside(found[..., identified])
    return found


def warmth_along(model: IdentifiedRobot, time: ArrayLike, qd: ArrayLike, start: ArrayLike) -> Array:
    """Return the warmth along a motion; see `hil.results.model.Model.warmth`."""
    (speed,) = samples(model.robot.n_joints, qd=qd)
    speed, t = np.atleast_2d(speed), np.asarray(time, dtype=np.float64)
    if t.shape != speed.shape[:1] or not (np.diff(t) > 0).all() or not np.isfinite(t).all():
        raise InvalidArray(
            f"time of shape {t.shape} must ascend and have one value for each of the"
            f" {len(speed)} rows of qd"
        )
    begin = np.broadcast_to(np.asarray(start, dtype=np.float64), speed.shape[1:])
    _refuse_outside(begin)
    mean = (np.abs(speed[1:]) + np.abs(speed[:-1])) / 2
    found = np.full(speed.shape, np.nan)
    for axis, law in enumerate(model.friction_law.axes):
        if law is not None and law.warmth is not None:
            past = History(t[1:], mean / law.speed, float(t[0]))
            taus = law.warmth.warming, law.warmth.cooling
            found[:, axis] = warmth_at(past, axis, *taus, t, float(begin[axis]))
    return found


def _refuse_outside(warmth: Array) -> None:
    if not ((warmth >= 0) & (warmth <= 1)).all():
        worst = warmth.ravel()[np.argmax(~((warmth >= 0) & (warmth <= 1)).ravel())]
        raise InvalidArray(f"warmth {worst:g} must be in [0, 1]: 0 cold, 1 warmed up by motion")
