"""Sections of base parameters: values, intervals, comparison of methods."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import FileError
from hil.estimation.identify import JOINT
from hil.model.base_parameters import base_parameters
from hil.results.model import Model
from hil.results.model_file import NAME
from hil.results.tables import parameters as tables
from hil.show.charts.chart import MODEL, Chart, Panel, Points, Rule, chart
from hil.show.section import Plot, Section

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.report.reported_run import ReportedRun
    from hil.runs.run import Run
    from hil.show.charts.chart import Item


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


def intervals(model: Model, check: Model | None, effect: Array) -> Chart:
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
    return chart(
        Panel(
            items,
            x_label="effect on the torque of the most affected axis [%]",
            y_range=(0.3, len(order) + 0.7),
            rows={float(row): base.titles[k] for row, k in zip(rows, order, strict=True)},
            width=780.0,
            left=260.0,
            height=max(21.0 * len(order), 120.0),
        )
    )
