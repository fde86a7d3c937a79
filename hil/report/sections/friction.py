"""Friction sections: over a campaign from step 1, and by measurements (the paper's Figs. 1, 2).

The leading section has measured and predicted torque over time, and friction over speed. The
recordings are held out, from the model's last validation; without a validation they are those of
the identification, as stated on the page.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from hil.commands import friction as command
from hil.commands.torques import torque_chart
from hil.estimation.friction.points import judge_local_values
from hil.estimation.local_fits import REFERENCE_SPEED
from hil.friction.equation import SLOW
from hil.least_squares.uncertainty import TWICE
from hil.planning.measurement import ELEMENT_KINDS
from hil.report.sections.parameters import friction_curves
from hil.results.identified_robot import friction_alone, lacking
from hil.results.tables import friction as tables
from hil.show.charts.chart import (
    GREEN,
    INK,
    MODEL,
    MUTED,
    PURPLE,
    Band,
    Line,
    Panel,
    Points,
    Rule,
    ordered_colours,
)
from hil.show.outcome import Plot, Section
from hil.view.along_motion import most_demanding

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from hil.commands.friction import FrictionResult
    from hil.estimation.friction.points import FrictionPoint
    from hil.estimation.local_fits import LocalValue
    from hil.friction.drift import Drift
    from hil.friction.law import AxisLaw
    from hil.model.robot import Robot
    from hil.report.reported_run import ReportedRun
    from hil.results.model import Model
    from hil.results.recorded_torque import PredictedTorque
    from hil.show.charts.chart import Item


POINTS = 150
"""Maximum number of friction points per axis; more would overlap."""
STYLES = {
    "linear": (MUTED, "1 3"),
    "cube-root": (GREEN, "5 3"),
    "arctan": (MODEL, ""),
    "stribeck": (PURPLE, "6 2 1 2"),
}
"""Colour and dash pattern by friction model."""


def torque(run: ReportedRun) -> Section | None:
    """Create the section of torques over time and friction over speed."""
    plots: list[Plot] = []
    if not run.is_identified:
        plots += [models_plot(run.friction)] if run.friction and run.friction.axes else []
        return Section("Torque", "torque.html", plots=tuple(plots), leads=True) if plots else None
    model, found = run.model, run.shown_torques
    if found.stretches:
        axes = {each.axis + 1 for each in found.stretches.values() if not each.own_friction}
        fitted = ", ".join(map(str, sorted(axes)))
        beside = f" Friction of axis {fitted} (no law in the model) is fitted in the recording."
        plots.append(Plot(
            "torque",
            lambda: torque_chart(most_demanding(found.stretches), run.robot),
            "Measured and predicted torque of every axis over time with its interval of 95 %, and"
            " their difference below.",
            f"Measured and predicted torque, low-passed; below, the residual. {found.words} Each "
            "axis in a recording with large torques; no prediction close to standstill, where "
            f"friction is not a function of velocity.{beside if fitted else ''}",
        ))  # fmt: skip
    draw: Callable[[], Iterator[Panel]] | None = None
    if curves := model.details.curves:
        draw, words = partial(friction_curves, curves, run.robot), (
            "half-differences of forward and backward torque, less that of the rigid bodies, "
            "with intervals of 95 %. Dashed: Coulomb and viscous friction alone."
        )  # fmt: skip
    elif model.friction_law.known and found.stretches:
        linked = found is run.own_torques
        draw = partial(draw_friction, model, found.stretches.values(), linked=linked)
        words = (
            "measured torque less that of rigid bodies and motors, and the friction law at no "
            "load with its interval of 95 %, wander included."
        )
    if draw is not None:
        plots.append(Plot(
            "friction-law",
            draw,
            "Friction of every axis over its speed, measured and by the law of friction.",
            f"Torque of friction over the speed: {words}",
        ))  # fmt: skip
    return Section("Torque", "torque.html", plots=tuple(plots), leads=True) if plots else None


def draw_friction(
    model: Model, found: Iterable[PredictedTorque], *, linked: bool
) -> Iterator[Panel]:
    """Draw friction over speed, measured and from the model's law.

    Points link to recordings if `linked`, for recordings of the run itself.
    """
    by_axis: dict[int, list[PredictedTorque]] = {}
    for each in found:
        by_axis.setdefault(each.axis, []).append(each)
    for axis, law in enumerate(model.friction_law.axes):
        if law is not None and axis in by_axis:
            yield _law(model, axis, law, by_axis[axis], linked)


def _law(
    model: Model, axis: int, law: AxisLaw, own: Sequence[PredictedTorque], linked: bool
) -> Panel:
    robot = model.robot
    speed, residual = (
        np.concatenate([getattr(each, name) for each in own]) for name in ("qd", "residual")
    )
    # speed range of the law, or above a share of its reference speed
    low, high = law.speeds or (SLOW * law.speed, np.inf)
    there = (low <= np.abs(speed)) & (np.abs(speed) <= high) & np.isfinite(residual)
    ids = np.repeat([each.measurement for each in own], [len(each.time) for each in own])[there]
    speed, residual = speed[there], residual[there]
    at = np.zeros(len(speed))
    bands: list[Item] = []
    lines: list[Item] = []
    for side in (-1.0, 1.0):
        here = side * speed > 0
        if here.any():
            slowest, fastest = np.abs(speed[here]).min(), np.abs(speed[here]).max()
            v = np.linspace(slowest, fastest, 60)
            level, error = friction_alone(model, axis, side * v)
            half = TWICE * error
            at[here] = np.interp(side * speed[here], v, level)
            bands.append(Band(side * v, level - half, level + half, label="95 % interval"))
            lines.append(Line(side * v, level, label="law of friction", width=1.8))
    kept = np.linspace(0, len(speed) - 1, min(POINTS, len(speed))).astype(int)
    order = np.argsort(speed)[kept]
    return Panel(
        (
            Rule(0.0),
            *bands,
            Points(
                speed[order], (at + residual)[order], "o", MUTED, "measured",
                ids=ids[order].tolist() if linked else (), size=1.7,
            ),
            *lines,
        ),
        title=f"axis {axis + 1}",
        x_label=f"speed [{robot.position_unit(axis)}/s]",
        y_label=f"friction [{robot.torque_unit(axis)}]",
        width=357.0,
        height=140.0,
    )  # fmt: skip


def model_curves(result: FrictionResult) -> Iterator[Panel]:
    """Draw measured friction and fitted models of the axes: Fig. 1b."""
    for fit in result.axes:
        limit = float(result.robot.velocity_limit[fit.axis])
        v = np.geomspace(fit.velocity.min(), fit.velocity.max(), 120)
        lines = (
            Line(
                v / limit,
                model.torque(v),
                STYLES[kind][0],
                kind,
                STYLES[kind][1],
                width=2.0 if kind == fit.chosen else 1.0,
            )
            for kind, model in fit.models.items()
        )
        yield Panel(
            (*lines, Points(fit.velocity / limit, fit.torque, label="measured")),
            title=f"axis {fit.axis + 1}: {fit.chosen}",
            x_label="speed / speed limit",
            y_label=f"friction [{result.robot.torque_unit(fit.axis)}]",
            decades=True,
        )


def draw_levels(drifts: Sequence[Drift]) -> Iterator[Panel]:
    """Draw friction levels over time with the fitted drift model: Fig. 2a."""
    for each in drifts:
        minutes = np.array([level.time for level in each.levels]) / 60
        measured = np.array([level.friction for level in each.levels])
        groups = [level.group for level in each.levels]
        items: list[Item] = []
        for group in dict.fromkeys(groups):
            own = np.array([g == group for g in groups])
            base, t = measured[own].mean(), minutes[own]
            # a gap where the pause exceeds three times the usual interval
            pauses = np.diff(t, prepend=t[:1])
            fitted = np.where(pauses > 3.0 * np.median(pauses), np.nan, each.fitted[own] / base)
            items += (
                Points(t, measured[own] / base, "o", label="measured", size=1.8),
                Line(t, fitted, label="two states, three time constants"),
            )
        yield Panel(
            tuple(items),
            title=f"axis {each.axis + 1}",
            x_label="time [min]",
            y_label="friction / its mean",
        )


def operation_curves(result: FrictionResult) -> Iterator[Panel]:
    """Draw characteristics after several times of continuous operation: Fig. 2b."""
    for axis in axes_in_operation(result):
        curves = characteristics(result, axis)
        begin = curves[0][0].time
        items: list[Item] = [Rule(0.0, colour=INK)]
        for curve, colour in zip(curves, ordered_colours(len(curves)), strict=True):
            own = sorted(curve, key=lambda p: p.velocity)
            after = f"after {(curve[0].time - begin) / 60:.0f} min of operation"
            v = np.array([point.velocity for point in own])
            forward = [point.forward for point in own]
            backward = [point.backward for point in own]
            x, y = np.append(-v[::-1], v), np.append(backward[::-1], forward)
            ids = [point.id for point in own]
            items += (
                Line(x, y, colour),
                Points(x, y, "o", colour, after, ids=[*ids[::-1], *ids], size=2.0),
            )
        yield Panel(
            tuple(items),
            title=f"axis {axis + 1}",
            x_label=f"speed [{result.robot.position_unit(axis)}/s]",
            y_label=f"friction [{result.robot.torque_unit(axis)}]",
            height=190.0,
        )


def characteristics(result: FrictionResult, axis: int) -> list[list[FrictionPoint]]:
    """Group the points of an axis by exercise; groups with fewer than 4 speeds are left out."""
    lists: list[list[FrictionPoint]] = [[]]
    for point in sorted(result.axis_points(axis), key=lambda p: p.time):
        if result.planned[point.id].exercise:
            lists.append([])
        lists[-1].append(point)
    return [each for each in lists if len({p.velocity for p in each}) >= 4]


def axes_in_operation(result: FrictionResult) -> list[int]:
    """Return axes with characteristics after more than one time of operation."""
    axes = sorted({point.axis for point in result.points})
    return [axis for axis in axes if len(characteristics(result, axis)) > 1]


def levels(local: Sequence[LocalValue], robot: Robot) -> Iterator[Panel]:
    """Draw the friction of the axes over a campaign, from step 1."""
    last = max((value.time for value in local), default=0.0) / 60
    for axis in sorted({value.axis for value in local}):
        items = []
        for name, kind in ELEMENT_KINDS.items():
            own = [value for value in local if (value.axis, value.kind) == (axis, name)]
            speed = "creep speed" if kind.pair else f"{REFERENCE_SPEED:.0%} of the speed limit"
            items.append(Points(
                [value.time / 60 for value in own],
                [value.friction for value in own],
                kind.marker,
                kind.colour,
                f"{kind.name}, at {speed}",
                ids=[value.id for value in own],
                size=2.6,
            ))  # fmt: skip
        yield Panel(
            tuple(items),
            title=f"axis {axis + 1}",
            x_label="robot time [min]",
            y_label=f"friction [{robot.torque_unit(axis)}]",
            x_range=(-0.02 * last, 1.02 * last),
            height=125.0,
        )


def friction_over_campaign(run: ReportedRun) -> Section | None:
    """Create the section of friction over a campaign: law, levels, drift and symmetry."""
    if run.found.effect is None:
        return None
    local = run.estimate.local
    plot = Plot(
        "friction",
        partial(levels, local, run.robot),
        "Friction level of every axis over robot time, one panel per axis, markers by kind of "
        "measurement.",
        "Friction level of each axis, found with each element in step 1. Levels of different "
        "kinds come from different fits and may differ by a step; the course of one kind is "
        f"drift by temperature and lubricant. {friction_change(local)} No effect on the "
        "parameters: friction is fitted anew in every measurement.",
    )
    return Section(
        "Friction over the campaign",
        "friction_over_campaign.html",
        {
            "law": tables.campaign_friction(run.model),
            "lack": lacking(run.model),
            "drift": tables.drift(run.found.drifts),
            "symmetry": tables.symmetry(judge_local_values(local)),
        },
        (plot,) if local else (),
    )


def friction_change(local: Sequence[LocalValue]) -> str:
    """Describe the largest change of the friction level within a kind of measurement."""
    spread = {}
    for axis, kind in sorted({(v.axis, v.kind) for v in local}):
        found = [v.friction for v in local if (v.axis, v.kind) == (axis, kind)]
        if min(found) > 0:
            spread[axis, kind] = max(found) / min(found) - 1.0
    if not spread:
        return "Levels near zero allow no statement on drift."
    (axis, kind), most = max(spread.items(), key=lambda item: item[1])
    return (
        f"At axis {axis + 1} the {kind} measurements alone find levels that differ by"
        f" {100 * most:.0f} %."
    )


def friction(run: ReportedRun) -> Section | None:
    """Create the section of a run's friction measurements; None if absent."""
    result = run.friction
    if result is None:
        return None
    values = {
        "result": result,
        "models": command.models(result),
        "symmetry": tables.symmetry(result.symmetry),
        "drift": tables.drift(result.drifts),
    }
    shown = [models_plot(result)] if result.axes and run.is_identified else []
    if result.drifts:
        shown.append(Plot(
            "over-time",
            partial(draw_levels, result.drifts),
            "Friction level over time, one panel per axis.",
            "Friction level in the course of time (Fig. 2a).",
        ))  # fmt: skip
    if axes_in_operation(result):
        shown.append(Plot(
            "in-operation",
            partial(operation_curves, result),
            "Friction characteristics after several durations of operation.",
            "Friction characteristics after several durations of continuous operation (Fig. 2b).",
        ))  # fmt: skip
    return Section("Friction", "friction.html", values, tuple(shown))


def models_plot(result: FrictionResult) -> Plot:
    """Create the plot of friction over speed."""
    return Plot(
        "models",
        partial(model_curves, result),
        "Friction over speed with fitted models, one panel per axis.",
        "Measured friction and the models fitted to it (Fig. 1b); thick: the chosen model.",
    )
