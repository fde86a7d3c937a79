"""What the model leaves of the measurements, and how well it predicts torques."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from hil.planning.measurement import ELEMENT_KINDS, element_measurements
from hil.report.plots.residuals import residuals, residuals_over_angles
from hil.report.section import Plot, Section
from hil.results.tables import torques as tables

if TYPE_CHECKING:
    from hil.planning.measurement import ElementKind
    from hil.report.reported_run import IdentifiedRun


def section(run: IdentifiedRun) -> Section:
    """Residuals of all measurements, over angles too, and predicted torques."""
    kinds = {value.kind for value in run.estimate.local}
    over_angles = (
        _over_angles(name, kind, run)
        for name, kind in ELEMENT_KINDS.items()
        if name in kinds and not kind.pair
    )
    return Section(
        "Residuals and torques",
        "torques.html",
        {
            "residuals": tables.residuals(run.model),
            "predicted": tables.predicted(run.found.prediction, run.robot),
        },
        (_all(run), *over_angles) if kinds else (),
    )


def _all(run: IdentifiedRun) -> Plot:
    planned = {each.id: each for each in element_measurements(run.source.plan.measurements)}
    return Plot(
        "residuals",
        partial(residuals, run.estimate, run.robot, planned),
        "Residuals of all measurements as a share of torque limits, and their normal probability"
        " plot.",
        "Left: measured less modelled elements as torques (inertias times the acceleration they"
        " were measured with), relative to the axis's limit, eq. (16). Right: the same, centred and"
        " scaled by axis and kind; points far from the line are outliers.",
    )


def _over_angles(name: str, kind: ElementKind, run: IdentifiedRun) -> Plot:
    of_gravity = (
        " (Fig. 7 for all pairs). A pattern over an angle is something that the robot file leaves"
        " out; hil diagnose tests what."
    )
    return Plot(
        f"{name}-angles",
        partial(residuals_over_angles, run.local_values(name), run.robot, kind),
        f"Residuals of the {kind.elements} over the position of each joint that varied.",
        f"Residuals of the {kind.elements} against the position of every joint that varied"
        + (of_gravity if kind.symbol == "g" else "."),
    )
