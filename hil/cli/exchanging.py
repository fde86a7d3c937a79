"""Commands `hil import` and `hil export`: exchange with other tools."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from checked_files.foreign_text import shown
from hil.cli.arguments import (
    Masses,
    Scheduler,
    Without,
    Workers,
    body_bounds,
    executor,
    files,
    formats,
    parse_pairs,
    robots,
    runs,
)
from hil.cli.outputs import Status, folder_to_write, new_folder, output_option, refuse_no_folder
from hil.terminal.console import out, say, working

if TYPE_CHECKING:
    from hil.imports.statement import Statement


commands = typer.Typer()


@commands.command("import")
def import_(
    output: Annotated[Path, output_option(new_folder, "Run folder to write, or map with --draft.")],
    maps: Annotated[
        list[Path] | None,
        Argument(
            metavar="MAP",
            help="Maps: files that state what each column holds.",
            autocompletion=files,
        ),
    ] = None,
    draft: Annotated[
        Path | None, Option("--draft", help="Recording to draft a first map from.")
    ] = None,
    robot: Annotated[
        str | None,
        Option(
            help="Robot file, URDF, or name of a robot, for --draft; or robot of a map, "
            "{urdf: FILE, to: LINK}.",
            autocompletion=robots,
        ),
    ] = None,
    layout: Annotated[
        list[str] | None,
        Option(
            "--format",
            metavar="KEY=VALUE",
            help="Layout of the recording for --draft, such as topic=/joint_states or skip=3; may"
            " be repeated.",
        ),
    ] = None,
    allowed: Annotated[
        list[Path] | None,
        Option(
            "--files",
            help="File or folder outside of a map's folder that the maps may read; repeatable.",
        ),
    ] = None,
    explain: Annotated[
        bool,
        Option(
            "--explain",
            help="Print the interpretation of each joint, and the results of all checks.",
        ),
    ] = False,
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Import recordings of any robot into a run folder."""
    if (draft is None) == (not maps):
        raise typer.BadParameter("give either maps, or a recording with --draft")
    if draft is not None:
        _draft(draft, output, robot, layout)
        return
    if robot is not None or layout:
        raise typer.BadParameter(
            "maps name their robot and format; omit --robot and --format, or draft a map by --draft"
        )
    from hil.imports.importing import import_recordings

    paths, done = list(maps or ()), 0

    def state(statement: Statement) -> None:
        nonlocal done
        done += 1
        explained = statement.explanation if explain else ()
        for line in (*statement.lines(), *explained):
            say(f"{statement.the_map.path}: {line}")
        status.update(f"{done} of {len(paths)} maps imported")

    def progress(path: Path, rows: int) -> None:
        status.update(f"{done} of {len(paths)} maps imported, reading {path.name}: {rows} rows")

    most = len(paths) if workers or scheduler else 1
    with executor(workers, scheduler, most) as execute, out.status("reading") as status:
        run = import_recordings(paths, output, state, progress, execute, allowed or ())
    say(f"{output}: a run of {run.robot.name}; continue with: hil identify {output}")


def _relative(path: Path, output: Path) -> str:
    """Return a path relative to the folder of `output`."""
    return Path(os.path.relpath(path.resolve(), output.resolve().parent)).as_posix()


def _draft(recording: Path, output: Path, robot: str | None, layout: list[str] | None) -> None:
    """Write a first map, with the paths of recording and robot relative to the map."""
    from pydantic import ValidationError

    from checked_files.yaml_file import UNSTATED, parse_yaml, problems
    from hil.imports.draft import draft_map
    from hil.imports.map_file import Format, MappedRobot
    from hil.model.robot import Robot
    from hil.runs.atomic_file import write_file

    refuse_no_folder(output)
    paths, chain = {recording: _relative(recording, output)}, MappedRobot(name=robot or "")
    if robot and robot.startswith("{"):
        chain = parse_yaml(robot, MappedRobot, "--robot")
    source = Path(chain.urdf or chain.name or "")
    if source.is_file():
        paths[source] = _relative(source, output)
    try:
        stated = Format.model_validate(parse_pairs(layout))
    except ValidationError as error:
        raise typer.BadParameter("; ".join(problems(error)), param_hint="--format") from error
    known = None
    if robot:
        known = Robot.load(chain.urdf or robot, chain.base, chain.tip, chain.gravity)
    chain = chain.renamed(paths.get(source, str(chain.name)))
    text = draft_map(recording, paths[recording], known, chain, stated)
    write_file(output, text.encode())
    outside = {p.resolve().parent for p, name in paths.items() if name.startswith("..")}
    options = "".join(f" --files {folder}" for folder in sorted(outside))
    following = f"hil import {output}{options} -o RUN"
    if marks := text.count(f": {UNSTATED} "):
        say(f"{output}: {marks} lines marked {UNSTATED} must be filled in by you")
    else:
        say(f"{output}: complete; continue with: {following}")
    if outside and marks:
        say(f"{output}: names files outside of its folder; import with: {following}")


