"""Waiting awake for a peer in lock-step, who answers sooner than the kernel wakes anybody.

A cycle with the plant in another process takes .03 ms over EtherCAT and .07 ms over a local channel
where both look out for the next frame, .13 to .15 ms where both sleep meanwhile
(`benchmarks/two_processes.py`, two cores).
"""

from __future__ import annotations

import os
import time
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

T = TypeVar("T")

LONG = 0.1
"""Who may wait so long waits for a plant in lock-step; on the wall clock there is less time [s]."""
EAGER = 0.0003
"""How long something is looked for [s]: several cycles, and .3 % of a core where nothing comes for
`LONG` each time."""


def look_out(receive: Callable[[], T | None]) -> T | None:
    """Return what `receive` gives within `EAGER`, None if it gives nothing."""
    ends = time.perf_counter() + EAGER
    while time.perf_counter() < ends:
        if (found := receive()) is not None:
            return found
        os.sched_yield()  # who is to send may need this core
    return None
