"""The plot that a campaign's report begins with: how far its parameters are certain, in torques."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.least_squares.uncertainty import TWICE
from hil.model.base_parameters import base_parameters
from hil.report.charts.chart import Chart, Panel, Points, Rule
from hil.report.charts.colours import MODEL
from hil.results.rounding import percent

if TYPE_CHECKING:
    from hil.results.model import Model
    from hil.results.prediction import Prediction

ROW = 19.0
"""Height of a parameter's row."""


def intervals(model: Model, check: Model | None, prediction: Prediction) -> Chart:
    """Draw 95 % intervals of all parameters, and where the published method has them.

    A kg m² matters more on a wrist than on a shoulder: what a parameter is off by is shown as the
    torque that it makes on a free motion, relative to the axis's, on the axis where it is most.
    """
    base = base_parameters(model.robot)
    order = [k for members in base.groups.values() for k in members]
    effect = 100 * np.nan_to_num(prediction.relative_effect).max(axis=0)
    interval = model.interval(0.95)
    half = (interval[:, 1] - interval[:, 0]) / 2 / model.standard_errors * effect
    rows = np.arange(len(order), 0, -1.0)
    checked: tuple[Points, ...] = ()
    if check is not None:
        off = (check.values - model.values) / model.standard_errors * effect
        checked = (Points(off[order], rows, "ring", MODEL, "by the published method", size=3.4),)
    torques = 100 * np.nan_to_num(prediction.relative)
    axes = np.arange(len(torques), 0, -1.0)
    return Chart(
        (
            Panel(
                (
                    Rule(0.0, upright=True),
                    Points(np.zeros(len(order)), rows, "o", error=half[order], along=True,
                           label="identified, with 95 % interval", size=2.6),
                    *checked,
                ),
                title="base parameters",
                x_label="effect on the torque of the axis where it is largest [%]",
                y_range=(0.3, len(order) + 0.7),
                rows={float(row): base.names[k] for row, k in zip(rows, order, strict=True)},
                width=530.0,
                height=max(ROW * len(order), 120.0),
            ),
            Panel(
                (Points(np.zeros(len(axes)), axes, "o", error=TWICE * torques, along=True,
                        size=2.6), Rule(0.0, upright=True)),
                title="torque of a free motion",
                x_label="interval of 95 % [% of the torque]",
                y_range=(0.3, len(axes) + 0.7),
                rows={
                    float(row): f"axis {k}: ± {percent(TWICE * torque, 100.0)} %"
                    for k, (row, torque) in enumerate(zip(axes, torques, strict=True), start=1)
                },
                width=420.0,
                left=110.0,
                height=max(ROW * len(order), 120.0),
            ),
        )
    )  # fmt: skip
