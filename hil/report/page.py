"""A run's report: one HTML file with everything in it, made from the recordings alone.

It can be written again at any time, without hardware and without the network. What stands in it,
and in which order, is the registry of `hil.report.sections`; above them stands the plot that shows
the result best, which is that of the first section that leads. Plots are part of the page as SVG,
and behind their points are the recordings (`hil.report.carried`).
"""

from __future__ import annotations

import base64
import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

from markupsafe import Markup

from hil.report import header
from hil.report.carried import carried, downloads
from hil.report.header import when
from hil.report.reported_run import IdentifiedRun, read
from hil.report.section import Plot
from hil.report.sections import OF_FRICTION, OF_IDENTIFIED
from hil.results.tables.html import environment
from hil.runs.atomic_file import file_errors, write_file
from hil.runs.journal import now, versions

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from jinja2 import Environment

    from hil.report.carried import Downloads
    from hil.report.header import Header
    from hil.report.reported_run import ReportedRun
    from hil.report.section import Picture, Section
    from hil.runs.run import Run

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
    whole = read(run)
    files: Downloads = ()
    made: Iterable[Section | None] = (each(whole) for each in OF_FRICTION)
    if isinstance(whole, IdentifiedRun):
        made, files = (each(whole) for each in OF_IDENTIFIED), downloads(whole.model)
    sections = [section for section in made if section is not None]
    path = run.path / NAME
    write_html(path, NAME, **_values(whole, header.of(whole), sections, files))
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


def _values(
    whole: ReportedRun, top: Header, sections: Sequence[Section], files: Downloads
) -> dict[str, object]:
    templates = _templates()
    lead = next((each.plots[0] for each in sections if each.leads and each.plots), None)
    script = (TEMPLATES[0] / "report.js").read_text(encoding="utf-8")
    behind = frozenset[str]().union(*(plot.chart.ids for plot in _plots(sections)))
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return {
        "top": top,
        "lead": lead,
        "sections": [(section, _text(templates, section, lead)) for section in sections],
        "downloads": files,
        "script": Markup(script),  # noqa: S704 - our own
        "script_source": f"'sha256-{digest}'",
        "recordings": carried(whole.campaign, whole.robot, behind),
        "run": whole.source,
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
