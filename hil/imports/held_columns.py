"""Columns whose values are held for several rows, while others are sampled at each row.

A coarse column repeats its value by chance: about once in as many rows as a usual step has
increments. A held one repeats more often than that, while its joint moves. Positions that are all
held alike are thinned out before (`hil.imports.held`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.imports.evidence import Suspicion
from hil.least_squares.standstill import increment

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array
    from hil.imports.evidence import Evidence, Excerpt

OFTENER = 5.0
"""Times that a column repeats oftener than by chance where it is held: three rows more than the one
in which noise may bring the same value again, and one to spare."""
SHARE = 0.2
"""Share of rows from which on held values are stated: fewer delay a column by a tenth of a sample
on average."""


def held_suspicions(excerpts: Sequence[Excerpt], evidence: Evidence) -> Iterator[Suspicion]:
    """Columns that repeat the value of the row before, where their joint moves."""
    for joint in np.flatnonzero(evidence.moves).tolist():
        for key, name in (("position", "q"), ("velocity", "qd"), ("torque", "tau")):
            share = _repeats([getattr(each, name)[:, joint] for each in excerpts],
                             [each.q[:, joint] for each in excerpts])  # fmt: skip
            if share > SHARE:
                yield Suspicion(
                    "still",
                    ("joints", joint, key),
                    f"repeats the value of the row before in {100 * share:.0f} % of the rows in"
                    f" which joint {joint + 1} moves: its values are held, and come every"
                    f" {1.0 / max(1.0 - share, 1e-9):.2g} rows on average, late by half of that;"
                    " record it as often as the others, or keep the rows in which it changes",
                    certain=False,
                )


def _repeats(columns: Sequence[Array], positions: Sequence[Array]) -> float:
    """Share of rows that repeat a value where the joint is under way; 0 where that is chance."""
    steps = np.abs(np.concatenate([np.diff(x) for x in columns]))
    about = np.ones(9)  # rows over which a held position has changed
    ways = np.abs(np.concatenate([np.convolve(np.diff(q), about, "same") for q in positions]))
    # under way: faster than half of the rows
    steps = steps[ways >= np.median(ways)]
    share = float(np.mean(steps == 0))
    if not 0 < share < 1:
        return 0.0
    usual = float(np.median(steps[steps > 0]))
    finest = increment(np.concatenate(columns))
    return share if share > OFTENER * min(finest / usual, 1.0) else 0.0
