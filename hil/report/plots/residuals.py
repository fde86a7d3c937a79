"""The plots of what a model leaves of the measurements: over all of them, and over joint angles.

Call and save them within `hil.report.plots.style.plotting`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from scipy import special

from hil.planning.measurement import ELEMENT_KINDS
from hil.report.plots.columns import Column, draw_columns, label_columns
from hil.report.plots.style import MEASURED, MUTED, WIDTH, align_label, fixed_grid, legend
from hil.results.rounding import signed

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate
    from hil.estimation.local_values import LocalValue
    from hil.model.robot import Robot
    from hil.planning.measurement import ElementKind, ElementMeasurement

    Array = NDArray[np.float64]

_ROW = 1.35
"""Height of a row of panels [inch]."""


def residuals(
    estimate: Estimate, robot: Robot, planned: Mapping[str, ElementMeasurement]
) -> Figure:
    """Draw what the model leaves of every measurement, as torque; and how normal that is.

    Parameters
    ----------
    planned : mapping
        Measurements by their id.
    """
    figure, grid = fixed_grid(WIDTH, 3.4, 1, 2, ratios=(2.2, 1.0))
    left, right = figure.add_subplot(grid[0]), figure.add_subplot(grid[1])
    number = {value.id: k for k, value in enumerate(estimate.local, start=1)}
    for name, kind in ELEMENT_KINDS.items():
        values = [value for value in estimate.local if value.kind == name]
        relative = np.array([_relative(value, robot, planned[value.id]) for value in values])
        left.plot([number[value.id] for value in values], 100 * relative, kind.marker,
                  color=kind.colour, markersize=3.6, label=name)  # fmt: skip
        normal, ordered = _quantiles(relative, [value.axis for value in values])
        right.plot(normal, ordered, kind.marker, color=kind.colour, markersize=3.2)
    left.axhline(0.0, color=MUTED, linewidth=0.8)
    left.set_xlabel("measurement, in the plan's order")
    left.set_ylabel("measured − modelled [% of torque limit]")
    left.set_title("residuals of all measurements")
    right.axline((0.0, 0.0), slope=1.0, color=MUTED, linewidth=0.8)
    right.set_xlabel("quantile of the normal distribution")
    right.set_ylabel("residual, centred and scaled by axis")
    right.set_title("normal probability plot")
    legend(figure, left)
    return figure


def residuals_over_angles(values: Sequence[LocalValue], robot: Robot, kind: ElementKind) -> Figure:
    """Measured less modelled elements of every axis against every joint's position.

    What is the same at all configurations of an axis is taken off: it is friction that differs by
    direction, or that step 1 takes for part of the element, and hides what depends on angles.

    Parameters
    ----------
    values : sequence of LocalValue
        Of one kind.
    robot : Robot
    kind : ElementKind
        Theirs.
    """
    axes = sorted({value.axis for value in values})
    rows = max(len(axes), 1)
    height = 0.95 + _ROW * rows
    figure = Figure(figsize=(WIDTH, height))
    margins = {"left": 0.075, "right": 0.99, "bottom": 0.5 / height, "top": 1 - 0.5 / height}
    panels = figure.subplots(rows, squeeze=False, gridspec_kw={**margins, "hspace": 0.32})[:, 0]
    n_joints = robot.n_joints
    columns = [
        Column.of(k, [v.q[k] for v in values], turns=bool(robot.revolute[k]))
        for k in range(n_joints)
    ]
    for axis, panel in zip(axes, panels, strict=False):
        own = [value for value in values if value.axis == axis]
        left = np.array([value.value - value.model for value in own])
        mean = float(left.mean())
        error = 2.0 * np.nan_to_num([value.standard_error for value in own])
        angles = np.concatenate([c.place([v.q[c.joint] for v in own]) for c in columns])
        panel.errorbar(angles, np.tile(left - mean, n_joints), np.tile(error, n_joints), fmt="x",
                       color=MEASURED, markersize=3.5, elinewidth=0.7,
                       label="measured − modelled, ± 2 standard errors")  # fmt: skip
        draw_columns(panel, columns)
        unit = kind.unit_of(robot, axis, axis)
        panel.set_ylabel(f"Δ${kind.element(axis, axis)}$ [{unit}]")
        panel.set_title(f"mean {signed(f'{mean:.2g}')} {unit} taken off",
                        fontweight="normal", fontsize=8, color=MUTED)  # fmt: skip
        align_label(figure, panel, 0.66)
    label_columns(panels[-1], columns)
    legend(figure, panels[0])
    return figure


def _relative(value: LocalValue, robot: Robot, planned: ElementMeasurement) -> float:
    """Measured less modelled as a torque over the axis's limit, eq. (16)."""
    torque = (value.value - value.model) * planned.torque_per_element
    return float(torque / robot.torque_limit[value.axis])


def _quantiles(residual: Array, axes: Sequence[int]) -> tuple[Array, Array]:
    """Residuals of a kind, each axis's standardised, in order, and where normal ones would be."""
    left, axis = residual.copy(), np.array(axes)
    for a in set(axis.tolist()):
        own = left[axis == a]
        scatter = own.std(ddof=1) if len(own) > 1 else 0.0
        left[axis == a] = (own - own.mean()) / (scatter or 1.0)
    normal = special.ndtri((np.arange(len(left)) + 0.5) / max(len(left), 1))
    return np.asarray(normal, dtype=np.float64), np.sort(left)
