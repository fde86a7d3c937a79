"""A reading: what the columns of recordings mean, as far as a file may have it wrong.

The identity is what robot file and drives file state. Joint i is read from channel `order[i]`, and

    q = sign_q scale q_read + zero,    tau_read = sign_tau gain (A p + scale^-2 H qdd) + friction,

so that a gear ratio N that is stated as N' has scale = N' / N and, as torques of the motor are
multiplied by it too, the same gain; a torque constant k stated as k' has gain = k' / k. Residuals
stay in recorded torque under every reading: none gains by making torques small.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.model.dynamics import regressor

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.mistakes.evidence import Channel
    from hil.model.robot import Robot

    Array = NDArray[np.float64]


class Slip(NamedTuple):
    """From `instant` [s] on the link of an axis stands `angle` [rad] from where it is read."""

    axis: int
    instant: float
    angle: float


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """What recordings mean.

    Attributes
    ----------
    robot : Robot
        Whose base parameters are fitted.
    order : tuple of int
        Channel from which each joint is read.
    sign_q, sign_tau, scale, gain, zero : ndarray, shape (n_joints,)
        By joint.
    gravity : ndarray, shape (3,)
        In the base frame [m/s^2].
    slip : Slip, optional
    """

    robot: Robot
    order: tuple[int, ...]
    sign_q: Array
    sign_tau: Array
    scale: Array
    gain: Array
    zero: Array
    gravity: Array
    slip: Slip | None = None

    @classmethod
    def stated(cls, robot: Robot) -> Reading:
        """What the robot file and the drives file state."""
        n = robot.n_joints
        one = np.ones(n)
        return cls(robot, tuple(range(n)), one, one, one, one, np.zeros(n), np.array(robot.gravity))

    def at(
        self,
        axis: int,
        *,
        sign_q: float | None = None,
        sign_tau: float | None = None,
        scale: float | None = None,
        gain: float | None = None,
        zero: float | None = None,
    ) -> Reading:
        """The same with other values of one axis."""
        return replace(
            self,
            sign_q=_put(self.sign_q, axis, sign_q),
            sign_tau=_put(self.sign_tau, axis, sign_tau),
            scale=_put(self.scale, axis, scale),
            gain=_put(self.gain, axis, gain),
            zero=_put(self.zero, axis, zero),
        )

    def joint(self, channel: int) -> int:
        """The joint that is read from a channel."""
        return self.order.index(channel)

    def motion(self, channel: Channel) -> tuple[Array, Array, Array]:
        """True q, qd and qdd of all joints, each of shape (n, n_joints)."""
        factor = self.sign_q * self.scale
        q, qd, qdd = (x[:, self.order] * factor for x in (channel.q, channel.qd, channel.qdd))
        q = q + self.zero
        if self.slip is not None:
            q[:, self.slip.axis] += self.slip.angle * (channel.time >= self.slip.instant)
        return q, qd, qdd

    def columns(self, channel: Channel) -> tuple[Array, Array]:
        """Torque that is read per unit of each base parameter, and of the motor.

        Shapes (n, n_base) and (n,).
        """
        joint = self.joint(channel.axis)
        q, qd, qdd = self.motion(channel)
        factor = self.sign_tau[joint] * self.gain[joint]
        rows = regressor(self.robot, q, qd, qdd, joints=[joint], gravity=self.gravity)[:, 0]
        motor = self.robot.reflected_inertia[joint] / self.scale[joint] ** 2 * qdd[:, joint]
        return factor * rows, factor * motor


def _put(values: Array, axis: int, value: float | None) -> Array:
    """Return `values` with that of an axis replaced, if there is one to put there."""
    if value is None:
        return values
    other = values.copy()
    other[axis] = value
    return other
