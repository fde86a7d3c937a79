"""A study on the terminal: how far it is, and its table."""

from __future__ import annotations

import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich import box
from rich.progress import BarColumn, Progress, TextColumn
from rich.table import Table

from hil.results.rounding import clock, significant
from hil.study.scenarios import SCENARIOS
from hil.study.summary import GROUPS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from rich.console import Console

    from hil.study.drift import Done
    from hil.study.summary import Row


@contextmanager
def shown(console: Console) -> Iterator[Callable[[Done], None]]:
    """Show jobs as they are done, a line each without a terminal; yields what takes them."""
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
                console.print(f"[red]{done.error}[/]", highlight=False, soft_wrap=True)
            elif not console.is_terminal:
                console.print(f"{text}, {left} left", highlight=False, soft_wrap=True)
            progress.update(
                task, description=text, completed=done.done, total=done.of, left=f"{left} left"
            )

        yield take


def render(rows: Sequence[Row], console: Console) -> None:
    """Print one table a scenario."""
    for scenario in dict.fromkeys(row.scenario for row in rows):
        console.print(_table([row for row in rows if row.scenario == scenario]))


def _table(rows: Sequence[Row]) -> Table:
    title = f"{rows[0].scenario}: {SCENARIOS[rows[0].scenario].says}"
    table = Table(title=title, box=box.SIMPLE_HEAD, pad_edge=False, title_justify="left")
    table.add_column("relative error, rms over seeds, %", no_wrap=True)
    headings = (*(group.replace("_", "-") for group in GROUPS), "torques", "over ours")
    for heading in (*headings, "in 95 %", "seeds"):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        errors = [row.group_error.get(group, float("nan")) for group in GROUPS]
        table.add_row(
            row.method,
            *(significant(100 * error, 2) for error in (*errors, row.torque_error)),
            significant(row.ratio, 2),
            f"{100 * row.coverage:.0f} %",
            str(row.n),
        )
    return table
