"""Display of a study on the terminal: progress and table."""

from __future__ import annotations

import math
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich import box
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn
from rich.table import Table

from hil.model.dependencies import GROUPS
from hil.show.rounding import clock, significant

from .scenarios import SCENARIOS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from rich.console import Console

    from .drift import Done
    from .summary import MethodScore


@contextmanager
def shown(console: Console) -> Iterator[Callable[[Done], None]]:
    """Show finished jobs, a line each without a terminal; yields a function for events."""
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[left]}"))
    began: dict[str, float] = {}
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("starting", total=None, left="")

        def take(done: Done) -> None:
            first = began.setdefault(done.step, time.monotonic())
            spent, before = time.monotonic() - first, max(done.done - 1, 1)
            left = clock(spent / before * (done.of - done.done)) if done.done > 1 else "?"
            text = f"{done.step} {done.done} of {done.of}: {done.cell}"
            if done.error:
                console.print(f"[red]{escape(done.error)}[/]", highlight=False, soft_wrap=True)
            elif not console.is_terminal:
                console.print(f"{text}, {left} left", highlight=False, soft_wrap=True)
            progress.update(
                task, description=text, completed=done.done, total=done.of, left=f"{left} left"
            )

        yield take


def render(rows: Sequence[MethodScore], console: Console) -> None:
    """Print one table per scenario."""
    for scenario in dict.fromkeys(row.scenario for row in rows):
        console.print(_table([row for row in rows if row.scenario == scenario]), "")


def _table(rows: Sequence[MethodScore]) -> Table:
    says = f"{rows[0].scenario}: {SCENARIOS[rows[0].scenario].says}"
    table = Table(
        title=f"{says}\nrelative errors in %, rms over the seeds",
        box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0),
        title_justify="left",
    )  # fmt: skip
    table.add_column("")
    groups = [group.replace("off_", "off-\n") for group in GROUPS]
    for heading in (*groups, "torques", "over\nours", "in\n95 %", "seeds"):
        table.add_column(heading, justify="right", no_wrap=True)
    family = ""
    for row in rows:
        before, colon, method = row.method.rpartition(": ")
        if colon and before != family:
            table.add_row(f"{before}:")
        family = before
        errors = [row.group_error.get(group, math.nan) for group in GROUPS]
        table.add_row(
            f"  {method}" if colon else method,
            *(_figure(100 * error) for error in (*errors, row.torque_error)),
            _figure(row.ratio),
            f"{100 * row.coverage:.0f} %",
            str(row.n),
        )
    return table


def _figure(value: float) -> str:
    """Return a number with two digits, without an exponent; an empty text for NaN."""
    if not math.isfinite(value):
        return ""
    return f"{float(f'{value:.2g}'):.0f}" if value >= 100 else significant(value, 2)
