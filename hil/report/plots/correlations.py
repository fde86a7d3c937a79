"""The plot of how the errors of parameters are correlated.

Call and save it within `hil.report.plots.style.plotting`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from hil.model.base_parameters import base_parameters
from hil.report.plots.style import INK, WIDTH
from hil.results.rounding import signed

if TYPE_CHECKING:
    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot


def correlations(estimate: Estimate, robot: Robot) -> Figure:
    """Draw correlations of the parameters' errors, parameters in the order of their groups."""
    base = base_parameters(robot)
    order = [k for members in base.groups.values() for k in members]
    found = estimate.correlation[np.ix_(order, order)]
    n = len(order)
    figure = Figure(figsize=(0.58 * WIDTH, 0.48 * WIDTH))
    panel = figure.add_axes((0.08, 0.06, 0.76, 0.917))
    panel.grid(visible=False)
    shown = panel.imshow(found, cmap="RdBu_r", vmin=-1, vmax=1)
    names = [base.names[k] for k in order]
    panel.set_xticks(range(n), names, rotation=90 if n > 20 else 0)
    panel.set_yticks(range(n), names)
    panel.tick_params(length=0)
    panel.spines[:].set_visible(False)
    for i, j in np.ndindex(n, n):
        if n <= 20 and i != j and abs(found[i, j]) >= 0.05:
            panel.text(j, i, signed(f"{found[i, j]:.1f}"), ha="center", va="center", fontsize=6.5,
                       color="white" if abs(found[i, j]) > 0.6 else INK)  # fmt: skip
    figure.colorbar(shown, cax=figure.add_axes((0.88, 0.2, 0.025, 0.6)), label="correlation")
    return figure
