"""A robot's base parameters on the terminal: eq. (22), its groups and Table 2."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from rich.table import Table

from hil.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console

    from hil.base_parameters import BaseParameters
    from hil.robot import Robot


def render(robot: Robot, console: Console) -> None:
    """Print base parameters as expressions, their groups and where each occurs."""
    base = base_parameters(robot)
    console.print(_parameters(robot, base))
    console.print(_dependencies(robot, base))


def _parameters(robot: Robot, base: BaseParameters) -> Table:
    group_of = {k: group for group, members in base.groups.items() for k in members}
    table = Table("", "group", "unit", title=f"{robot.name}: {len(base)} base parameters")
    table.add_column("expression", overflow="fold")
    for k, name in enumerate(base.names):
        group = group_of.get(k, "").replace("_", "-")
        table.add_row(name, group, base.units[k], base.expressions[k])
    return table


def _dependencies(robot: Robot, base: BaseParameters) -> Table:
    """Rows of M (upper triangle) and g with the numbers of the parameters that occur in them."""
    joints = range(robot.n_joints)
    table = Table("", *(f"M_i{j + 1}" for j in joints), "g_i", title="Base parameters in M and g")
    for i in joints:
        cells = [_numbers(base.dependencies.mass[i, j]) if j >= i else "" for j in joints]
        table.add_row(f"i = {i + 1}", *cells, _numbers(base.dependencies.gravity[i]))
    return table


def _numbers(occurs: Sequence[bool] | np.ndarray) -> str:
    """Write which parameters occur, runs of three or more as a range: 1-4, 7."""
    found = [int(k) + 1 for k in np.flatnonzero(occurs)]
    runs: list[list[int]] = []
    for k in found:
        if runs and k == runs[-1][-1] + 1:
            runs[-1].append(k)
        else:
            runs.append([k])
    parts = [f"{r[0]}-{r[-1]}" if len(r) > 2 else ", ".join(map(str, r)) for r in runs]
    return ", ".join(parts) or "0"
