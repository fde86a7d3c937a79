"""A reading: what the columns of recordings mean, as far as a file may have it wrong.

The identity is what robot file and drives file state. Joint i is read from channel `order[i]`, and

    q = sign_q scale q_read + zero,    tau_read = sign_tau gain (A p + scale^-2 H qdd) + friction,

so that a gear ratio N that is stated as N' has scale = N' / N and, as torques of the motor are
multiplied by it too, the same gain; a torque constant k stated as k' has gain = k' / k. The gain
may drift, and a torque that depends on q alone, such as a spring's, may be added. Residuals stay
in recorded torque under every reading: none gains by making torques small.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from operator import is_
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.model.dynamics import regressor

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.arrays import Array
    from hil.estimation.mistakes.evidence import Channel
    from hil.model.robot import Robot


class Slip(NamedTuple):
    """From `instant` [s] on the link of an axis stands `angle` [rad] from where it is read."""

    axis: int
    instant: float
    angle: float


class GainDrift(NamedTuple):
    """The gain of an axis changes by `share` for each `duration` [s], and is stated at `middle`."""

    axis: int
    middle: float
    duration: float
    share: float

    def factor(self, time: Array) -> Array:
        """Gain over that at the middle, shape (n,)."""
        factor: Array = 1.0 + self.share * (time - self.middle) / self.duration
        return factor


class Added(NamedTuple):
    """Torque of an axis by its position alone: `shapes` (n, k) of q times `sizes` [N m]."""

    axis: int
    shapes: Callable[[Array], Array]
    sizes: Array

    def torque(self, q: Array) -> Array:
        """Shape (n,) [N m]."""
        torque: Array = self.shapes(q) @ self.sizes
        return torque


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
    drift : GainDrift, optional
    added : Added, optional
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
    drift: GainDrift | None = None
    added: Added | None = None

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

    def moves_as(self, other: Reading) -> bool:
        """Whether both read the same motion of the same robot: one regressor serves both."""
        mine, theirs = (
            (each.robot, each.order, each.sign_q, each.scale, each.zero, each.gravity, each.slip)
            for each in (self, other)
        )
        return all(map(is_, mine, theirs))

    def reads_as(self, other: Reading, channel: Channel) -> bool:
        """Whether both say the same of a channel of one and the same motion."""
        joint = self.joint(channel.axis)
        concerned = (
            any(each is not None and each.axis == joint for each in (one.drift, one.added))
            for one in (self, other)
        )
        mine, theirs = (each.sign_tau[joint] * each.gain[joint] for each in (self, other))
        return bool(mine == theirs) and not any(concerned)

    def columns(self, channel: Channel, known: Array | None = None) -> tuple[Array, Array]:
        """Torque that is read per unit of each base parameter, and of motor and what is added.

        Shapes (n, n_base) and (n,). `known` are the former of a reading of the same motion, which
        scales none of them.
        """
        joint = self.joint(channel.axis)
        q, qd, qdd = self.motion(channel)
        factor = np.full(len(q), self.sign_tau[joint] * self.gain[joint])
        if self.drift is not None and self.drift.axis == joint:
            factor = factor * self.drift.factor(channel.time)
        rows = known
        if rows is None:
            rows = regressor(self.robot, q, qd, qdd, joints=[joint], gravity=self.gravity)[:, 0]
        motor = self.robot.reflected_inertia[joint] / self.scale[joint] ** 2 * qdd[:, joint]
        if self.added is not None and self.added.axis == joint:
            motor = motor + self.added.torque(q[:, joint])
        return factor[:, np.newaxis] * rows, factor * motor


def _put(values: Array, axis: int, value: float | None) -> Array:
    """Return `values` with that of an axis replaced, if there is one to put there."""
    if value is None:
        return values
    other = values.copy()
    other[axis] = value
    return other
