"""The torque that drives are to be fed along a planned motion, by a model.

It is that of `hil.results.model.Model.torque` but for friction, in two ways. A law of friction is a
sum of terms that may go anywhere at speeds it was not found from: slower or faster than any sample
it goes on from there with the slope of the plainest law, Coulomb and viscous friction. Nor does it
jump at a reversal, for a drive that is fed a jump does worse than one that is fed none: between a
small speed in one direction and the same in the other it goes over in a straight line, by the
velocity that is planned and not by a measured one, which would chatter.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.results.torque_parts import known_friction

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
    slowest, fastest, slope = _known_speeds(model)
    speed = np.maximum(np.abs(qd), width)
    known = np.clip(speed, slowest, fastest)
    back, forth = (
        model.torque(q, side * known, qdd, parts=("friction",)) + side * slope * (speed - known)
        for side in (-1.0, 1.0)
    )
    share = np.clip(0.5 + qd / (2 * width), 0.0, 1.0)
    friction: Array = back + share * (forth - back)
    return model.torque(q, qd, qdd, ("rigid bodies", "motors")) + friction


def _known_speeds(model: Model) -> tuple[Array, Array, Array]:
    """Slowest and fastest samples of each axis's law, and its slope beyond; shape (n_joints,).

    [rad/s or m/s], [N m s/rad or N s/m]
    """
    rows = []
    for law in known_friction(model).axes:
        assert law is not None  # noqa: S101 - `known_friction` refuses it
        slowest, fastest = law.speeds or (0.0, np.inf)
        rows.append((slowest, fastest, law.plain["viscous"].value / law.speed))
    slowests, fastests, slopes = np.array(rows).T
    return slowests, fastests, slopes
