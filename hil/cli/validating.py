"""`hil validate`: a model judged by a recording that it was not made from."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.cli.arguments import RealTime, RobotsBus, RunPath, expand_records
from hil.cli.measuring import OnBus
from hil.cli.measuring import measure as measure_plan
from hil.cli.outputs import REFUSED, refuse_unwritable, say_judgement, say_simulated
from hil.terminal.console import out, say, working

if TYPE_CHECKING:
    from hil.results.model import Model
    from hil.runs.run import Run

commands = typer.Typer()


@commands.command()
@expand_records
def validate(
    folder: RunPath,
    model_path: Annotated[
        Path,
        typer.Option(
            "--model", help="Model to judge: its file, or the folder of the run that gave it."
        ),
    ],
    measure: Annotated[
        bool,
        typer.Option("--measure", help="Measure another motion into the folder first; it moves."),
    ] = False,
    *,
    where: RobotsBus,
    realtime: RealTime = False,
) -> None:
    """Judge a model by a run that it was not made from; exit status 3 where it failed."""
    with working("reading the model"):
        from hil.results.model import Model
        from hil.results.model_file import file_of
        from hil.results.validation import NAME
        from hil.runs.run import Run

        refuse_unwritable(folder / NAME)
        model_path = file_of(model_path)
        model = Model.load(model_path)
    if measure:
        from hil.model.robot import refuse_unknown
        from hil.planning.design.trajectories import design_validation

        refuse_unknown(model.robot)
        with working("choosing a motion"):
            plan = design_validation(model.robot)
        how = OnBus(**vars(where), realtime=realtime)
        measure_plan(plan, model.robot, folder / "plan.yaml", folder, how)
    _judge(model, model_path, Run.open(folder))


def _judge(model: Model, model_path: Path, run: Run) -> None:
    from hil.report.pictures import Drawn, write_validation_plot
    from hil.results.predicted_torques import predicted_torques
    from hil.results.tables.terminal import show
    from hil.results.validation import of_own_recordings, table, write_validation
    from hil.results.validation import validate as judge
    from hil.runs.pooling import pooled

    _refuse_other_robot(model, run)
    with working("predicting the torques of the recordings"):
        drawn = Drawn(predicted_torques(model, pooled([run])))
        found = of_own_recordings(model, run) or judge(model, drawn)
        file = write_validation(run, model, model_path, found)
    say_simulated(run)
    if found.axes:
        show(table(found, _notes(model, run)), out)
    say_judgement(found)
    if found.axes:
        say(f"plot in {write_validation_plot(run.path, found, drawn.first)}")
    say(f"validation in {file}")
    if found.word == "failed":
        raise typer.Exit(REFUSED)


def _refuse_other_robot(model: Model, run: Run) -> None:
    from hil.errors import Mismatch

    if model.robot.digest != run.robot.digest:
        raise Mismatch(
            f"{run.path}: was recorded with another robot file than the model was made with"
            f" ({run.robot.name} {run.robot.digest[:12]}, {model.robot.name}"
            f" {model.robot.digest[:12]}); import or measure it with the same one"
        )


def _notes(model: Model, run: Run) -> tuple[str, ...]:
    """What restricts the scores."""
    found = []
    if model.provenance.plan_digest == run.plan.digest:
        found.append("the model was made from this very plan: record another motion to judge it")
    return tuple(found)
