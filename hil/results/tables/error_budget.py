"""Causes of error, the largest first."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.results.rounding import significant
from hil.results.tables.table import Column, Part, Table, figures

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.results.error_term import ErrorTerm
    from hil.results.tables.table import Row


def error_budget(terms: Sequence[ErrorTerm]) -> Table:
    """What spoils a result, or would; no rows where nothing but noise does."""
    return Table(
        title="Largest causes of error",
        columns=(
            Column("cause"),
            Column("axes"),
            *figures("torque, %", "share, %"),
            Column("accounted for"),
        ),
        parts=(Part(tuple(map(_row, terms))),) if terms else (),
        explanation=(
            "Error of the torques on a free motion, and share of the sum of the squares; noise is"
            " the rest. What is accounted for would do that if it were not."
        ),
    )


def _row(term: ErrorTerm) -> Row:
    return (
        term.cause,
        ", ".join(map(str, term.axes)) or "all",
        significant(100 * term.torque, 2),
        f"{100 * term.share:.0f}",
        "yes" if term.accounted else "no",
    )
