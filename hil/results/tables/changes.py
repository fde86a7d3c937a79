"""Table of the changes of a machine."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.show.rounding import probability, signed, significant, uncertain, unit
from hil.show.table import Column, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.results.changes import Change
    from hil.show.table import Row


def changed_table(changes: Sequence[Change], title: str = "What changed", of: str = "run") -> Table:
    """Return the table of significant changes; no rows without any."""
    return table(
        title,
        (
            *(Column(head, folds=True) for head in (of, "since", "quantity")),
            *figures("change", "± 95 %"),
            "unit",
            *figures("change, %", "p"),
            Column("possible cause", folds=True),
        ),
        map(_change, changes),
        "The interval includes the possible effect of temperature on friction; p: probability of "
        "such a change by chance, over all tests of the run (Holm).",
    )


def _change(each: Change) -> Row:
    share = "" if each.relative is None else signed(significant(100 * each.relative, 2))
    size, half = uncertain(each.size, each.half_width)
    return (
        each.run, each.against, each.quantity.title, size, half, unit(each.quantity.unit), share,
        probability(each.adjusted), each.meaning,
    )  # fmt: skip
