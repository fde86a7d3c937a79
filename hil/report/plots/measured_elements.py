"""The plots of measured elements against those of the model: the paper's Figs. 5 and 6.

What was measured is blue with error bars of two standard errors, what the model says is orange,
wherever both appear.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.report.charts.chart import Chart, Line, Panel, Points, Rule
from hil.report.charts.colours import MODEL

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.estimation.local_values import LocalValue
    from hil.model.robot import Robot
    from hil.planning.measurement import ElementKind


def measured_elements(values: Sequence[LocalValue], kind: ElementKind, robot: Robot) -> Chart:
    """Draw elements of g(q) or M(q) of one kind as measured against those of the model.

    One panel an element: measured and modelled above, their difference below.
    """
    keys = sorted({(value.axis, value.partner) for value in values})
    numbered = list(enumerate(values, start=1))
    return Chart(
        tuple(
            _element([(k, v) for k, v in numbered if (v.axis, v.partner) == key], kind, robot)
            for key in keys
        )
    )


def _element(chosen: Sequence[tuple[int, LocalValue]], kind: ElementKind, robot: Robot) -> Panel:
    axis, partner = chosen[0][1].axis, chosen[0][1].partner
    x, ids = [number for number, _ in chosen], [value.id for _, value in chosen]
    measured = np.array([value.value for _, value in chosen])
    model = np.array([value.model for _, value in chosen])
    error = 2.0 * np.nan_to_num([value.standard_error for _, value in chosen])
    unit, label = kind.unit_of(robot, axis, partner), "measured, ± 2 standard errors"
    return Panel(
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
