"""The page of an acceptance: one HTML file, which can be printed and signed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.report.header import when
from hil.report.page import TEMPLATES
from hil.results.acceptance import table
from hil.results.tables.html import environment
from hil.results.tables.table import Column, Part, Table
from hil.runs.atomic_file import write_file
from hil.runs.journal import now, versions

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from hil.results.acceptance import Acceptance
    from hil.results.tables.table import Row
    from hil.runs.run import Run

NOT_KNOWN = "not stated"


def write_page(path: Path, run: Run, found: Acceptance, stated: Mapping[str, str]) -> None:
    """Write the page, whole or not at all; `stated`: facts that the run does not hold."""
    sessions = run.journal.sessions
    facts = {
        **{name: text or NOT_KNOWN for name, text in stated.items()},
        "Measured": when(sessions[-1].started) if sessions else NOT_KNOWN,
        "Bus": sessions[-1].bus if sessions else NOT_KNOWN,
    }
    templates = environment(*TEMPLATES)
    templates.filters["when"] = when
    text = templates.get_template("acceptance.html").render(
        robot=run.robot.name,
        word=found.word,
        failed=sum(check.word == "failed" for check in found.checks),
        count=len(found.checks),
        facts=facts.items(),
        tables=[each for each in (table(found), _drives(run)) if each],
        simulated=run.journal.simulated,
        written=now(),
        version=versions()["canopen-robot-identification"],
    )
    write_file(path, text.encode())


def _drives(run: Run) -> Table | None:
    axes = next((session.axes for session in run.journal.sessions if session.axes), ())
    rows: tuple[Row, ...] = tuple((axis.name, axis.identity) for axis in axes)
    if not rows:
        return None
    return Table("Drives", (Column("axis"), Column("identity", folds=True)), (Part(rows),))
