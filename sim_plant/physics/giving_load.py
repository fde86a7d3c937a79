"""Loose or soft load: its centre of mass yields to gravity.

The load hangs on a soft, damped and isotropic suspension: a liquid, a cable, a loose screw. After
settling its centre is displaced by `give` along gravity; every change of the pose restarts the
settling. The response to accelerations is neglected. The load's share of the last body is updated
at every call of the physics, not at every step.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sim_plant.physics.reflected_inertia import Arm
    from sim_plant.plant_file import Payload

    Array = NDArray[np.float64]

SETTLING = 0.1
"""Time constant of the load [s]."""


class GivingLoad:
    """Load of an arm, with its share of the last body updated.

    Parameters
    ----------
    arm : Arm
        Arm whose last body is changed; at first it contains the load at its original centre.
    load : Payload
    """

    def __init__(self, arm: Arm, load: Payload) -> None:
        self._arm, self._load = arm, load
        self._rest = arm[2][-1] - load.body().row()
        self._off: Array | None = None

    def settle(self, q: Array, duration: float) -> None:
        """Let the load yield for `duration` [s] at configuration `q`, shape (n,) [rad or m]."""
        target = self._load.gives * gravity_direction(self._arm, q)
        before = target if self._off is None else self._off
        self._off = target + math.exp(-duration / SETTLING) * (before - target)
        centre = np.array(self._load.centre) + self._off
        moved = self._load.model_copy(update={"centre": tuple(centre.tolist())})
        self._arm[2][-1] = self._rest + moved.body().row()


def gravity_direction(arm: Arm, q: Array) -> Array:
    """Return the unit vector of gravity in the last frame, shape (3,); zero without gravity."""
    _, frames, _, gravity, kinds = arm
    v = gravity / max(float(np.linalg.norm(gravity)), 1e-12)
    for i, (ca, sa) in enumerate(frames[:, :2]):
        turned = q[i] if kinds is None else kinds[i, 1] + (1.0 - kinds[i, 0]) * q[i]
        c, s = math.cos(turned), math.sin(turned)
        x, y, z = v[0], ca * v[1] + sa * v[2], ca * v[2] - sa * v[1]
        v = np.array([c * x + s * y, c * y - s * x, z])
    return v
