"""The load that was found, as a table."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.results.rounding import uncertain, unit
from hil.results.tables.table import Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Iterable

    from hil.estimation.loads.figures import Figure
    from hil.results.tables.table import Row


def quantities(load: Iterable[Figure]) -> Table:
    """Mass, first moments, centre of mass and inertia of the load."""
    return table(
        "The load, in the last link's frame",
        ("", *figures("value", "std. error", "95 %, ±"), "unit"),
        map(_row, load),
    )


def _row(q: Figure) -> Row:
    value, error = uncertain(q.value, q.standard_error)
    half = uncertain(q.half_width, q.standard_error)[0] if q.half_width else ""
    stated = not q.standard_error
    return q.name, value, "stated" if stated else error, "" if stated else half, unit(q.unit)
