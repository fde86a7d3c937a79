"""Command `hil replay`: simulation of recordings with a model, against the recorded motion."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from hil.cli.arguments import ModelPath, RunPath, Without
from hil.cli.outputs import Status, refuse_unwritable, show, write_page
from hil.terminal.console import give, working

if TYPE_CHECKING:
    from hil.model.robot import Robot
    from hil.simulation.replay import Controller

commands = typer.Typer()


Gains = Annotated[
    list[float] | None,
    typer.Option(min=0.0, help="Gain of a PD controller; one for all axes, or one per axis."),
]


@commands.command()
def replay(
    folder: RunPath,
    model_path: ModelPath,
    simulator: Annotated[
        Literal["builtin", "mujoco"],
        typer.Option(
            help="Built-in simulator with exact stick-slip, or MuJoCo (a separate package)."
        ),
    ] = "builtin",
    friction: Annotated[
        Literal["law", "plain", "exported"] | None,
        typer.Option(
            help="Friction: the model's law (law), only its offset, Coulomb and viscous terms"
            " (plain), or as exported (exported; always with mujoco)."
        ),
    ] = None,
    max_error: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LIMIT",
            help="Largest position error allowed, such as 2deg or 5mm; may be repeated.",
        ),
    ] = None,
    restart: Annotated[
        float | None,
        typer.Option(
            min=0.05, help="Time after which a simulation restarts from the recording \\[s]."
        ),
    ] = None,
    kp: Gains = None,
    kd: Gains = None,
    before: Annotated[
        Path | None,
        typer.Option(help="URDF or MJCF of the robot: its own values are simulated as well."),
    ] = None,
    without: Without = None,
) -> None:
    """Simulate the recordings of a run with a model, and compute the position error.

    Drives repeat the recorded torques; with --kp and --kd they hold the recorded positions.
    Exit status 3 where an error passes its limit.
    """
    with working("reading the model") as now:
        from hil.commands import replay as command
        from hil.results.model import loaded
        from hil.runs.run import Run
        from hil.simulation import replay as simulated

        refuse_unwritable(folder / command.PAGE)
        limits = simulated.limits(max_error or ())
        run = Run.open(folder).exclude(without or ())
        model = loaded(model_path, run.robot)
        models = [model]
        if before is not None:
            from hil.export.patch import patched_file, stated_model

            models.append(stated_model(model, patched_file(before, run.robot)))
        found, *others = (
            simulated.replay(
                run,
                each,
                simulator=simulator,
                friction=friction,
                controller=_controller(run.robot, kp, kd),
                restart=restart,
                progress=lambda name: now(f"simulating {name}"),
            )
            for each in models
        )
        outcome = command.replay(run, found, limits, *others)
    show(outcome)
    give(rms=found.rms.tolist(), largest=found.largest.tolist())
    if others:
        give(before=others[0].rms.tolist())
    write_page(folder / command.PAGE, outcome)
    if any(each.kind == "failed" for each in outcome.verdicts):
        raise typer.Exit(Status.REFUSED)


def _controller(robot: Robot, kp: list[float] | None, kd: list[float] | None) -> Controller | None:
    """Create the PD controller from the options, None without gains."""
    import numpy as np

    from hil.simulation.replay import Controller

    if not kp and not kd:
        return None
    gains = []
    for name, given in (("kp", kp), ("kd", kd)):
        if not given or len(given) not in (1, robot.n_joints):
            raise typer.BadParameter(
                f"{len(given or ())} values; a controller needs --kp and --kd, once or "
                f"{robot.n_joints} times each",
                param_hint=f"--{name}",
            )
        gains.append(np.broadcast_to(np.array(given), robot.n_joints).copy())
    return Controller(*gains)
