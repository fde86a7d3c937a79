"""Recordings that somebody else made, into a run folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.cli.arguments import refuse_existing
from hil.terminal.console import out, say

if TYPE_CHECKING:
    from hil.imports.statement import Statement

commands = typer.Typer()


@commands.command("import")
def import_(
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Run folder to make, or map with --draft.")
    ],
    maps: Annotated[
        list[Path] | None, typer.Argument(help="Maps that state which column is what.")
    ] = None,
    draft: Annotated[
        Path | None,
        typer.Option("--draft", help="File of a recording for which a first map is written."),
    ] = None,
) -> None:
    """Turn recordings of any robot into a run folder; a map states which column is what."""
    if (draft is None) == (not maps):
        raise typer.BadParameter("give maps, or a recording with --draft: one of the two")
    if draft is not None:
        _draft(draft, output)
        return
    from hil.imports.importing import import_recordings

    with out.status("reading") as status:
        run = import_recordings(
            maps or (),
            output,
            _state,
            lambda path, rows: status.update(f"reading {path.name}: {rows} rows"),
        )
    say(f"{output}: a run of {run.robot.name}; go on with: hil identify {output}")


def _state(statement: Statement) -> None:
    for line in statement.lines():
        say(f"{statement.the_map.path}: {line}")


def _draft(recording: Path, output: Path) -> None:
    """Write a first map, which names the recording as it is seen from the map's folder."""
    import os

    from checked_files.yaml_file import UNSTATED
    from hil.imports.draft import draft_map
    from hil.runs.atomic_file import write_file

    refuse_existing(output)
    name = Path(os.path.relpath(recording.resolve(), output.resolve().parent)).as_posix()
    text = draft_map(recording, name)
    write_file(output, text.encode())
    marks = text.count(f": {UNSTATED} ")
    say(f"{output}: {marks} lines marked {UNSTATED} are yours to fill in")
