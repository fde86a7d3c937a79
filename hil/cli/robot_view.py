"""What a robot file comes to, on the terminal: Table 1, eq. (22) by group, and Table 2."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from rich.table import Table

from hil.model.base_parameters import base_parameters
from hil.model.dependencies import DIAGONAL, GRAVITY, OFF_DIAGONAL
from hil.results.rounding import unit

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from rich.console import Console

    from hil.model.base_parameters import BaseParameters
    from hil.model.robot import Robot

WIDEST = 12
"""Joints up to which the table of M and g can be read on a terminal."""
_GROUP_TITLES = {
    GRAVITY: "gravity: in g(q)",
    DIAGONAL: "diagonal: on the diagonal of M(q), not in g(q)",
    OFF_DIAGONAL: "off-diagonal: beside the diagonal of M(q) only",
}


def render(robot: Robot, console: Console) -> None:
    """Print present parameters, base parameters by group, and where each occurs."""
    base = base_parameters(robot)
    console.print(_present_parameters(robot))
    console.print(_base_parameters(robot, base))
    if robot.n_joints <= WIDEST:
        console.print(_dependencies(robot, base))
    else:
        console.print(
            f"which parameter occurs in which element is a table of {robot.n_joints} columns, which"
            f" is shown up to {WIDEST}; in Python: base_parameters(robot).dependencies",
            highlight=False, soft_wrap=True,
        )  # fmt: skip


def _present_parameters(robot: Robot) -> Table:
    table = Table("link", "joint", title=f"{robot.name}: link parameters present")
    table.add_column("parameters", overflow="fold")
    for link, joint in enumerate(robot.file.joints, start=1):
        names = (f"{name}{link}" for name in joint.parameters)
        listed = (f"{n} = {robot.ties[n]}" if n in robot.ties else n for n in names)
        table.add_row(str(link), joint.type, ", ".join(listed) or "none")
    return table


def _base_parameters(robot: Robot, base: BaseParameters) -> Table:
    lengths = ", ".join(f"{name} = {value:g} m" for name, value in robot.file.lengths.items())
    table = Table("", title=f"{len(base)} base parameters", caption=lengths or None)
    table.add_column("expression", overflow="fold")
    table.add_column("unit", no_wrap=True)
    for group, members in base.groups.items():
        table.add_section()
        table.add_row("", f"[bold]{_GROUP_TITLES[group]}[/bold]", "")
        for k in members:
            table.add_row(base.names[k], base.expressions[k], unit(base.units[k]))
    return table


def _dependencies(robot: Robot, base: BaseParameters) -> Table:
    """Rows of M, upper triangle as it is symmetric, and g, with the numbers that occur in them."""
    joints = range(robot.n_joints)
    table = Table(title="parameters p_k that occur in M_ij(q) and g_i(q), by k", show_lines=True)
    for heading in ("", *(f"M_i{j + 1}" for j in joints), "g_i"):
        table.add_column(heading, overflow="fold")
    for i in joints:
        cells = [_numbers(base.dependencies.mass[i, j]) if j >= i else "" for j in joints]
        table.add_row(f"i = {i + 1}", *cells, _numbers(base.dependencies.gravity[i]))
    return table


def _numbers(occurs: NDArray[np.bool_]) -> str:
    """Numbers from 1 of what occurs, three or more in a row as a range: ``1-4, 7``."""
    found = np.flatnonzero(occurs) + 1
    runs = np.split(found, np.flatnonzero(np.diff(found) > 1) + 1) if found.size else []
    parts = [f"{run[0]}-{run[-1]}" if run.size > 2 else ", ".join(map(str, run)) for run in runs]
    return ", ".join(parts) or "0"
