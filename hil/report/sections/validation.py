"""What the run's model was worth on other recordings, as `hil validate` found."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.errors import HilError
from hil.report.section import Section
from hil.results.model import Model
from hil.results.model_file import NAME
from hil.results.stamp import same_parameters
from hil.results.tables.validation import verdicts

if TYPE_CHECKING:
    from hil.report.reported_run import FreeRun, IdentifiedRun, StrokesRun


def section(run: IdentifiedRun | FreeRun | StrokesRun) -> Section | None:
    """Verdicts on the model that is kept, as long as it is the one of this report."""
    path = run.source.path / NAME
    if not path.exists():
        return None
    try:
        kept = Model.load(path)
    except HilError:
        return None
    if not kept.validations or same_parameters(kept.values.tolist(), run.model.values):
        return None
    return Section("Validation", "validation.html", {"verdicts": verdicts(kept.validations)})
