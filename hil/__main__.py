"""The program `hil`, with a quiet exit on Ctrl-C during loading.

Before a command powers axes or shows its progress, an exit needs no clean-up: files are written
whole or not at all. Therefore an interrupt ends the process at once, even inside libraries that
would convert the interrupt into an error during loading.
"""

from __future__ import annotations

import gc
import io
import os
import signal
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from types import FrameType

STATUS = 130
"""Exit status of an interrupted program."""
STREAMS = {1: "stdout", 2: "stderr"}
CLEARED = b"\r\x1b[2K\x1b[?25h"
"""Escape sequence that clears a progress line and shows the hidden cursor."""


def main() -> None:
    """Entry point of ``hil`` and ``python -m hil``."""
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, _leave)
    # make output streams accept any text, even if closed, unread, or limited to ASCII
    for number, name in STREAMS.items():
        stream = getattr(sys, name)
        if stream is None:  # closed by the caller; the next opened file would get its number
            _discard(number)
        kept = io.TextIOWrapper(
            io.BufferedWriter(_Patient(number, "w", closefd=False)),
            encoding="utf-8" if stream is None else stream.encoding,
            errors="replace",
            line_buffering=stream is not None and (stream.line_buffering or number == 2),
        )
        setattr(sys, name, kept)
    # matrices are small here: threads would wait for one another, at a third more processor time
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # by default Python collects garbage after 700 new objects: loading and estimating then spend a
    # tenth of their processor time on cycles (`hil identify` of 152 measurements: 0.4 of 4.6 s);
    # loading alone makes 150 000 that stay
    gc.set_threshold(200_000)
    try:
        from hil.cli import main as command_line  # noqa: PLC0415 - takes a while, see above

        command_line()
    except KeyboardInterrupt:
        sys.exit(STATUS)
    finally:
        # An interrupt of code that a library generated stays noted in the interpreter, which would
        # end by that signal instead of with our status; running any generated code clears the note.
        exec("")  # noqa: S102
        # write buffered output, or discard it if the stream is broken
        for stream in (sys.stdout, sys.stderr):
            try:
                stream.flush()
            except OSError:
                _discard(stream.fileno())


class _Patient(io.FileIO):
    """Output stream that lets a run finish, and keep the results, after the reader has gone."""

    def write(self, content: Any) -> int:
        """Write content, or discard content without a reader."""
        try:
            return super().write(content) or 0
        except BrokenPipeError:
            _discard(self.fileno())
            return len(content)


def _discard(number: int) -> None:
    """Discard all further output to a stream."""
    null = os.open(os.devnull, os.O_WRONLY)
    if null != number:
        os.dup2(null, number)
        os.close(null)


def _leave(number: int, frame: FrameType | None) -> None:
    del number, frame
    if os.isatty(1):
        os.write(1, CLEARED)
    os._exit(STATUS)


if __name__ == "__main__":
    main()
