"""How uncertain a solution is: what scatters over time, and what scatters over states.

Noise and a friction that wanders differ from one block of time to the next; the jackknife over
blocks shows them. What a model lacks, such as a shape of friction, does not: it repeats with the
motion, in a periodic one exactly. But it differs from one part of the space of states to the
next. Cells of that space (`accumulation`) are to it what blocks are to noise: each leaves a score,
what its own equations leave at the solution of all, and were the model complete these scores would
sum up to as little as those of as many blocks of time. So the covariance is the sum of two

    V = V_blocks + N^-1 (sum of score score' over cells) N^-1,

the latter with the degrees of freedom that as many cells give as carry a parameter. Over-all it is
too large rather than too small: noise counts in both.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.regression.least_squares import inverse
from hil.regression.uncertainty import effective_degrees, jackknife, left_out, scatter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.regression.normal_equations import Normal

    Array = NDArray[np.float64]

BLOCKS = 30
"""Of time, at most: few, so that what lasts longer than a piece counts."""


class Uncertainty(NamedTuple):
    """Covariance of the unknowns, shape (n, n), its degrees of freedom, (n,), and misfit's part."""

    covariance: Array
    degrees_of_freedom: Array
    misfit: Array


def uncertainty(pieces: Normal, cells: Normal, x: Array) -> Uncertainty:
    """Uncertainty of the solution `x`.

    Parameters
    ----------
    pieces, cells : Normal
        The same samples by time and by state.
    """
    blocks = pieces.grouped(BLOCKS)
    changes = left_out(blocks.N, blocks.scores(x))
    of_time = jackknife(changes)
    influence = cells.scores(x) @ inverse(blocks.information)
    used = cells.square > 0
    of_states = scatter(influence[used], few=True)
    shares = np.vstack([changes, influence[used]]) ** 2
    return Uncertainty(of_time + of_states, effective_degrees(shares), of_states)
