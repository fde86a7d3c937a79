"""What in a run needs attention, with its remedies."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.report.section import Section
from hil.results.tables.table import Column, Part, Table

if TYPE_CHECKING:
    from hil.report.reported_run import IdentifiedRun
    from hil.results.judgement import Reservation

COLUMNS = (
    Column("where"),
    Column("finding", folds=True),
)


def section(run: IdentifiedRun) -> Section | None:
    """What is to be done as a table, notes as a list."""
    if run.source.imported:
        return None
    urgent = [item for item in run.found.advice if item.word != "good"]
    notes = [item for item in run.found.advice if item.word == "good"]
    return Section(
        "Findings and remedies",
        "advice.html",
        {"urgent": _table(urgent), "notes": notes},
    )


def _table(items: list[Reservation]) -> Table:
    """Findings under their remedies, each of which is stated once."""
    remedies = dict.fromkeys(item.remedy for item in items)
    return Table(
        "",
        COLUMNS,
        tuple(
            Part(
                tuple((item.subject, item.reason) for item in items if item.remedy == remedy),
                f"Remedy: {remedy}",
            )
            for remedy in remedies
        ),
    )
