"""By how much each axis's current is read late."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from hil.results.tables.cells import uncertain
from hil.results.tables.table import Column, Part, Table, figures

if TYPE_CHECKING:
    from hil.estimation.estimate import Estimate
    from hil.results.tables.table import Row


def torque_lag(estimate: Estimate) -> Table:
    """Lag of each axis's torque behind its position; no rows where none was estimated."""
    each = enumerate(zip(estimate.lag, estimate.lag_error, strict=True))
    return Table(
        title="Lag of the torque behind the position, compensated",
        columns=(Column("axis"), *figures("lag, ms", "std. error, ms")),
        parts=(Part(tuple(_axis(k, float(lag), float(error)) for k, (lag, error) in each)),)
        if estimate.method == "improved"
        else (),
    )


def _axis(axis: int, lag: float, error: float) -> Row:
    if math.isnan(error):
        return str(axis + 1), "not identifiable", ""
    return (str(axis + 1), *uncertain(1e3 * lag, 1e3 * error))
