"""By how much each axis's current is read late."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from hil.results.tables.cells import uncertain
from hil.results.tables.table import Column, Part, Table, figures

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.estimation.estimate import Estimate
    from hil.estimation.torque_lag import Lags
    from hil.results.tables.table import Row


def torque_lag(estimate: Estimate) -> Table:
    """Lag of each axis's torque behind its position; no rows where none was estimated."""
    lags = estimate.lags
    return Table(
        title="Torque lag, compensated",
        columns=(Column("axis"), *figures("lag, ms", "std. error, ms")),
        parts=(Part(tuple(_axes(lags))),) if lags else (),
    )


def _axes(lags: Lags) -> Iterator[Row]:
    for axis, (lag, error) in enumerate(zip(lags.lag, lags.standard_error, strict=True)):
        yield _axis(axis, float(lag), float(error))


def _axis(axis: int, lag: float, error: float) -> Row:
    if math.isnan(error):
        return str(axis + 1), "not identifiable", ""
    return (str(axis + 1), *uncertain(1e3 * lag, 1e3 * error))
