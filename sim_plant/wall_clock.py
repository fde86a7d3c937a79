"""Wall time for a plant that does not count on SYNC."""

from __future__ import annotations

import time

TICK = 0.002
"""How often the plant follows the wall clock [s]."""

LAG_MAX = 0.25
"""Lag beyond which the plant gives up catching up [s]: a stopped process or a slow machine."""


class WallClock:
    """How much time has gone by since last asked."""

    def __init__(self) -> None:
        self._last = time.monotonic()

    def elapsed(self) -> float:
        """Seconds since the last call, at most `LAG_MAX`."""
        now = time.monotonic()
        elapsed, self._last = now - self._last, now
        return min(elapsed, LAG_MAX)
