"""A bus whose time runs no faster than so many times the clock on the wall.

Where SYNC is the plant's clock a campaign is as fast as the processor, too fast for the eye. Each
sample is held back until it is due; nothing is sent meanwhile, and the plant stands still.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from hil.measuring.feeding import BusInFront

if TYPE_CHECKING:
    from drivers.drive_bus import DriveBus, Sample

REAL_TIME = 4.0
"""Time of motion at its own speed before it becomes faster [s]: as long as a look takes."""
DOUBLED = 1.5
"""Time after which it is twice as fast, again and again [s]."""


class PacedBus(BusInFront):
    """A `drivers.drive_bus.StreamingBus` in front of another one.

    Parameters
    ----------
    bus : DriveBus
        Not entered yet; SYNC is the clock of what moves on it.
    fastest : float
        Times real time that are reached in the end, at least 1: motion begins in real time. It may
        be changed meanwhile.
    """

    def __init__(self, bus: DriveBus, fastest: float) -> None:
        super().__init__(bus)
        self.fastest = fastest
        self._began = self._due = 0.0

    def sample(self) -> Sample:
        """Wait for the next SYNC, and until it is due.

        Where samples come later than that the pace begins anew with them: nothing is made up for.
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
