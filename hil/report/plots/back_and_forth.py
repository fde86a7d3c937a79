"""The plots of axes that move back and forth; draw them within `style.plotting`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np

from hil.report.plots.style import MEASURED, MODEL, panels_in_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from hil.estimation.back_and_forth.half_sums import HalfSums
    from hil.estimation.back_and_forth.result import FrictionCurve
    from hil.model.robot import Robot

SHOWN = 6
"""Recordings of an axis."""


def shown_half_sums(half_sums: Sequence[HalfSums], robot: Robot) -> Figure:
    """Torque of the rigid bodies over the position, measured and modelled, axis by axis."""
    axes = sorted({each.axis for each in half_sums})
    figure, panels = panels_in_rows(len(axes), height=2.8)
    for axis, (panel,) in zip(axes, panels, strict=True):
        own = [each for each in half_sums if each.axis == axis]
        longest = sorted(own, key=lambda each: -float(np.ptp(each.q)))[:SHOWN]
        colours = mpl.colormaps["viridis"](np.linspace(0.0, 0.85, len(longest)))
        for each, colour in zip(longest, colours, strict=True):
            error = np.nan_to_num(each.standard_error)
            panel.errorbar(each.q, each.measured, error, fmt=".", markersize=3, color=colour)
            panel.plot(each.q, each.model, color=colour)
        panel.set_title(f"axis {axis + 1}")
        panel.set_xlabel(f"position [{robot.position_unit(axis)}]")
        panel.set_ylabel(_torque(robot, axis))
    return figure


def friction_curves(curves: Sequence[FrictionCurve], robot: Robot) -> Figure:
    """Friction over the speed, axis by axis."""
    figure, panels = panels_in_rows(len(curves), height=2.4)
    for curve, (panel,) in zip(curves, panels, strict=True):
        axis = curve.axis - 1
        speed = np.array([point.speed for point in curve.points])
        friction = np.array([point.friction for point in curve.points])
        half = np.array([point.half_width or 0.0 for point in curve.points])
        panel.errorbar(speed, friction, half, fmt="o", markersize=3, color=MEASURED, capsize=2)
        if curve.plain:
            coulomb, viscous = (curve.plain[name].value for name in ("Coulomb", "viscous"))
            ends = np.array([0.0, speed.max()])
            panel.plot(ends, coulomb + viscous * ends, "--", color=MODEL)
        panel.set_xlim(left=0.0)
        panel.set_ylim(bottom=min(0.0, float(np.min(friction - half))))
        panel.set_title(f"axis {curve.axis}")
        panel.set_xlabel(f"speed [{robot.position_unit(axis)}/s]")
        panel.set_ylabel(_torque(robot, axis))
    return figure


def _torque(robot: Robot, axis: int) -> str:
    return "torque [N m]" if robot.revolute[axis] else "force [N]"
