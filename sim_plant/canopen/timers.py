"""Timers in simulated time: heartbeats, inhibit times, event timers, time-outs.

The machine advances from one due timer to the next, so that each timer acts at its own instant for
any SYNC period, and the plant stays deterministic. A heap keeps the earliest timer first; stopped
or moved timers stay in the heap until they become first.
"""

from __future__ import annotations

import heapq
import math
from itertools import count
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable

Action: TypeAlias = "Callable[[], None]"


class Timers:
    """One-shot timers by name; starting a running timer moves it.

    Attributes
    ----------
    now : float
        Present time [s]; set by the caller that advances the machine.
    next : float
        Due time of the earliest timer [s]; inf without timers.
    """

    def __init__(self) -> None:
        self.now = 0.0
        self.next = math.inf
        self._numbers = count()
        self._running: dict[Hashable, int] = {}
        self._heap: list[tuple[float, int, Hashable, Action]] = []

    def start(self, name: Hashable, delay: float, action: Action) -> None:
        """Call `action` in `delay` seconds."""
        number = self._running[name] = next(self._numbers)
        heapq.heappush(self._heap, (self.now + delay, number, name, action))
        self._find_next()

    def stop(self, name: Hashable) -> None:
        """Stop a timer if it runs."""
        if self._running.pop(name, None) is not None:
            self._find_next()

    def runs(self, name: Hashable) -> bool:
        """Return True if a timer of this name runs."""
        return name in self._running

    def run(self) -> None:
        """Run the actions of all due timers, earliest first."""
        while self.next <= self.now:
            _, _, name, action = heapq.heappop(self._heap)
            del self._running[name]
            self._find_next()
            action()

    def _find_next(self) -> None:
        heap, running = self._heap, self._running
        while heap and running.get(heap[0][2]) != heap[0][1]:
            heapq.heappop(heap)
        self.next = heap[0][0] if heap else math.inf
