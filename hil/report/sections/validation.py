"""What the run's model was worth on other recordings, as `hil validate` found."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.report.kept_result import kept_model
from hil.report.section import Section
from hil.results.tables.validation import verdicts

if TYPE_CHECKING:
    from hil.report.reported_run import FreeRun, IdentifiedRun, StrokesRun


def section(run: IdentifiedRun | FreeRun | StrokesRun) -> Section | None:
    """Verdicts on the model that is kept, as long as it is the one of this report."""
    kept = kept_model(run)
    if kept is None or not kept.validations:
        return None
    return Section("Validation", "validation.html", {"verdicts": verdicts(kept.validations)})
