"""A run's report: one HTML file with everything in it, made from the recordings alone.

It can be written again at any time, without hardware and without the network; what `hil identify`
wrote before is only mentioned. Plots are embedded as SVG. The text is in `templates/report.html`,
the figures that stand in it come from `hil.report.campaign_rows`. What `hil payload` and `hil
diagnose` found is shown as they wrote it (`hil.report.findings`).
"""

from __future__ import annotations

import base64
from pathlib import Path
from typing import TYPE_CHECKING

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from checked_files.yaml_file import FileError, load_yaml
from hil.estimation import signals
from hil.estimation.identify import NotIdentifiable, estimates
from hil.planning.measurement import ELEMENT_KINDS, element_measurements
from hil.regression import terms, window
from hil.report import campaign_rows, findings, findings_rows, friction
from hil.report.campaign_rows import Result
from hil.report.plots import campaign
from hil.report.plots.style import drawn, image
from hil.results.advice import advice
from hil.results.model_file import NAME as MODEL_NAME
from hil.results.model_file import ModelFile, recorded
from hil.results.prediction import predict
from hil.runs.atomic_file import operator_told, write_file
from hil.runs.journal import now, versions
from hil.runs.run_folder import RunFolder

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from hil.report.findings import Findings
    from hil.runs.recording_file import Measured

NAME = "report.html"
_TEMPLATES = Path(__file__).parent / "templates"


def report(run_folder: Path | str, figures: Path | None = None) -> Path:
    """Estimate a run anew by both methods and write its report into its folder.

    Parameters
    ----------
    figures : path, optional
        Folder for the plots as PNG files too; made if it is not there.

    Returns
    -------
    Path
        Of the report.

    Raises
    ------
    FileError
        No run folder, a damaged recording, measurements that do not suffice, a full disk.
    """
    folder = RunFolder.open(run_folder)
    if friction.friction_only(folder):
        return _friction(folder, figures)
    campaign = list(folder)
    result = _evaluate(folder, campaign)
    path = folder.path / NAME
    with drawn():
        shown = findings.of_campaign(folder, result.estimate)
        drawings = _draw(folder, result) | findings.drawings(shown)
        write_file(path, _html(folder, campaign, result, shown, drawings).encode())
        if figures is not None:
            _write_figures(figures, drawings)
    return path


def _friction(folder: RunFolder, figures: Path | None) -> Path:
    path = folder.path / NAME
    with drawn():
        html, drawings = friction.page(folder)
        write_file(path, html.encode())
        if figures is not None:
            _write_figures(figures, drawings)
    return path


def _evaluate(folder: RunFolder, campaign: Sequence[Measured]) -> Result:
    recordings = list(recorded(campaign))
    try:
        found = estimates(folder.robot, recordings)
    except NotIdentifiable as error:
        raise FileError(f"{folder.path}: {error}") from error
    best = found["improved"]
    prediction = predict(best, folder.robot)
    return Result(
        robot=folder.robot,
        estimate=best,
        printed=found["printed"],
        prediction=prediction,
        advice=advice(best, prediction, folder.robot, folder.plan, campaign),
        robot_time=max(float(recording.time[-1]) for _, recording in recordings),
    )


def _draw(folder: RunFolder, result: Result) -> dict[str, Figure]:
    planned = {each.id: each for each in element_measurements(folder.plan.measurements)}
    evidence = campaign.Evidence(result.estimate, folder.robot, planned)
    return {name: draw(evidence) for name, draw in campaign.PLOTS.items()}


def _html(
    folder: RunFolder,
    campaign: Sequence[Measured],
    result: Result,
    findings: Findings,
    drawings: dict[str, Figure],
) -> str:
    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters.update(symbols=campaign_rows.symbols, when=campaign_rows.when)
    return environment.get_template(NAME).render(
        result=result,
        folder=folder,
        journal=folder.journal,
        campaign=campaign,
        content=campaign_rows,
        kinds=ELEMENT_KINDS,
        plots={name: _data_uri(image(figure, "svg")) for name, figure in drawings.items()},
        model_note=_model_note(folder),
        findings=findings,
        findings_content=findings_rows,
        written=now(),
        version=versions()["canopen-robot-identification"],
        signals=signals,
        smoothing=window,
        columns=terms,
        **friction.of_campaign(folder, list(recorded(campaign)), result.estimate),
    )


def _data_uri(svg: bytes) -> str:
    return "data:image/svg+xml;base64," + base64.b64encode(svg).decode()


def _model_note(folder: RunFolder) -> str:
    """What `model.yaml` has to do with this report."""
    path = folder.path / MODEL_NAME
    if not path.exists():
        return f"There is no {MODEL_NAME} yet; hil identify writes these parameters into one."
    try:
        model = load_yaml(path, ModelFile)
    except FileError as error:
        return f"{MODEL_NAME} cannot be used: {error}"
    if model.provenance.together_with:
        return (
            f"{MODEL_NAME} was identified from this run together with"
            f" {', '.join(model.provenance.together_with)}; here the run stands alone."
        )
    if model.provenance.method != "improved":
        return (
            f"{MODEL_NAME} holds the parameters of the {model.provenance.method} method, not these;"
            " hil identify writes it anew."
        )
    return f"{MODEL_NAME} holds the parameters of the same method, with their covariance."


def _write_figures(folder: Path, drawings: dict[str, Figure]) -> None:
    with operator_told(folder, "made"):
        folder.mkdir(parents=True, exist_ok=True)
    for name, figure in drawings.items():
        write_file(folder / f"{name}.png", image(figure, "png"))
