"""The torque that drives are to be fed along a planned motion, by a model.

It is that of `hil.results.model.Model.torque`, but friction does not jump at a reversal, for a
drive that is fed a jump does worse than one that is fed none: between a small speed in one
direction and the same in the other it goes over in a straight line, by the velocity that is planned
and not by a measured one, which would chatter.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.results.model import Model

    Array = NDArray[np.float64]

REVERSAL = 0.005
"""Share of the velocity limit below which friction goes over from one direction to the other."""


def drive_torque(model: Model, q: Array, qd: Array, qdd: Array) -> Array:
    """Torques to be fed forward, shape of `q` [N m or N].

    Parameters
    ----------
    model : Model
    q, qd, qdd : ndarray, shape (n, n_joints)
        Of a planned motion [rad, rad/s, rad/s^2; m for prismatic joints].

    Raises
    ------
    NotEnoughData
        The model has no law of friction.
    """
    width = REVERSAL * model.robot.velocity_limit
    speed = np.maximum(np.abs(qd), width)
    back, forth = (model.torque(q, side * speed, qdd, parts=("friction",)) for side in (-1.0, 1.0))
    share = np.clip(0.5 + qd / (2 * width), 0.0, 1.0)
    friction: Array = back + share * (forth - back)
    return model.torque(q, qd, qdd, ("rigid bodies", "motors")) + friction
