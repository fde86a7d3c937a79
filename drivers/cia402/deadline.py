"""Deadlines by the clock of the bus and by real time."""

from __future__ import annotations

import math
from time import monotonic
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable


class Deadline:
    """Deadline on two clocks, whichever is first: the bus of a dead plant has a slow clock.

    Parameters
    ----------
    duration : float
        Time by `clock` [s].
    clock : callable, optional
        Clock [s]; by default real time.
    real : float
        Time in real time [s].
    """

    def __init__(
        self, duration: float, clock: Callable[[], float] | None = None, *, real: float = math.inf
    ) -> None:
        self._clock = clock or monotonic
        self._ends = self._clock() + duration
        self._real_ends = monotonic() + real

    @property
    def passed(self) -> bool:
        """True after the deadline."""
        return self._clock() >= self._ends or monotonic() >= self._real_ends
