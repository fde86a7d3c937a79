"""The seam between identification and servo axes.

A `DriveBus` is a set of axes that can be given profile position set-points and that report
position and torque once per SYNC. Whoever measures (``sequencer``) sees only this protocol:
joint side, SI, no counts, no objects, no threads. Time passes only in `DriveBus.sample`, which
returns the state of all axes latched at one SYNC; a bus in lock-step is as fast as the processor,
a bus on the wall clock returns when the next SYNC is due.

What can go wrong is a `DriveError`::

    DriveError
     +-- BusUnavailable      no such interface or channel, no permission, bus off
     +-- NodeSilent          a node does not answer, or its heartbeat stopped
     +-- DriveRefused        a drive that cannot serve: identity, mode, object, value not taken
     +-- LimitExceeded       a set-point outside the axis's limits: nothing was commanded
     +-- DriveFault          a drive reports a fault (EMCY, statusword)
     +-- MoveFailed          a set-point not acknowledged or not reached in time
     +-- Tripped             an axis too far off, too fast or too strong, or left without
                             supervision: we stopped all

Whatever stops the axes in the middle of operation latches: until `DriveBus.reset` nothing moves.
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
"""Time after a late SYNC in which it is the first cause to look at for whatever goes wrong [s]."""


class DriveError(HilError):
    """What the operator must know about a drive or the bus; the message names the remedy."""


class BusUnavailable(DriveError):
    """The bus cannot be opened or has gone."""


class NodeSilent(DriveError):
    """A node does not answer, or its heartbeat stopped."""


class DriveRefused(DriveError):
    """A drive that cannot serve our purpose, and why."""


class LimitExceeded(DriveError):
    """A set-point outside the axis's limits; nothing was commanded."""


class DriveFault(DriveError):
    """A drive reports a fault."""


class MoveFailed(DriveError):
    """A set-point that was not acknowledged or not reached in time."""


class Tripped(DriveError):
    """An axis too far off its way, too fast or too strong for too long: we stopped all axes."""


def joined(problems: Sequence[DriveError], head: str = "") -> DriveError:
    """Return one error for several drives, a line each: that they are silent, if all are."""
    silent = all(isinstance(problem, NodeSilent) for problem in problems)
    lines = (*filter(None, [head]), *map(str, problems))
    return (NodeSilent if silent else DriveRefused)("\n".join(lines))


class SampleFlag(enum.IntFlag):
    """What is wrong with one axis's share of a sample; 0 when nothing is."""

    MISSING = 1
    """No TPDO answered this SYNC: position and torque are NaN, never a guess."""
    DOUBLED = 2
    """More than one TPDO answered this SYNC; the first counts."""
    LATE = 4
    """A TPDO of an earlier SYNC arrived within this one's period and was dropped, or this one came
    alone soon after a missing one and may be that."""
    LIMIT = 8
    """The drive reports an internal limit (statusword bit 11): its torque saturates."""
    SKIPPED = 16
    """SYNCs right before this one were passed over: they had waited too long to be judged."""
    OLD = 32
    """The drive had not renewed position or torque since the SYNC before, in motion."""
    UNTIMED = 64
    """This computer was interrupted while it sent this SYNC, so its instant is uncertain."""


@dataclass(frozen=True, slots=True)
class Move:
    """A profile position set-point of one axis: a trapezoid of velocity.

    Attributes
    ----------
    target : float
        Where the axis shall come to rest [rad, or m for a prismatic joint].
    velocity : float
        Profile velocity, positive [rad/s].
    acceleration : float
        Profile acceleration and deceleration, positive [rad/s^2].
    """

    target: float
    velocity: float
    acceleration: float


class Sample(NamedTuple):
    """All axes at one SYNC.

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
        Every axis that was given a set-point has acknowledged it, reached it and stands still.
    """

    time: float
    q: tuple[float, ...]
    tau: tuple[float, ...]
    flags: tuple[int, ...]
    reached: bool


@dataclass(frozen=True, slots=True)
class AxisInfo:
    """What a drive stated about itself when the bus was entered; goes into the provenance.

    Attributes
    ----------
    q_min, q_max, velocity_max, acceleration_max : float
        Limits that hold [rad, rad/s, rad/s^2; m if prismatic].
    own_limits : mapping of str to str
        Where it is the drive's own limit that holds: ``q_min``, ``q_max``, ``velocity``,
        ``acceleration`` or ``torque``, and the object that sets it, such as ``607D``.
    unit : {"rad", "m"}
        Of its position.
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
    powers off, whatever happened in between. Nothing moves unless `move` was called.
    """

    @property
    def period(self) -> float:
        """Time between two samples [s]."""

    @property
    def axes(self) -> tuple[AxisInfo, ...]:
        """The axes in joint order; known once entered."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What the operator should know though it stops nothing; grows."""

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
        """Wait for the next SYNC and return what the axes reported for it.

        Raises
        ------
        NodeSilent, DriveFault, MoveFailed, Tripped, BusUnavailable
            After the axes have been stopped, or given up to their watchdogs.
        """

    def samples(self, limit: int) -> Sequence[Sample]:
        """Return the samples of the next SYNCs: one on the wall clock, several in lock-step.

        Nothing needs to be commanded before the last of them: only that one may have `reached`
        changed.

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
        """Bring every axis to rest with its profile deceleration; the drives stay powered."""

    def reset(self) -> None:
        """Power the axes on again after something has stopped them; a decision of the caller's.

        Raises
        ------
        DriveFault, DriveRefused, NodeSilent, BusUnavailable
            The axes cannot be powered on; they are stopped and switched off.
        """


@runtime_checkable
class StreamingBus(DriveBus, Protocol):
    """A `DriveBus` whose axes also follow set-points that the master sends at every SYNC.

    Where set-points cannot be sent or supervised in time the axes pass their path more slowly, to
    rest if need be, and go on by themselves.
    """

    @property
    def along(self) -> float:
        """Number of the set-points that act from the last sample's SYNC on, from 0.

        Between two of them where the path is slowed down; axes follow later, by the delay of their
        drives.
        """

    def stream(
        self,
        path: Sequence[Sequence[float]],
        velocity: Sequence[Sequence[float]] | None = None,
        torque: Sequence[Sequence[float]] | None = None,
        holding: Sequence[Sequence[float]] | None = None,
    ) -> None:
        """Begin to send a path of set-points, the next of which goes out with every `sample`.

        The whole path is checked before any set-point is sent; some SYNCs may pass while the drives
        change their mode. `Sample.reached` shows when the axes rest at the last set-point, where
        they are held until the next `move` or `stream`.

        Parameters
        ----------
        path : array_like, shape (n, n_axes)
            A set-point of each axis every `period`, beginning where the axes stand [rad or m].
        velocity, torque, holding : array_like, shape (n, n_axes), optional
            What is fed forward with each set-point and counts until the next [rad/s or m/s], [N m
            or N]; zero at both ends, for at rest the loops hold the axes by themselves. Where
            any is given drives feed nothing forward by themselves, and what is left out is zero. A
            stop or halt takes all back. `holding` is the part of the torque that holds the axes
            where they are: where the path is slowed down, it counts as it is, and the rest less.

        Raises
        ------
        LimitExceeded
            The path leaves the limits, or does not begin where the axes stand; what is fed forward
            is beyond the limits or does not begin and end with zero.
        DriveRefused
            A drive has no mode for it, or was not set up to take what is fed forward.
        """
