"""Positions, velocities and accelerations as a user gives them, brought to one shape."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.errors import InvalidArray

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]


def samples(n_joints: int, **given: ArrayLike) -> tuple[Array, ...]:
    """Bring arrays to the one shape that all of them broadcast to.

    Parameters
    ----------
    n_joints : int
    **given : scalar, or array_like of shape (n_joints,) or (n_samples, n_joints)
        By name, for messages. A scalar counts for all joints; of a robot with one joint, shape
        (n_samples,) will do.

    Returns
    -------
    tuple of ndarray, shape (n_joints,) or (n_samples, n_joints)

    Raises
    ------
    InvalidArray
        Another shape, different numbers of samples, or values that are no finite numbers.
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
        raise InvalidArray(
            f"{name} has {bad} values that are NaN or infinite; leave those samples out"
        )
    return array


def _wanted(n_joints: int) -> str:
    return f"it must be a number, or an array of shape ({n_joints},) or (n_samples, {n_joints})"
