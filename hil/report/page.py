"""A run's report: one HTML file with everything in it, made from the recordings alone.

It can be written again at any time, without hardware and without the network; what `hil identify`
wrote before is only mentioned. Plots are embedded as SVG. The text is in `templates/report.html`,
the figures that stand in it come from `hil.report.campaign_rows`. What `hil payload` and `hil
diagnose` found is shown as they wrote it (`hil.report.findings`).
"""

from __future__ import annotations

import base64
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from hil.errors import FileError
from hil.estimation import signals
from hil.estimation.identify import estimates
from hil.planning.measurement import ELEMENT_KINDS, element_measurements
from hil.regression import terms, window
from hil.report import campaign_rows, findings, findings_rows, friction
from hil.report.campaign_rows import Result
from hil.report.plots import campaign
from hil.report.plots.style import drawn, image
from hil.results.advice import advice
from hil.results.model import Model
from hil.results.model_file import NAME as MODEL_NAME
from hil.results.naming import named
from hil.results.prediction import predict
from hil.runs.atomic_file import file_errors, write_file
from hil.runs.journal import now, versions
from hil.runs.pooling import recorded

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from hil.planning.measurement import Measurement
    from hil.report.findings import Findings
    from hil.runs.recording import Recording
    from hil.runs.recording_file import Measured
    from hil.runs.run import Run

    Recordings = Sequence[tuple[Measurement, Recording]]

NAME = "report.html"
_TEMPLATES = Path(__file__).parent / "templates"


def report(run: Run, figures: Path | None = None) -> Path:
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
        A damaged recording, or a full disk.
    NotIdentifiable
        Measurements that do not suffice.
    """
    campaign = list(run)
    recordings = list(recorded(campaign))
    if friction.friction_only(run):
        return _friction(run, recordings, figures)
    result = _evaluate(run, campaign, recordings)
    path = run.path / NAME
    with drawn():
        shown = findings.of_campaign(run, result.estimate)
        drawings = _draw(run, result) | findings.drawings(shown)
        about = friction.of_campaign(run, recordings, result.estimate)
        write_file(path, _html(run, campaign, result, shown, drawings, about).encode())
        if figures is not None:
            _write_figures(figures, drawings)
    return path


def _friction(run: Run, recordings: Recordings, figures: Path | None) -> Path:
    path = run.path / NAME
    with drawn():
        html, drawings = friction.page(run, recordings)
        write_file(path, html.encode())
        if figures is not None:
            _write_figures(figures, drawings)
    return path


def _evaluate(run: Run, campaign: Sequence[Measured], recordings: Recordings) -> Result:
    with named(run):
        found = estimates(run.robot, recordings)
    best = found["improved"]
    prediction = predict(best, run.robot)
    return Result(
        robot=run.robot,
        estimate=best,
        printed=found["printed"],
        prediction=prediction,
        advice=advice(best, prediction, run.robot, run.plan, campaign),
        robot_time=max(float(recording.time[-1]) for _, recording in recordings),
    )


def _draw(run: Run, result: Result) -> dict[str, Figure]:
    planned = {each.id: each for each in element_measurements(run.plan.measurements)}
    evidence = campaign.Evidence(result.estimate, run.robot, planned)
    return {name: draw(evidence) for name, draw in campaign.PLOTS.items()}


def _html(
    run: Run,
    campaign: Sequence[Measured],
    result: Result,
    findings: Findings,
    drawings: dict[str, Figure],
    about_friction: dict[str, Any],
) -> str:
    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters.update(symbols=campaign_rows.symbols, when=campaign_rows.when)
    return environment.get_template(NAME).render(
        result=result,
        folder=run,
        journal=run.journal,
        campaign=campaign,
        content=campaign_rows,
        kinds=ELEMENT_KINDS,
        plots={name: _data_uri(image(figure, "svg")) for name, figure in drawings.items()},
        model_note=_model_note(run),
        findings=findings,
        findings_content=findings_rows,
        written=now(),
        version=versions()["canopen-robot-identification"],
        signals=signals,
        smoothing=window,
        columns=terms,
        **about_friction,
    )


def _data_uri(svg: bytes) -> str:
    return "data:image/svg+xml;base64," + base64.b64encode(svg).decode()


def _model_note(run: Run) -> str:
    """What `model.yaml` has to do with this report."""
    path = run.path / MODEL_NAME
    if not path.exists():
        return f"There is no {MODEL_NAME} yet; hil identify writes these parameters into one."
    try:
        origin = Model.load(path).provenance
    except FileError as error:
        return f"{MODEL_NAME} cannot be used: {error}"
    if origin.together_with:
        return (
            f"{MODEL_NAME} was identified from this run together with"
            f" {', '.join(origin.together_with)}; here the run stands alone."
        )
    if origin.method != "improved":
        return (
            f"{MODEL_NAME} holds the parameters of the {origin.method} method, not these;"
            " hil identify writes it anew."
        )
    return f"{MODEL_NAME} holds the parameters of the same method, with their covariance."


def _write_figures(folder: Path, drawings: dict[str, Figure]) -> None:
    with file_errors(folder, "made"):
        folder.mkdir(parents=True, exist_ok=True)
    for name, figure in drawings.items():
        write_file(folder / f"{name}.png", image(figure, "png"))
