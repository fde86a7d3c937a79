"""The plot of how the errors of parameters are correlated."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.model.base_parameters import base_parameters
from hil.report.charts.chart import Chart, Matrix, Panel

if TYPE_CHECKING:
    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot


def correlations(estimate: Estimate, robot: Robot) -> Chart:
    """Draw correlations of the parameters' errors, parameters in the order of their groups."""
    base = base_parameters(robot)
    order = [k for members in base.groups.values() for k in members]
    found = Matrix(estimate.correlation[np.ix_(order, order)], [base.names[k] for k in order])
    size = max(300.0, min(26.0 * len(order), 700.0))
    return Chart((Panel((found,), x_label="correlation", width=size + 76.0, height=size),))
