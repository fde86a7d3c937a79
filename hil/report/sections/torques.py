"""Leading section: measured and predicted torque over time, and friction over speed.

The recordings are held out, from the model's last validation; without a validation they are those
of the identification, as stated on the page.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from hil.commands.torques import torque_chart
from hil.friction.equation import SLOW
from hil.least_squares.uncertainty import TWICE
from hil.report.sections.friction import models_plot
from hil.report.sections.parameters import friction_curves
from hil.results.identified_robot import friction_alone
from hil.show.charts.chart import MUTED, Band, Line, Panel, Points, Rule
from hil.show.section import Plot, Section
from hil.view.along_motion import most_demanding

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from hil.friction.law import AxisLaw
    from hil.report.reported_run import ReportedRun
    from hil.results.model import Model
    from hil.results.recorded_torque import PredictedTorque
    from hil.show.charts.chart import Item

POINTS = 150
"""Maximum number of friction points per axis; more would overlap."""


def torque(run: ReportedRun) -> Section | None:
    """Create the section of torques over time and friction over speed."""
    plots = (*_torque_plots(run), *_friction(run))
    return Section("Torque", "torque.html", plots=plots, leads=True) if plots else None


def _torque_plots(run: ReportedRun) -> Iterator[Plot]:
    found = run.shown_torques if run.is_identified else None
    if found is None or not found.stretches:
        return
    fitted = sorted({each.axis + 1 for each in found.stretches.values() if not each.own_friction})
    beside = (
        f" Friction of axis {', '.join(map(str, fitted))} (no law in the model) is fitted in the "
        "recording."
        if fitted
        else ""
    )
    yield Plot(
        "torque",
        lambda: torque_chart(most_demanding(found.stretches), run.robot),
        "Measured and predicted torque of every axis over time with its interval of 95 %, and their"
        " difference below.",
        f"Measured and predicted torque, low-passed; below, the residual. {found.words} Each "
        "axis in a recording with large torques; no prediction close to standstill, where "
        f"friction is not a function of velocity.{beside}",
    )


def _friction(run: ReportedRun) -> Iterator[Plot]:
    if not run.is_identified:
        if run.friction is not None and run.friction.axes:
            yield models_plot(run.friction)
    elif curves := run.model.details.curves:
        yield _law_plot(
            partial(friction_curves, curves, run.robot),
            "half-differences of forward and backward torque, less that of the rigid bodies, "
            "with intervals of 95 %. Dashed: Coulomb and viscous friction alone.",
        )
    elif run.model.friction_law.known and run.shown_torques.stretches:
        yield _law_plot(
            lambda: draw_friction(
                run.model,
                run.shown_torques.stretches.values(),
                linked=run.shown_torques is run.own_torques,
            ),
            "measured torque less that of rigid bodies and motors, and the friction law at no "
            "load with its interval of 95 %, wander included.",
        )


def _law_plot(draw: object, words: str) -> Plot:
    return Plot(
        "friction-law",
        draw,  # type: ignore[arg-type]
        "Friction of every axis over its speed, measured and by the law of friction.",
        f"Torque of friction over the speed: {words}",
    )


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
