"""Wall time for a plant that does not count on SYNC."""

from __future__ import annotations

import time

TICK = 0.002
"""How often the plant follows the wall clock [s]."""

LAG_MAX = 0.25
"""Lag beyond which the plant gives up catching up [s]: a stopped process or a slow machine."""


BREATH = 5.0
"""A plant on a slow machine rests so many times as long as its last step took, or it would have no
time left for frames."""


class WallClock:
    """How much time has gone by since last asked, and when to ask again.

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
        """Whether the pause is over."""
        return time.monotonic() - self._last >= self.pause

    def stepped(self) -> None:
        """Take note that the step for which `elapsed` was asked is done."""
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
