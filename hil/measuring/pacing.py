"""Bus with a limited speed of time relative to the wall clock.

Where SYNC is the plant's clock a campaign is as fast as the processor, too fast for the eye.
Samples are held back until they are due; nothing is sent meanwhile, and the plant stands still.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from hil.measuring.feeding import BusInFront

if TYPE_CHECKING:
    from drivers.drive_bus import DriveBus, Sample

REAL_TIME = 4.0
"""Duration of real-time motion before time is accelerated [s], enough for a look at the page."""
DOUBLED = 1.5
"""Time between doublings of the speed [s]."""


class PacedBus(BusInFront):
    """Bus with limited speed in front of another bus.

    Parameters
    ----------
    bus : DriveBus
        Bus not entered yet, whose axes are clocked by SYNC.
    fastest : float
        Final ratio to real time, at least 1: motion begins in real time. The ratio may be changed
        during the motion.
    """

    def __init__(self, bus: DriveBus, fastest: float) -> None:
        super().__init__(bus)
        self.fastest = fastest
        self._began = self._due = 0.0

    def sample(self) -> Sample:
        """Wait for the next SYNC, and until it is due.

        After late samples the pace starts anew, without catching up.
        """
        sample = self._bus.sample()
        now = time.monotonic()
        if not self._began:
            self._began = self._due = now
        faster = min((now - self._began - REAL_TIME) / DOUBLED, 20.0)
        self._due += self.period / min(self.fastest, max(1.0, 2.0**faster))
        if now < self._due:
            time.sleep(self._due - now)
        else:
            self._due = now
        return sample
