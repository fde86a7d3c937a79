"""Console of all commands, and a line with the current computation.

Plain strings without a style are messages, suppressed by ``--quiet``; tables, texts of results and
warnings are not. With ``--json`` standard output holds a JSON object of the tables and of
additional results (`give`), and everything else goes to standard error.

All text from files is shown with control characters replaced by their codes: names of columns and
files come from somebody else, and an escape sequence in one would move the cursor, recolour or
rename the operator's terminal.
"""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.segment import Segment

from checked_files.foreign_text import printable, shown

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from hil.show.table import Table


class Output(Console):
    """Standard output with the options ``--quiet`` and ``--json``.

    Attributes
    ----------
    messages : bool
        True to show messages.
    verbose : bool
        True to show tracebacks of refusals.
    given : dict or None
        Contents of the JSON object; None without ``--json``.
    """

    def __init__(self) -> None:
        super().__init__()
        self.begin()

    def begin(self) -> None:
        """Show everything, as at the start of a command."""
        self.messages, self.verbose, self.given, self.stderr = True, False, None, False

    given: dict[str, Any] | None

    def print(self, *objects: Any, **how: Any) -> None:
        """Print unless suppressed; collect tables for JSON."""
        if not self.messages and not how.get("style") and all(type(o) is str for o in objects):
            return
        if self.given is not None:
            tables = [each.source for each in objects if hasattr(each, "source")]
            self.given["tables"] += map(_tabulate, tables)
            objects = tuple(each for each in objects if not hasattr(each, "source"))
            if not objects:
                return
        super().print(*objects, **how)

    def render(self, renderable: Any, options: Any = None) -> Iterator[Segment]:
        """Render tables and text without control characters."""
        for segment in super().render(renderable, options):
            if segment.control or segment.text.isprintable():
                yield segment
            else:
                yield Segment(printable(segment.text), segment.style)


out = Output()


def give(**results: Any) -> None:
    """Add results outside of tables to the JSON object."""
    if out.given is not None:
        out.given |= results


def give_each(key: str, value: Any) -> None:
    """Append a result to a list in the JSON object."""
    if out.given is not None and value:
        out.given.setdefault(key, []).append(value)


def _tabulate(table: Table) -> dict[str, Any]:
    """Convert a table to title, rows and notes: cells by heading, numbers as such."""
    keys = [
        column.head or ("name" if k == 0 else f"column {k + 1}")
        for k, column in enumerate(table.columns)
    ]
    return {
        "title": table.title,
        "rows": [
            {
                **({"group": part.name} if part.name else {}),
                **{key: _number(cell) for key, cell in zip(keys, row, strict=True)},
            }
            for part in table.parts
            for row in part.rows
            if any(row)
        ],
        **({"notes": list(table.notes)} if table.notes else {}),
    }


def _number(cell: str) -> str | float | None:
    text = cell.strip().replace("\N{MINUS SIGN}", "-")
    if not text:
        return None
    try:
        value = int(text) if text.lstrip("-").isdecimal() else float(text)
    except ValueError:
        return str(cell)
    # JSON has no infinity and NaN
    return value if abs(value) < float("inf") else str(cell)


def say(text: str, style: str | None = None, console: Console = out) -> None:
    """Print a sentence without markup."""
    from hil.show.terminal import broken  # noqa: PLC0415 - help and completion say nothing

    told = broken(shown(text), console)
    console.print(told, style=style, highlight=False, markup=False, soft_wrap=True)


@contextmanager
def working(what: str) -> Iterator[Callable[[str], None]]:
    """Show the current computation with its duration; yield a function that changes the words.

    Without a terminal nothing is shown. Words appear within a tenth of a second, so libraries
    should be loaded within the block. Other output appears above the line.
    """
    from rich import progress  # noqa: PLC0415 - help and completion show no progress

    with progress.Progress(
        progress.SpinnerColumn("line"),
        progress.TextColumn("{task.description}", markup=False),
        progress.TimeElapsedColumn(),
        console=out,
        transient=True,
        disable=not out.is_terminal or not out.messages,
        refresh_per_second=4,
    ) as line:
        task = line.add_task(printable(what), total=None)

        def now(what: str) -> None:
            line.update(task, description=printable(what), refresh=True)

        yield now
