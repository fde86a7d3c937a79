"""Buses in front of another bus, to which all calls are passed.

A bus with additional functions derives from `BusInFront` and defines only the changed calls.
`FeedingBus` feeds forward velocity and torque with every streamed path, without a change of its
callers. Velocities and accelerations are differences of the set-points. A drive follows its
set-points with a delay, by its interpolation, so the feed-forward must have the same delay:

    a set-point is sent at time t; until the next set-point the drive's loops act at
    t, t + h ... t + T - h, with the demand planned for t - d ... t - d + T - h,

with the SYNC period T, the period of the loops h and the delay d. Velocity and torque are held for
a SYNC period, so the values are those of the middle of the period, planned for t - d + (T - h)/2.

The torque is that of the motion less the torque at the path's beginning: at rest the loops hold the
axes without feed-forward, and continue to do so.

`PacedBus` limits the speed of time relative to the wall clock. If SYNC is the plant's clock, a
campaign is as fast as the processor, too fast for the eye. Samples are held back until they are
due; nothing is sent meanwhile, and the plant stands still.
"""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any

import numpy as np

from drivers.drive_bus import DriveRefused, LimitExceeded, StreamingBus

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from typing import Self

    from drivers.drive_bus import AxisInfo, DriveBus, Move, Sample
    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.trajectory import Trajectory

    Predict = Callable[[Array, Array, Array], Array]


DELAY = 1.5
"""Delay of drives behind their set-points in SYNC periods.

The delay is one period until the arrival of the next set-point, plus half a period for an
interpolation with continuous velocity.
"""
LOOP = 0.001
"""Period of the control loops of many drives [s]."""
REAL_TIME = 4.0
"""Duration of real-time motion before time is accelerated [s], enough for a look at the page."""
DOUBLED = 1.5
"""Time between doublings of the speed [s]."""
AT_ONCE = 0.01
"""Duration of the samples passed together [s]: a quarter of the time between displayed samples."""
LATE = 0.04
"""Maximum delay that is made up for [s]: the time between two displayed samples."""


