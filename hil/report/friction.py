"""The report of a run about friction alone, and friction's part in that of a campaign."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from hil.errors import FileError, Mismatch
from hil.estimation.friction.history import history
from hil.estimation.friction.symmetry import BOUND, of_local_values
from hil.planning.measurement import Friction, recorded_as
from hil.report import friction_rows
from hil.report.campaign_rows import when
from hil.report.plots import friction
from hil.report.plots.style import image
from hil.results.friction import campaign_drifts, evaluate
from hil.results.friction_file import load_friction
from hil.runs.journal import now, versions

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from hil.estimation.estimate import Estimate
    from hil.planning.measurement import Measurement
    from hil.results.friction import FrictionResult
    from hil.runs.recording import Recording
    from hil.runs.run import Run

    Recordings = Sequence[tuple[Measurement, Recording]]

TEMPLATES = Path(__file__).parent / "templates"


def friction_only(run: Run) -> bool:
    """Whether a run measures nothing but friction."""
    return all(m.kind == "friction" for m in run.plan.measurements)


def page(run: Run, recordings: Recordings) -> tuple[str, dict[str, Figure]]:
    """HTML and plots of a run about friction alone; call within `plot_style.drawn`.

    Raises
    ------
    NotEnoughData
        No recordings.
    """
    result = _evaluated(run, recordings)
    drawn = friction.drawings(result)
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters["when"] = when
    html = environment.get_template("friction.html").render(
        result=result,
        content=friction_rows,
        plots=_uris(drawn),
        journal=run.journal,
        planned=len(run.plan.measurements),
        written=now(),
        version=versions()["canopen-robot-identification"],
    )
    return html, drawn


def of_campaign(run: Run, recordings: Recordings, estimate: Estimate) -> dict[str, Any]:
    """What the report of a campaign says about friction besides; call within `drawn`."""
    result = _evaluated(run, recordings) if recorded_as(Friction, recordings) else None
    drawn = friction.drawings(result) if result else {}
    drifts = campaign_drifts(run.robot, estimate.local, history(run.robot, recordings))
    return {
        "friction_result": result,
        "friction_content": friction_rows,
        "friction_plots": _uris(drawn),
        "drift_rows": friction_rows.drift_rows(drifts),
        "symmetry_rows": friction_rows.symmetry_rows(of_local_values(estimate.local)),
    }


def _evaluated(run: Run, recordings: Recordings) -> FrictionResult:
    """As `hil friction fit` did it last: by the same model of gravity, with the same bound."""
    try:
        kept = load_friction(run)
        model = Path(kept.model_folder) if kept.model_folder else None
        return evaluate(run, recordings, model, BOUND if kept.bound is None else kept.bound)
    except (FileError, Mismatch):  # nothing was fitted, or its model is gone
        return evaluate(run, recordings)


def _uris(drawn: dict[str, Figure]) -> dict[str, str | None]:
    names = ("normalised", "models", "over-time", "in-operation")
    return {
        name: "data:image/svg+xml;base64," + base64.b64encode(image(drawn[name], "svg")).decode()
        if name in drawn
        else None
        for name in names
    }
