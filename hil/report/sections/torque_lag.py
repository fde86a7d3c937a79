"""How late the drives' currents were read."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.report.section import Section
from hil.results.tables.torque_lag import torque_lag

if TYPE_CHECKING:
    from hil.report.reported_run import IdentifiedRun


def section(run: IdentifiedRun) -> Section | None:
    """Lag of each axis; None where none was estimated."""
    lags = torque_lag(run.estimate)
    if not lags:
        return None
    return Section("How late the current was read", "torque_lag.html", {"lags": lags})
