"""Warmth of the gears of a model's robot: as it is stated, or along a motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.errors import InvalidArray, NotEnoughData
from hil.friction.warmth import History, warmth_at
from hil.results.samples import samples

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from hil.arrays import Array
    from hil.friction.warmth import Warmth
    from hil.results.identified_robot import IdentifiedRobot


def known_warmth(model: IdentifiedRobot) -> tuple[Warmth | None, ...]:
    """How friction of each axis depends on its warmth; None where that is not identified."""
    if model.friction_law is None:
        return (None,) * model.robot.n_joints
    return tuple(None if law is None else law.warmth for law in model.friction_law.axes)


def warmth_of(model: IdentifiedRobot, warmth: ArrayLike | None, q: Array) -> Array | None:
    """Stated warmth in the shape of `q`; None where none is stated.

    Raises
    ------
    InvalidArray
        Another shape, or outside 0 to 1 on an axis whose warmth is identified.
    NotEnoughData
        No axis's is.
    """
    if warmth is None:
        return None
    identified = np.array([each is not None for each in known_warmth(model)])
    if not identified.any():
        raise NotEnoughData(
            f"warmth is stated, but the model of {model.robot.name} knows of no axis how friction"
            " depends on it: leave warmth out, or identify longer runs together (hil identify RUN"
            " --with RUN)"
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
    """Warmth along a motion; see `hil.results.model.Model.warmth`."""
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
    for axis, law in enumerate(() if model.friction_law is None else model.friction_law.axes):
        if law is not None and law.warmth is not None:
            past = History(t[1:], mean / law.speed, float(t[0]))
            taus = law.warmth.warming, law.warmth.cooling
            found[:, axis] = warmth_at(past, axis, *taus, t, float(begin[axis]))
    return found


def _refuse_outside(warmth: Array) -> None:
    if not ((warmth >= 0) & (warmth <= 1)).all():
        worst = warmth.ravel()[np.argmax(~((warmth >= 0) & (warmth <= 1)).ravel())]
        raise InvalidArray(f"warmth {worst:g} must be from 0, cold, to 1, as warm as motion makes")