class BusInFront:
    """`drivers.drive_bus.StreamingBus` in front of another bus.

    Parameters
    ----------
    bus : DriveBus
        Bus not entered yet.
    """

    def __init__(self, bus: DriveBus) -> None:
        self._bus = bus
        self._streaming: StreamingBus | None = None

    @property
    def period(self) -> float:
        """Time between two samples [s]."""
        return self._bus.period

    @property
    def axes(self) -> tuple[AxisInfo, ...]:
        """Axes in joint order; known once entered."""
        return self._bus.axes

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes for the operator about harmless irregularities; grows."""
        return self._bus.notes

    def __enter__(self) -> Self:
        """Check, configure and power on every drive."""
        self._bus.__enter__()
        return self

    def __exit__(self, *raised: Any) -> None:
        """Stop the axes and power off."""
        self._bus.__exit__(*raised)

    def move(self, moves: Mapping[int, Move]) -> None:
        """Send set-points to axes."""
        self._bus.move(moves)

    def sample(self) -> Sample:
        """Wait for the next SYNC."""
        return self._bus.sample()

    def samples(self, limit: int) -> Sequence[Sample]:
        """Return only the next sample, so that derived buses see every sample."""
        del limit
        return (self.sample(),)

    def halt(self) -> None:
        """Bring every axis to rest."""
        self._bus.halt()

    def reset(self) -> None:
        """Power the axes on again after a stop."""
        self._bus.reset()

    def stream(
        self,
        path: Sequence[Sequence[float]],
        velocity: Sequence[Sequence[float]] | None = None,
        torque: Sequence[Sequence[float]] | None = None,
        holding: Sequence[Sequence[float]] | None = None,
    ) -> None:
        """Start to send a path.

        Raises
        ------
        DriveRefused
            The drives support no streamed set-points.
        """
        # checked once: the protocol check reads all attributes of a bus
        if not isinstance(self._bus, StreamingBus):
            raise DriveRefused(
                "these drives accept no cyclic set-points; use drives with mode 8 (6502, bit 7)"
            )
        self._bus.stream(path, velocity, torque, holding)
        self._streaming = self._bus

    @property
    def path_index(self) -> float:
        """Index of the last sample on the streamed path."""
        return self._streaming.path_index if self._streaming else 0.0


class FeedingBus(BusInFront):
    """Bus with feed-forward in front of another bus.

    Parameters
    ----------
    bus : DriveBus
        Bus not entered yet, whose drives accept offsets of velocity and torque.
    velocity : bool
        Feed velocities forward; if not, they are zero.
    predict : callable, optional
        ``predict(q, qd, qdd)`` returns torques [N m or N]; all arrays of shape (n, n_axes). None
        feeds no torques forward.
    delay : float
        Delay of the drives behind their set-points [SYNC periods].
    loop : float
        Period of the drives' loops [s].
    """

    def __init__(
        self,
        bus: DriveBus,
        *,
        velocity: bool,
        predict: Predict | None,
        delay: float = DELAY,
        loop: float = LOOP,
    ) -> None:
        super().__init__(bus)
        self._velocity = velocity
        self._predict = predict
        self._delay = delay
        self._loop = loop

    def stream(
        self,
        path: Sequence[Sequence[float]],
        velocity: Sequence[Sequence[float]] | None = None,
        torque: Sequence[Sequence[float]] | None = None,
        holding: Sequence[Sequence[float]] | None = None,
    ) -> None:
        """Start to send a path, with computed feed-forward unless stated by the caller."""
        if velocity is None and torque is None:
            ahead = 0.5 - self._loop / (2 * self.period) - self._delay
            q, qd, qdd = motion_of(np.asarray(path, dtype=float), self.period, ahead)
            still = np.zeros_like(q)
            velocity = (qd if self._velocity else still).tolist()
            torque = added_torque(self._predict, q, qd, qdd).tolist()
            holding = added_torque(self._predict, q, still, still).tolist()
        super().stream(path, velocity, torque, holding)


def added_torque(predict: Predict | None, q: Array, qd: Array, qdd: Array) -> Array:
    """Return the torques of a motion relative to its start, shape of `q`; zero without a model."""
    if predict is None:
        return np.zeros_like(q)
    tau = predict(q, qd, qdd)
    added: Array = tau - tau[0]
    return added


def refuse_beyond_torque(trajectory: Trajectory, robot: Robot, predict: Predict) -> None:
    """Refuse a trajectory beyond the torque limit of an axis.

    Raises
    ------
    drivers.drive_bus.LimitExceeded
        Message with axis, instant, torque and limit.
    """
    # many more samples than extremes of the harmonics
    t = np.linspace(0.0, trajectory.period, 2000)
    q, qd, qdd = trajectory.motion(t)
    for tau, what in (
        (predict(q, qd, qdd), "needs a torque of"),
        (added_torque(predict, q, qd, qdd), "needs an added torque of"),
    ):
        beyond = np.abs(tau) - robot.torque_limit
        at, axis = np.unravel_index(int(beyond.argmax()), beyond.shape)
        if beyond[at, axis] > 0:
            unit = robot.torque_unit(int(axis))
            raise LimitExceeded(
                f"{trajectory.id}: axis {axis + 1} {what} {tau[at, axis]:.4g} {unit} at "
                f"{t[at]:.3g} s by the model, at most {robot.torque_limit[axis]:.4g} {unit} "
                "allowed; plan a slower trajectory"
            )


def motion_of(path: Array, period: float, ahead: float) -> tuple[Array, Array, Array]:
    """Return positions, velocities and accelerations at a constant shift after the set-points.

    Parameters
    ----------
    path : ndarray, shape (n, n_axes)
        Set-points [rad or m], at rest before the first and after the last.
    period : float
        Time between set-points [s].
    ahead : float
        Time shift [periods]; may be negative.

    Returns
    -------
    q, qd, qdd : ndarray, shape (n, n_axes)
    """
    still = np.vstack([path[:1], path, path[-1:]])
    qd = (still[2:] - still[:-2]) / (2 * period)
    qdd = np.diff(still, n=2, axis=0) / period**2
    at = np.clip(np.arange(len(path)) + ahead, 0, len(path) - 1)
    return _interpolate(path, at), _interpolate(qd, at), _interpolate(qdd, at)


def _interpolate(values: Array, at: Array) -> Array:
    numbers = np.arange(len(values))
    return np.column_stack([np.interp(at, numbers, column) for column in values.T])


class PacedBus(BusInFront):
    """Bus with limited speed in front of another bus.

    Parameters
    ----------
    bus : DriveBus
        Bus not entered yet, whose axes are clocked by SYNC.
    fastest : float
        Final ratio to real time, at least 1. The ratio may be changed during the motion.
    ramped : bool
        True to begin motion in real time.
    """

    def __init__(self, bus: DriveBus, fastest: float, *, ramped: bool = True) -> None:
        super().__init__(bus)
        self.fastest = fastest
        self._ramped = ramped
        self._began = self._due = 0.0

    def sample(self) -> Sample:
        """Wait for the next SYNC, and until the sample is due."""
        return self.samples(1)[0]

    def samples(self, limit: int) -> Sequence[Sample]:
        """Wait for the next SYNCs, and until the last sample is due.

        After samples later than `LATE` the pace starts anew; the delay is not made up for.
        """
        now = time.monotonic()
        self._began = self._began or now
        rate = self.fastest  # ratio to real time
        if self._ramped:
            doublings = min((now - self._began - REAL_TIME) / DOUBLED, 20.0)
            rate = min(self.fastest, max(1.0, math.pow(2.0, doublings)))
        taken = self._bus.samples(max(1, min(limit, int(AT_ONCE * rate / self.period))))
        now = time.monotonic()
        if now - self._due > LATE:
            self._due = now
        self._due += len(taken) * self.period / rate
        # a sleep takes longer than requested: many short ones would fall behind
        if self._due - now > AT_ONCE / 2:
            time.sleep(self._due - now)
        return taken
