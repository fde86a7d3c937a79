"""A robot: what can be identified of it, and a first file of it from a URDF or a table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hil.cli.arguments import RobotName, group_of
from hil.cli.outputs import new_file, output_option
from hil.terminal.console import out, say, working

commands = typer.Typer()
robot_commands = typer.Typer(
    cls=group_of("show"),
    help="Show base parameters, their groups, and where they occur in M and g.",
    no_args_is_help=True,
)
commands.add_typer(robot_commands, name="robot")


@robot_commands.command()
def show(name: RobotName) -> None:
    """Show base parameters; `hil robot NAME` does so too."""
    with working("reading the robot") as now:
        from hil.cli import plan_view
        from hil.model.base_parameters import base_parameters
        from hil.model.robot import load_robot

        robot = load_robot(name)
        now(f"finding what can be identified of {robot.n_joints} joints")
        base_parameters(robot)
    plan_view.render_robot(robot, out)


@robot_commands.command()
def new(
    output: Annotated[Path, output_option(new_file, "Robot file to write.")],
    urdf: Annotated[
        Path | None, typer.Option("--urdf", help="URDF file; expand a xacro file first.")
    ] = None,
    dh: Annotated[
        Path | None,
        typer.Option("--dh", help="Table of standard Denavit-Hartenberg parameters, CSV or YAML."),
    ] = None,
    mdh: Annotated[
        Path | None,
        typer.Option("--mdh", help="Table of modified Denavit-Hartenberg parameters, CSV or YAML."),
    ] = None,
    base: Annotated[
        str | None,
        typer.Option("--from", help="Link of the URDF that stands still; by default the root."),
    ] = None,
    tip: Annotated[
        str | None,
        typer.Option(
            "--to", help="Link of the URDF at the end; by default that of the longest chain."
        ),
    ] = None,
    gravity: Annotated[
        tuple[float, float, float],
        typer.Option(help="Gravity in the link, or frame 0, that stands still \\[m/s2]."),
    ] = (0.0, 0.0, -9.81),
) -> None:
    """Write a first robot file from a URDF or a table, and list what is to be stated in it."""
    from checked_files.yaml_file import UNSTATED
    from hil.runs.atomic_file import write_file

    if sum(given is not None for given in (urdf, dh, mdh)) != 1:
        raise typer.BadParameter("give one of --urdf, --dh and --mdh")
    if urdf is None and (base or tip):
        raise typer.BadParameter("--from and --to name links of a URDF; leave them out")
    if urdf is not None:
        text, found, rounded = _from_urdf(urdf, base, tip, gravity)
    else:
        text, found, rounded = _from_table(dh, mdh, gravity)
    write_file(output, text.encode())
    say(found)
    if rounded > 0:
        say(f"angles within {rounded:.2g} rad of quarter turns were taken for these")
    marks = text.count(f": {UNSTATED} ")
    say(f"{output}: {marks} lines marked {UNSTATED} are yours to fill in")


def _from_urdf(
    urdf: Path, base: str | None, tip: str | None, gravity: tuple[float, float, float]
) -> tuple[str, str, float]:
    """Text of a robot file, what it is of, and how far angles were rounded [rad]."""
    from hil.model.readers.robot_draft import draft_robot
    from hil.model.readers.urdf import read_urdf

    chain = read_urdf(urdf, base, tip)
    joints = ", ".join(joint.name for joint in chain.joints)
    found = f"{len(chain.joints)} joints from {chain.base} to {chain.tip}: {joints}"
    return draft_robot(chain, gravity), found, chain.rounded


def _from_table(
    dh: Path | None, mdh: Path | None, gravity: tuple[float, float, float]
) -> tuple[str, str, float]:
    """The same of a table."""
    from hil.model.readers.dh_table import read_dh
    from hil.model.readers.robot_draft import draft_robot

    table = read_dh(dh, "standard") if dh is not None else read_dh(str(mdh), "modified")
    types = ", ".join(f"{joint.name} {joint.type}" for joint in table.joints)
    found = f"{len(table.joints)} joints of a {table.notation} table: {types}"
    return draft_robot(table, gravity), found, table.rounded
