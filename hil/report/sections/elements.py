"""Elements of g(q) and M(q), measured and modelled, with residuals: the paper's Figs. 5 and 6.

Measured values are blue with error bars of two standard errors, modelled ones orange. Residuals are
drawn over all measurements, and over joint angles.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from hil.commands.diagnose import residuals_over_angles
from hil.planning.measurement import ELEMENT_KINDS, element_measurements
from hil.results.tables import parameters as tables
from hil.show.charts.chart import MODEL, Line, Panel, Points, Rule
from hil.show.section import Plot, Section

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from hil.estimation.estimate import Estimate
    from hil.estimation.local_fits import LocalValue
    from hil.model.robot import Robot
    from hil.planning.measurement import ElementKind, ElementMeasurement
    from hil.report.reported_run import ReportedRun


BELIEVED = (
    "Effects estimated by the improved method are subtracted from each element: lag, "
    "compliance, friction of the load and by direction, ripple, and acceleration of other "
    "compliant axes."
)
AS_PUBLISHED = (
    "Step 1 is that of the published method: friction by direction, compliance and moving other "
    "axes become part of the element, and all points of an axis deviate alike from the model."
)


def measured_and_modelled(run: ReportedRun) -> Section | None:
    """Create the section of measured elements, with a plot per kind."""
    kinds = {value.kind for value in run.estimate.local}
    plots = tuple(
        Plot(
            name,
            partial(measured_elements, run.local_values(name), kind, run.robot),
            f"Measured and modelled {kind.elements} over configuration number, one panel per "
            f"{'pair of axes' if kind.pair else 'axis'}, with their differences below.",
            kind.caption,
        )
        for name, kind in ELEMENT_KINDS.items()
        if name in kinds
    )
    if not plots:
        return None
    note = BELIEVED if run.model.method == "improved" else AS_PUBLISHED
    return Section("Measured and modelled", "measured_and_modelled.html", {"note": note}, plots)


def torques(run: ReportedRun) -> Section | None:
    """Create the section of residuals over measurements and angles."""
    if run.found.effect is None:
        return None
    kinds = {value.kind for value in run.estimate.local}
    planned = {each.id: each for each in element_measurements(run.source.plan.measurements)}
    every = Plot(
        "residuals",
        partial(residuals, run.estimate, planned),
        "Residuals of all measurements as a share of torque limits.",
        "Measured less modelled elements as torques (inertias times the acceleration they were"
        " measured with), relative to the axis's limit, eq. (16).",
    )
    pattern = (
        " (Fig. 7 for all pairs). A pattern over an angle shows an effect missing in the robot "
        "file; hil diagnose tests for it."
    )
    over_angles = (
        Plot(
            f"{name}-angles",
            partial(residuals_over_angles, run.local_values(name), run.robot, kind),
            f"Residuals of the {kind.elements} over the position of each joint that varied.",
            f"Residuals of the {kind.elements} against the position of every joint that varied"
            + (pattern if kind.symbol == "g" else "."),
        )
        for name, kind in ELEMENT_KINDS.items()
        if name in kinds and not kind.pair
    )
    return Section(
        "Residuals and torques",
        "torques.html",
        {
            "residuals": tables.residuals(run.model),
            "band": tables.band_residual(
                run.model.band_residual, run.model.robot, "of these recordings"
            ),
        },
        (every, *over_angles) if kinds else (),
    )


def measured_elements(
    values: Sequence[LocalValue], kind: ElementKind, robot: Robot
) -> Iterator[Panel]:
    """Draw measured and modelled elements of g(q) or M(q) of one kind.

    A panel per element: measured and modelled above, their difference below.
    """
    label = "measured, ± 2 standard errors"
    for axis, partner in sorted({(value.axis, value.partner) for value in values}):
        chosen = [
            (number, value)
            for number, value in enumerate(values, start=1)
            if (value.axis, value.partner) == (axis, partner)
        ]
        x, ids = [number for number, _ in chosen], [value.id for _, value in chosen]
        measured, error = np.array([value.shown for _, value in chosen]).T
        model = np.array([value.model for _, value in chosen])
        error = 2.0 * np.nan_to_num(error)
        unit = kind.unit_of(robot, axis, partner)
        yield Panel(
            items=(
                Line(x, model, width=0.7, opacity=0.6),
                Points(x, model, "ring", MODEL, "modelled", size=3.2),
                Points(x, measured, label=label, error=error, ids=ids),
            ),
            title=f"${kind.element(axis, partner)}$",
            x_label="configuration number",
            y_label=f"{kind.quantity} [{unit}]",
            whole=True,
            below=Panel(
                items=(Rule(0.0, colour=MODEL), Points(x, measured - model, error=error, ids=ids)),
                y_label=f"Δ [{unit}]",
                height=48.0,
            ),
        )


def residuals(estimate: Estimate, planned: Mapping[str, ElementMeasurement]) -> Iterator[Panel]:
    """Draw the residual torque of every measurement.

    Parameters
    ----------
    planned : mapping
        Measurements by their id.
    """
    number = {value.id: k for k, value in enumerate(estimate.local, start=1)}
    points = []
    for name, kind in ELEMENT_KINDS.items():
        values = [value for value in estimate.local if value.kind == name]
        # relative to the axis's torque limit, eq. (16)
        torques = [(v.shown[0] - v.model) * planned[v.id].torque_per_element for v in values]
        limits = (float(estimate.robot.torque_limit[value.axis]) for value in values)
        relative = [100 * (each / limit) for each, limit in zip(torques, limits, strict=True)]
        places, ids = [number[value.id] for value in values], [value.id for value in values]
        points.append(Points(places, relative, kind.marker, kind.colour, name, ids=ids, size=2.6))
    yield Panel(
        (Rule(0.0), *points),
        x_label="measurement, in the plan's order",
        y_label="measured − modelled [% of torque limit]",
        whole=True,
        width=1000.0,
        height=220.0,
    )
