"""The page of a machine's history: one HTML file with tables and plots, and nothing outside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.estimation.intervals import SIGNIFICANT
from hil.report.header import when
from hil.report.page import TEMPLATES
from hil.report.plots.history import over_time
from hil.report.section import Plot
from hil.results.tables import history as tables
from hil.results.tables.html import environment
from hil.runs.atomic_file import write_file
from hil.runs.journal import now, versions

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from hil.results.compared_runs import History
    from hil.results.quantities import Kind

_CAPTION = "Values with intervals of 95 %, thin lines with what temperature may add to friction."


def write_page(path: Path, found: History) -> None:
    """Write the page, whole or not at all."""
    templates = environment(*TEMPLATES)
    templates.filters["when"] = when
    text = templates.get_template("history.html").render(
        robot=found.robot.name,
        newest=found.runs[-1].label,
        marked=found.sentences(found.runs[-1]),
        tables=[table(found) for table in (tables.runs, tables.changes, tables.condition)],
        plots=list(_plots(found)),
        rate=f"{SIGNIFICANT:.0%}",
        written=now(),
        version=versions()["canopen-robot-identification"],
    )
    write_file(path, text.encode())


def _plots(found: History) -> Iterator[Plot]:
    """A plot of each kind of quantity that the runs know."""
    names: dict[Kind, str] = {
        "gravity parameter": "Gravity parameters", "inertia parameter": "Inertia parameters",
        "friction level": "Friction", "offset": "Offsets",
    }  # fmt: skip
    for kind, name in names.items():
        places = [k for k, each in enumerate(found.quantities) if each.kind == kind]
        if places:
            yield Plot(
                kind.replace(" ", "-"),
                lambda places=places: over_time(found, places),  # type: ignore[misc]
                f"{name} over time, a panel each",
                f"{name} over time. {_CAPTION}",
            )
