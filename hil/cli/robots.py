"""Commands `hil robot` and `hil twin`: identifiable parameters, draft of a file, virtual plant."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Annotated

import typer

from checked_files.errors import HilError
from hil.cli.arguments import RobotName, group_of
from hil.cli.outputs import folder_to_write, new_file, output_option
from hil.terminal.console import say, working

commands = typer.Typer()
robot_commands = typer.Typer(
    cls=group_of("show"),
    help="Show what can be identified of a robot, or write a first robot file.",
    no_args_is_help=True,
)
commands.add_typer(robot_commands, name="robot")


@robot_commands.command()
def show(name: RobotName) -> None:
    """Show base parameters and where they occur in M and g; the default command."""
    with working("reading the robot") as now:
        from hil.cli import plan_view
        from hil.model.base_parameters import base_parameters
        from hil.model.robot import Robot

        robot = Robot.load(name)
        now(f"finding the base parameters of {robot.n_joints} joints")
        base_parameters(robot)
    plan_view.render_robot(robot)


@robot_commands.command()
def new(
    output: Annotated[Path, output_option(new_file, "Robot file to write.")],
    urdf: Annotated[
        Path | None, typer.Option("--urdf", help="URDF or MJCF; expand a xacro file first.")
    ] = None,
    dh: Annotated[
        Path | None,
        typer.Option("--dh", help="Table of standard Denavit-Hartenberg parameters; CSV or YAML."),
    ] = None,
    mdh: Annotated[
        Path | None,
        typer.Option("--mdh", help="Table of modified Denavit-Hartenberg parameters; CSV or YAML."),
    ] = None,
    base: Annotated[
        str | None, typer.Option("--from", help="Base link; the root by default.")
    ] = None,
    tip: Annotated[
        str | None,
        typer.Option(
            "--to",
            help="Last link, or several separated by commas; by default that of the"
            " longest chain, or all of a tree.",
        ),
    ] = None,
    gravity: Annotated[
        tuple[float, float, float] | None,
        typer.Option(
            metavar="X Y Z",
            help="Gravity in the base link, or frame 0 \\[m/s2].",
            show_default="9.81 along -z of the URDF's root, or of frame 0",
        ),
    ] = None,
) -> None:
    """Write a first robot file from a URDF, an MJCF or a table, and list what to fill in."""
    from checked_files.yaml_file import UNSTATED
    from hil.model.readers.robot_draft import draft_robot
    from hil.runs.atomic_file import write_file

    if sum(given is not None for given in (urdf, dh, mdh)) != 1:
        raise typer.BadParameter("give one of --urdf, --dh and --mdh")
    if urdf is None and (base or tip):
        raise typer.BadParameter("--from and --to apply only to a URDF; omit both")
    if urdf is not None:
        from hil.model.robot import read_description

        chain = read_description(urdf, base, tip)
        joints = ", ".join(joint.name for joint in chain.joints)
        about = f"{len(chain.joints)} joints from {chain.base} to {chain.tip}: {joints}"
        found, rounded = "\n".join([about, *chain.not_taken]), chain.rounded
        text = draft_robot(chain, gravity)
    else:
        from hil.model.readers.dh_table import read_dh

        dh_table = read_dh(dh, "standard") if dh is not None else read_dh(str(mdh), "modified")
        types = ", ".join(f"{joint.name} {joint.type}" for joint in dh_table.joints)
        found = f"{len(dh_table.joints)} joints of a {dh_table.notation} table: {types}"
        text, rounded = draft_robot(dh_table, gravity), dh_table.rounded
    write_file(output, text.encode())
    say(found)
    if rounded > 0:
        say(f"angles within {rounded:.2g} rad of a multiple of pi/2 were rounded to that multiple")
    marks = text.count(f": {UNSTATED} ")
    say(f"{output}: {marks} lines marked {UNSTATED} must be filled in by you")


@commands.command()
def twin(
    name: RobotName,
    output: Annotated[Path, output_option(folder_to_write, "Folder to write both files into.")],
) -> None:
    """Write a virtual plant of a robot and a drives file, for rehearsals."""
    # the plant runs as a separate program: its arm model must stay independent of the tested model
    with working("scaling a plant to the limits of the robot"):
        from hil.model.robot import Robot

        robot = Robot.load(name).source
        made = subprocess.run(  # noqa: S603 - our own program, by its own name
            [sys.executable, "-m", "sim_plant", "twin", robot, "--output", str(output)],
            capture_output=True,
            text=True,
            check=False,
        )
    if made.returncode:
        raise HilError(made.stderr.strip().removeprefix("sim_plant: "))
    say(made.stdout.rstrip())
