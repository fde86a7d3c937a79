"""Achievable period of SYNC for computer, adapter, bus and drives together.

First nothing is sent, and no drive takes part. For some seconds the process waits for the deadlines
of an absolute grid, on the same bus, as the driver does between two SYNCs. The delay at every
deadline is recorded, also for those missed during one long sleep. The driver leaves out a SYNC
delayed by more than `drivers.fieldbus.TOO_LATE` of the period, so the achievable rate is the
highest one at which hardly any deadline is missed.

Then, while powered drives hold their position, SYNC is sent and answered, which shows the influence
of adapter, bus and drives: response times, and the deviation of SYNC from its period at the drives.
An adapter accessible only to this process is included, since nothing else times SYNC there.

If the kernel sends SYNC, the deadlines are kept without this process; a late wake-up then delays
only observation and reaction.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from drivers.commissioning.verdict import Grade, Verdict, grade_check
from drivers.fieldbus import TOO_LATE

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from drivers.session.connection import Fieldbus, TimedFieldbus

RATES = (1000.0, 500.0, 250.0, 200.0, 125.0, 100.0, 50.0, 25.0)
"""Usual rates of SYNC, highest first [Hz]."""
IN_TIME = 0.999
"""Smallest share of timely wake-ups at a recommended rate."""


@dataclass(frozen=True, eq=False)
class WakeUps:
    """Delays of a process at its deadlines.

    Attributes
    ----------
    period : float
        Time between two deadlines [s].
    late : array (n,)
        Delay at each deadline [s].
    """

    period: float
    late: NDArray[np.float64]

    def quantile(self, share: float) -> float:
        """Return the delay not exceeded by a share of the wake-ups [s]."""
        return float(np.quantile(self.late, share))

    @property
    def longest(self) -> float:
        """Largest delay [s]."""
        return float(self.late.max())

    @property
    def missed(self) -> float:
        """Share of missed deadlines at this period."""
        return float(np.mean(self.late > TOO_LATE * self.period))

    @property
    def recommended(self) -> float | None:
        """Highest usual rate that is kept [Hz], None if there is none."""
        return usual_rate(self.quantile(IN_TIME) / TOO_LATE)


def usual_rate(shortest: float) -> float | None:
    """Return the highest usual rate with a period above `shortest` [Hz], None if there is none."""
    return next((rate for rate in RATES if shortest < 1 / rate), None)


def measure_wake_ups(
    period: float,
    duration: float,
    wait: Callable[[float], object],
    clock: Callable[[], float] = time.perf_counter,
) -> WakeUps:
    """Wait for deadlines and record the delays.

    Parameters
    ----------
    period, duration : float
        Time between deadlines, and total time [s].
    wait : callable
        Waits at most for a time [s], as a bus does when nothing is received.
    clock : callable
        Monotonic clock [s].
    """
    count = max(1, round(duration / period))
    late = np.empty(count)
    begun = clock()
    for number in range(count):
        deadline = begun + (number + 1) * period
        while (left := deadline - clock()) > 0.0:
            wait(left)
        late[number] = clock() - deadline
    return WakeUps(period, late)


def wake_ups_on(bus: Fieldbus, period: float, duration: float) -> WakeUps | None:
    """Measure wake-ups on an open bus; drop received frames. Return None in lock-step."""
    if bus.lock_step:
        return None
    return measure_wake_ups(period, duration, bus.wait)


def judge_wake_ups(found: WakeUps, *, real_time: bool, by_kernel: bool = False) -> Verdict:
    """Compare the rate of SYNC kept by this computer with the wanted rate.

    Parameters
    ----------
    found : WakeUps
        Delays at the wanted period.
    real_time : bool
        True if measured in real time.
    by_kernel : bool
        True if the kernel sends SYNC, so that a late wake-up delays supervision only.
    """
    wanted, best = 1.0 / found.period, found.recommended
    ok = found.missed <= 1.0 - IN_TIME and best is not None
    remedies = [] if real_time else ["try --realtime"]
    if best is not None and best < wanted:
        remedies.append(f"set sync_period to {1.0 / best:g} s or more")
    remedies.append("set up this computer as in docs/reference/can.md")
    return grade_check(
        ok,
        Grade.WARNING,
        "this computer",
        "wake-ups for SYNC",
        f"{found.missed:.2%} too late at {wanted:.4g} Hz; "
        + ("no usual rate is achievable" if best is None else f"keeps {best:g} Hz")
        + ("; SYNC is sent by the kernel, only supervision is late" if by_kernel else ""),
        f"at most {1.0 - IN_TIME:.1%} later than {TOO_LATE:g} of the period",
        ", or ".join(remedies),
    )


def judge_period(timed: TimedFieldbus, period: float, late: float) -> Verdict:
    """Compare the highest achievable rate of SYNC with that of the drives file.

    Parameters
    ----------
    timed : TimedFieldbus
        Bus on which powered drives have answered SYNC for a while.
    period : float
        Time between two SYNCs by the drives file [s].
    late : float
        Wake-up delay of this process before SYNC, exceeded by one in a thousand [s]; 0 if SYNC does
        not depend on this process.
    """
    carried, slowest = timed.achievable_rate()
    jitter = max(timed.jitter(period), late)
    bounds = {
        "bus load and the drives' answers": 1 / carried,
        "the jitter of SYNC by this computer and its adapter": jitter / TOO_LATE,
    }
    why = max(bounds, key=lambda name: bounds[name])
    rate = usual_rate(bounds[why])
    advice = "no usual rate is achievable" if rate is None else f"set sync_period to {1 / rate:g} s"
    return grade_check(
        period * (1 + 1e-9) >= bounds[why],
        Grade.WARNING,
        "bus",
        "achievable rate of SYNC",
        f"{1 / bounds[why]:.0f} Hz, "
        + (
            f"slowest answer {1000 * slowest:.2g} ms, SYNC jitter at most {1000 * jitter:.2g} ms"
            if slowest
            else "response times are not measured here"
        ),
        f"file: {1 / period:.4g} Hz",
        f"{advice}: {why} allow no more",
    )
