"""Plots of what is found beside the parameters: residuals over angles, Fig. 7, loads.

Call and save them within `hil.report.plots.style.drawn`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, MultipleLocator

from hil.report.plots.style import (
    INK,
    MEASURED,
    MODEL,
    MUTED,
    WIDTH,
    fixed_grid,
    legend,
    panels_in_rows,
)
from hil.results.rounding import signed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from hil.estimation.gravity_phase import Phase
    from hil.estimation.local_values import LocalValue
    from hil.planning.measurement import ElementKind
    from hil.results.payload_file import Element

    Array = NDArray[np.float64]

_ROW = 1.35
"""Height of a row of panels [inch]."""
_LONG = 40
"""Letters from which on names do not go into a legend."""
_NARROW = 4.0
"""Angles that are shown at least [deg]."""


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
            _residuals(panel, own, left - mean, joint)
        row[0].set_ylabel(f"Δ${kind.element(axis, axis)}$ [{kind.unit}]")
        row[0].set_title(f"mean {signed(f'{mean:.2g}')} {kind.unit} taken off",
                         fontweight="normal", fontsize=8, color=MUTED)  # fmt: skip
    for joint, panel in enumerate(panels[-1]):
        panel.set_xlabel(f"$q_{{{joint + 1}}}$ [deg]")
        _scale(panel)
    figure.align_ylabels(panels[:, 0])
    legend(figure, panels[0][0])
    return figure


def _residuals(panel: Axes, values: Sequence[LocalValue], left: Array, joint: int) -> None:
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


def shifted_sinusoid(phase: Phase, found: str) -> Figure:
    """The paper's Fig. 7: a gravity torque by the robot file and by what was `found`."""
    figure, grid = fixed_grid(0.75 * WIDTH, 3.6, 1, 1)
    panel = figure.add_subplot(grid[0])
    angle = np.linspace(-np.pi, np.pi, 181)
    panel.plot(np.degrees(angle), phase.stated.at(angle), "--", color=MODEL,
               label="robot file")  # fmt: skip
    panel.plot(np.degrees(angle), phase.extended.at(angle), color=MODEL,
               label=f"with {found if len(found) < _LONG else 'what was found'}")  # fmt: skip
    error = 2.0 * np.nan_to_num(phase.standard_error)
    panel.errorbar(np.degrees(phase.angle), phase.torque, error, fmt="x", color=MEASURED,
                   markersize=4.5, elinewidth=0.9, label="measured")  # fmt: skip
    panel.set_xticks(range(-180, 181, 60))
    panel.set_xlabel(f"$q_{{{phase.over + 1}}}$ [deg]")
    panel.set_ylabel(f"$g_{{{phase.axis + 1}}}$ [N m]")
    shift = signed(f"{np.degrees(phase.shift):.1f}")
    panel.set_title(f"phase offset {shift}°", color=INK)
    legend(figure, panel)
    return figure


def with_and_without_load(
    without: Sequence[Element], loaded: Sequence[Element], kind: ElementKind
) -> Figure:
    """The paper's Figs. 5 and 6: elements of both runs over configuration number.

    Parameters
    ----------
    without, loaded : sequence of Element
    kind : ElementKind
        Of the elements that are drawn.
    """
    runs = [[each for each in run if each.kind == kind.name] for run in (without, loaded)]
    axes = sorted({each.axis for run in runs for each in run})
    figure, panels = panels_in_rows(len(axes), height=2.3)
    for axis, (panel,) in zip(axes, panels, strict=True):
        for run, colour, mark, line, told in zip(
            runs, (MUTED, MEASURED), ("o", "x"), ("-", "--"), ("without", "with"), strict=True
        ):
            x = [k for k, each in enumerate(run, start=1) if each.axis == axis]
            own = [each for each in run if each.axis == axis]
            panel.plot(x, [each.model for each in own], line, color=MODEL, linewidth=0.9,
                       label=f"model {told} load")  # fmt: skip
            panel.plot(x, [each.value for each in own], mark, color=colour, markersize=4,
                       markerfacecolor="none", label=f"measured {told} load")  # fmt: skip
        panel.set_title(f"${kind.element(axis - 1, axis - 1)}$", fontsize=11)
        panel.set_xlabel("configuration number")
        panel.set_ylabel(kind.label)
        panel.margins(y=0.12)
        panel.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    if panels:
        legend(figure, panels[0][0])
    return figure
