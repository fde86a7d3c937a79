"""Which clock SYNC goes by on a python-can bus (`drivers.sync_clock`).

Where the kernel can send SYNC it does, and the deadlines are its business
(`drivers.can_bus.kernel_sync`); a recorded session goes by its own instants.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from drivers.can_bus.capabilities import capabilities_of
from drivers.can_bus.kernel_sync import KernelSync
from drivers.fieldbus import TOO_LATE
from drivers.sync_clock import PAUSE, LockStep, SyncClock, WallClock

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    import can

    from drivers.fieldbus import PacingName


class KernelClock(SyncClock):
    """The kernel's deadlines: SYNC comes by itself, and its instant with it.

    Parameters
    ----------
    bus : KernelSync
        Where it comes.
    period : float
        Time between two SYNCs [s].
    clock : callable
        The one that the bus goes by [s].
    """

    def __init__(
        self, bus: KernelSync, period: float, *, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        super().__init__(period, clock)
        self._bus = bus

    def sent(self) -> float:
        """Return the instant of the SYNC that was waited for [s]; the bus has counted others."""
        self.skipped += self._bus.skipped
        self._bus.skipped, self.passed_over = 0, self._bus.passed_over
        return self._bus.instant - self._start

    def window(self) -> float:
        """How long answers may still take [s]: until the next SYNC is here, late or not."""
        if self._bus.overdue:
            return 0.0
        return max(0.0, self._bus.instant + (1.0 + TOO_LATE) * self._period - self._clock())

    def hurry(self, hurried: bool) -> None:
        """Wait for the kernel's SYNC no longer than two periods."""
        self._bus.silence = 2 * self._period if hurried else None


class AsRecorded(WallClock):
    """Deadlines of a recorded session: a SYNC is due when it was sent then.

    The recording has one instant for each SYNC and not how long sending took, so none is uncertain.

    Parameters
    ----------
    period : float
        Time between two SYNCs [s].
    clock : callable
        The recording's time [s].
    left : callable
        How long until the next frame was sent [s].
    """

    def __init__(
        self, period: float, *, clock: Callable[[], float], left: Callable[[], float]
    ) -> None:
        super().__init__(period, clock=clock)
        self._left = left

    def due(self) -> float:
        """How long until the next SYNC [s]."""
        return self._left()

    def sending(self) -> None:
        """Take no note: the recording has the instant itself."""


def kernel_sync(
    bus: can.BusABC, requested: PacingName, period: float, answers: Collection[int]
) -> KernelSync | None:
    """Return a bus to be put on this one where the kernel can send SYNC, for `KernelClock`.

    Parameters
    ----------
    bus : can.BusABC
    requested : {"auto", "lock-step", "wall-clock"}
        As for `choose_sync_clock`.
    period : float
        Time between two SYNCs [s].
    answers : collection of int
        Identifiers of the TPDOs that answer a SYNC.
    """
    if requested == "lock-step" or not capabilities_of(bus).kernel_sync:
        return None
    return KernelSync(bus, period, answers, pause=PAUSE)


def choose_sync_clock(bus: can.BusABC, requested: PacingName, period: float) -> SyncClock:
    """Decide where SYNC's time comes from, where the kernel does not send SYNC (`kernel_sync`).

    Parameters
    ----------
    bus : can.BusABC
        An open bus.
    requested : {"auto", "lock-step", "wall-clock"}
        "auto" takes lock-step where the bus offers it and the wall clock elsewhere. "lock-step" on
        another bus sends the next SYNC when all answers are in, for a plant behind that bus whose
        time is SYNC.
    period : float
        Time between two SYNCs [s].
    """
    able = capabilities_of(bus)
    if requested == "lock-step" or (requested == "auto" and able.lock_step):
        return LockStep(period, synchronous=able.lock_step, clock=able.clock)
    if able.until_next_sent is not None:
        return AsRecorded(period, clock=able.clock, left=able.until_next_sent)
    return WallClock(period, clock=able.clock)
