"""`hil export`: an identified model as files of other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hil.terminal.console import say

commands = typer.Typer()


@commands.command()
def export(
    source: Annotated[
        Path,
        typer.Argument(metavar="MODEL", help="Folder of an identified run, or its model.yaml."),
    ],
    to: Annotated[str, typer.Option(help="Name of the format; an unknown one lists all.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder to write into.")],
) -> None:
    """Write an identified model as files of other tools."""
    from hil.export.exported import write_exported
    from hil.export.formats import export
    from hil.export.origin import origin, passed, validations
    from hil.results.model import Model

    model = Model.load(source)
    exported = export(model, to, origin(model, source))
    paths = write_exported(exported, output)
    for line in validations(model, source):
        say(line, style=None if passed(model) else "yellow")
    for remark in exported.remarks:
        say(remark)
    for path in paths:
        say(f"written: {path}")
