"""How the numbers of a report were found: model, measurements, signals, methods, uncertainty."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.estimation import signals
from hil.friction import equation
from hil.least_squares import window
from hil.report.section import Section

if TYPE_CHECKING:
    from hil.report.reported_run import IdentifiedRun


def section(run: IdentifiedRun) -> Section | None:
    """Text alone, with the constants that the estimation uses; none of trajectories alone."""
    if not run.estimate.local:
        return None
    values = {"signals": signals, "window": window, "terms": equation}
    return Section("Method of identification", "derivation.html", values)
