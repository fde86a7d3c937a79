"""Keyboard and signals: single keys, stop and pause of a run, answers, interruption.

`Keys` sets the terminal to cbreak mode while entered, so that keys act at once and are not echoed;
Ctrl-C stays an interrupt. If standard input is no terminal (a pipe, a job in the background, a
system without termios) no keys are read and nothing is changed.

During a run s or space stops all axes and ends it, p pauses. A thread waits for keys at no cost. A
stop is an interrupt like Ctrl-C, sent to the main thread: it acts between two steps of the
interpreter, anywhere in the sample loop, and continues by the most tested path, quick stop and
power off of the drives. A pause lasts from the end of the present measurement until any key is
pressed; the axes stay powered and sampled, since drives without telegrams would switch off.

The operator in front of the robot agrees to motion, stops it, and answers. Without a terminal, an
answer may come through a pipe; without an answer, nothing is powered on.

While axes may be powered, Ctrl-C, SIGTERM, and SIGHUP after the terminal is closed each raise
`KeyboardInterrupt` in the main thread, so that all contexts are left in order: axes stopped and
switched off, files complete, the terminal restored. During the loading of a module or compiled code
the interrupt waits: libraries would turn it into an import error, or crash in callbacks. Signals
ignored by nohup stay ignored. A closed terminal refuses every output with an error; it is replaced
by the null device, so that no message prevents switching off.
"""

from __future__ import annotations

import logging
import os
import select
import signal
import sys
import threading
import time
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

import typer
from rich.text import Text

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from types import FrameType


try:
    import termios
    import tty
except ImportError:  # Windows
    termios = None  # type: ignore[assignment]

if TYPE_CHECKING:
    from typing import Self, TextIO

    from rich.console import Console


class Keys:
    """Keys typed while the context is entered.

    Parameters
    ----------
    stream : text file, optional
        Source of keys; standard input by default.

    Attributes
    ----------
    listening : bool
        True if keys can be read; questions to the operator depend on it.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        self.listening = False
        self._stream = sys.stdin if stream is None else stream
        self._descriptor = -1

    def __enter__(self) -> Self:
        """Read single keys from now on, if there is a terminal."""
        if termios is None or self._stream is None:
            return self
        try:
            self._descriptor = self._stream.fileno()
            self.listening = os.isatty(self._descriptor) and _is_foreground(self._descriptor)
            if self.listening:
                self._before = termios.tcgetattr(self._descriptor)
                tty.setcbreak(self._descriptor)
        except (OSError, ValueError, termios.error):  # closed, or a substitute without descriptor
            self.listening = False
        return self

    def __exit__(self, *_raised: object) -> None:
        """Restore the terminal."""
        if self.listening:
            self.listening = False
            try:
                termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._before)
            except termios.error:  # the terminal has gone
                return

    def pressed(self) -> str:
        """Return the keys typed since the last call, in order; empty if none."""
        typed = b""
        try:
            while self.listening and _is_foreground(self._descriptor) and self._waiting():
                chunk = os.read(self._descriptor, 64)
                if not chunk:  # the terminal has gone
                    self.listening = False
                    break
                typed += chunk
        except OSError:  # the terminal has gone
            self.listening = False
        return typed.decode(errors="ignore")

    def awaited(self, timeout: float) -> str:
        """Return the typed keys after waiting up to `timeout` [s]; for a separate thread."""
        try:
            if self.listening:
                self._waiting(timeout)
        except OSError:  # the terminal has gone
            self.listening = False
        return self.pressed()

    def _waiting(self, timeout: float = 0.0) -> bool:
        return bool(select.select([self._descriptor], [], [], timeout)[0])


def _is_foreground(descriptor: int) -> bool:
    """Return True if the process may read; reading would stop a job in the background."""
    try:
        return os.tcgetpgrp(descriptor) == os.getpgrp()
    except OSError:  # not our controlling terminal, so not a job of another process group
        return True


STOPS = frozenset("sS ")
PAUSES = frozenset("pP")
HINT = "s or space: stop all axes and end; p: pause after the present measurement"


class KeyboardStop:
    """Listener to the keyboard while entered.

    Parameters
    ----------
    keys : Keys, optional
        Source of keys; the terminal by default.

    Attributes
    ----------
    listening : bool
        True if there is a keyboard.
    """

    def __init__(self, keys: Keys | None = None) -> None:
        self._keys = Keys() if keys is None else keys
        self._paused = False
        self._wanted = self._started = False
        self._thread = threading.Thread(target=self._listen, name="keyboard", daemon=True)

    @property
    def listening(self) -> bool:
        """True if there is a keyboard."""
        return self._keys.listening

    def __enter__(self) -> Self:
        """Start to listen, if there is a terminal."""
        self._keys.__enter__()
        if self.listening:
            self._before = signal.getsignal(signal.SIGINT)
            if self._before is signal.SIG_IGN:
                # A shell may have started the process as a background job with Ctrl-C ignored; a
                # stop must still work.
                signal.signal(signal.SIGINT, signal.default_int_handler)
            self._wanted = self._started = True
            self._thread.start()
        return self

    def __exit__(self, *_raised: object) -> None:
        """Stop listening and restore the terminal."""
        self._wanted = False
        if self._started:
            self._thread.join()
            signal.signal(signal.SIGINT, self._before)
        self._keys.__exit__()

    def pause(self) -> bool:
        """Return True while the operator wants a pause, after a short sleep."""
        if self._paused:
            time.sleep(0.001)  # else lock-step would occupy a processor with samples
        return self._paused

    def take(self, key: str) -> None:
        """Execute the command of a key."""
        if key in STOPS:
            self._wanted = False
            interrupt_main(signal.SIGINT)
        else:
            self._paused = key in PAUSES and not self._paused

    def _listen(self) -> None:
        while self._wanted and self._keys.listening:
            # short waits, so that the thread ends soon after the context
            for key in self._keys.awaited(0.1):
                self.take(key)


STOP_HINT = "space, q or Esc stops all axes"


class TerminalOperator:
    """Operator at the terminal.

    Parameters
    ----------
    console : Console
        Console for questions.
    keys : Keys
        Source of answers, entered already.
    agreed : bool
        True if everything is agreed to beforehand, without questions.
    """

    def __init__(self, console: Console, keys: Keys, *, agreed: bool) -> None:
        self._console = console
        self._keys = keys
        self._agreed = agreed

    @property
    def present(self) -> bool:
        """True if the operator can be asked."""
        return self._keys.listening and not self._agreed

    def agrees(self, intent: str) -> bool:
        """Ask before power-on; without a terminal a line of standard input is the answer."""
        if self._agreed:
            return True
        self.show(f"{intent} [y/N]")
        key = self._wait() if self._keys.listening else sys.stdin.readline()[:1]
        if key.lower() == "y" and self._keys.listening:
            self.show(STOP_HINT)
        return key.lower() == "y"

    def show(self, text: str) -> None:
        """Show a line."""
        self._console.print(Text(text), highlight=False, soft_wrap=True)

    def pressed(self) -> str:
        """Return the keys pressed since the last call, without waiting."""
        return self._keys.pressed()

    def _wait(self) -> str:
        while not (typed := self._keys.pressed()) and self._keys.listening:
            time.sleep(0.05)  # nothing is powered
        return typed[:1]


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
