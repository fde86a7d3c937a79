"""The improved and the published method side by side."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.report.section import Section
from hil.results.tables.parameters import DISAGREEMENT, methods

if TYPE_CHECKING:
    from hil.report.reported_run import IdentifiedRun


def section(run: IdentifiedRun) -> Section | None:
    """Parameters by both methods."""
    if run.found.check is None:
        return None
    values = {
        "methods": methods(run.model, run.found.check),
        "disagreement": DISAGREEMENT,
    }
    return Section("Improved and published method", "methods.html", values)
