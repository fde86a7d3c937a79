"""The plots of a report, each a function from evidence to a matplotlib figure.

What was measured is blue with error bars of two standard errors, what the model says is orange,
wherever both appear. Call and save them within `hil.report.plots.style.drawn`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy import stats

from hil.estimation.local_fits import REFERENCE_SPEED
from hil.model.base_parameters import base_parameters
from hil.planning.measurement import ELEMENT_KINDS
from hil.report.plots.findings import residuals_over_angles
from hil.report.plots.style import (
    INK,
    MEASURED,
    MODEL,
    MUTED,
    WIDTH,
    align_label,
    fixed_grid,
    legend,
    panels_in_rows,
)
from hil.results.rounding import signed

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate
    from hil.estimation.local_values import LocalValue
    from hil.model.robot import Robot
    from hil.planning.measurement import ElementKind, ElementMeasurement

    Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """What plots are drawn from.

    Attributes
    ----------
    estimate : Estimate
    robot : Robot
    planned : mapping
        Measurements by their id.
    """

    estimate: Estimate
    robot: Robot
    planned: Mapping[str, ElementMeasurement]

    def of_kind(self, kind: str) -> list[LocalValue]:
        """Local values of one kind, in the order of the plan."""
        return [value for value in self.estimate.local if value.kind == kind]


def measured_elements(kind: ElementKind, evidence: Evidence) -> Figure:
    """Elements of g(q) or M(q) as measured against those of the model: the paper's Figs. 5 and 6.

    One panel an element: measured and modelled above, their difference below.
    """
    values = evidence.of_kind(kind.name)
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
        above.set_ylabel(kind.label)
        below.set_ylabel(f"Δ [{kind.unit}]")
        below.set_xlabel("configuration number")
        for panel in (above, below):
            align_label(figure, panel)
    if panels:
        legend(figure, panels[0][0])
    return figure


def over_angles(kind: ElementKind, evidence: Evidence) -> Figure:
    """Residuals of a kind against every joint angle: the paper's Fig. 7 if of gravity."""
    return residuals_over_angles(evidence.of_kind(kind.name), evidence.robot.n_joints, kind)


def friction_levels(evidence: Evidence) -> Figure:
    """Friction of every axis over the campaign, as step 1 finds it by the way."""
    local = evidence.estimate.local
    axes = sorted({value.axis for value in local})
    figure, panels = panels_in_rows(len(axes), height=2.1)
    last = max((value.time for value in local), default=0.0) / 60
    for axis, (panel,) in zip(axes, panels, strict=True):
        values = [value for value in local if value.axis == axis]
        for name, kind in ELEMENT_KINDS.items():
            chosen = [value for value in values if value.kind == name]
            minutes = [value.time / 60 for value in chosen]
            levels = [value.friction for value in chosen]
            panel.plot(minutes, levels, kind.marker, color=kind.colour, markersize=3.6,
                       markerfacecolor="white" if kind.pair else kind.colour,
                       label=_friction_label(kind))  # fmt: skip
        panel.set_title(f"axis {axis + 1}")
        panel.set_xlabel("robot time [min]")
        panel.set_ylabel("friction [N m]")
        panel.set_xlim(-0.02 * last, 1.02 * last)
        panel.margins(y=0.15)
    legend(figure, panels[0][0])
    return figure


def residuals(evidence: Evidence) -> Figure:
    """What the model leaves of every measurement, as torque; and how normal that is."""
    figure, grid = fixed_grid(WIDTH, 3.4, 1, 2, ratios=(2.2, 1.0))
    left, right = figure.add_subplot(grid[0]), figure.add_subplot(grid[1])
    number = {value.id: k for k, value in enumerate(evidence.estimate.local, start=1)}
    for name, kind in ELEMENT_KINDS.items():
        values = evidence.of_kind(name)
        left.plot([number[value.id] for value in values],
                  [100 * _relative_residual(evidence, value) for value in values],
                  kind.marker, color=kind.colour, markersize=3.6, label=name)  # fmt: skip
        normal, ordered = _quantiles(evidence, values)
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


def correlations(evidence: Evidence) -> Figure:
    """Correlation matrix of the parameters' errors, parameters in the order of their groups."""
    base = base_parameters(evidence.robot)
    order = [k for members in base.groups.values() for k in members]
    found = evidence.estimate.correlation[np.ix_(order, order)]
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


PLOTS: dict[str, Callable[[Evidence], Figure]] = {
    **{name: partial(measured_elements, kind) for name, kind in ELEMENT_KINDS.items()},
    "friction": friction_levels,
    "residuals": residuals,
    **{
        f"{name}-angles": partial(over_angles, kind)
        for name, kind in ELEMENT_KINDS.items()
        if not kind.pair
    },
    "correlation": correlations,
}
"""All of them by name, in the order of a report."""


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


def _friction_label(kind: ElementKind) -> str:
    speed = "creep speed" if kind.pair else f"{REFERENCE_SPEED:.0%} of the speed limit"
    return f"{kind.name}, at {speed}"


def _relative_residual(evidence: Evidence, value: LocalValue) -> float:
    """Measured less modelled as a torque over the axis's limit, eq. (16)."""
    scale = evidence.planned[value.id].torque_per_element
    return float((value.value - value.model) * scale / evidence.robot.torque_limit[value.axis])


def _quantiles(evidence: Evidence, values: Sequence[LocalValue]) -> tuple[Array, Array]:
    """Residuals of a kind, each axis's standardised, in order, and where normal ones would be."""
    left = np.array([_relative_residual(evidence, value) for value in values])
    axis = np.array([value.axis for value in values])
    for a in set(axis.tolist()):
        own = left[axis == a]
        scatter = own.std(ddof=1) if len(own) > 1 else 0.0
        left[axis == a] = (own - own.mean()) / (scatter or 1.0)
    normal = stats.norm.ppf((np.arange(len(left)) + 0.5) / max(len(left), 1))
    return np.asarray(normal, dtype=np.float64), np.sort(left)
