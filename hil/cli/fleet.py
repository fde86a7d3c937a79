"""`hil fleet`: index of the models of many machines, and search for deviating machines."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.cli.arguments import Scheduler, Workers, executor
from hil.cli.outputs import (
    Status,
    file_to_write,
    folder_to_write,
    output_option,
    show,
    write_page,
)
from hil.terminal.console import give, out, say, working

if TYPE_CHECKING:
    from hil.commands.fleet import Runs

commands = typer.Typer()
fleet_commands = typer.Typer(no_args_is_help=True)
commands.add_typer(
    fleet_commands,
    name="fleet",
    help="Index the models of many machines, and find machines that deviate from the fleet.",
)

Index = Annotated[Path, typer.Argument(metavar="INDEX", help="Index of a fleet.")]
Rate = Annotated[
    float,
    typer.Option(
        min=0.001, max=100.0, help="Maximum number of false alarms per machine in ten years."
    ),
]


@fleet_commands.command()
def index(
    folders: Annotated[
        list[str],
        typer.Argument(
            metavar="FOLDER",
            help="Folders MACHINE/RUN of identified runs; object storage addresses are accepted.",
        ),
    ],
    output: Annotated[
        Path, output_option(folder_to_write, "Folder of the index to create or extend.")
    ] = Path("fleet.parquet"),
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Add the models of all runs in folders to an index; known models are not read again."""
    from hil.commands.fleet import index as index_models

    with executor(workers, scheduler) as execute, out.status("looking for models") as status:
        found = index_models(folders, output, execute, status.update)
    give(added=found.new)
    _finish(found, f"{found.new} runs added to {output}, {found.known} known already")


@fleet_commands.command()
def identify(
    folders: Annotated[
        list[Path],
        typer.Argument(
            metavar="FOLDER",
            help="Folders with run folders at any depth.",
        ),
    ],
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Identify the runs in folders, in parallel; up-to-date models stay.

    The same command resumes an interrupted one.
    """
    from hil.commands.fleet import identify_runs

    with executor(workers, scheduler) as execute, out.status("looking for runs") as status:
        found = identify_runs(folders, execute, status.update)
    verdicts: dict[str, int] = dict(found.verdicts or {})
    give(identified=found.new, verdicts=verdicts)
    words = ", ".join(f"{n} {word}" for word, n in sorted(verdicts.items()) if word)
    sentence = f"{found.new} runs identified, {found.known} up to date"
    _finish(found, f"{sentence}: {words}" if words else sentence)


def _finish(found: Runs, sentence: str) -> None:
    """State which runs were left out and why; exit status 3 if there are any."""
    for reason in found.left_out:
        say(f"left out: {reason}", style="yellow")
    say(sentence)
    give(known=found.known, left_out=list(found.left_out))
    if found.left_out:
        raise typer.Exit(Status.REFUSED)


@fleet_commands.command()
def query(path: Index, rate: Rate = 0.5) -> None:
    """List machines that deviate from their own past or from the fleet."""
    with working("testing all machines"):
        from hil.commands.fleet import ask
        from hil.results.fleet_index import read_fleets

        found = ask(read_fleets(path), rate)
    show(found)


@fleet_commands.command()
def page(
    path: Index,
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", callback=file_to_write, help="Page to write; one HTML file."
        ),
    ] = Path("fleet.html"),
    rate: Rate = 0.5,
) -> None:
    """Write a page of the deviating machines, with their quantities over time."""
    with working("testing all machines"):
        from hil.commands.fleet import ask
        from hil.results.fleet_index import read_fleets

        found = ask(read_fleets(path), rate)
    write_page(output, found)
