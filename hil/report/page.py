"""A run's report: one HTML file with everything in it, made from the recordings alone.

It can be written again at any time, without hardware and without the network; what `hil identify`
wrote before is only mentioned. Plots are embedded as SVG. What stands in it, and in which order, is
the registry of `hil.report.sections`.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from hil.report import header
from hil.report.friction_of_run import friction_alone
from hil.report.header import when
from hil.report.plots.style import drawn
from hil.report.reported_run import identified, read
from hil.report.sections import OF_CAMPAIGN, OF_FRICTION
from hil.results.tables.html import environment
from hil.runs.atomic_file import operator_told, write_file
from hil.runs.journal import now, versions
from hil.runs.run_folder import RunFolder

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from jinja2 import Environment

    from hil.report.header import Header
    from hil.report.section import Plot, Section

NAME = "report.html"
TEMPLATES = tuple(Path(__file__).parent / folder for folder in ("templates", "sections"))


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
    top, sections = _content(folder)
    path = folder.path / NAME
    with drawn():
        write_file(path, _html(folder, top, sections).encode())
        if figures is not None:
            _write_figures(figures, [plot for each in sections for plot in each.plots])
    return path


def _content(folder: RunFolder) -> tuple[Header, list[Section]]:
    run = read(folder)
    if friction_alone(folder):
        return header.of_friction(run), _present(each(run) for each in OF_FRICTION)
    found = identified(run)
    return header.of_campaign(found), _present(each(found) for each in OF_CAMPAIGN)


def _present(sections: Iterable[Section | None]) -> list[Section]:
    return [section for section in sections if section is not None]


def _html(folder: RunFolder, top: Header, sections: Sequence[Section]) -> str:
    templates = environment(*TEMPLATES)
    templates.filters["when"] = when
    return templates.get_template(NAME).render(
        top=top,
        sections=[(section.heading, _text(templates, section)) for section in sections],
        folder=folder,
        written=now(),
        version=versions()["canopen-robot-identification"],
    )


def _text(templates: Environment, section: Section) -> str:
    plots = {plot.name: plot for plot in section.plots}
    return templates.get_template(section.template).render(plots=plots, **section.values)


def _write_figures(folder: Path, plots: Iterable[Plot]) -> None:
    with operator_told(folder, "made"):
        folder.mkdir(parents=True, exist_ok=True)
    for plot in plots:
        write_file(folder / f"{plot.name}.png", plot.image("png"))
