"""Command `hil doctor`: checks of this computer with remedies."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.terminal.console import give, out, working

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.cli.computer import Judged

commands = typer.Typer()
STYLES = {"OK": "green", "WARN": "yellow", "FAIL": "bold red"}
EXTRAS = {
    "dask": "distributed",
    "fleet": "duckdb",
    "mujoco": "mujoco",
    "pandas": "pandas",
    "recordings": "pyarrow",
}
"""Optional extras of the installation, with a module from each."""


@commands.command()
def doctor(
    folder: Annotated[
        Path,
        typer.Option(
            "--folder", help="Folder for runs; its free space and permissions are checked."
        ),
    ] = Path(),
) -> None:
    """Check this computer: Python, CAN, rights, clock, disk.

    Exit status 1 where a check fails.
    """
    with working("examining this computer"):
        from hil.cli.computer import judge, read_computer

        points = judge(read_computer(folder, EXTRAS))
    give(points=[asdict(each) for each in points])
    _show(points)
    if any(each.word == "FAIL" for each in points):
        raise typer.Exit(1)


def _show(points: Sequence[Judged]) -> None:
    from rich.text import Text

    from hil.show.terminal import show_beside

    width = max(len(each.point) for each in points)
    for each in points:
        remedy = f"; {each.remedy}" if each.remedy else ""
        head = Text(f"{each.word:4}  {each.point}", style=STYLES[each.word])
        show_beside(head, f"{each.found}{remedy}", width + 8, out)
