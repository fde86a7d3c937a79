"""How uncertain the base parameters are: what scatters over pairs, and what over positions.

Friction that wanders and noise differ from one pair of strokes to the next; the jackknife over
blocks of pairs shows them. What the model lacks repeats with the strokes, but differs from one part
of the space of states to the next; Huber's sandwich over cells of it shows that, and noise once
more. So in each direction of the unknowns the greater of the two counts: with

    V_pairs + V_cells = L L',    L^-1 V_pairs L^-T = U diag(a) U',

it is ``V = L U diag(max(a, 1 - a)) U' L'``. (Of free motions, whose blocks of time are few and
alike, both are added up: `hil.least_squares.regression`.) Degrees of freedom are those of
the blocks, by each one's share of the variance were the noise white.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.least_squares.solving import inverse, inverse_root
from hil.least_squares.uncertainty import degrees_if_white, jackknife, left_out, scatter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.least_squares.normal_equations import Normal

    Array = NDArray[np.float64]


def uncertainty(pairs: Normal, cells: Normal, x: Array) -> tuple[Array, Array]:
    """Covariance of the solution `x`, shape (n, n), and its degrees of freedom, shape (n,).

    Parameters
    ----------
    pairs, cells : Normal
        The same rows by blocks of pairs and by state.
    """
    of_pairs = jackknife(left_out(pairs.N, pairs.scores(x)))
    inverted = inverse(pairs.information)
    of_cells = scatter(cells.scores(x) @ inverted, few=True)
    return greater(of_pairs, of_cells), degrees_if_white(inverted, pairs.N)


def greater(first: Array, second: Array) -> Array:
    """The greater of two covariances in each of their common principal directions."""
    both = first + second
    root = inverse_root(both)
    share, turned = np.linalg.eigh(root.T @ first @ root)
    directions = both @ root @ turned
    found: Array = (directions * np.maximum(share, 1.0 - share)) @ directions.T
    return found
