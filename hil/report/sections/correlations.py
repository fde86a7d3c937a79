"""Correlations of the errors of the parameters."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from hil.report.plots.correlations import correlations
from hil.report.section import Plot, Section

if TYPE_CHECKING:
    from hil.report.reported_run import IdentifiedRun


def section(run: IdentifiedRun) -> Section:
    """Correlation matrix."""
    plot = Plot(
        "correlation",
        partial(correlations, run.estimate, run.robot),
        "Matrix of the correlations between the parameters' errors.",
        "Correlations of the parameters' errors. Strongly correlated parameters are more certain"
        " together than apart; the whole covariance is in model.yaml.",
    )
    return Section("Correlations of the parameters", "correlations.html", plots=(plot,))
