"""Process data of the axes, independent of the bus."""

from __future__ import annotations

import math
import struct
from abc import ABC, abstractmethod
from operator import itemgetter
from typing import TYPE_CHECKING, NamedTuple

from drivers.drive_bus import SampleFlag

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from drivers.sync_clock import SyncClock

SPEED_TIME = 0.008
"""Minimum time base of speeds [s]: positions need not change in every cycle."""
CODES = {"u16": "H", "i16": "h", "i32": "i", "f32": "f"}
"""Format characters of `struct` for the types evaluated; bytes of other types are skipped."""


class Cycles(NamedTuple):
    """Process data of consecutive regular SYNCs.

    Attributes
    ----------
    times : list of float
        Instants of the SYNCs [s].
    positions, currents : list of tuple
        As in `ProcessData`, for each SYNC.
    """

    times: list[float]
    positions: list[tuple[int, ...]]
    currents: list[tuple[float, ...]]


class ProcessData(ABC):
    """Process data of a session's axes, latched at SYNC, and the time of the SYNC.

    Positions are in increments, currents in the drive's unit; axes are in joint order.

    Parameters
    ----------
    n_axes : int
    clock : SyncClock
        Source of the cycle time.

    Attributes
    ----------
    words, positions, currents : sequence of int (currents of float), length n_axes
        Statusword, position and current; values of the SYNC before where a telegram is missing.
    flags : tuple of int, length n_axes
        `drivers.drive_bus.SampleFlag` of each axis: MISSING, DOUBLED, LATE and SKIPPED.
    irregular : bool
        True if a flag is set.
    untimed : bool
        True if the instant `time` is uncertain.
    misfits : dict
        Description of the telegram that arrived instead of the expected one, by axis.
    time : float
        Instant of the last SYNC [s].
    looks_ahead : bool
        True if `sync_ahead` may send several SYNCs.
    on_arrival : tuple of int
        Axes whose drives cannot delay streamed set-points to the next SYNC. If there is one,
        set-points of all axes act on arrival, otherwise at the next SYNC.
    """

    on_arrival: tuple[int, ...] = ()
    looks_ahead = False

    def __init__(self, n_axes: int, clock: SyncClock) -> None:
        self._clock = clock
        self._regular = (0,) * n_axes
        self.words: tuple[int, ...] = self._regular
        self.positions: tuple[int, ...] = self._regular
        self.currents: Sequence[float] = self._regular
        self.flags: tuple[int, ...] = self._regular
        self.irregular = self.untimed = False
        self.misfits: dict[int, str] = {}
        self.time = 0.0
        self._before = self._anchor = (-math.inf, self._regular)

    @abstractmethod
    def command(self, axis: int, target: int, controlword: int) -> None:
        """Send target position [increments] and controlword to an axis immediately.

        Every word must arrive, also of several between two SYNCs: a fault reset sends two.
        """

    @abstractmethod
    def lead(self, axis: int, target: int) -> None:
        """Send a streamed set-point to an axis [increments]."""

    @abstractmethod
    def feed_forward(self, axis: int, velocity: int, torque: int) -> None:
        """Send offsets of velocity [drive's unit] and torque [per mille of rated] to an axis.

        Offsets act until the next ones; only for drives set up for feed-forward.
        """

    @abstractmethod
    def withdraw(self, axis: int) -> None:
        """Cancel the feed-forward of an axis; no effect where drives take no offsets."""

    @abstractmethod
    def sync(self) -> float:
        """Wait until the next SYNC is due, send it, collect answers; return its instant [s].

        Raises
        ------
        drivers.drive_bus.BusUnavailable
            The bus no longer takes or delivers telegrams.
        """

    def sync_ahead(self, times: int) -> Cycles | None:
        """Send up to `times` SYNCs as `sync` does, but only one unless the bus is in lock-step.

        Parameters
        ----------
        times : int
            Largest number of SYNCs, at least 1.

        Returns
        -------
        Cycles or None
            Data of the SYNCs before the last, statuswords unchanged; None if only one was sent.

        Raises
        ------
        drivers.drive_bus.BusUnavailable
            The bus no longer takes or delivers telegrams.
        """
        del times
        self.sync()
        return None

    @abstractmethod
    def tick(self) -> None:
        """Let a period pass while the drives send no process data yet."""

    def now(self) -> float:
        """Return the time on the clock of `time` [s]."""
        return self._clock.now()

    @property
    def skipped(self) -> int:
        """Number of SYNCs left out because the deadline had passed; may be set."""
        return self._clock.skipped

    @skipped.setter
    def skipped(self, number: int) -> None:
        self._clock.skipped = number

    def miss(self) -> None:
        """Let a period pass in which the bus accepted no SYNC."""
        self._clock.miss()

    def hurry(self, hurried: bool) -> None:
        """Shorten waits to the time available during a stop of the axes, or restore them."""
        self._clock.hurry(hurried)

    def speeds(self) -> list[float]:
        """Return the speeds of the axes over the last `SPEED_TIME` or twice that [increments/s].

        An axis whose telegram is missing has the speed ``inf``.
        """
        then, positions = self._before
        elapsed = self.time - then
        return [
            math.inf if flag & SampleFlag.MISSING or elapsed <= 0 else abs(here - there) / elapsed
            for here, there, flag in zip(self.positions, positions, self.flags, strict=True)
        ]

    def _pass_to(self, instant: float) -> None:
        """Set the time to the instant of a new cycle [s], before its values are stored."""
        if self.time - self._anchor[0] >= SPEED_TIME:
            self._before, self._anchor = self._anchor, (self.time, self.positions)
        self.time = instant

    def _publish(self, found: Mapping[int, int]) -> None:
        """Set the flags of single axes, and those of every axis if cycles were passed over."""
        all_axes = SampleFlag.SKIPPED.value if self._clock.passed_over else 0
        self.irregular = bool(found) or bool(all_axes)
        self.flags = tuple(found.get(axis, 0) | all_axes for axis in range(len(self._regular)))


def make_unpacker(layout: str, order: Sequence[int]) -> Callable[[bytes], tuple[int, ...]]:
    """Return a function that unpacks the start of a buffer and puts the values in an order."""
    unpack = struct.Struct(layout).unpack_from
    if list(order) == list(range(len(unpack(bytes(struct.calcsize(layout)))))):
        return unpack
    pick = itemgetter(*order)
    return lambda data: pick(unpack(data))
