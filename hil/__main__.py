"""The program `hil`, which also leaves quietly on a Ctrl-C while it is still loading.

Until a command powers axes or shows its progress there is nothing to leave in order: files are
written whole or not at all. So an interrupt ends the process at once, also where libraries that are
being loaded would turn it into an error of their own.
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
"""Exit status of a program that was interrupted."""
STREAMS = {1: "stdout", 2: "stderr"}
CLEARED = b"\r\x1b[2K\x1b[?25h"
"""What takes a line of progress away, and shows the cursor again that it had hidden."""


def main() -> None:
    """Entry point of ``hil`` and ``python -m hil``."""
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, _leave)
    _keep_streams()
    # matrices are small here: threads would wait for one another, at a third more processor time
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # with Python's 700 new objects loading and estimating spend a tenth of their processor time on
    # looking for cycles (`hil identify` of 152 measurements: 0.4 of 4.6 s)
    gc.set_threshold(50_000)
    try:
        from hil.cli import main as command_line  # noqa: PLC0415 - takes a while, see above

        command_line()
    except KeyboardInterrupt:
        sys.exit(STATUS)
    finally:
        # An interrupt of code that a library generated stays noted in the interpreter, which would
        # end by that signal instead of with our status; running any generated code clears the note.
        exec("")  # noqa: S102
        _flush()


class _Patient(io.FileIO):
    """Drops what is written once nobody reads it: neither a run nor a result ends by that."""

    def write(self, content: Any) -> int:
        """Write what is taken."""
        try:
            return super().write(content) or 0
        except BrokenPipeError:
            _to_nowhere(self.fileno())
            return len(content)


def _keep_streams() -> None:
    """Let every text be written: where a stream is closed, unread or knows ASCII alone."""
    for number, name in STREAMS.items():
        stream = getattr(sys, name)
        if stream is None:  # closed by the caller; a file that is opened next would get its number
            _to_nowhere(number)
        kept = io.TextIOWrapper(
            io.BufferedWriter(_Patient(number, "w", closefd=False)),
            encoding="utf-8" if stream is None else stream.encoding,
            errors="replace",
            line_buffering=stream is not None and (stream.line_buffering or number == 2),
        )
        setattr(sys, name, kept)


def _to_nowhere(number: int) -> None:
    """Drop what is written to a stream from now on."""
    null = os.open(os.devnull, os.O_WRONLY)
    if null != number:
        os.dup2(null, number)
        os.close(null)


def _leave(number: int, frame: FrameType | None) -> None:
    del number, frame
    if os.isatty(1):
        os.write(1, CLEARED)
    os._exit(STATUS)


def _flush() -> None:
    """Write out what is left, or drop it where it cannot be written any more."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            _to_nowhere(stream.fileno())


if __name__ == "__main__":
    main()
