"""Friction in a conventional regression: columns fitted jointly, or a known characteristic.

Models (1) and (2) are those of the paper. The rich set contains further linear terms: two
degressive shapes, a progressive one, an offset for asymmetric friction and current sensors, and
torque ripple at multiples of the motor's angle, which without these columns would affect the
inertia of the wrist. Two customary columns may be added to every set: the offset, and friction that
grows with the transmitted torque Q_t (Hamon, Gautier, Garrec, *Dynamic identification of robots
with a dry friction model depending on load and velocity*, IROS 2010),

    mu |Q_t| sign(qd),

with Q_t of the previous estimate of the base parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from hil.friction.ripple import RIPPLE_ORDERS
from hil.friction.terms import BEND

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.signals import Signals
    from hil.model.robot import Robot

    Array = NDArray[np.float64]

Terms = Literal["model 1", "model 2", "rich", "none"]
Characteristic = Callable[["Array"], "Array"]
"""Friction torque of one axis [N m] at its velocities (n,) [rad/s], measured beforehand."""
N_OF_SPEED = {"model 1": 2, "model 2": 3, "rich": 5, "none": 0}
"""Number of speed-dependent columns of each set, which change with friction. Larger sets begin with
the columns of smaller ones.
"""
DIRECTION = 1
"""Index of the sign of the velocity among the columns."""
OFFSET, LOAD, RIPPLE = 5, 6, 7
"""Indices of the offset, of load-dependent friction, and of the first column of ripple."""
N_FRICTION = RIPPLE + 2 * len(RIPPLE_ORDERS)
"""Number of columns of one axis."""


def friction_columns(robot: Robot, q: Array, qd: Array, axis: int, direction: Array) -> Array:
    """Return all friction columns of one axis, shape (n, N_FRICTION); load friction is still zero.

    Parameters
    ----------
    q, qd : ndarray, shape (n, n_joints)
        Positions and velocities [rad], [rad/s].
    direction : ndarray, shape (n,)
        Sign of the axis's velocity, from filtered positions.
    """
    v = qd[:, axis] / robot.velocity_limit[axis]
    return np.stack(
        [
            v, direction, np.cbrt(v), np.arctan(v / BEND), v * np.abs(v),
            np.ones(len(v)), np.zeros(len(v)), *_ripple(robot.gear_ratio[axis] * q[:, axis]),
        ],
        axis=1,
    )  # fmt: skip


def places(terms: Terms, *, offset: bool, load: bool) -> list[int]:
    """Return the columns of a set of terms, those of speed first; rich has offset and ripple.

    Parameters
    ----------
    offset, load : bool
        Add the offset, and the friction of the load.
    """
    rich = terms == "rich"
    return [
        *range(N_OF_SPEED[terms]),
        *([OFFSET] if offset or rich else []),
        *([LOAD] if load else []),
        *(range(RIPPLE, N_FRICTION) if rich else []),
    ]


def _ripple(angle: Array) -> list[Array]:
    """Return sine and cosine of every order of the motor's angle."""
    return [f(order * angle) for order in RIPPLE_ORDERS for f in (np.cos, np.sin)]


def compensated(s: Signals, characteristics: Sequence[Characteristic]) -> Array:
    """Return friction torques of all axes by known characteristics, shape (n, n_joints) [N m]."""
    return np.column_stack([f(s.qd[:, axis]) for axis, f in enumerate(characteristics)])
