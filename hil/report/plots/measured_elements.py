"""The plots of measured elements against those of the model: the paper's Figs. 5 and 6.

What was measured is blue with error bars of two standard errors, what the model says is orange,
wherever both appear. Call and save them within `hil.report.plots.style.plotting`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import MaxNLocator

from hil.report.plots.style import MEASURED, MODEL, align_label, legend, panels_in_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from hil.estimation.local_values import LocalValue
    from hil.model.robot import Robot
    from hil.planning.measurement import ElementKind


def measured_elements(values: Sequence[LocalValue], kind: ElementKind, robot: Robot) -> Figure:
    """Draw elements of g(q) or M(q) of one kind as measured against those of the model.

    One panel an element: measured and modelled above, their difference below.
    """
    keys = sorted({(value.axis, value.partner) for value in values})
    figure, panels = panels_in_rows(len(keys), height=2.7, strip=0.32)
    for (axis, partner), (above, below) in zip(keys, panels, strict=True):
        chosen = [
            (number, value)
            for number, value in enumerate(values, start=1)
            if (value.axis, value.partner) == (axis, partner)
        ]
        _measured_and_modelled(above, below, chosen)
        above.set_title(f"${kind.element(axis, partner)}$", fontsize=11)
        unit = kind.unit_of(robot, axis, partner)
        above.set_ylabel(f"{kind.quantity} [{unit}]")
        below.set_ylabel(f"Δ [{unit}]")
        below.set_xlabel("configuration number")
        for panel in (above, below):
            align_label(figure, panel)
    if panels:
        legend(figure, panels[0][0])
    return figure


def _measured_and_modelled(
    above: Axes, below: Axes, chosen: Sequence[tuple[int, LocalValue]]
) -> None:
    x = np.array([number for number, _ in chosen])
    measured = np.array([value.value for _, value in chosen])
    model = np.array([value.model for _, value in chosen])
    error = 2.0 * np.nan_to_num([value.standard_error for _, value in chosen])
    above.plot(x, model, color=MODEL, linewidth=0.6, alpha=0.6)
    above.plot(x, model, "o", color=MODEL, markersize=5, markerfacecolor="white", label="modelled")
    for panel, level in ((above, measured), (below, measured - model)):
        panel.errorbar(x, level, error, fmt="x", color=MEASURED, markersize=4.5, elinewidth=0.9,
                       label="measured, ± 2 standard errors")  # fmt: skip
    below.axhline(0.0, color=MODEL, linewidth=1.0)
    above.tick_params(labelbottom=False)
    below.xaxis.set_major_locator(MaxNLocator(6, integer=True))
