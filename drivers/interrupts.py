"""Postponement of signals while a step must be finished, such as powering off a robot."""

from __future__ import annotations

import signal
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType

HELD = tuple(
    # Windows has no SIGHUP
    getattr(signal, name)
    for name in ("SIGINT", "SIGTERM", "SIGHUP")
    if hasattr(signal, name)
)


@contextmanager
def hold_interrupts() -> Iterator[None]:
    """Postpone SIGINT, SIGTERM and SIGHUP to the end of the block.

    Outside the main thread, where Python delivers no signals, the block runs unchanged. Ignored
    signals stay ignored, such as SIGHUP under nohup.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[int] = []

    def remember(number: int, frame: FrameType | None) -> None:
        del frame
        arrived.append(number)

    held = [number for number in HELD if signal.getsignal(number) not in {signal.SIG_IGN, None}]
    previous = {number: signal.signal(number, remember) for number in held}
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
    for number in dict.fromkeys(arrived):
        signal.raise_signal(number)
