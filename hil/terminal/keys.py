"""Single keys from the terminal, without waiting and without Enter.

`Keys` puts the terminal into cbreak mode for as long as it is entered, so that a key counts at
once and is not echoed; Ctrl-C stays an interrupt. Where standard input is no terminal (a pipe, a
job in the background, a system without termios) nothing is ever pressed, and nothing is changed.
"""

from __future__ import annotations

import os
import select
import sys
from typing import TYPE_CHECKING

try:
    import termios
    import tty
except ImportError:  # Windows
    termios = None  # type: ignore[assignment]

if TYPE_CHECKING:
    from types import TracebackType
    from typing import Self, TextIO

CHUNK = 64


class Keys:
    """What is typed while the context is entered.

    Parameters
    ----------
    stream : text file, optional
        Where keys come from; standard input unless given.

    Attributes
    ----------
    listening : bool
        Whether keys can come at all; what the operator is asked follows from it.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        self.listening = False
        self._stream = sys.stdin if stream is None else stream
        self._descriptor = -1

    def __enter__(self) -> Self:
        """Read keys singly from now on, where there is a terminal."""
        if termios is None or self._stream is None:
            return self
        try:
            self._descriptor = self._stream.fileno()
            self.listening = os.isatty(self._descriptor) and _in_foreground(self._descriptor)
            if self.listening:
                self._before = termios.tcgetattr(self._descriptor)
                tty.setcbreak(self._descriptor)
        except (OSError, ValueError, termios.error):  # closed, or a stand-in without descriptor
            self.listening = False
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Leave the terminal as it was found."""
        if self.listening:
            self.listening = False
            try:
                termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._before)
            except termios.error:  # the terminal has gone
                return

    def pressed(self) -> str:
        """Return what was typed since the last call, in order; empty if nothing was."""
        typed = b""
        try:
            while self.listening and _in_foreground(self._descriptor) and self._waiting():
                chunk = os.read(self._descriptor, CHUNK)
                if not chunk:  # the terminal has gone
                    self.listening = False
                    break
                typed += chunk
        except OSError:  # the terminal has gone
            self.listening = False
        return typed.decode(errors="ignore")

    def awaited(self, timeout: float) -> str:
        """Return what is typed, waiting up to `timeout` for it [s]; for a thread of its own."""
        try:
            if self.listening:
                self._waiting(timeout)
        except OSError:  # the terminal has gone
            self.listening = False
        return self.pressed()

    def _waiting(self, timeout: float = 0.0) -> bool:
        return bool(select.select([self._descriptor], [], [], timeout)[0])


def _in_foreground(descriptor: int) -> bool:
    """Whether reading does not stop us: the shell keeps keys from jobs in the background."""
    try:
        return os.tcgetpgrp(descriptor) == os.getpgrp()
    except OSError:  # not our controlling terminal: it is nobody else's job
        return True
