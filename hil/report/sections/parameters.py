"""Sections of parameters: values, intervals, methods, excluded causes, and results of imports.

For imported axes moving back and forth alone, half-sums and half-differences are drawn.

Elements of g(q) and M(q) are drawn measured and modelled, with residuals (the paper's Figs. 5 and
6). Measured values are blue with error bars of two standard errors, modelled ones orange. Residuals
are drawn over all measurements, and over joint angles.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from hil.commands.diagnose import residuals_over_angles
from hil.errors import FileError
from hil.estimation.identify import JOINT
from hil.model.base_parameters import base_parameters
from hil.planning.measurement import ELEMENT_KINDS, element_measurements
from hil.results.model import Model
from hil.results.model_file import NAME
from hil.results.tables import excluded as causes
from hil.results.tables import parameters as tables
from hil.results.tables.friction import campaign_friction
from hil.show.charts.chart import INK, MODEL, Line, Panel, Points, Rule, ordered_colours
from hil.show.outcome import Plot, Section

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from hil.arrays import Array
    from hil.estimation.back_and_forth.description import HalfSums
    from hil.estimation.back_and_forth.result import FrictionCurve
    from hil.estimation.estimate import Estimate
    from hil.estimation.excluded.result import Excluded, Limit
    from hil.estimation.local_fits import LocalValue
    from hil.model.robot import Robot
    from hil.planning.measurement import ElementKind, ElementMeasurement
    from hil.report.reported_run import ReportedRun
    from hil.runs.run import Run
    from hil.show.charts.chart import Item


LEAST = 1e-3
"""Lower end of the axis [%]: a tenth of the smallest detectable torque of measured campaigns."""


def parameters(run: ReportedRun) -> Section | None:
    """Create the section of base parameters by group, with intervals as torques."""
    if run.found.effect is None:
        return None
    plot = Plot(
        "intervals",
        partial(intervals, run.model, run.found.check, run.found.effect),
        "Intervals of 95 % of all base parameters, as shares of the torque of a free motion.",
        "95 % intervals of the base parameters, as torque errors on an exciting trajectory, in % "
        "of the torque of the axis with the largest error.",
    )
    return Section(
        "Base parameters",
        "parameters.html",
        {
            "parameters": tables.parameters(run.model, in_full=True),
            "lengths": run.robot.file.lengths,
            "model_note": _model_note(run.source),
        },
        (plot,),
    )


def _model_note(run: Run) -> str:
    path = run.path / NAME
    if not path.exists():
        return f"No {NAME} yet; hil identify writes these parameters there."
    try:
        origin = Model.load(path).provenance
    except FileError as error:
        return f"{NAME} cannot be used: {error}"
    if origin.together_with:
        alone = "as here" if origin.method == JOINT else "here only this run is used"
        return (
            f"{NAME} was identified from this run together with {', '.join(origin.together_with)};"
            f" {alone}."
        )
    return f"{NAME} holds the parameters of the same method, with their covariance."


def methods(run: ReportedRun) -> Section | None:
    """Create the section of parameters by both methods."""
    if run.found.check is None:
        return None
    values = {
        "methods": tables.methods(run.model, run.found.check),
        "disagreement": tables.DISAGREEMENT,
    }
    return Section("Improved and published method", "methods.html", values)


def intervals(model: Model, check: Model | None, effect: Array) -> Iterator[Panel]:
    """Draw 95 % intervals of the parameters, and the values of the published method.

    A kg m² matters more on a wrist than on a shoulder: errors are shown as torques on a free
    motion, relative to the axis's torque, on the axis where they are largest.
    """
    base = base_parameters(model.robot)
    order = [k for members in base.groups.values() for k in members]
    most = 100 * effect.max(axis=0)
    interval = model.interval(0.95)
    half = (interval[:, 1] - interval[:, 0]) / 2 / model.standard_errors * most
    rows = np.arange(len(order), 0, -1.0)
    checked: tuple[Points, ...] = ()
    if check is not None:
        off = (check.values - model.values) / model.standard_errors * most
        checked = (Points(off[order], rows, "ring", MODEL, "by the published method", size=3.4),)
    items: tuple[Item, ...] = (
        Rule(0.0, upright=True),
        Points(np.zeros(len(order)), rows, "o", error=half[order], along=True,
               label="identified, with 95 % interval", size=2.6),
        *checked,
    )  # fmt: skip
    yield Panel(
        items,
        x_label="effect on the torque of the most affected axis [%]",
        y_range=(0.3, len(order) + 0.7),
        rows={float(row): base.titles[k] for row, k in zip(rows, order, strict=True)},
        width=780.0,
        left=260.0,
        height=max(21.0 * len(order), 120.0),
    )


def excluded(run: ReportedRun) -> Section | None:
    """Create the section of excluded causes: findings, detectable sizes and torques."""
    proof, n_joints = run.model.excluded, run.robot.n_joints
    if proof is None:
        return None
    plot = Plot(
        "excluded",
        partial(dots, proof, n_joints),
        "Largest undetected torque by each cause, for each axis.",
        "Largest undetected torque by each cause, for each axis, in % of the axis's recorded "
        "torque. Rings: causes invisible in these recordings, at their usual size.",
    )
    values = {
        "excluded": causes.excluded(proof, n_joints),
        "sentences": tuple(causes.sentences(proof)),
    }
    return Section("What is excluded", "excluded.html", values, (plot,))


def dots(proof: Excluded, n_joints: int) -> Iterator[Panel]:
    """Draw the largest undetected torques by cause and axis."""
    drawn = [
        each
        for each in proof.limits
        if 100.0 * each.unnoticed > LEAST and (each.cause, each.axis) not in proof.places
    ]
    names = list(dict.fromkeys(map(_name, drawn)))
    most, colours = (
        max([100.0, *(100.0 * each.unnoticed for each in drawn)]),
        ordered_colours(n_joints),
    )
    items: list[Item] = []
    for each in sorted(drawn, key=lambda each: each.axis):
        # axis 1 at the top of a row, no axis in the middle
        row, torque = len(names) - names.index(_name(each)), 100.0 * each.unnoticed
        at = row + (0.35 - 0.7 * (each.axis - 0.5) / n_joints if each.axis else 0.0)
        colour = colours[each.axis - 1] if each.axis else INK
        label = f"axis {each.axis}" if each.axis else "all axes"
        items.append(
            Points([torque], [at], "ring", INK, "invisible", size=2.4)
            if each.size is None
            else Points([torque], [at], "o", colour, label, size=3.0)
        )
    yield Panel(
        items,
        x_label="largest undetected torque [%]",
        x_range=(LEAST, most),
        y_range=(0.4, len(names) + 0.6),
        rows={float(len(names) - k): name for k, name in enumerate(names)},
        decades=True,
        width=760.0,
        left=150.0,
        height=max(30.0 * len(names), 120.0),
    )


def _name(limit: Limit) -> str:
    return f"{limit.cause} {limit.part}".strip()


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
    plot = Plot(
        "half-sums",
        partial(draw_half_sums, run.estimate.half_sums, run.robot),
        "Torque of the rigid bodies over the position of each axis, measured and modelled.",
        "Gravity and, during acceleration, inertia: half-sum of forward and backward torque over "
        "the position, less effects that differ by direction. Means over the pairs with standard "
        "errors, for the recordings of the longest strokes, one colour each; lines: model.",
    )
    plots = (plot,) if run.estimate.half_sums else ()
    return Section("Parameters, friction and torques", "identified.html", values, plots)


def draw_half_sums(half_sums: Sequence[HalfSums], robot: Robot) -> Iterator[Panel]:
    """Draw measured and modelled torques of the rigid bodies over position, by axis.

    The six recordings with the longest strokes are shown per axis.
    """
    axes = sorted({each.axis for each in half_sums})
    for axis in axes:
        own = (each for each in half_sums if each.axis == axis)
        longest = sorted(own, key=lambda each: -float(np.ptp(each.q)))[:6]
        items: list[Item] = []
        for each, colour in zip(longest, ordered_colours(len(longest)), strict=True):
            error = np.nan_to_num(each.standard_error)
            items += (
                Points(each.q, each.measured, "o", colour, error=error, size=1.6),
                Line(each.q, each.model, colour),
            )
        yield Panel(
            tuple(items),
            title=f"axis {axis + 1}",
            x_label=f"position [{robot.position_unit(axis)}]",
            y_label=_torque(robot, axis),
        )


def friction_curves(curves: Sequence[FrictionCurve], robot: Robot) -> Iterator[Panel]:
    """Draw friction over speed, by axis."""
    for curve in curves:
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
        yield Panel(
            tuple(items),
            title=f"axis {curve.axis}",
            x_label=f"speed [{robot.position_unit(axis)}/s]",
            y_label=_torque(robot, axis),
            x_range=(0.0, 1.05 * float(speed.max())),
            y_range=(low, high + 0.08 * (high - low)),
        )


def _torque(robot: Robot, axis: int) -> str:
    return "torque [N m]" if robot.revolute[axis] else "force [N]"


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
