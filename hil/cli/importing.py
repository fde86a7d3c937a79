"""Recordings that somebody else made, into a run folder."""

from __future__ import annotations

import os
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hil.cli.outputs import new_folder, output_option, refuse_no_folder
from hil.terminal.console import out, say

if TYPE_CHECKING:
    from hil.imports.statement import Statement

LOCAL = "local"
commands = typer.Typer()


@commands.command("import")
def import_(
    output: Annotated[Path, output_option(new_folder, "Run folder to make, or map with --draft.")],
    maps: Annotated[
        list[Path] | None, typer.Argument(help="Maps that state which column is what.")
    ] = None,
    draft: Annotated[
        Path | None,
        typer.Option("--draft", help="File of a recording for which a first map is written."),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Number of maps at once; 1 by default, with no scheduler."),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            help="Address of a Dask scheduler, such as tcp://host:8786, or local: a process for"
            " each processor of this machine."
        ),
    ] = None,
) -> None:
    """Turn recordings of any robot into a run folder; a map states which column is what."""
    if (draft is None) == (not maps):
        raise typer.BadParameter("give maps, or a recording with --draft: one of the two")
    if draft is not None:
        _draft(draft, output)
        return
    if workers is not None and scheduler not in (None, LOCAL):
        raise typer.BadParameter(
            "--workers is for this machine, a Dask cluster has its own; leave it out",
            param_hint="--workers",
        )
    from hil.imports.importing import import_recordings

    paths, done = list(maps or ()), 0

    def state(statement: Statement) -> None:
        nonlocal done
        done += 1
        for line in statement.lines():
            say(f"{statement.the_map.path}: {line}")
        status.update(f"{done} of {len(paths)} maps imported")

    def progress(path: Path, rows: int) -> None:
        status.update(f"{done} of {len(paths)} maps imported, reading {path.name}: {rows} rows")

    with _executor(scheduler, workers, len(paths)) as execute, out.status("reading") as status:
        run = import_recordings(paths, output, state, progress, execute)
    say(f"{output}: a run of {run.robot.name}; go on with: hil identify {output}")


def _executor(
    scheduler: str | None, workers: int | None, n_maps: int
) -> AbstractContextManager[Any]:
    """What imports several maps at once; None where one comes after the other."""
    from hil import execution

    if scheduler not in (None, LOCAL):
        return execution.cluster(scheduler)
    most = workers or (os.cpu_count() or 1 if scheduler else 1)
    return execution.local(min(most, n_maps)) if min(most, n_maps) > 1 else nullcontext()


def _draft(recording: Path, output: Path) -> None:
    """Write a first map, which names the recording as it is seen from the map's folder."""
    from checked_files.yaml_file import UNSTATED
    from hil.imports.draft import draft_map
    from hil.runs.atomic_file import write_file

    refuse_no_folder(output)
    name = Path(os.path.relpath(recording.resolve(), output.resolve().parent)).as_posix()
    text = draft_map(recording, name)
    write_file(output, text.encode())
    marks = text.count(f": {UNSTATED} ")
    say(f"{output}: {marks} lines marked {UNSTATED} are yours to fill in")
