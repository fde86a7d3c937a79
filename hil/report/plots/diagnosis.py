"""The plots of a diagnosis: the paper's Fig. 7, and as files residuals over angles too."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.planning.measurement import ELEMENT_KINDS
from hil.report.plots.residuals import residuals_over_angles
from hil.report.plots.style import (
    INK,
    MEASURED,
    MODEL,
    WIDTH,
    fixed_grid,
    image,
    legend,
    plotting,
)
from hil.results.rounding import signed
from hil.runs.atomic_file import own_folder, write_file

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from hil.estimation.gravity_phase import Phase
    from hil.model.robot import Robot
    from hil.results.diagnosis import Diagnosis

_LONG = 40
"""Letters from which on names do not go into a legend."""


def shifted_sinusoid(phase: Phase, found: str, robot: Robot) -> Figure:
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
    panel.set_ylabel(f"$g_{{{phase.axis + 1}}}$ [{robot.torque_unit(phase.axis)}]")
    shift = signed(f"{np.degrees(phase.shift):.1f}")
    panel.set_title(f"phase offset {shift}°", color=INK)
    legend(figure, panel)
    return figure


def write_diagnosis_plots(run_folder: Path, found: Diagnosis) -> Path:
    """Draw residuals over angles and, where there is one, Fig. 7; return their folder."""
    place = run_folder / "diagnosis"
    own_folder(place)
    with plotting():
        for name, figure in _figures(found).items():
            write_file(place / f"{name}.svg", image(figure, "svg"))
    return place


def _figures(found: Diagnosis) -> dict[str, Figure]:
    local = found.estimate.local
    figures = {
        name: residuals_over_angles([v for v in local if v.kind == name], found.robot, kind)
        for name, kind in ELEMENT_KINDS.items()
        if not kind.pair
    }
    if found.phase is not None:
        labels = ", ".join(c.label for c in found.errors.found)
        figures["phase"] = shifted_sinusoid(found.phase, labels, found.robot)
    return figures
