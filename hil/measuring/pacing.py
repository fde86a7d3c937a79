"""Bus with a limited speed of time relative to the wall clock.

If SYNC is the plant's clock, a campaign is as fast as the processor, too fast for the eye. Samples
are held back until they are due; nothing is sent meanwhile, and the plant stands still.
"""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

from hil.measuring.feeding import BusInFront

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.drive_bus import DriveBus, Sample

REAL_TIME = 4.0
"""Duration of real-time motion before time is accelerated [s], enough for a look at the page."""
DOUBLED = 1.5
"""Time between doublings of the speed [s]."""
AT_ONCE = 0.01
"""Duration of the samples passed together [s]: a quarter of the time between displayed samples."""
LATE = 0.04
"""Maximum delay that is made up for [s]: the time between two displayed samples."""


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
        rate = self._rate(now)
        taken = self._bus.samples(max(1, min(limit, int(AT_ONCE * rate / self.period))))
        now = time.monotonic()
        if now - self._due > LATE:
            self._due = now
        self._due += len(taken) * self.period / rate
        # a sleep takes longer than requested: many short ones would fall behind
        if self._due - now > AT_ONCE / 2:
            time.sleep(self._due - now)
        return taken

    def _rate(self, now: float) -> float:
        """Return the present ratio to real time."""
        if not self._ramped:
            return self.fastest
        doublings = min((now - self._began - REAL_TIME) / DOUBLED, 20.0)
        return min(self.fastest, max(1.0, math.pow(2.0, doublings)))
