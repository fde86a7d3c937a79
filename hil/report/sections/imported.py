"""Results from imported recordings: parameters and friction.

For axes moving back and forth alone, half-sums and half-differences are drawn.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from hil.results.tables.friction import campaign_friction
from hil.show.charts.chart import MODEL, Chart, Line, Panel, Points, chart, ordered_colours
from hil.show.section import Plot, Section

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.estimation.back_and_forth.description import HalfSums
    from hil.estimation.back_and_forth.result import FrictionCurve
    from hil.model.robot import Robot
    from hil.report.reported_run import ReportedRun
    from hil.show.charts.chart import Item


def identified(run: ReportedRun) -> Section | None:
    """Create the section of the identified model, with plots of the data."""
    if run.found.effect is not None:
        return None
    shown = run.model.summary()
    values = {
        "tables": (*shown.tables, campaign_friction(run.model)),
        "remarks": shown.remarks,
        "lengths": run.robot.file.lengths,
    }
    plots = tuple(_plots(run))
    return Section("Parameters, friction and torques", "identified.html", values, plots)


def _plots(run: ReportedRun) -> Iterator[Plot]:
    if run.estimate.half_sums:
        yield Plot(
            "half-sums",
            partial(draw_half_sums, run.estimate.half_sums, run.robot),
            "Torque of the rigid bodies over the position of each axis, measured and modelled.",
            "Gravity and, during acceleration, inertia: half-sum of forward and backward torque "
            "over the position, less effects that differ by direction. Means over the pairs with "
            "standard errors, for the recordings of the longest strokes, one colour each; lines: "
            "model.",
        )


def draw_half_sums(half_sums: Sequence[HalfSums], robot: Robot) -> Chart:
    """Draw measured and modelled torques of the rigid bodies over position, by axis.

    The six recordings with the longest strokes are shown per axis.
    """
    axes = sorted({each.axis for each in half_sums})
    return chart(
        Panel(
            tuple(_half_sums([each for each in half_sums if each.axis == axis])),
            title=f"axis {axis + 1}",
            x_label=f"position [{robot.position_unit(axis)}]",
            y_label=_torque(robot, axis),
        )
        for axis in axes
    )


def _half_sums(own: Sequence[HalfSums]) -> Iterator[Item]:
    longest = sorted(own, key=lambda each: -float(np.ptp(each.q)))[:6]
    for each, colour in zip(longest, ordered_colours(len(longest)), strict=True):
        error = np.nan_to_num(each.standard_error)
        yield Points(each.q, each.measured, "o", colour, error=error, size=1.6)
        yield Line(each.q, each.model, colour)


def friction_curves(curves: Sequence[FrictionCurve], robot: Robot) -> Chart:
    """Draw friction over speed, by axis."""
    return chart(_curve(curve, robot) for curve in curves)


def _curve(curve: FrictionCurve, robot: Robot) -> Panel:
    axis = curve.axis - 1
    speed = np.array([point.speed for point in curve.points])
    friction = np.array([point.friction for point in curve.points])
    half = np.array([point.half_width or 0.0 for point in curve.points])
    items: list[Item] = [Points(speed, friction, "o", label="measured", error=half, size=2.2)]
    if curve.plain:
        coulomb, viscous = (curve.plain[name].value for name in ("Coulomb", "viscous"))
        ends = np.array([0.0, speed.max()])
        items.append(Line(ends, coulomb + viscous * ends, MODEL, "Coulomb and viscous", "5 3"))
    low, high = min(0.0, float(np.min(friction - half))), float(np.max(friction + half))
    return Panel(
        tuple(items),
        title=f"axis {curve.axis}",
        x_label=f"speed [{robot.position_unit(axis)}/s]",
        y_label=_torque(robot, axis),
        x_range=(0.0, 1.05 * float(speed.max())),
        y_range=(low, high + 0.08 * (high - low)),
    )


def _torque(robot: Robot, axis: int) -> str:
    return "torque [N m]" if robot.revolute[axis] else "force [N]"
