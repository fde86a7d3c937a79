"""The plots of a diagnosis: the paper's Fig. 7, and as files residuals over angles too."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.planning.measurement import ELEMENT_KINDS
from hil.report.charts.chart import Chart, Line, Panel, Points
from hil.report.charts.colours import MODEL
from hil.report.charts.file import file
from hil.report.plots.residuals import residuals_over_angles
from hil.results.rounding import signed
from hil.runs.atomic_file import own_folder, write_file

if TYPE_CHECKING:
    from pathlib import Path

    from hil.estimation.gravity_phase import Phase
    from hil.model.robot import Robot
    from hil.results.diagnosis import Diagnosis

_LONG = 40
"""Letters from which on names do not go into a legend."""


def shifted_sinusoid(phase: Phase, found: str, robot: Robot) -> Chart:
    """The paper's Fig. 7: a gravity torque by the robot file and by what was `found`."""
    angle = np.linspace(-np.pi, np.pi, 181)
    shown = np.degrees(angle)
    name = found if len(found) < _LONG else "what was found"
    error = 2.0 * np.nan_to_num(phase.standard_error)
    return Chart(
        (
            Panel(
                (
                    Line(shown, phase.stated.at(angle), MODEL, "robot file", "5 3"),
                    Line(shown, phase.extended.at(angle), MODEL, f"with {name}"),
                    Points(np.degrees(phase.angle), phase.torque, error=error, label="measured"),
                ),
                title=f"phase offset {signed(f'{np.degrees(phase.shift):.1f}')}°",
                x_label=f"$q_{{{phase.over + 1}}}$ [deg]",
                y_label=f"$g_{{{phase.axis + 1}}}$ [{robot.torque_unit(phase.axis)}]",
                ticks={float(each): signed(f"{each}") for each in range(-180, 181, 60)},
                width=700.0,
                height=220.0,
            ),
        )
    )


def write_diagnosis_plots(run_folder: Path, found: Diagnosis) -> Path:
    """Draw residuals over angles and, where there is one, Fig. 7; return their folder."""
    place = run_folder / "diagnosis"
    own_folder(place)
    for name, chart in _charts(found).items():
        write_file(place / f"{name}.svg", file(chart))
    return place


def _charts(found: Diagnosis) -> dict[str, Chart]:
    local = found.estimate.local
    charts = {
        name: residuals_over_angles([v for v in local if v.kind == name], found.robot, kind)
        for name, kind in ELEMENT_KINDS.items()
        if not kind.pair
    }
    if found.phase is not None:
        labels = ", ".join(c.label for c in found.errors.found)
        charts["phase"] = shifted_sinusoid(found.phase, labels, found.robot)
    return charts
