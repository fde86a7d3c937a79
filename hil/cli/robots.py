"""A robot: what can be identified of it, and a first file of it from a URDF."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from hil.cli.arguments import RobotName, refuse_existing
from hil.terminal.console import out, say


class _ShowsByDefault(TyperGroup):
    """Takes what is no command of its own for the robot that `show` is to show."""

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """Return name, command and arguments."""
        if args and args[0] not in self.commands:
            args = ["show", *args]
        return super().resolve_command(ctx, args)


commands = typer.Typer()
robot_commands = typer.Typer(
    cls=_ShowsByDefault,
    help="Show base parameters, their groups, and where they occur in M and g.",
    no_args_is_help=True,
)
commands.add_typer(robot_commands, name="robot")


@robot_commands.command()
def show(name: RobotName) -> None:
    """Show base parameters; `hil robot NAME` does so too."""
    from hil.cli import robot_view
    from hil.model.robot import load_robot

    robot_view.render(load_robot(name), out)


@robot_commands.command()
def new(
    urdf: Annotated[Path, typer.Option("--urdf", help="URDF file; expand a xacro file first.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Robot file to write.")],
    base: Annotated[
        str | None, typer.Option("--from", help="Link that stands still; by default the root.")
    ] = None,
    tip: Annotated[
        str | None,
        typer.Option("--to", help="Link at the end; by default that of the longest chain."),
    ] = None,
    gravity: Annotated[
        tuple[float, float, float],
        typer.Option(help="Gravity in the link that stands still \\[m/s2]."),
    ] = (0.0, 0.0, -9.81),
) -> None:
    """Write a first robot file from a URDF, and list what is to be stated in it."""
    from checked_files.yaml_file import UNSTATED
    from hil.model.robot_draft import draft_robot
    from hil.model.urdf import read_urdf
    from hil.runs.atomic_file import write_file

    refuse_existing(output)
    chain = read_urdf(urdf, base, tip)
    text = draft_robot(chain, gravity)
    write_file(output, text.encode())
    joints = ", ".join(joint.name for joint in chain.joints)
    say(f"{len(chain.joints)} joints from {chain.base} to {chain.tip}: {joints}")
    if chain.rounded > 0:
        say(f"angles within {chain.rounded:.2g} rad of quarter turns were taken for these")
    marks = text.count(f": {UNSTATED} ")
    say(f"{output}: {marks} lines marked {UNSTATED} are yours to fill in")
