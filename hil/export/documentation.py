"""What the head of exported code states: origin, units, functions, base parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.export.expressions import count
from hil.export.friction_file import presliding_left_out
from hil.export.operations import of_whole_links
from hil.model.base_parameters import base_parameters
from hil.results.torque_parts import lacking

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.export.functions import Function
    from hil.results.model import Model


def description(
    model: Model, origin: tuple[str, ...], functions: Sequence[Function]
) -> tuple[str, ...]:
    """Lines for the head of a file of code."""
    lines = [
        *(part for line in origin for part in line.splitlines()),
        "",
        f"Dynamics of {model.robot.name}, written by hil export.",
        f"Positions in {model.robot.position_units}, times in s, torques in"
        f" {model.robot.torque_units}, all joint side. Results may overwrite an argument.",
        *(f"{each.name}({', '.join(each.arguments)}): {each.purpose}" for each in functions),
        *missing(model, functions),
        "",
        "Base parameters, which the numbers below were made from:",
        *_parameters(model),
    ]
    return tuple(lines)


def missing(model: Model, functions: Sequence[Function]) -> tuple[str, ...]:
    """What the code has not, and why: functions, and friction that turns round by and by."""
    there = {each.name for each in functions}
    said = []
    if "friction" not in there:
        said.append(
            "No friction: the model has no law of it for all axes; identify the run anew with: hil"
            " identify"
        )
    else:
        if lack := lacking(model):
            said.append(f"FRICTION UNKNOWN: {lack}")
        said += presliding_left_out(model)
    if "current" not in there:
        said.append(
            "No current: gear ratio or torque constant of an axis is unknown; state them in the"
            f" robot file of {model.robot.name}"
        )
    return tuple(said)


def remarks(model: Model, functions: Sequence[Function]) -> tuple[str, ...]:
    """What the terminal states of exported code: operations, and what there is not."""
    counted = {each.name: f"{each.name}: {count(each.results)}" for each in functions}
    counted["rigid_bodies"] += f"; {of_whole_links(model.robot)} for whole links"
    return (*counted.values(), *missing(model, functions))


def _parameters(model: Model) -> list[str]:
    base = base_parameters(model.robot)
    rows = zip(base.names, model.values, base.units, base.expressions, strict=True)
    return [f"  {name} = {value:.9g} {unit}: {text}" for name, value, unit, text in rows]
