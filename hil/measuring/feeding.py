"""A bus that stands in front of another one and passes everything on.

What adds something to a bus derives from it and states no more than what it adds. `FeedingBus`
feeds forward velocity and torque with every path that is streamed on it; whatever streams
set-points works on it as on the bus itself. Velocities and accelerations are differences of the
set-points. A drive follows its set-points late, by the time that its interpolation takes, so what
is fed forward must be as late:

    a set-point goes out at time t; the drive's loops act at t, t + h ... t + T - h before the next
    one, while the demand goes through what was planned for t - d ... t - d + T - h,

with the SYNC period T, the period of the loops h and the delay d. Velocity and torque are held
meanwhile, so they are those of the middle, planned for t - d + (T - h)/2.

Torque is what the motion adds to that at the path's beginning: at rest the loops hold the axes by
themselves, and go on to do so.
"""

from __future__ import annotations

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
"""SYNC periods by which drives follow their set-points: one until the next has come, and half of
one where their interpolation has a continuous velocity."""
LOOP = 0.001
"""Period of the loops of many drives [s]."""


class BusInFront:
    """A `drivers.drive_bus.StreamingBus` in front of another bus.

    Parameters
    ----------
    bus : DriveBus
        Not entered yet.
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
        """The axes in joint order; known once entered."""
        return self._bus.axes

    @property
    def notes(self) -> tuple[str, ...]:
        """What the operator should know though it stops nothing; grows."""
        return self._bus.notes

    def __enter__(self) -> Self:
        """Check, configure and power on every drive."""
        self._bus.__enter__()
        return self

    def __exit__(self, *raised: Any) -> None:
        """Stop the axes and power off."""
        self._bus.__exit__(*raised)

    def move(self, moves: Mapping[int, Move]) -> None:
        """Give set-points to axes."""
        self._bus.move(moves)

    def sample(self) -> Sample:
        """Wait for the next SYNC."""
        return self._bus.sample()

    def samples(self, limit: int) -> Sequence[Sample]:
        """Return the next sample, as `sample` does: what stands in front sees each by itself."""
        del limit
        return (self.sample(),)

    def halt(self) -> None:
        """Bring every axis to rest."""
        self._bus.halt()

    def reset(self) -> None:
        """Power the axes on again after something has stopped them."""
        self._bus.reset()

    def stream(
        self,
        path: Sequence[Sequence[float]],
        velocity: Sequence[Sequence[float]] | None = None,
        torque: Sequence[Sequence[float]] | None = None,
        holding: Sequence[Sequence[float]] | None = None,
    ) -> None:
        """Begin to send a path.

        Raises
        ------
        DriveRefused
            The drives follow no stream of set-points.
        """
        # asked once: looking for what a bus can do reads all of its attributes
        if not isinstance(self._bus, StreamingBus):
            raise DriveRefused("these drives follow no stream of set-points")
        self._bus.stream(path, velocity, torque, holding)
        self._streaming = self._bus

    @property
    def path_index(self) -> float:
        """Where on the path that is streamed the last sample was."""
        return self._streaming.path_index if self._streaming else 0.0


class FeedingBus(BusInFront):
    """A `drivers.drive_bus.StreamingBus` in front of another one.

    Parameters
    ----------
    bus : DriveBus
        Not entered yet; its drives take offsets of velocity and torque.
    velocity : bool
        Feed velocities forward; if not, they are zero.
    predict : callable, optional
        ``predict(q, qd, qdd)`` returns torques [N m or N]; all arrays of shape (n, n_axes). None
        feeds no torques forward.
    delay : float
        By how much drives follow their set-points late [SYNC periods].
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
        """Begin to send a path, with what is fed forward for it where the caller states nothing."""
        if velocity is None and torque is None:
            fed = self._fed(np.asarray(path, dtype=float))
            velocity, torque, holding = (values.tolist() for values in fed)
        super().stream(path, velocity, torque, holding)

    def _fed(self, path: Array) -> tuple[Array, Array, Array]:
        ahead = 0.5 - self._loop / (2 * self.period) - self._delay
        q, qd, qdd = motion_of(path, self.period, ahead)
        velocity = qd if self._velocity else np.zeros_like(qd)
        still = np.zeros_like(q)
        holding = added_torque(self._predict, q, still, still)
        return velocity, added_torque(self._predict, q, qd, qdd), holding


def added_torque(predict: Predict | None, q: Array, qd: Array, qdd: Array) -> Array:
    """Torques that a motion adds to those at its beginning, shape of `q`; zero without a model."""
    if predict is None:
        return np.zeros_like(q)
    tau = predict(q, qd, qdd)
    added: Array = tau - tau[0]
    return added


def refuse_beyond_torque(trajectory: Trajectory, robot: Robot, predict: Predict) -> None:
    """Refuse a trajectory that needs more torque than an axis has.

    Raises
    ------
    drivers.drive_bus.LimitExceeded
        With axis, instant, torque and limit.
    """
    t = np.linspace(0.0, trajectory.period, 2000)  # far more than harmonics have extremes
    q, qd, qdd = trajectory.motion(t)
    for tau, what in (
        (predict(q, qd, qdd), "needs"),
        (added_torque(predict, q, qd, qdd), "adds"),
    ):
        beyond = np.abs(tau) - robot.torque_limit
        at, axis = np.unravel_index(int(beyond.argmax()), beyond.shape)
        if beyond[at, axis] > 0:
            unit = robot.torque_unit(int(axis))
            raise LimitExceeded(
                f"{trajectory.id}: axis {axis + 1} {what} {tau[at, axis]:.4g} {unit} after"
                f" {t[at]:.3g} s by the model, its limit is {robot.torque_limit[axis]:.4g} {unit};"
                " plan a slower trajectory"
            )


def motion_of(path: Array, period: float, ahead: float) -> tuple[Array, Array, Array]:
    """Positions, velocities and accelerations somewhat later than each set-point of a path.

    Parameters
    ----------
    path : ndarray, shape (n, n_axes)
        Set-points [rad or m], at rest before the first and after the last.
    period : float
        From one to the next [s].
    ahead : float
        By how much later [periods]; may be negative.

    Returns
    -------
    q, qd, qdd : ndarray, shape (n, n_axes)
    """
    still = np.vstack([path[:1], path, path[-1:]])
    qd = (still[2:] - still[:-2]) / (2 * period)
    qdd = np.diff(still, n=2, axis=0) / period**2
    at = np.clip(np.arange(len(path)) + ahead, 0, len(path) - 1)
    return _at(path, at), _at(qd, at), _at(qdd, at)


def _at(values: Array, at: Array) -> Array:
    numbers = np.arange(len(values))
    return np.column_stack([np.interp(at, numbers, column) for column in values.T])
