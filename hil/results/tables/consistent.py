"""The nearest robot that consists of bodies: links, changed base parameters, cost in torque."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.model.base_parameters import base_parameters
from hil.model.frames import pseudo_inertia
from hil.results.rounding import significant
from hil.results.tables.table import Column, Part, Table, figures

if TYPE_CHECKING:
    from hil.model.robot import Robot
    from hil.results.consistent_robot import ConsistentRobot, LinkBody
    from hil.results.tables.table import Row

_SHOWN = 0.01
"""Least change of a base parameter that is listed, in standard errors."""


def bodies(robot: Robot, found: ConsistentRobot) -> Table:
    """Mass, centre and spread of every link."""
    binding = {each.name: each.distance_without for each in found.binding}
    rows = [_link(number, body, binding) for number, body in enumerate(found.links, start=1)]
    return Table(
        title="Nearest robot that consists of bodies",
        columns=(
            Column("link"),
            *figures("mass, kg", "centre, m", "spread, mm", "without"),
        ),
        parts=(Part(tuple(rows)),),
        explanation=(
            "Bodies whose base parameters are nearest to the estimate in the metric of its"
            " covariance. The mass spreads root mean square about its centre, in its three"
            " principal directions. The last column: the distance if this link need not be a"
            " body, where that condition binds. What no torque decides, masses among it, is taken"
            f" from {found.likely}."
        ),
        notes=found.statements(robot),
    )


def changed_parameters(robot: Robot, found: ConsistentRobot) -> Table:
    """Base parameters that bodies change."""
    base = base_parameters(robot)
    rows = [
        (base.names[k], significant(found.values[k], 5), f"{found.change[k]:+.2f}", base.units[k])
        for k in range(len(found.values))
        if abs(found.change[k]) > _SHOWN
    ]
    return Table(
        title="Base parameters of these bodies where they differ",
        columns=(
            Column("", symbols=True),
            *figures("value", "change, std. errors"),
            Column("unit"),
        ),
        parts=(Part(tuple(rows)),),
    )


def torque_costs(robot: Robot, found: ConsistentRobot) -> Table:
    """What the change means in torques."""
    rows = [
        (
            str(axis + 1),
            significant(each.change, 2),
            significant(each.standard_error, 2),
            significant(each.torque, 3),
            robot.torque_unit(axis),
        )
        for axis, each in enumerate(found.torque)
    ]
    return Table(
        title="What bodies cost in torque",
        columns=(Column("axis"), *figures("change", "std. error", "torque"), Column("unit")),
        parts=(Part(tuple(rows if found.binding else ())),),
        explanation=(
            "Root mean squares over the run's motions: change of the torques, standard error of"
            " those that the estimate predicts, and these torques of the rigid bodies."
        ),
    )


def _link(number: int, body: LinkBody, binding: dict[str, float]) -> Row:
    J = pseudo_inertia(np.array(body.parameters))
    mass, centre = J[3, 3], J[:3, 3] / J[3, 3]
    spread = np.sqrt(np.linalg.eigvalsh(J[:3, :3] / mass - np.outer(centre, centre)).clip(0.0))
    without = binding.get(f"link {number}")
    return (
        str(number),
        significant(float(mass), 3),
        " ".join(f"{x:.3f}" for x in centre),
        " ".join(f"{1e3 * x:.3g}" for x in spread),
        "" if without is None else f"{without:.3g}",
    )
