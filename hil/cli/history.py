"""`hil history`: the condition of one machine over many runs, and what changed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.cli.outputs import file_to_write
from hil.terminal.console import out, say, working

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

commands = typer.Typer()
CHANGED = 4
"""Exit status with --fail-on-change where something of the newest run changed."""


@commands.command()
def history(
    folders: Annotated[list[Path], typer.Argument(help="Folders of identified runs.")],
    reference: Annotated[
        Path | None,
        typer.Option(help="Run that all others are compared with; by default the first in time."),
    ] = None,
    wander: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=99.0,
            help="Percentage of friction that temperature may account for, at least.",
        ),
    ] = 0.0,
    page: Annotated[
        Path | None,
        typer.Option(
            "--html", callback=file_to_write, help="Page with plots to write, one HTML file."
        ),
    ] = None,
    json_file: Annotated[
        Path | None,
        typer.Option(
            "--json", callback=file_to_write, help="JSON file to write, for monitoring systems."
        ),
    ] = None,
    identify: Annotated[
        bool, typer.Option("--identify", help="Identify runs that have no model.yaml yet.")
    ] = False,
    fail_on_change: Annotated[
        bool,
        typer.Option(
            "--fail-on-change", help="End with status 4 where anything of the newest run changed."
        ),
    ] = False,
) -> None:
    """Show parameters and friction of one machine over many runs, and mark what changed."""
    with working(f"reading {len(folders)} runs") as now:
        from hil.results import history_file as tables
        from hil.results.history import read_history
        from hil.results.history_file import write_history
        from hil.results.tables.terminal import show
        from hil.runs.journal import NO_REAL_MACHINE

        if identify:
            _identify([*folders, *([reference] if reference else [])], now)
        now(f"comparing {len(folders)} runs")
        found = read_history(folders, reference, wander / 100)
    if any(run.model.provenance.of_virtual_plant for run in found.runs):
        say(NO_REAL_MACHINE, style="yellow")
    show(tables.runs(found), out)
    show(tables.condition(found), out)
    show(tables.changes(found), out)
    newest = found.sentences(found.runs[-1])
    for sentence in newest:
        say(sentence, style="bold red")
    if not newest:
        say(f"{found.runs[-1].label}: nothing changed significantly")
    if json_file is not None:
        write_history(json_file, found)
        say(f"history in {json_file}")
    if page is not None:
        with working("drawing the page"):
            from hil.report.further_pages import write_history_page

            write_history_page(page, found)
        say(f"page in {page}")
    if fail_on_change and newest:
        raise typer.Exit(CHANGED)


def _identify(folders: Sequence[Path], now: Callable[[str], None]) -> None:
    """Identify the runs among folders that have no model yet."""
    from hil.estimation.identify import default_method
    from hil.results.findings import found_in
    from hil.results.model_file import file_of
    from hil.runs.run import Run

    for folder in folders:
        if folder.is_dir() and not (path := file_of(folder)).exists():
            now(f"identifying {folder}")
            run = Run.open(folder)
            found_in(run, default_method(run.motions)[0]).model.save(path)
            say(f"model in {path}")
