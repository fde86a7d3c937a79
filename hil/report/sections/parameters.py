"""The identified base parameters, and what `model.yaml` has to do with them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError, load_yaml
from hil.report.section import Section
from hil.results.model_file import NAME, ModelFile
from hil.results.tables.parameters import parameters

if TYPE_CHECKING:
    from hil.report.reported_run import IdentifiedRun
    from hil.runs.run_folder import RunFolder


def section(run: IdentifiedRun) -> Section:
    """Base parameters by group."""
    return Section(
        "Base parameters",
        "parameters.html",
        {
            "parameters": parameters(run.estimate, run.robot, run.prediction),
            "lengths": run.robot.file.lengths,
            "model_note": _model_note(run.folder),
        },
    )


def _model_note(folder: RunFolder) -> str:
    path = folder.path / NAME
    if not path.exists():
        return f"There is no {NAME} yet; hil identify writes these parameters into one."
    try:
        origin = load_yaml(path, ModelFile).provenance
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
