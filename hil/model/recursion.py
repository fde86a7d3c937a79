"""Newton-Euler recursion in machine code (``recursion.c``), built at installation.

The functions take contiguous arrays of `float` and `int64`, as made by `hil.model.dynamics`. If no
C compiler was available at installation, importing this module raises ModuleNotFoundError, and
`hil.model.recursion_by_arrays` gives the same results, more slowly.
"""

from __future__ import annotations

from ctypes import c_int64
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.machine_code import library, pointer

if TYPE_CHECKING:
    from hil.arrays import Array, Integers


def columns(
    state: Array,
    frames: Array,
    parents: Integers,
    gravity: Array,
    kinds: Integers,
    links: Integers,
    rows: Integers,
    out: Array,
) -> None:
    """Compute the torque on the joints `rows` per unit of standard parameters.

    Parameters
    ----------
    state : array, shape (5, n_samples, n_joints)
        Cosine and sine of the angle about each joint's axis, shift along it, velocity,
        acceleration.
    frames : array, shape (n_joints, 4)
        cos(alpha), sin(alpha), d, and 1 for a revolute or 0 for a prismatic joint.
    parents : int array, shape (n_joints,)
        Indices of the joints that carry each joint, lower than its own; -1 for the base.
    gravity : array, shape (3,)
        Gravity in the base frame [m/s^2].
    kinds, links : int arrays, shape (n_columns,)
        Index in eq. (4) and link of each column; links never decrease.
    rows : int array, shape (n_rows,)
        Joints in ascending order.
    out : array, shape (n_samples, n_rows, n_columns)
        Output array.
    """
    arrays = state, frames, parents, gravity, kinds, links, rows
    _call(_LIBRARY.columns, arrays, (*state.shape[1:], kinds.size, rows.size), out)


def torques(
    state: Array,
    frames: Array,
    parents: Integers,
    gravity: Array,
    kinds: Integers,
    links: Integers,
    values: Array,
    out: Array,
) -> None:
    """Compute the torque on all joints for standard parameters of the given `values`.

    Parameters are those of `columns`; `values` has the shape (n_columns,) and `out` (n_samples,
    n_joints).
    """
    arrays = state, frames, parents, gravity, kinds, links, values
    _call(_LIBRARY.torques, arrays, (*state.shape[1:], kinds.size), out)


def positions(q: Array, theta: Array, shift: Array, revolute: Array, state: Array) -> None:
    """Fill the first three parts of a state from positions (n_samples, n_joints)."""
    arrays = np.ascontiguousarray(q), theta, shift, revolute
    if _LIBRARY.positions(*map(pointer, arrays), *map(c_int64, q.shape), pointer(state)):
        angle = theta + revolute * q
        far = ~(np.abs(angle) <= 2.0**20)  # too large for the machine code's quarter turns, or NaN
        state[0][far], state[1][far] = np.cos(angle[far]), np.sin(angle[far])


def _call(
    function: Any, arrays: tuple[Array | Integers, ...], sizes: tuple[int, ...], out: Array
) -> None:
    if function(*map(pointer, arrays), *map(c_int64, sizes), pointer(out)):
        raise MemoryError(f"no memory for the regressor of {sizes[1]} joints")


_LIBRARY = library(__file__, "_recursion")
