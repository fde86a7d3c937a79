"""The identified base parameters, and what `model.yaml` has to do with them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.errors import FileError
from hil.report.section import Section
from hil.results.model import Model
from hil.results.model_file import NAME
from hil.results.tables.parameters import parameters

if TYPE_CHECKING:
    from hil.report.reported_run import IdentifiedRun
    from hil.runs.run import Run


def section(run: IdentifiedRun) -> Section:
    """Base parameters by group."""
    return Section(
        "Base parameters",
        "parameters.html",
        {
            "parameters": parameters(run.model, run.prediction),
            "lengths": run.robot.file.lengths,
            "model_note": _model_note(run.source),
        },
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
    if origin.method != "improved":
        return (
            f"{NAME} holds the parameters of the {origin.method} method, not these; hil identify"
            " writes it anew."
        )
    return f"{NAME} holds the parameters of the same method, with their covariance."
