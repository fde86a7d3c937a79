"""The interface between identification and servo axes.

A `DriveBus` is a set of axes that take profile position set-points and report position and torque
once per SYNC. The measuring side (``sequencer``) sees only this protocol: joint side, SI, no
counts, no objects, no threads. Time passes only in `DriveBus.sample`, which returns the state of
the axes latched at one SYNC; a bus in lock-step is as fast as the processor, a bus on the wall
clock returns when the next SYNC is due.

Failures are a `DriveError`::

    DriveError
     +-- BusUnavailable      no such interface or channel, no permission, bus off
     +-- NodeSilent          a node does not answer, or its heartbeat stopped
     +-- DriveRefused        a drive that cannot serve: identity, mode, object, value not taken
     +-- LimitExceeded       a set-point outside the axis's limits: nothing was commanded
     +-- DriveFault          a drive reports a fault (EMCY, statusword)
     +-- MoveFailed          a set-point not acknowledged or not reached in time
     +-- Tripped             an axis too far off, too fast or too strong, or left without
                             supervision: we stopped all

Any stop of the axes during operation latches: until `DriveBus.reset` nothing moves.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, Protocol, runtime_checkable

from checked_files.errors import HilError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from types import TracebackType
    from typing import Self

LATE_FOR = 0.5
"""Time after a late SYNC in which the late SYNC is the first suspected cause of a failure [s]."""


class DriveError(HilError):
    """Failure of a drive or the bus; the message names the remedy."""


class BusUnavailable(DriveError):
    """The bus cannot be opened or has gone."""


class NodeSilent(DriveError):
    """A node does not answer, or its heartbeat stopped."""


class DriveRefused(DriveError):
    """A drive is unsuitable; the message names the reason."""


class LimitExceeded(DriveError):
    """A set-point outside the axis's limits; nothing was commanded."""


class DriveFault(DriveError):
    """A drive reports a fault."""


class MoveFailed(DriveError):
    """A set-point that was not acknowledged or not reached in time."""


class Tripped(DriveError):
    """An axis too far off the path, too fast or too strong for too long: axes stopped."""


def join_errors(problems: Sequence[DriveError], head: str = "") -> DriveError:
    """Return a common error for several drives, a line each; `NodeSilent` if no drive answers."""
    silent = all(isinstance(problem, NodeSilent) for problem in problems)
    lines = (*filter(None, [head]), *map(str, problems))
    return (NodeSilent if silent else DriveRefused)("\n".join(lines))


class SampleFlag(enum.IntFlag):
    """Defect of an axis's share of a sample; 0 if there is none."""

    MISSING = 1
    """No TPDO answered this SYNC: position and torque are NaN."""
    DOUBLED = 2
    """More than one TPDO answered this SYNC; the first is used."""
    LATE = 4
    """A TPDO of an earlier SYNC was dropped in this period, or the TPDO after a missing one may
    itself be late.
    """
    LIMIT = 8
    """The drive reports an internal limit (statusword bit 11): its torque saturates."""
    SKIPPED = 16
    """SYNCs immediately before this one were passed over: their answers were too old to judge."""
    OLD = 32
    """The axis moves, but its position or torque was not refreshed since the previous SYNC."""
    UNTIMED = 64
    """The instant of this SYNC is uncertain: the computer was interrupted while sending."""


@dataclass(frozen=True, slots=True)
class Move:
    """Profile position set-point of an axis: a trapezoidal velocity profile.

    Attributes
    ----------
    target : float
        Rest position at the end [rad, or m for a prismatic joint].
    velocity : float
        Profile velocity, positive [rad/s].
    acceleration : float
        Profile acceleration and deceleration, positive [rad/s^2].
    """

    target: float
    velocity: float
    acceleration: float


class Sample(NamedTuple):
    """State of the axes at a SYNC.

    Attributes
    ----------
    time : float
        The SYNC's instant since the bus was entered [s].
    q : tuple of float, length n_axes
        Joint positions, NaN where the TPDO is missing [rad].
    tau : tuple of float, length n_axes
        Joint torques from the motor currents, positive along q [N m].
    flags : tuple of int, length n_axes
        `SampleFlag` bits of each axis.
    reached : bool
        True if every axis with a set-point has acknowledged and reached it and stands still.
    """

    time: float
    q: tuple[float, ...]
    tau: tuple[float, ...]
    flags: tuple[int, ...]
    reached: bool