@commands.command()
def export(
    source: Annotated[
        Path,
        Argument(
            metavar="MODEL|RUN",
            help="Identified run, or model file; any run for its recordings.",
            autocompletion=runs,
        ),
    ],
    to: Annotated[
        str,
        Option(
            help="Format, such as c, python, st, urdf, csv; an unknown name lists all.",
            autocompletion=formats,
        ),
    ],
    output: Annotated[Path, output_option(folder_to_write, "Folder to write into.")],
    urdf: Annotated[
        Path | None,
        Option(help="URDF for shapes and names (formats urdf, mjcf) or names only (mcap)."),
    ] = None,
    patch: Annotated[
        Path | None,
        Option(
            help="Your URDF or MJCF; the output has a copy with the model's values.",
            autocompletion=files,
        ),
    ] = None,
    masses: Masses = None,
    watch: Annotated[
        Path | None,
        Option(
            help="Folder of a watch: also write its alarms and thresholds (c, python, st, json).",
            autocompletion=files,
        ),
    ] = None,
    without: Without = None,
    force: Annotated[
        bool, Option("--force", help="Export the model of a failed identification, too.")
    ] = False,
) -> None:
    """Export an identified model, or the recordings of a run, to other tools."""
    from checked_files.yaml_file import FileError
    from hil.export.formats import RECORDINGS, SIMULATORS, refuse_unknown

    refuse_unknown(to)
    if to in RECORDINGS:
        stated = None if to == "mcap" else urdf
        _refuse(to, urdf=stated, patch=patch, mass=masses, force=force, watch=watch)
        if source.is_file():
            raise FileError(
                f"{source}: is a file, but format {to} holds the recordings of a run; name the"
                " folder of the run"
            )
        with working("reading the run") as now:
            from hil.runs.run import Run
            from hil.tasks.exporting import exported_recordings

            run = Run.open(source).exclude(without or ())
            paths = exported_recordings(run, to, output, urdf, lambda name: now(f"writing {name}"))
    elif to not in SIMULATORS and (urdf or patch or masses):
        raise typer.BadParameter(
            f"--urdf, --patch and --mass are for formats with rigid bodies, not for {to}; use "
            f"them with {' and '.join(SIMULATORS)}",
            param_hint="--to",
        )
    else:
        _refuse(to, without=without)
        with working("reading the model") as now:
            from hil.cli.results import show_bodies
            from hil.export.exported import cautions, passed, validations, write_exported
            from hil.results.model import Model
            from hil.tasks.exporting import exported_model

            model = Model.load(source)
            if model.failed and not force:
                text = f"the model's identification {model.verdict}; --force exports it with"
                sys.stderr.write(shown(f"{source}: {text} FAILED on top of every file\n"))
                raise typer.Exit(Status.REFUSED)
            now(f"writing the model as {to}")
            bounds = body_bounds(masses) if masses else None
            model, exported = exported_model(model, to, source, urdf, bounds, patch, watch)
            if to in SIMULATORS:
                show_bodies(model)
            paths = write_exported(exported, output)
        for line in cautions(model):
            say(line, style="bold red" if model.failed else "yellow")
        for line in validations(model, source):
            say(line, style=None if passed(model) else "yellow")
        for remark in exported.remarks:
            say(remark)
    for path in paths:
        say(f"written: {path}")


def _refuse(to: str, **given: object) -> None:
    """Refuse options without effect on a format."""
    for name, value in given.items():
        if value:
            raise typer.BadParameter(
                f"not applicable to {to}; omit the option", param_hint=f"--{name}"
            )
