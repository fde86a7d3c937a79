"""What the run's model was worth on other recordings, as `hil validate` found."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.report.kept_result import kept_model
from hil.report.plots import VALIDATION
from hil.report.section import Picture, Section, picture_uri
from hil.results.validation import judgements

if TYPE_CHECKING:
    from hil.report.reported_run import ForeignRun, IdentifiedRun


def section(run: IdentifiedRun | ForeignRun) -> Section | None:
    """Judgements of the kept model, if it is the one of this report, and the newest's picture."""
    kept = kept_model(run)
    if kept is None or not kept.validations:
        return None
    places = (run.source.path / each.run / VALIDATION for each in reversed(kept.validations))
    uri = next(filter(None, map(picture_uri, places)), None)
    picture = Picture(
        "validation",
        uri or "",
        "Torque of every axis over time on the recording that was validated last: measured,"
        " predicted with its interval, and what is left.",
        "Torques of the recording that was validated last, from where each axis moves first; below"
        " each axis what the prediction leaves, and its 95 % interval.",
    )
    return Section(
        "Validation",
        "validation.html",
        {"judgements": judgements(kept.validations)},
        (picture,) if uri else (),
        leads=True,
    )
