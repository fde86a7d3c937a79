"""The plots of what a model leaves of the measurements: over all of them, and over joint angles.

Call and save them within `hil.report.plots.style.plotting`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, MultipleLocator
from scipy import stats

from hil.planning.measurement import ELEMENT_KINDS
from hil.report.plots.style import MEASURED, MODEL, MUTED, WIDTH, fixed_grid, legend
from hil.results.rounding import signed

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate
    from hil.estimation.local_values import LocalValue
    from hil.model.robot import Robot
    from hil.planning.measurement import ElementKind, ElementMeasurement

    Array = NDArray[np.float64]

_ROW = 1.35
"""Height of a row of panels [inch]."""
_NARROW = 4.0
"""Angles that are shown at least [deg]."""


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


def residuals_over_angles(values: Sequence[LocalValue], n_joints: int, kind: ElementKind) -> Figure:
    """Measured less modelled elements of every axis against every joint angle.

    What is the same at all configurations of an axis is taken off: it is friction that differs by
    direction, or that step 1 takes for part of the element, and hides what depends on angles.

    Parameters
    ----------
    values : sequence of LocalValue
        Of one kind.
    kind : ElementKind
        Theirs.
    """
    axes = sorted({value.axis for value in values})
    rows = max(len(axes), 1)
    height = 0.95 + _ROW * rows
    figure = Figure(figsize=(WIDTH, height))
    panels = figure.subplots(
        rows, n_joints, squeeze=False, sharey="row", sharex="col",
        gridspec_kw={
            "left": 0.075, "right": 0.99, "bottom": 0.5 / height, "top": 1 - 0.5 / height,
            "wspace": 0.1, "hspace": 0.32,
        },
    )  # fmt: skip
    for axis, row in zip(axes, panels, strict=False):
        own = [value for value in values if value.axis == axis]
        left = np.array([value.value - value.model for value in own])
        mean = float(left.mean())
        for joint, panel in enumerate(row):
            _over_angle(panel, own, left - mean, joint)
        row[0].set_ylabel(f"Δ${kind.element(axis, axis)}$ [{kind.unit}]")
        row[0].set_title(f"mean {signed(f'{mean:.2g}')} {kind.unit} taken off",
                         fontweight="normal", fontsize=8, color=MUTED)  # fmt: skip
    for joint, panel in enumerate(panels[-1]):
        panel.set_xlabel(f"$q_{{{joint + 1}}}$ [deg]")
        _scale(panel)
    figure.align_ylabels(panels[:, 0])
    legend(figure, panels[0][0])
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
    normal = stats.norm.ppf((np.arange(len(left)) + 0.5) / max(len(left), 1))
    return np.asarray(normal, dtype=np.float64), np.sort(left)


def _over_angle(panel: Axes, values: Sequence[LocalValue], left: Array, joint: int) -> None:
    angle = np.degrees([value.q[joint] for value in values])
    error = 2.0 * np.nan_to_num([value.standard_error for value in values])
    panel.axhline(0.0, color=MODEL, linewidth=0.9)
    panel.errorbar(angle, left, error, fmt="x", color=MEASURED, markersize=3.5, elinewidth=0.7,
                   label="measured − modelled, ± 2 standard errors")  # fmt: skip
    panel.margins(x=0.08, y=0.12)
    panel.yaxis.set_major_locator(MaxNLocator(4))


def _scale(panel: Axes) -> None:
    """Ticks at right angles; a joint that hardly moved is not blown up."""
    low, high = panel.get_xlim()
    if high - low < _NARROW:
        panel.set_xlim((low + high - _NARROW) / 2, (low + high + _NARROW) / 2)
        panel.xaxis.set_major_locator(MaxNLocator(3))
    else:
        panel.xaxis.set_major_locator(MultipleLocator(180 if high - low > 340 else 90))
