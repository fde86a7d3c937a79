"""The plots of a run's friction: the paper's Figs. 1 and 2 of this robot, levels of a campaign.

Call and save them within `hil.report.plots.style.plotting`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np

from hil.estimation.local_fits import REFERENCE_SPEED
from hil.planning.measurement import ELEMENT_KINDS
from hil.report.plots.style import (
    INK,
    MEASURED,
    MODEL,
    MUTED,
    WIDTH,
    fixed_grid,
    legend,
    panels_in_rows,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from hil.estimation.friction.drift import Drift
    from hil.estimation.friction.points import FrictionPoint
    from hil.estimation.local_values import LocalValue
    from hil.model.robot import Robot
    from hil.planning.measurement import ElementKind
    from hil.results.friction import FrictionResult

    Array = NDArray[np.float64]

STYLES = {
    "linear": (MUTED, ":"),
    "cube-root": ("#3f8f5f", "--"),
    "arctan": (MODEL, "-"),
    "stribeck": ("#8a5fb0", "-."),
}
"""Colour and line of each model."""
PAUSE = 3.0
"""Multiple of the usual interval between levels from which on a line is interrupted."""
FEWEST = 4
"""Speeds that make a characteristic."""


def normalised(result: FrictionResult) -> Figure:
    """Characteristics of all axes over their full speed ranges, normalised: Fig. 1a."""
    figure, grid = fixed_grid(0.62 * WIDTH, 4.0, 1, 1)
    panel = figure.add_subplot(grid[0])
    colours = mpl.colormaps["viridis"](np.linspace(0.0, 0.9, len(result.axes)))
    for fit, colour in zip(result.axes, colours, strict=True):
        own = sorted(result.of_axis(fit.axis), key=lambda p: p.velocity)
        limit = float(result.robot.velocity_limit[fit.axis])
        top = max(max(p.forward, -p.backward) for p in own)
        v = np.array([p.velocity for p in own]) / limit
        forward = np.array([p.forward for p in own]) / top
        backward = np.array([p.backward for p in own]) / top
        panel.plot(np.append(-v[::-1], v), np.append(backward[::-1], forward), "o-",
                   color=colour, markersize=3, label=f"axis {fit.axis + 1}")  # fmt: skip
    panel.set_xlabel("speed / speed limit")
    panel.set_ylabel("friction / largest friction")
    panel.legend(loc="lower right")
    return figure


def models(result: FrictionResult) -> Figure:
    """Measured friction of every axis and the models fitted to it: Fig. 1b."""
    figure, panels = panels_in_rows(len(result.axes), height=2.5)
    for fit, (panel,) in zip(result.axes, panels, strict=True):
        limit = float(result.robot.velocity_limit[fit.axis])
        panel.plot(fit.velocity / limit, fit.torque, "x", color=MEASURED, markersize=4.5,
                   label="measured")  # fmt: skip
        v = np.geomspace(fit.velocity.min(), fit.velocity.max(), 300)
        for kind, model in fit.models.items():
            colour, line = STYLES[kind]
            panel.plot(v / limit, model.torque(v), line, color=colour, label=kind,
                       linewidth=1.8 if kind == fit.chosen else 1.0)  # fmt: skip
        panel.set_xscale("log")
        panel.set_title(f"axis {fit.axis + 1}: {fit.chosen}")
        panel.set_xlabel("speed / speed limit")
        panel.set_ylabel(f"friction [{result.robot.torque_unit(fit.axis)}]")
    legend(figure, panels[0][0])
    return figure


def over_time(drifts: Sequence[Drift]) -> Figure:
    """Friction levels in the course of time and the model of their drift: Fig. 2a."""
    figure, panels = panels_in_rows(len(drifts), height=2.6)
    for each, (panel,) in zip(drifts, panels, strict=True):
        minutes = np.array([level.time for level in each.levels]) / 60
        measured = np.array([level.friction for level in each.levels])
        groups = [level.group for level in each.levels]
        for group in dict.fromkeys(groups):
            own = np.array([g == group for g in groups])
            base = measured[own].mean()
            panel.plot(minutes[own], measured[own] / base, "o", color=MEASURED, markersize=2.6,
                       label="measured")  # fmt: skip
            panel.plot(minutes[own], _interrupted(minutes[own], each.fitted[own] / base), "-",
                       color=MODEL, label="two states, three time constants")  # fmt: skip
        panel.set_title(f"axis {each.axis + 1}")
        panel.set_xlabel("time [min]")
        panel.set_ylabel("friction / its mean")
    first = panels[0][0]
    handles, labels = first.get_legend_handles_labels()
    figure.legend(handles[:2], labels[:2], loc="upper right", ncols=2)
    return figure


def _interrupted(minutes: Array, fitted: Array) -> Array:
    """Leave a gap where nothing was measured for long."""
    pauses = np.diff(minutes, prepend=minutes[:1])
    return np.where(pauses > PAUSE * np.median(pauses), np.nan, fitted)


def in_operation(result: FrictionResult) -> Figure:
    """Characteristics after several times of continuous operation: Fig. 2b."""
    axes = axes_in_operation(result)
    figure, panels = panels_in_rows(len(axes), height=3.0)
    for axis, (panel,) in zip(axes, panels, strict=True):
        curves = characteristics(result, axis)
        colours = mpl.colormaps["plasma"](np.linspace(0.0, 0.85, len(curves)))
        begin = curves[0][0].time
        for curve, colour in zip(curves, colours, strict=True):
            own = sorted(curve, key=lambda p: p.velocity)
            v = np.array([p.velocity for p in own])
            f, b = np.array([p.forward for p in own]), np.array([p.backward for p in own])
            panel.plot(np.append(-v[::-1], v), np.append(b[::-1], f), "o-", color=colour,
                       markersize=3, label=f"{(curve[0].time - begin) / 60:.0f} min")  # fmt: skip
        panel.axhline(0.0, color=INK, linewidth=0.5)
        panel.set_title(f"axis {axis + 1}")
        panel.set_xlabel(f"speed [{result.robot.position_unit(axis)}/s]")
        panel.set_ylabel(f"friction [{result.robot.torque_unit(axis)}]")
        panel.legend(title="operation")
    return figure


def characteristics(result: FrictionResult, axis: int) -> list[list[FrictionPoint]]:
    """Points of an axis, a new list beginning after every exercise; short lists left out."""
    lists: list[list[FrictionPoint]] = [[]]
    for point in sorted(result.of_axis(axis), key=lambda p: p.time):
        if result.planned[point.id].exercise:
            lists.append([])
        lists[-1].append(point)
    return [each for each in lists if len({p.velocity for p in each}) >= FEWEST]


def axes_in_operation(result: FrictionResult) -> list[int]:
    """Axes that have characteristics after more than one time of operation."""
    axes = sorted({point.axis for point in result.points})
    return [axis for axis in axes if len(characteristics(result, axis)) > 1]


def levels(local: Sequence[LocalValue], robot: Robot) -> Figure:
    """Draw the friction of every axis over a campaign, as step 1 finds it by the way."""
    axes = sorted({value.axis for value in local})
    figure, panels = panels_in_rows(len(axes), height=2.1)
    last = max((value.time for value in local), default=0.0) / 60
    for axis, (panel,) in zip(axes, panels, strict=True):
        values = [value for value in local if value.axis == axis]
        for name, kind in ELEMENT_KINDS.items():
            chosen = [value for value in values if value.kind == name]
            minutes = [value.time / 60 for value in chosen]
            levels = [value.friction for value in chosen]
            panel.plot(minutes, levels, kind.marker, color=kind.colour, markersize=3.6,
                       markerfacecolor="white" if kind.pair else kind.colour,
                       label=_friction_label(kind))  # fmt: skip
        panel.set_title(f"axis {axis + 1}")
        panel.set_xlabel("robot time [min]")
        panel.set_ylabel(f"friction [{robot.torque_unit(axis)}]")
        panel.set_xlim(-0.02 * last, 1.02 * last)
        panel.margins(y=0.15)
    legend(figure, panels[0][0])
    return figure


def _friction_label(kind: ElementKind) -> str:
    speed = "creep speed" if kind.pair else f"{REFERENCE_SPEED:.0%} of the speed limit"
    return f"{kind.name}, at {speed}"
