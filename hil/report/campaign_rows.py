"""What a report says, as plain values for its template: sentences and tables, no layout."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup, escape

from hil.model.base_parameters import base_parameters
from hil.planning.measurement import ELEMENT_KINDS
from hil.results.rounding import clock, percent, rounded, signed, significant

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot
    from hil.results.advice import Advice
    from hil.results.prediction import Prediction
    from hil.runs.recording_file import Measured

    Row = dict[str, str]

DISAGREEMENT = 3.0
"""Standard errors between the two methods from which on their difference is marked."""
_NAME = re.compile(r"([A-Za-z])(\w*)")
_POWER = re.compile(r"\^(\d+)")


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """What a report is about: a robot as both methods see it.

    Attributes
    ----------
    robot : Robot
    estimate, printed : Estimate
        By the improved method, which the report is about, and by the printed one as a check.
    prediction : Prediction
        What the improved method's parameters mean in torques.
    advice : tuple of Advice
    robot_time : float
        From entering the bus to the end of the last measurement [s].
    """

    robot: Robot
    estimate: Estimate
    printed: Estimate
    prediction: Prediction
    advice: tuple[Advice, ...]
    robot_time: float


def verdict(result: Result) -> str:
    """Tell the whole report in two sentences."""
    n = len(result.estimate.p)
    prediction = result.prediction
    worst = int(np.nanargmax(prediction.relative))
    weak = sum(item.urgent for item in result.advice)
    attention = "Nothing needs attention."
    if weak:
        attention = f"{weak} point{'s need' if weak > 1 else ' needs'} attention, see below."
    return (
        f"All {n} base parameters of {result.robot.name} were identified. On a free motion within"
        f" the robot's limits they tell the rigid-body torques to"
        f" {percent(float(np.nanmean(prediction.relative)), 1.0)} % on average over the joints, to"
        f" {percent(float(prediction.relative[worst]), 1.0)} % at joint {worst + 1} (one standard"
        f" error). {attention}"
    )


def counts(campaign: Sequence[Measured]) -> str:
    """Tell how many measurements there are of each kind."""
    kinds: list[str] = [measured.measurement.kind for measured in campaign]
    each = (f"{kinds.count(kind)} {kind}" for kind in ELEMENT_KINDS)
    return f"{len(kinds)} ({', '.join(each)})"


def parameters(result: Result) -> list[tuple[str, float, list[Row]]]:
    """Table 3 with uncertainties: each group with its condition number and its rows."""
    base, estimate = base_parameters(result.robot), result.estimate
    return [
        (
            group.replace("_", "-"),
            estimate.condition[group],
            [_parameter(result, k) for k in members],
        )
        for group, members in base.groups.items()
        if members
    ]


def _parameter(result: Result, k: int) -> Row:
    base, estimate = base_parameters(result.robot), result.estimate
    value, error = float(estimate.p[k]), float(estimate.standard_error[k])
    half = float(estimate.half_width()[k])
    effect = np.nan_to_num(result.prediction.relative_effect[:, k])
    joint = int(np.argmax(effect))
    return {
        "name": base.names[k],
        "expression": base.expressions[k],
        "unit": base.units[k].replace("m2", "m²"),
        "value": rounded(value, error),
        "error": rounded(error, error),
        "low": rounded(value - half, error),
        "high": rounded(value + half, error),
        "relative": percent(error, value),
        "effect": f"{percent(float(effect[joint]), 1.0)} % of joint {joint + 1}",
        "degrees": f"{estimate.degrees_of_freedom[k]:.1f}",
    }


def methods(result: Result) -> list[Row]:
    """Both methods side by side."""
    base = base_parameters(result.robot)
    rows = []
    for members in base.groups.values():
        for k in members:
            value, check = float(result.estimate.p[k]), float(result.printed.p[k])
            errors = [float(e.standard_error[k]) for e in (result.estimate, result.printed)]
            ratio = (check - value) / math.hypot(*errors)
            rows.append({
                "name": base.names[k],
                "unit": base.units[k].replace("m2", "m²"),
                "value": rounded(value, errors[0]),
                "error": rounded(errors[0], errors[0]),
                "printed": rounded(check, errors[1]),
                "printed_error": rounded(errors[1], errors[1]),
                "difference": rounded(check - value, errors[1]),
                "ratio": signed(f"{ratio:.1f}"),
                "marked": "marked" if abs(ratio) > DISAGREEMENT else "",
            })  # fmt: skip
    return rows


def axes(result: Result) -> list[Row]:
    """What is known of each axis: residuals of the local models, predicted torques."""
    prediction = result.prediction
    rows = []
    for axis, residual in enumerate(result.estimate.residual):
        limit = float(result.robot.torque_limit[axis])
        torque, error = float(prediction.torque[axis]), float(prediction.standard_error[axis])
        rows.append({
            "name": str(axis + 1),
            "limit": f"{limit:g}",
            "residual": "not measured" if np.isnan(residual) else significant(residual, 3),
            "share": "" if np.isnan(residual) else percent(float(residual), limit),
            "torque": significant(torque, 3),
            "error": significant(error, 2),
            "relative": percent(error, torque),
        })  # fmt: skip
    return rows


def friction_change(estimate: Estimate) -> str:
    """Tell by how much friction of one kind of measurement changed at most, and where."""
    spread = {}
    for axis, kind in sorted({(v.axis, v.kind) for v in estimate.local}):
        levels = [v.friction for v in estimate.local if (v.axis, v.kind) == (axis, kind)]
        if min(levels) > 0:
            spread[axis, kind] = max(levels) / min(levels) - 1.0
    if not spread:
        return "Levels near zero allow no statement on drift."
    (axis, kind), most = max(spread.items(), key=lambda item: item[1])
    return (
        f"At axis {axis + 1} the {kind} measurements alone find levels that differ by"
        f" {100 * most:.0f} %."
    )


def when(stamp: str) -> str:
    """Write an ISO time stamp for readers."""
    return f"{datetime.fromisoformat(stamp):%d %B %Y, %H:%M %Z}".lstrip("0") if stamp else "unknown"


def duration(seconds: float) -> str:
    """Write a duration for readers."""
    return f"{clock(seconds)} {'h' if seconds >= 3600 else 'min'}"


def symbols(expression: str) -> Markup:
    """Typeset names and powers: ``l1^2 Izz2`` with subscripts and superscripts."""
    typeset = _NAME.sub(r"<i>\1</i><sub>\2</sub>", str(escape(expression)))
    typeset = _POWER.sub(r"<sup>\1</sup>", typeset).replace("<sub></sub>", "")
    return Markup(typeset.replace(" - ", " − "))  # noqa: S704 - escaped above
