"""A change during the recordings: a load, a tool or a setting, from some time on.

The pieces of time before and after a change follow parameters and friction of their own. Pieces
held out in turn are predicted by the other pieces, of all time or of the same side of a division.
A change is the division that predicts an axis significantly better (`hil.least_squares.choice`),
with at most `LEAVES` of the mean square: useless unknowns predict held-out pieces worse.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.result import Change
from hil.least_squares.choice import FOLDS, simplest
from hil.least_squares.solving import solved

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.least_squares.regression import Regression

LEAVES = 1.0 / 9.0
"""Maximum share of an axis's mean square after a division, as for readings that contradict a map:
friction that warms leaves 0.4."""
FEWEST = 3
"""Minimum number of pieces of time on either side."""


def find_change(pieces: Regression, duration: float) -> Change | None:
    """Find a change during recordings of a `duration` [s]."""
    pieces = replace(pieces, blocks=pieces.blocks.grouped(FOLDS))
    n = len(pieces.blocks)
    whole = _held_out(pieces, 0)
    errors = {k: _held_out(pieces, k) for k in range(FEWEST, n - FEWEST + 1)}
    found = None
    for axis, own in enumerate(whole.T):
        tried = {"0": own} | {str(k): error[:, axis] for k, error in errors.items()}
        best = int(simplest(tried))
        left = float(tried[str(best)].sum() / max(own.sum(), np.finfo(float).tiny))
        if best and left <= (LEAVES if found is None else found.left):
            share = pieces.blocks.counts[:best].sum() / pieces.blocks.counts.sum()
            found = Change(axis=axis + 1, after=float(share * duration), left=left)
    return found


def _held_out(pieces: Regression, division: int) -> Array:
    """Return squared errors of held-out pieces, shape (n, n_axes), before and after a division."""
    normal, found = pieces.normal, np.zeros(pieces.blocks.counts.shape)
    for side in (slice(0, division), slice(division, len(found))):
        N, v = normal.N[side].sum(axis=0), normal.v[side].sum(axis=0)
        for k in range(len(found))[side]:
            x = np.zeros(pieces.layout.size)
            x[pieces.kept] = solved(N - normal.N[k], v - normal.v[k])
            found[k] = pieces.blocks.squares_left(x)[k]
    return found
