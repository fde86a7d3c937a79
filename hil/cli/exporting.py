"""`hil export`: an identified model as files of other tools."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.cli.arguments import Masses
from hil.cli.outputs import folder_to_write
from hil.terminal.console import say
from hil.terminal.working import working

if TYPE_CHECKING:
    from collections.abc import Iterable

    from hil.export.exported import Exported
    from hil.planning.measurement import RecordedMotion
    from hil.results.model import Model
    from hil.runs.recording import Recording

commands = typer.Typer()


@commands.command()
def export(
    source: Annotated[
        Path,
        typer.Argument(metavar="MODEL", help="Folder of an identified run, or its model.yaml."),
    ],
    to: Annotated[str, typer.Option(help="Name of the format; an unknown one lists all.")],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", callback=folder_to_write, help="Folder to write into."),
    ],
    urdf: Annotated[
        Path | None,
        typer.Option(help="URDF of the robot, whose shapes and names urdf and mjcf keep."),
    ] = None,
    masses: Masses = None,
) -> None:
    """Write an identified model as files of other tools."""
    with working("reading the model") as now:
        from hil.export.exported import write_exported
        from hil.export.formats import export, refuse_unknown
        from hil.export.origin import origin, passed, validations
        from hil.export.simulators import SIMULATORS
        from hil.results.model import Model

        refuse_unknown(to)
        if to not in SIMULATORS and (urdf or masses):
            raise typer.BadParameter(
                f"--urdf and --mass are about bodies, which {to} has not; they go with"
                f" {' and '.join(SIMULATORS)}",
                param_hint="--to",
            )
        model = Model.load(source)
        now(f"writing the model as {to}")
        if to in SIMULATORS:
            exported = _bodies(model, source, to, urdf, masses)
        else:
            exported = export(model, to, origin(model, source))
        paths = write_exported(exported, output)
    for line in validations(model, source):
        say(line, style=None if passed(model) else "yellow")
    for remark in exported.remarks:
        say(remark)
    for path in paths:
        say(f"written: {path}")


def _bodies(
    model: Model, source: Path, to: str, urdf: Path | None, masses: list[str] | None
) -> Exported:
    """The model with bodies, found now unless the model has them as they are asked for."""
    from hil.cli.consistent_view import body_bounds, render
    from hil.export.given_urdf import bodies_of, given_urdf
    from hil.export.origin import origin
    from hil.export.simulators import export_to_simulator
    from hil.results.consistency import SHAPES, with_consistent_robot

    given = None if urdf is None else given_urdf(urdf, model.robot)
    likely = None if given is None else bodies_of(given, model.robot)
    if model.consistent is None or masses or likely is not None:
        model = with_consistent_robot(
            model,
            _recordings(source),
            body_bounds(masses),
            likely,
            SHAPES if likely is None else f"the inertials of {urdf}",
        )
    exported = export_to_simulator(model, to, origin(model, source), given)
    render(model)
    return exported


def _recordings(source: Path) -> Iterable[tuple[RecordedMotion, Recording]]:
    """Recordings of the run in whose folder the model lies; none where that is no run."""
    from hil.results.model_file import file_of
    from hil.runs.pooling import pooled
    from hil.runs.run import Run

    folder = file_of(source).parent
    return pooled([Run.open(folder)]) if (folder / "run.json").exists() else ()
