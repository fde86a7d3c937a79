"""What a command is computing, and for how long already: a line on a terminal, until it is done.

Without a terminal nothing is shown: such a line is worth nothing afterwards.
"""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from hil.terminal.console import out
from hil.terminal.printable import printable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


@contextmanager
def working(what: str) -> Iterator[Callable[[str], None]]:
    """Show what is being computed while the block lasts; yields what puts other words there.

    Words begin within the first tenth of a second, so libraries are best loaded within the block.
    What else is printed meanwhile comes to stand above the line.
    """
    from rich.progress import (  # noqa: PLC0415 - help and completion show no progress
        Progress,
        SpinnerColumn,
        TextColumn,
        TimeElapsedColumn,
    )

    columns = (
        SpinnerColumn("line"),
        TextColumn("{task.description}", markup=False),
        TimeElapsedColumn(),
    )
    with Progress(
        *columns, console=out, transient=True, disable=not out.is_terminal, refresh_per_second=4
    ) as line:
        task = line.add_task(printable(what), total=None)

        def now(what: str) -> None:
            line.update(task, description=printable(what), refresh=True)

        yield now
