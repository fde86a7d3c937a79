"""The plots of a diagnosis, as files: residuals over angles, and the paper's Fig. 7."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.planning.measurement import ELEMENT_KINDS
from hil.report.plots.findings import residuals_over_angles, shifted_sinusoid
from hil.report.plots.style import drawn, image
from hil.runs.atomic_file import own_folder, write_file

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from hil.results.diagnosis import Diagnosis


def write_diagnosis_plots(run_folder: Path, found: Diagnosis) -> Path:
    """Draw residuals over angles and, where there is one, Fig. 7; return their folder."""
    place = run_folder / "diagnosis"
    own_folder(place)
    with drawn():
        for name, figure in _figures(found).items():
            write_file(place / f"{name}.svg", image(figure, "svg"))
    return place


def _figures(found: Diagnosis) -> dict[str, Figure]:
    local, n = found.estimate.local, found.robot.n_joints
    figures = {
        name: residuals_over_angles([v for v in local if v.kind == name], n, kind)
        for name, kind in ELEMENT_KINDS.items()
        if not kind.pair
    }
    if found.phase is not None:
        labels = ", ".join(c.label for c in found.errors.found)
        figures["phase"] = shifted_sinusoid(found.phase, labels)
    return figures
