"""Command `hil payload`: a load from two whole runs, or from a short measurement."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from hil.cli.arguments import ModelPath, RobotsBus, expand_records, group_of, runs
from hil.cli.outputs import (
    folder_to_write,
    output_option,
    refuse_unwritable,
    show,
    show_causes,
    write_page,
)
from hil.cli.planning import poses
from hil.terminal.console import say, working

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.estimation.loads.figures import Load
    from hil.results.load_file import LoadFile
    from hil.runs.run import Run

TWO_RUNS = "two-runs"
LEAST_MINUTES = 1.0
"""Shortest measurement [min]: the first slow stroke of the built-in robot takes 0.6 to 0.75 min."""
SLOW, FAST = "slow", "fast"
"""Folders of the two stages, within the folder of the measurement."""


payload = typer.Typer(
    cls=group_of(TWO_RUNS),
    help="Identify a load from runs without and with it, or measure one in minutes.",
    no_args_is_help=True,
)
commands = typer.Typer()
commands.add_typer(payload, name="payload")


@payload.command(TWO_RUNS)
def two_runs(
    without: Annotated[
        Path, Argument(metavar="RUN", help="Run without the load.", autocompletion=runs)
    ],
    loaded: Annotated[
        Path, Argument(metavar="LOADED", help="Run with the load.", autocompletion=runs)
    ],
    mass: Annotated[
        float | None,
        Option(
            min=1e-3,
            help="Known mass of the load \\[kg]; corrects the torque constants of runs measured by"
            " strokes.",
        ),
    ] = None,
    gains: Annotated[
        bool,
        Option(
            "--gains",
            help="Estimate the torque gains of all axes of imported runs, too; needs --mass.",
        ),
    ] = False,
) -> None:
    """Identify a load from a run without and a run with it; the default command.

    The command writes load.yaml into the folder of the second run.
    """
    if gains and mass is None:
        raise typer.BadParameter(
            "needs --mass, from which gains are estimated", param_hint="--gains"
        )
    with working("reading the runs") as now:
        from hil.commands.payload import verdict
        from hil.results import load_file
        from hil.results.problem import regression
        from hil.runs.run import Run

        path = loaded / load_file.NAME
        refuse_unwritable(path)
        runs = Run.open(without), Run.open(loaded)
        now("estimating both runs and the load")
        found = regression(runs[0], loaded=runs[1:], mass=mass, gains=gains).fit()
        kept = load_file.write_load(loaded, runs[0], runs[1:], found, verdict(found.load))
    _finish(loaded, runs[0], runs[1:], found.load, kept)
    say(f"load in {path}; hil report {loaded} shows it with the robot's parameters")


@payload.command()
@expand_records
def measure(
    model: ModelPath,
    output: Annotated[
        Path, output_option(folder_to_write, "Folder to write the measurement into.")
    ],
    minutes: Annotated[
        float,
        Option(min=LEAST_MINUTES, max=3, help="Duration of motion, including travel \\[min]."),
    ] = 3.0,
    mass: Annotated[float | None, Option(min=1e-3, help="Known mass of the load \\[kg].")] = None,
    at_most: Annotated[
        float | None,
        Option(min=1e-3, help="Maximum payload mass that the axes must hold in all poses \\[kg]."),
    ] = None,
    pose: Annotated[
        list[str] | None,
        Option(
            help="Axis and its position in all measurements, such as axis5=90 \\[deg; m]; may be"
            " repeated."
        ),
    ] = None,
    *,
    where: RobotsBus,
    resume: Annotated[
        bool, Option("--resume", help="Continue a measurement that was stopped.")
    ] = False,
) -> None:
    """Measure a load, slowly and then faster; the robot moves."""
    from checked_files.yaml_file import FileError
    from hil.cli.measuring import OnBus
    from hil.cli.measuring import measure as measured
    from hil.commands.payload import advised, verdict
    from hil.errors import Mismatch
    from hil.planning.timetable import timetable
    from hil.results.load import BareRun, LoadFit, find_load
    from hil.results.load_file import NAME, write_load
    from hil.runs.run import Run
    from hil.show.rounding import clock, count
    from hil.tasks.plans import designed

    if mass is not None and at_most is not None and mass > at_most:
        raise typer.BadParameter(
            f"{mass:g} kg must be at most the {at_most:g} kg of --at-most", param_hint="--mass"
        )
    bare_run = Run.open(model if model.is_dir() else model.parent)
    if output.resolve() == bare_run.path.resolve():
        raise Mismatch(
            f"{output}: is the run without the load; name another folder for the run with the "
            "load: -o"
        )
    if (output / "run.json").exists():
        raise FileError(f"{output}: holds another run; choose another folder with -o")
    if (output / SLOW).exists() and not resume:
        raise FileError(
            f"{output}: already holds a load measurement; finish it with --resume, or choose "
            "another folder with -o"
        )
    bare, how = BareRun(bare_run), OnBus(**vars(where))
    kind = {"model": bare, "minutes": minutes, "pose": poses(bare_run.robot, pose or [])}
    heaviest = at_most if mass is None else mass
    for stage, more in ((SLOW, {"at_most": heaviest}), (FAST, {"refine": [output / SLOW]})):
        folder = output / stage
        begun = (folder / "run.json").exists()
        if begun:
            earlier = Run.open(folder)
            if earlier.robot.digest != bare_run.robot.digest:
                raise Mismatch(
                    f"{folder}: was measured with another robot file than {bare_run.path}; choose "
                    "another folder with -o"
                )
            plan = earlier.planned
        else:
            with working(f"planning {stage} measurements") as now:
                found = designed("load", now, **kind, **more)
            plan = found.plan
            entries = timetable(plan, bare_run.robot, plan.measurements)
            lasts = clock(sum(each.travel + each.duration for each in entries))
            say(f"{stage}: {count(len(entries), 'measurement')} in {lasts} min of motion")
            show(*found.shown)
        again = resume and begun
        measured(plan, bare_run.robot, folder / "plan.yaml", folder, how, again)
    runs = [Run.open(output / stage_of) for stage_of in (SLOW, FAST)]
    with working("estimating the load"):
        load = find_load(bare, runs, mass)
        said = verdict(load, advised(bare.known, [run.planned for run in runs], load))
        kept = write_load(output, bare_run, runs, LoadFit(bare_run.robot, load), said)
    _finish(output, bare_run, runs, load, kept)
    say(f"load in {output / NAME}")


def _finish(folder: Path, bare: Run, loaded: Sequence[Run], found: Load, kept: LoadFile) -> None:
    """Show a load, the causes of a non-rigid load, and write the page."""
    from hil.commands.payload import PAGE, outcome
    from hil.estimation.loads.figures import LOOSE

    load = outcome(bare, loaded, found, kept)
    show(load)
    if found.is_loose or kept.p_value <= LOOSE:
        show_causes(bare.path, *loaded, known=("load",))
    write_page(folder / PAGE, load)
