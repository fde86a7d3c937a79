"""Wall clock of a plant not driven by SYNC."""

from __future__ import annotations

import time

TICK = 0.002
"""Period of the plant's steps on the wall clock [s]."""

LAG_MAX = 0.25
"""Lag beyond which the plant gives up catching up [s]: a stopped process or a slow machine."""


BREATH = 5.0
"""Pause after a step, in durations of the step: leaves time for frames on a slow machine."""


class WallClock:
    """Elapsed time since the last step, and time of the next step.

    Attributes
    ----------
    pause : float
        Until the next step [s].
    """

    def __init__(self) -> None:
        self.pause = TICK
        self._last = time.monotonic()

    @property
    def due(self) -> bool:
        """True if the pause is over."""
        return time.monotonic() - self._last >= self.pause

    def stepped(self) -> None:
        """Note the end of the step of the last `elapsed`."""
        self.pause = max(TICK, BREATH * (time.monotonic() - self._last))

    def elapsed(self, until: float | None = None) -> float:
        """Return the time since the last call, at most `LAG_MAX` [s].

        Parameters
        ----------
        until : float, optional
            Time stamp of the frame that is answered [s]: it may have waited for this process.
        """
        now = time.monotonic()
        waited = 0.0 if until is None else time.time() - until
        if 0.0 < waited < LAG_MAX:  # else the stamp is of another clock
            now = max(self._last, now - waited)
        elapsed, self._last = now - self._last, now
        return min(elapsed, LAG_MAX)
