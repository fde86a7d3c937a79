"""How long something may take, by the bus's time and by ours."""

from __future__ import annotations

import math
from time import monotonic
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable


class Deadline:
    """Passed when the first of two clocks says so: a bus whose plant is gone has a slow one.

    Parameters
    ----------
    duration : float
        By `clock` [s].
    clock : callable, optional
        Time [s]; by default real time.
    real : float
        In real time [s].
    """

    def __init__(
        self,
        duration: float,
        clock: Callable[[], float] | None = None,
        *,
        real: float = math.inf,
    ) -> None:
        self._clock = clock or monotonic
        self._ends = self._clock() + duration
        self._real_ends = monotonic() + real

    @property
    def passed(self) -> bool:
        """Whether it is over."""
        return self._clock() >= self._ends or monotonic() >= self._real_ends
