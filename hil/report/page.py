"""A run's report: one HTML file with everything in it, made from the recordings alone.

It can be written again at any time, without hardware and without the network. What stands in it,
and in which order, is the registry of `hil.report.sections`; above them stands the plot that shows
the result best, which is that of the first section that leads. Plots are part of the page as SVG,
and behind their points are the recordings (`hil.report.carried`).
"""

from __future__ import annotations

import base64
import hashlib
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from hil.report.carried import carried, downloads
from hil.report.reported_run import ReportedRun
from hil.report.section import Plot
from hil.report.sections import OF_FRICTION, OF_IDENTIFIED
from hil.results.rounding import clock, percent
from hil.results.tables.html import environment
from hil.runs.atomic_file import file_errors, write_file
from hil.runs.journal import now, versions

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from jinja2 import Environment

    from hil.report.section import Picture, Section
    from hil.runs.recording_file import Measured
    from hil.runs.run import Run

    Facts = tuple[tuple[str, str], ...]

NAME = "report.html"
TEMPLATES = tuple(Path(__file__).parent / folder for folder in ("templates", "sections", "charts"))


def report(run: Run, figures: Path | None = None) -> Path:
    """Write the report of a run into its folder, as `hil identify` identifies it.

    Parameters
    ----------
    figures : path, optional
        Folder for the plots as SVG files too; made if it is not there.

    Returns
    -------
    Path
        Of the report.

    Raises
    ------
    FileError
        A damaged recording, or a full disk.
    NotIdentifiable, NotEnoughData
        Measurements that do not suffice.
    """
    whole = ReportedRun(run)
    registry = OF_IDENTIFIED if whole.is_identified else OF_FRICTION
    sections = list(filter(None, (each(whole) for each in registry)))
    path = run.path / NAME
    write_html(path, NAME, **_values(whole, sections))
    if figures is not None:
        _write_figures(figures, _plots(sections))
    return path


def _plots(sections: Iterable[Section]) -> list[Plot]:
    return [plot for each in sections for plot in each.plots if isinstance(plot, Plot)]


def write_html(path: Path, template: str, **values: object) -> None:
    """Write a page, whole or not at all, with when and by which version it is written."""
    about = {"written": now(), "version": versions()["canopen-robot-identification"]}
    write_file(path, _templates().get_template(template).render(**values, **about).encode())


def _templates() -> Environment:
    templates = environment(*TEMPLATES)
    templates.filters["when"] = when
    return templates


def _values(whole: ReportedRun, sections: Sequence[Section]) -> dict[str, object]:
    templates = _templates()
    lead = next((each.plots[0] for each in sections if each.leads and each.plots), None)
    script = (TEMPLATES[0] / "report.js").read_text(encoding="utf-8")
    behind = frozenset[str]().union(*(plot.chart.ids for plot in _plots(sections)))
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return {
        **_top(whole),
        "lead": lead,
        "sections": [(section, _text(templates, section, lead)) for section in sections],
        "downloads": downloads(whole.model) if whole.is_identified else (),
        "script": Markup(script),  # noqa: S704 - our own
        "script_source": f"'sha256-{digest}'",
        "recordings": carried(whole.campaign, whole.robot, behind),
        "run": whole.source,
    }


def _top(run: ReportedRun) -> dict[str, object]:
    """What a report is about, in two sentences where it was identified, and its facts by name."""
    source, journal = run.source, run.source.journal
    about, verdict, outcome = "friction", "", None
    facts: Facts = (
        ("Measurements", f"{len(run.campaign)} of {len(source.motions)} planned"),
        ("Sessions", str(len(journal.sessions))),
    )
    if run.is_identified:
        about, outcome = "identified dynamics", run.model.outcome
        verdict, facts = (_of_motions if run.found.prediction is None else _of_campaign)(run)
    last = journal.sessions[-1] if journal.sessions else None
    began, bus = (when(last.started), last.bus) if last else ("unknown", "unknown")
    bus += ", the virtual plant" if journal.simulated else ""
    begun = ("Imported", "From") if source.imported else ("Measured", "Bus")
    return {
        "title": f"{run.robot.name}: {about}",
        "outcome": outcome,
        "verdict": verdict,
        "facts": (*zip(begun, (began, bus), strict=True), *facts),
    }


def _text(templates: Environment, section: Section, lead: Plot | Picture | None) -> str:
    """Text of a section; the plot that leads stands above all of them."""
    plots = {plot.name: plot for plot in section.plots if plot is not lead}
    return templates.get_template(section.template).render(plots=plots, **section.values)


def _write_figures(folder: Path, plots: Iterable[Plot]) -> None:
    with file_errors(folder, "made"):
        folder.mkdir(parents=True, exist_ok=True)
    for plot in plots:
        write_file(folder / f"{plot.name}.svg", plot.file)


def _of_motions(run: ReportedRun) -> tuple[str, Facts]:
    """Verdict and facts of an imported run, by motions or strokes back and forth."""
    identified, fit = run.model.identified, run.model.back_and_forth or run.model.friction
    left = percent(0.0 if fit is None else fit.overall_residual, 1.0)
    verdict = (
        f"All {len(run.model.values)} base parameters of {run.robot.name} were identified together"
        f" with friction. Of the recorded torques {left} % are left, all samples and axes taken"
        " together."
    )
    if run.model.back_and_forth is not None:
        which = "All" if identified.all() else f"{identified.sum()} of"
        lost = "" if identified.all() else " Those not identified are zero in the model."
        verdict = (
            f"{which} {len(identified)} base parameters of {run.robot.name} were identified from"
            f" strokes back and forth, without a law of friction. Of the recorded torques {left} %"
            f" are left, all axes taken together, away from the reversals.{lost}"
        )
    took = sum(float(each.time[-1] - each.time[0]) for _, each in run.recordings)
    return verdict, (("Recordings", str(len(run.recordings))), ("Recorded", duration(took)))


def _of_campaign(run: ReportedRun) -> tuple[str, Facts]:
    """Verdict and facts of a run whose torques of a free motion are predicted."""
    assert run.found.prediction is not None  # noqa: S101 - asked for before
    relative = percent(float(np.nanmean(run.found.prediction.relative)), 1.0)
    urgent = sum(item.word != "good" for item in run.found.advice)
    attention = f"{urgent} finding{'s require' if urgent > 1 else ' requires'} action, see below."
    verdict = (
        f"All {len(run.estimate.p)} base parameters were identified; the rigid-body torques of a"
        f" free motion follow from them to {relative} % on average over the axes (one standard"
        f" error). {attention if urgent else 'No finding requires action.'}"
    )
    sessions = len(run.source.journal.sessions)
    robot_time = max(float(recording.time[-1]) for _, recording in run.recordings)
    took = duration(robot_time) + (f" in {sessions} sessions" if sessions > 1 else "")
    return verdict, (("Measurements", counts(run.campaign)), ("Robot time", took))


def counts(campaign: Sequence[Measured]) -> str:
    """State how many measurements there are of each kind."""
    kinds: list[str] = [measured.measurement.kind for measured in campaign]
    each = (f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
    return f"{len(kinds)} ({', '.join(each)})"


def when(stamp: str) -> str:
    """Write an ISO time stamp for readers."""
    return f"{datetime.fromisoformat(stamp):%d %B %Y, %H:%M %Z}".lstrip("0") if stamp else "unknown"


def duration(seconds: float) -> str:
    """Write a duration for readers."""
    return f"{clock(seconds)} {'h' if seconds >= 3600 else 'min'}"
