"""`hil doctor`: whether this computer is fit to measure, and what to do where it is not."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.terminal.console import say, working

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.cli.computer import Judged

commands = typer.Typer()
STYLES = {"OK": "green", "WARN": "yellow", "FAIL": "bold red"}
EXTRAS = {"dask": "distributed", "pandas": "pandas", "recordings": "pyarrow"}
"""Optional extras of the installation, and a module that each brings."""


@commands.command()
def doctor(
    folder: Annotated[
        Path, typer.Option("--folder", help="Folder that runs are to be written into.")
    ] = Path(),
    as_json: Annotated[bool, typer.Option("--json", help="Write the points as JSON.")] = False,
) -> None:
    """Examine this computer: Python, CAN, rights, clock, disk; exit status 1 where one fails."""
    with working("examining this computer"):
        from hil.cli.computer import judge, read_computer

        points = judge(read_computer(folder, EXTRAS))
    (_write_json if as_json else _show)(points)
    if any(each.word == "FAIL" for each in points):
        raise typer.Exit(1)


def _show(points: Sequence[Judged]) -> None:
    width = max(len(each.point) for each in points)
    for each in points:
        remedy = f"; {each.remedy}" if each.remedy else ""
        line = f"{each.word:4}  {each.point:{width}}  {each.found}{remedy}"
        say(line, style=STYLES[each.word])


def _write_json(points: Sequence[Judged]) -> None:
    import json
    from dataclasses import asdict

    say(json.dumps([asdict(each) for each in points], indent=2))
