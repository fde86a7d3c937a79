"""A run's report: one HTML file with everything in it, made from the recordings alone.

It can be written again at any time, without hardware and without the network. What stands in it,
and in which order, is the registry of `hil.report.sections`; the one that leads stands on the first
screen, beside what the result is worth and a picture of the robot. Plots are part of the page as
SVG, and behind their points are the recordings (`hil.report.carried`).
"""

from __future__ import annotations

import base64
import hashlib
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from markupsafe import Markup

from hil.report.carried import carried, downloads, first_pose
from hil.report.charts.arm import arm
from hil.report.reported_run import ReportedRun
from hil.report.sections import OF_FRICTION, OF_IDENTIFIED
from hil.results.rounding import clock
from hil.results.tables.html import environment
from hil.runs.atomic_file import file_errors, write_file
from hil.runs.journal import now, versions
from hil.runs.run import opened
from hil.view.packed import deflated
from hil.view.page import ASSETS, view_script

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from jinja2 import Environment

    from hil.report.section import Plot, Section
    from hil.runs.recording_file import Measured
    from hil.runs.run import Run

NAME = "report.html"
_HERE = Path(__file__).parent
TEMPLATES = _HERE / "templates", _HERE / "sections", _HERE / "charts", ASSETS


def report(run: Run | Path | str, figures: Path | None = None) -> Path:
    """Write the report of a run into its folder, as `hil identify` identifies it.

    Parameters
    ----------
    run : Run or path
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
    run = opened(run)
    whole = ReportedRun(run)
    registry = OF_IDENTIFIED if whole.is_identified else OF_FRICTION
    sections = list(filter(None, (each(whole) for each in registry)))
    path = run.path / NAME
    write_html(path, NAME, **_values(whole, sections))
    if figures is not None:
        _write_figures(figures, _plots(sections))
    return path


def _plots(sections: Iterable[Section]) -> list[Plot]:
    return [plot for each in sections for plot in each.plots]


def write_html(path: Path, template: str, **values: object) -> None:
    """Write a page, whole or not at all, with when and by which version it is written."""
    own = (_HERE / "templates" / "report.js").read_text(encoding="utf-8")
    bundle = view_script() if values["carried"] else ""
    about = {
        "bundle": deflated(bundle),
        "written": now(),
        "version": versions()["canopen-robot-identification"],
        "script": Markup(own),  # noqa: S704 - our own
        "script_source": " ".join(map(_hash, filter(None, (own, bundle)))),
    }
    write_file(path, _templates().get_template(template).render(**values, **about).encode())


def _templates() -> Environment:
    templates = environment(*TEMPLATES)
    templates.filters["when"] = when
    return templates


def _values(whole: ReportedRun, sections: Sequence[Section]) -> dict[str, object]:
    templates = _templates()
    texts = [(section, _text(templates, section)) for section in sections]
    charts = [plot.chart for plot in _plots(sections)]
    behind = frozenset[str]().union(*(chart.ids for chart in charts))
    played = {panel.recording for chart in charts for panel in chart.panels if panel.recording}
    return {
        **_top(whole),
        "lead": next((text for section, text in texts if section.leads), ""),
        "sections": [each for each in texts if not each[0].leads],
        "downloads": downloads(whole.model) if whole.is_identified else (),
        "carried": carried(whole, behind, played),
        "run": whole.source,
        "picture": arm(whole.robot, first_pose(whole.robot, whole.campaign[0].recording)),
    }


def _hash(script: str) -> str:
    """Source of a script by its content, as a policy names it."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"


def _top(run: ReportedRun) -> dict[str, object]:
    """What a report is about, what it is worth where it was identified, and its facts by name."""
    source, journal = run.source, run.source.journal
    last = journal.sessions[-1] if journal.sessions else None
    began, bus = (when(last.started), last.bus) if last else ("unknown", "unknown")
    bus += ", the virtual plant" if journal.simulated else ""
    begun = ("Imported", "From") if source.imported else ("Measured", "Bus")
    recorded = sum(float(each.time[-1] - each.time[0]) for _, each in run.recordings)
    total = max(float(each.time[-1]) for _, each in run.recordings)
    sessions, took = len(journal.sessions), duration(recorded if source.imported else total)
    took += f" in {sessions} sessions" if sessions > 1 else ""
    return {
        "title": f"{run.robot.name}: {'identified dynamics' if run.is_identified else 'friction'}",
        "outcome": run.model.verdict if run.is_identified else None,
        "facts": (
            *zip(begun, (began, bus), strict=True),
            ("Measurements", counts(run.campaign)),
            ("Recorded" if source.imported else "Robot time", took),
        ),
    }


def _text(templates: Environment, section: Section) -> str:
    """Text of a section."""
    plots = {plot.name: plot for plot in section.plots}
    return templates.get_template(section.template).render(plots=plots, **section.values)


def _write_figures(folder: Path, plots: Iterable[Plot]) -> None:
    with file_errors(folder, "made"):
        folder.mkdir(parents=True, exist_ok=True)
    for plot in plots:
        write_file(folder / f"{plot.name}.svg", plot.file)


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
