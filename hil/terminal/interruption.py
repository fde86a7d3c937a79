"""Interruption of a command: Ctrl-C, SIGTERM, and SIGHUP after its terminal is closed.

While axes may be powered, each of the three signals raises `KeyboardInterrupt` in the main thread,
so that all contexts are left in order: axes stopped and switched off, files complete, the terminal
restored. During the loading of a module or compiled code the interrupt waits: libraries would turn
it into an import error, or crash in callbacks. Signals ignored by nohup stay ignored. A closed
terminal refuses every output with an error; it is replaced by the null device, so that no message
prevents switching off.
"""

from __future__ import annotations

import logging
import os
import signal
import sys
import threading
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from types import FrameType

STATUS = 130
"""Exit status of an interrupted program."""

_NUMBERS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
_OUTPUTS = (1, 2)
_LOADERS = frozenset({"importlib", "llvmlite", "numba"})
"""Packages in which no exception may be raised."""


@contextmanager
def interruptible(ended: Callable[[], str]) -> Iterator[Callable[[], None]]:
    """End the block in order on Ctrl-C, SIGTERM and SIGHUP.

    Python drops any exception raised while an object is finalised, including an interrupt. So the
    yielded function is to be called regularly: it raises `KeyboardInterrupt` for a dropped
    interrupt.

    Parameters
    ----------
    ended : callable
        Function that returns the line to show after an interruption.

    Raises
    ------
    typer.Exit
        Exit status 130 after an interruption.
    """
    try:
        with _interrupts() as refuse_lost:
            yield refuse_lost
    except KeyboardInterrupt:
        # python-can warns about a bus interrupted during opening
        logging.getLogger("can").setLevel(logging.ERROR)
        report(ended())
        raise typer.Exit(STATUS) from None


def report(text: str) -> None:
    """Write a line to standard error; ignore failures."""
    with suppress(OSError):
        sys.stderr.write(f"{text}\n")
        sys.stderr.flush()


def interrupt_main(by: signal.Signals = signal.SIGTERM) -> None:
    """Interrupt the main thread from another thread, like a signal.

    SIGTERM is used, since a shell may have started the process with Ctrl-C ignored.
    """
    if main := threading.main_thread().ident:
        signal.pthread_kill(main, by)


@contextmanager
def _interrupts() -> Iterator[Callable[[], None]]:
    """Raise KeyboardInterrupt on the three signals, and on output to a closed terminal."""
    terminals = [descriptor for descriptor in _OUTPUTS if os.isatty(descriptor)]
    interrupted, again = False, threading.Timer(0.0, interrupt_main)

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal interrupted, again
        del number
        if _loads(frame):
            # importing a module takes some milliseconds
            again = threading.Timer(0.01, interrupt_main)
            again.start()
            return
        interrupted = True
        _exchange_gone(terminals)
        raise KeyboardInterrupt

    def refuse_lost() -> None:
        if interrupted:
            raise KeyboardInterrupt

    before = {number: signal.getsignal(number) for number in _NUMBERS}
    for number in _NUMBERS:
        if number == signal.SIGTERM or before[number] is not signal.SIG_IGN:
            signal.signal(number, interrupt)
    try:
        yield refuse_lost
    except OSError as error:
        if not _exchange_gone(terminals):
            raise
        raise KeyboardInterrupt from error
    finally:
        again.cancel()
        for number, handler in before.items():
            signal.signal(number, handler)


def _loads(frame: FrameType | None) -> bool:
    """Return True if a module is being loaded at the instant of a signal."""
    while frame is not None:
        if frame.f_globals.get("__name__", "").partition(".")[0] in _LOADERS:
            return True
        frame = frame.f_back
    return False


def _exchange_gone(terminals: Sequence[int]) -> bool:
    """Replace closed terminals by the null device; return True if any was closed."""
    gone = [descriptor for descriptor in terminals if not os.isatty(descriptor)]
    if gone:
        null = os.open(os.devnull, os.O_WRONLY)
        for descriptor in gone:
            os.dup2(null, descriptor)
        os.close(null)
    return bool(gone)
