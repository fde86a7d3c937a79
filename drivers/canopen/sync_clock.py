"""Choice of the clock for SYNC on a python-can bus (`drivers.sync_clock`).

SYNC and its deadlines are the kernel's if possible (`drivers.can_bus.kernel_sync`); a recorded
session follows its recorded instants.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from drivers.can_bus.capabilities import find_capabilities
from drivers.can_bus.kernel_sync import KernelSync
from drivers.fieldbus import TOO_LATE
from drivers.sync_clock import PAUSE, LockStep, SyncClock, WallClock

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    import can

    from drivers.fieldbus import PacingName


class KernelClock(SyncClock):
    """Clock of SYNCs sent by the kernel, with the kernel's instants.

    Parameters
    ----------
    bus : KernelSync
        Bus with the kernel's SYNC.
    period : float
        Time between two SYNCs [s].
    clock : callable
        Clock of the bus [s].
    """

    def __init__(
        self, bus: KernelSync, period: float, *, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        super().__init__(period, clock)
        self._bus = bus

    def note_sent(self) -> float:
        """Return the instant of the last awaited SYNC [s]; skipped ones are counted."""
        self.skipped += self._bus.skipped
        self._bus.skipped, self.passed_over = 0, self._bus.passed_over
        return self._bus.instant - self._start

    def window(self) -> float:
        """Return the time left for answers [s]: until the next SYNC, which may be late."""
        if self._bus.overdue:
            return 0.0
        return max(0.0, self._bus.instant + (1.0 + TOO_LATE) * self._period - self._clock())

    def hurry(self, hurried: bool) -> None:
        """Limit the wait for the kernel's SYNC to two periods, or restore it."""
        self._bus.silence = 2 * self._period if hurried else None


class AsRecorded(WallClock):
    """Clock of a recorded session: a SYNC is due at its recorded instant.

    The recording lacks the duration of sending, so no instant is uncertain.

    Parameters
    ----------
    period : float
        Time between two SYNCs [s].
    clock : callable
        Time of the recording [s].
    left : callable
        Time until the next sent frame [s].
    """

    def __init__(
        self, period: float, *, clock: Callable[[], float], left: Callable[[], float]
    ) -> None:
        super().__init__(period, clock=clock)
        self._left = left

    def due(self) -> float:
        """Return the time until the next SYNC [s]."""
        return self._left()

    def note_sending(self) -> None:
        """Do nothing: the recording has the instant itself."""


def kernel_sync(
    bus: can.BusABC, requested: PacingName, period: float, answers: Collection[int]
) -> KernelSync | None:
    """Return a bus with the kernel's SYNC for `KernelClock`; None if the kernel cannot send SYNC.

    Parameters
    ----------
    bus : can.BusABC
        An open bus.
    requested : {"auto", "lock-step", "wall-clock"}
        As for `choose_sync_clock`.
    period : float
        Time between two SYNCs [s].
    answers : collection of int
        Identifiers of the TPDOs that answer a SYNC.
    """
    if requested == "lock-step" or not find_capabilities(bus).kernel_sync:
        return None
    return KernelSync(bus, period, answers, pause=PAUSE)


def choose_sync_clock(bus: can.BusABC, requested: PacingName, period: float) -> SyncClock:
    """Return the clock for SYNC on a bus without the kernel's SYNC (`kernel_sync`).

    Parameters
    ----------
    bus : can.BusABC
        An open bus.
    requested : {"auto", "lock-step", "wall-clock"}
        "auto" selects lock-step if the bus offers lock-step, otherwise the wall clock. "lock-step"
        on another bus sends the next SYNC when all answers are in, for a plant on that bus whose
        time advances by SYNC.
    period : float
        Time between two SYNCs [s].
    """
    able = find_capabilities(bus)
    if requested == "lock-step" or (requested == "auto" and able.lock_step):
        return LockStep(period, synchronous=able.lock_step, clock=able.clock)
    if able.until_next_sent is not None:
        return AsRecorded(period, clock=able.clock, left=able.until_next_sent)
    return WallClock(period, clock=able.clock)
