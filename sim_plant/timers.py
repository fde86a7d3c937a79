"""Timers in the plant's time: heartbeats, inhibit times, event timers, time-outs.

The machine advances from one due timer to the next, so that each acts at its own instant however
long a SYNC period is, and the plant stays deterministic.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable

Action: TypeAlias = "Callable[[], None]"


class Timers:
    """One-shot timers by name; starting one again moves it.

    Attributes
    ----------
    now : float
        Present time [s]; set by whoever advances the machine.
    next : float
        When the earliest timer is due [s]; inf without timers.
    """

    def __init__(self) -> None:
        self.now = 0.0
        self.next = math.inf
        self._due: dict[Hashable, tuple[float, Action]] = {}

    def start(self, name: Hashable, delay: float, action: Action) -> None:
        """Call `action` in `delay` seconds."""
        self._due[name] = (self.now + delay, action)
        self._find_next()

    def stop(self, name: Hashable) -> None:
        """Forget a timer; one that does not run is none of anybody's business."""
        if self._due.pop(name, None):
            self._find_next()

    def run(self) -> None:
        """Call what is due now, earliest first."""
        while self.next <= self.now:
            name = min(self._due, key=lambda name: self._due[name][0])
            _, action = self._due.pop(name)
            self._find_next()
            action()

    def _find_next(self) -> None:
        self.next = min((due for due, _ in self._due.values()), default=math.inf)