@dataclass(frozen=True, slots=True)
class AxisInfo:
    """Description of a drive, read when the bus was entered; part of the provenance.

    Attributes
    ----------
    q_min, q_max, velocity_max, acceleration_max : float
        Limits in force [rad, rad/s, rad/s^2; m if prismatic].
    own_limits : mapping of str to str
        Limits set by the drive: ``q_min``, ``q_max``, ``velocity``, ``acceleration`` or
        ``torque``, and the object that sets the limit, such as ``607D``.
    unit : {"rad", "m"}
        Unit of the position.
    """

    name: str
    identity: str
    q_min: float
    q_max: float
    velocity_max: float
    acceleration_max: float
    torque_resolution: float
    position_resolution: float
    own_limits: Mapping[str, str] = field(default_factory=dict)
    unit: str = "rad"


@runtime_checkable
class DriveBus(Protocol):
    """Servo axes as a context manager.

    Entering checks every drive, writes the limits and powers on. Leaving stops the axes and
    powers off, also after an error. Nothing moves unless `move` was called.
    """

    @property
    def period(self) -> float:
        """Time between two samples [s]."""

    @property
    def axes(self) -> tuple[AxisInfo, ...]:
        """The axes in joint order; known once entered."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks for the operator without effect on the session; the tuple grows."""

    def __enter__(self) -> Self:
        """Check, configure and power on every drive."""

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Stop the axes and power off."""

    def move(self, moves: Mapping[int, Move]) -> None:
        """Give set-points to axes (by joint index, from 0) and return at once.

        All moves are checked before any is commanded.

        Raises
        ------
        LimitExceeded
            A target, velocity or acceleration outside the limits.
        Tripped
            The axes have been stopped for a reason that nobody has reset.
        """

    def sample(self) -> Sample:
        """Wait for the next SYNC and return the state of the axes.

        Raises
        ------
        NodeSilent, DriveFault, MoveFailed, Tripped, BusUnavailable
            After the axes have been stopped, or given up to their watchdogs.
        """

    def samples(self, limit: int) -> Sequence[Sample]:
        """Return the samples of the next SYNCs: one on the wall clock, several in lock-step.

        No command is due before the last sample: `reached` can change only there.

        Parameters
        ----------
        limit : int
            Largest number, at least 1.

        Raises
        ------
        NodeSilent, DriveFault, MoveFailed, Tripped, BusUnavailable
            As `sample`.
        """

    def halt(self) -> None:
        """Stop every axis with the profile deceleration; the drives stay powered."""

    def reset(self) -> None:
        """Power the axes on again after a stop; a decision of the caller.

        Raises
        ------
        DriveFault, DriveRefused, NodeSilent, BusUnavailable
            The axes cannot be powered on; they are stopped and switched off.
        """


@runtime_checkable
class StreamingBus(DriveBus, Protocol):
    """A `DriveBus` with axes that also follow set-points sent by the master at every SYNC.

    If set-points cannot be sent or supervised in time, the path is slowed down, to rest if
    necessary, and then resumed.
    """

    @property
    def path_index(self) -> float:
        """Index of the set-points that act from the last sample's SYNC on, from 0.

        A fraction where the path is slowed down; axes follow later, by the delay of their drives.
        """

    def stream(
        self,
        path: Sequence[Sequence[float]],
        velocity: Sequence[Sequence[float]] | None = None,
        torque: Sequence[Sequence[float]] | None = None,
        holding: Sequence[Sequence[float]] | None = None,
    ) -> None:
        """Start a path of set-points; every `sample` sends the next one.

        The whole path is checked before any set-point is sent; some SYNCs may pass while the drives
        change their mode. `Sample.reached` is True when the axes rest at the last set-point, which
        is held until the next `move` or `stream`.

        Parameters
        ----------
        path : array_like, shape (n, n_axes)
            A set-point of each axis every `period`, beginning at the present positions [rad or m].
        velocity, torque, holding : array_like, shape (n, n_axes), optional
            Feed-forward of each set-point [rad/s or m/s], [N m or N], in effect until the next;
            zero at both ends, since the loops alone hold the axes at rest. If any is given, drives
            add no feed-forward of their own, and omitted ones are zero. A stop or halt cancels the
            feed-forward. `holding` is the part of the torque that holds the axes against gravity:
            the part is kept where the path is slowed down, the rest is reduced.

        Raises
        ------
        LimitExceeded
            The path leaves the limits or does not begin at the present positions; the feed-forward
            exceeds the limits or does not begin and end with zero.
        DriveRefused
            A drive has no mode for streaming, or was not set up for feed-forward.
        """
