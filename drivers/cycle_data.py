"""Process data of all axes on whichever bus, as those see them who move and watch the axes."""

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
"""Over which speeds are taken at least [s]: positions need not change at every cycle."""
CODES = {"u16": "H", "i16": "h", "i32": "i", "f32": "f"}
"""Types of what is read, as `struct` has them; bytes of other types are skipped."""


class Cycles(NamedTuple):
    """Process data of several SYNCs in turn, none of them irregular.

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
    """Process data of all axes, latched at SYNC, and the time that SYNC makes.

    Positions are in increments, currents in the drive's unit; axes are in joint order.

    Parameters
    ----------
    n_axes : int
    clock : SyncClock
        Where the time of a cycle comes from.

    Attributes
    ----------
    words, positions, currents : sequence of int (currents of float), length n_axes
        Statusword, position and current; where an axis's telegram is missing, those of the SYNC
        before.
    flags : tuple of int, length n_axes
        `drivers.drive_bus.SampleFlag` of each axis: MISSING, DOUBLED, LATE and SKIPPED.
    irregular : bool
        Some flag is set.
    untimed : bool
        The instant `time` is uncertain.
    misfits : dict
        By axis, what came in place of its telegram, in words.
    time : float
        The last SYNC's instant [s].
    looks_ahead : bool
        `sync_ahead` may send several SYNCs.
    on_arrival : tuple of int
        Axes on which set-points of a stream act when they arrive, and then those of all do; where
        there are none they act at the next SYNC.
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
        """Send target position [increments] and controlword to one axis, at once.

        Each word counts, also where several are sent between two SYNCs: a fault reset sends two.
        """

    @abstractmethod
    def lead(self, axis: int, target: int) -> None:
        """Send a set-point of a stream to one axis that follows it [increments]."""

    @abstractmethod
    def feed_forward(self, axis: int, velocity: int, torque: int) -> None:
        """Send offsets of velocity [the drive's unit] and torque [per mille of rated] to one axis.

        They count until the next ones; only for drives that were set up to take them.
        """

    @abstractmethod
    def withdraw(self, axis: int) -> None:
        """Take back what is fed forward to one axis; nothing where drives take no offsets."""

    @abstractmethod
    def sync(self) -> float:
        """Send the next SYNC when it is due and collect its answers; return its instant [s].

        Raises
        ------
        drivers.drive_bus.BusUnavailable
            The bus does not take or give telegrams any more.
        """

    def sync_ahead(self, times: int) -> Cycles | None:
        """Do as `sync` for up to several SYNCs: one, unless the bus is in lock-step.

        Parameters
        ----------
        times : int
            Largest number of SYNCs, at least 1.

        Returns
        -------
        Cycles or None
            Of all SYNCs but the last, with unchanged statuswords; None if only one was sent.
        """
        del times
        self.sync()
        return None

    @abstractmethod
    def tick(self) -> None:
        """Let one period pass while the drives send no process data yet."""

    def now(self) -> float:
        """Time of the same clock as `time` [s]."""
        return self._clock.now()

    @property
    def skipped(self) -> int:
        """SYNCs that were left out because we came too late for them; may be set."""
        return self._clock.skipped

    @skipped.setter
    def skipped(self, number: int) -> None:
        self._clock.skipped = number

    def miss(self) -> None:
        """Let one period pass in which the bus took no SYNC."""
        self._clock.miss()

    def hurry(self, hurried: bool) -> None:
        """Wait for nothing longer than a stop of all axes can afford, or again as usual."""
        self._clock.hurry(hurried)

    def speeds(self) -> list[float]:
        """Return how fast each axis went in the last `SPEED_TIME` or twice that [increments/s].

        An axis that took no part in the last cycle has the speed ``inf``: it is not seen.
        """
        then, positions = self._before
        elapsed = self.time - then
        return [
            math.inf if flag & SampleFlag.MISSING or elapsed <= 0 else abs(here - there) / elapsed
            for here, there, flag in zip(self.positions, positions, self.flags, strict=True)
        ]

    def _pass_to(self, instant: float) -> None:
        """Let the instant of a cycle [s] come, before its values are taken."""
        if self.time - self._anchor[0] >= SPEED_TIME:
            self._before, self._anchor = self._anchor, (self.time, self.positions)
        self.time = instant

    def _publish(self, found: Mapping[int, int]) -> None:
        """Set the flags: those of single axes, and of all where cycles were passed over."""
        all_axes = SampleFlag.SKIPPED.value if self._clock.passed_over else 0
        self.irregular = bool(found) or bool(all_axes)
        self.flags = tuple(found.get(axis, 0) | all_axes for axis in range(len(self._regular)))


def unpacking(layout: str, order: Sequence[int]) -> Callable[[bytes], tuple[int, ...]]:
    """Return what unpacks a layout from the first bytes, and returns its values in an order."""
    unpack = struct.Struct(layout).unpack_from
    if list(order) == list(range(len(unpack(bytes(struct.calcsize(layout)))))):
        return unpack
    pick = itemgetter(*order)
    return lambda data: pick(unpack(data))
