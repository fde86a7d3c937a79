"""The program `hil`, which also leaves quietly on a Ctrl-C while it is still loading.

Until a command powers axes or shows its progress there is nothing to leave in order: files are
written whole or not at all. So an interrupt ends the process at once, also where libraries that are
being loaded would turn it into an error of their own.
"""

from __future__ import annotations

import os
import signal
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import FrameType

STATUS = 130
"""Exit status of a program that was interrupted."""
CLEARED = b"\r\x1b[2K\x1b[?25h"
"""What takes a line of progress away, and shows the cursor again that it had hidden."""


def main() -> None:
    """Entry point of ``hil`` and ``python -m hil``."""
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, _leave)
    # matrices are small here: threads would wait for one another, at a third more processor time
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
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


def _leave(number: int, frame: FrameType | None) -> None:
    del number, frame
    if os.isatty(1):
        os.write(1, CLEARED)
    os._exit(STATUS)


def _flush() -> None:
    """Write out what is left, or drop it where nobody reads it any more."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, stream.fileno())
            os.close(null)


if __name__ == "__main__":
    main()
