"""The console on which all commands print, and a line that states what is being computed.

Text from files is shown with control characters written out: names of columns and files come from
somebody else, and an escape sequence in one would move the cursor, recolour or rename the
operator's terminal.
"""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_KEPT = "\n\t"
_CONTROL = [*range(0x20), *range(0x7F, 0xA0)]
_WRITTEN_OUT = {code: f"\\x{code:02x}" for code in _CONTROL if chr(code) not in _KEPT}


def printable(text: str) -> str:
    """Text with each control character as its code in hexadecimal, save line ends and tabs."""
    return text.translate(_WRITTEN_OUT)


out = Console()


def say(text: str, style: str | None = None, console: Console = out) -> None:
    """Print a line as it is: nothing in it is markup, and the terminal alone wraps it."""
    console.print(printable(text), style=style, highlight=False, markup=False, soft_wrap=True)


@contextmanager
def working(what: str) -> Iterator[Callable[[str], None]]:
    """Show what is being computed, and for how long; yields what puts other words there.

    Without a terminal nothing is shown: such a line is worth nothing afterwards.
    Words begin within the first tenth of a second, so libraries are best loaded within the block.
    What else is printed meanwhile comes to stand above the line.
    """
    from rich import progress  # noqa: PLC0415 - help and completion show no progress

    with progress.Progress(
        progress.SpinnerColumn("line"),
        progress.TextColumn("{task.description}", markup=False),
        progress.TimeElapsedColumn(),
        console=out,
        transient=True,
        disable=not out.is_terminal,
        refresh_per_second=4,
    ) as line:
        task = line.add_task(printable(what), total=None)

        def now(what: str) -> None:
            line.update(task, description=printable(what), refresh=True)

        yield now
