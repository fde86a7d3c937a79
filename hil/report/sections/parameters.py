"""The identified base parameters, and what `model.yaml` has to do with them."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from hil.errors import FileError
from hil.report.plots.intervals import intervals
from hil.report.section import Plot, Section
from hil.results.model import Model
from hil.results.model_file import NAME
from hil.results.tables.parameters import parameters

if TYPE_CHECKING:
    from hil.report.reported_run import IdentifiedRun
    from hil.runs.run import Run


def section(run: IdentifiedRun) -> Section:
    """Base parameters by group, and what their intervals mean in torques."""
    plot = Plot(
        "intervals",
        partial(intervals, run.model, run.found.check, run.found.prediction),
        "Intervals of 95 % of all base parameters and of the torque of every axis, as shares of"
        " the torque of a free motion.",
        "How far the result is certain. Of each base parameter the interval by the torque that it"
        " makes on a free motion, relative to the torque of the axis where that is largest; of each"
        " axis what all parameters together leave uncertain of its torque.",
    )
    return Section(
        "Base parameters",
        "parameters.html",
        {
            "parameters": parameters(run.model, run.found.prediction),
            "lengths": run.robot.file.lengths,
            "model_note": _model_note(run.source),
        },
        (plot,),
        leads=True,
    )


def _model_note(run: Run) -> str:
    path = run.path / NAME
    if not path.exists():
        return f"There is no {NAME} yet; hil identify writes these parameters into one."
    try:
        origin = Model.load(path).provenance
    except FileError as error:
        return f"{NAME} cannot be used: {error}"
    if origin.together_with:
        return (
            f"{NAME} was identified from this run together with {', '.join(origin.together_with)};"
            " here the run stands alone."
        )
    return f"{NAME} holds the parameters of the same method, with their covariance."
