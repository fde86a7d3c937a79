"""Friction in a conventional regression: columns fitted jointly, or a known characteristic.

Models (1) and (2) are the paper's. The rich set is what can be had beyond them and still be linear:
two degressive shapes, a progressive one, an offset for asymmetric friction and current sensors, and
torque ripple at multiples of the motor's angle, which is no friction but would be taken for inertia
of the wrist.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from hil.regression.ripple import RIPPLE_ORDERS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.signals import Signals
    from hil.model.robot import Robot

    Array = NDArray[np.float64]

Terms = Literal["model 1", "model 2", "rich", "none"]
Characteristic = Callable[["Array"], "Array"]
"""Friction torque of one axis [N m] at its velocities (n,) [rad/s], measured beforehand."""
N_OF_SPEED = {"model 1": 2, "model 2": 3, "rich": 5, "none": 0}
"""How many of a set's columns, its first, are functions of speed that change as friction does.

Each set begins with the columns of the smaller ones.
"""
BEND = 0.08
"""Share of the speed limit at which the rich set's atan bends."""


def friction_columns(
    robot: Robot, q: Array, qd: Array, axis: int, terms: Terms, direction: Array
) -> Array:
    """Columns of one axis's friction, shape (n, n_terms).

    Parameters
    ----------
    q, qd : ndarray, shape (n, n_joints)
        [rad], [rad/s].
    terms : {"model 1", "model 2", "rich", "none"}
    direction : ndarray, shape (n,)
        Sign of the axis's velocity, from filtered positions.
    """
    v = qd[:, axis] / robot.velocity_limit[axis]
    sets = {
        "none": (),
        "model 1": (v, direction),
        "model 2": (v, direction, np.cbrt(v)),
        "rich": (
            v, direction, np.cbrt(v), np.arctan(v / BEND), v * np.abs(v), np.ones(len(v)),
            *_ripple(robot.gear_ratio[axis] * q[:, axis]),
        ),
    }  # fmt: skip
    return np.stack(sets[terms], axis=1) if sets[terms] else np.zeros((len(v), 0))


def _ripple(angle: Array) -> list[Array]:
    """Sine and cosine of every order of the motor's angle."""
    return [f(order * angle) for order in RIPPLE_ORDERS for f in (np.cos, np.sin)]


def compensated(s: Signals, characteristics: Sequence[Characteristic]) -> Array:
    """Friction torque of all axes by known characteristics, shape (n, n_joints) [N m]."""
    return np.column_stack([f(s.qd[:, axis]) for axis, f in enumerate(characteristics)])
