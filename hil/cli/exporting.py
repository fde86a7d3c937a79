"""`hil export`: an identified model, or the recordings of a run, as files of other tools."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.cli.arguments import Masses, Without, body_bounds
from hil.cli.outputs import REFUSED, folder_to_write, output_option
from hil.terminal.console import printable, say, working

if TYPE_CHECKING:
    from collections.abc import Iterable

    from hil.export.urdf_file import Given
    from hil.planning.measurement import RecordedMotion
    from hil.results.model import Model
    from hil.runs.recording import Recording

commands = typer.Typer()


@commands.command()
def export(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="MODEL|RUN",
            help="Folder of an identified run, or its model.yaml; of any run for recordings.",
        ),
    ],
    to: Annotated[str, typer.Option(help="Name of the format; an unknown one lists all.")],
    output: Annotated[Path, output_option(folder_to_write, "Folder to write into.")],
    urdf: Annotated[
        Path | None,
        typer.Option(
            help="URDF of the robot, whose shapes and names urdf and mjcf keep, and mcap its names."
        ),
    ] = None,
    masses: Masses = None,
    without: Without = None,
    force: Annotated[
        bool,
        typer.Option("--force", help="Write a model whose identification failed, too."),
    ] = False,
) -> None:
    """Write an identified model, or the recordings of a run, as files of other tools."""
    from hil.export.formats import RECORDINGS, SIMULATORS, refuse_unknown

    refuse_unknown(to)
    if to in RECORDINGS:
        _refuse(to, urdf=None if to == "mcap" else urdf, mass=masses, force=force)
        paths = _recordings_written(source, to, output, urdf, without)
    elif to not in SIMULATORS and (urdf or masses):
        raise typer.BadParameter(
            f"--urdf and --mass are about bodies, which {to} has not; they go with"
            f" {' and '.join(SIMULATORS)}",
            param_hint="--to",
        )
    else:
        _refuse(to, without=without)
        paths = _model_written(source, to, output, urdf, masses, force)
    for path in paths:
        say(f"written: {path}")


def _refuse(to: str, **given: object) -> None:
    """Refuse options that a format has no use for."""
    for name, value in given.items():
        if value:
            raise typer.BadParameter(
                f"{to} has no use for it; leave it out", param_hint=f"--{name}"
            )


def _model_written(
    source: Path, to: str, output: Path, urdf: Path | None, masses: list[str] | None, force: bool
) -> tuple[Path, ...]:
    with working("reading the model") as now:
        from hil.cli.results import show_bodies
        from hil.export.exported import cautions, origin, passed, validations, write_exported
        from hil.export.formats import SIMULATORS, export
        from hil.export.urdf_file import given_urdf
        from hil.results.model import Model

        model = Model.load(source)
        if model.failed and not force:
            text = f"its identification {model.outcome}; --force writes it all the same, with"
            sys.stderr.write(printable(f"{source}: {text} FAILED on top of every file\n"))
            raise typer.Exit(REFUSED)
        now(f"writing the model as {to}")
        given = None if urdf is None else given_urdf(urdf, model.robot)
        if to in SIMULATORS:
            model = _model_with_bodies(model, source, given, masses)
        exported = export(model, to, origin(model, source), given)
        if to in SIMULATORS:
            show_bodies(model)
        paths = write_exported(exported, output)
    for line in cautions(model):
        say(line, style="bold red" if model.failed else "yellow")
    for line in validations(model, source):
        say(line, style=None if passed(model) else "yellow")
    for remark in exported.remarks:
        say(remark)
    return paths


def _recordings_written(
    source: Path, to: str, output: Path, urdf: Path | None, without: list[str] | None
) -> tuple[Path, ...]:
    with working("reading the run") as now:
        from checked_files.yaml_file import FileError
        from hil.export.formats import export_recordings
        from hil.export.urdf_file import given_urdf
        from hil.runs.run import Run

        if source.is_file():
            raise FileError(
                f"{source}: is a file, and {to} holds the recordings of a run; name the folder of"
                " the run"
            )
        run = Run.open(source).without(without or ())
        chain = () if urdf is None else given_urdf(urdf, run.robot).chain.joints
        joints = [joint.name for joint in chain]
        return export_recordings(run, to, output, joints, lambda name: now(f"writing {name}"))


def _model_with_bodies(
    model: Model, source: Path, given: Given | None, masses: list[str] | None
) -> Model:
    """The model with bodies, found now unless the model has them as they are asked for."""
    from hil.estimation.consistent.nearest import SHAPES
    from hil.export.urdf_file import bodies_of
    from hil.results.consistency import with_consistent_robot

    likely = None if given is None else bodies_of(given, model.robot)
    if model.consistent is not None and not masses and likely is None:
        return model
    of = SHAPES if given is None or likely is None else f"the inertials of {given.path}"
    return with_consistent_robot(model, _recordings(source), body_bounds(masses), likely, of)


def _recordings(source: Path) -> Iterable[tuple[RecordedMotion, Recording]]:
    """Recordings of the run in whose folder the model lies; none where that is no run."""
    from hil.results.model_file import file_of
    from hil.runs.pooling import pooled
    from hil.runs.run import Run

    folder = file_of(source).parent
    return pooled([Run.open(folder)]) if (folder / "run.json").exists() else ()
