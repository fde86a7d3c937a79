"""Model choice by the prediction error on held-out groups.

Alternatives are compared by the error of prediction on groups held out in turn. The first
alternative, the usual one, is kept unless a richer one is significantly better. An alternative not
significantly better than the usual one is never chosen, even if no other is significantly better
than it: with few groups almost no difference is significant. The best of many useless alternatives
looks better by chance, too: so the test statistic is the largest t of all differences of squared
errors, compared with the largest t of the same differences with random signs of groups (White, A
reality check for data snooping, Econometrica 68 (2000) 1097-1126; studentised, since alternatives
scatter differently). Alternatives with equal predictions cost little in this way, and fewer than
six groups show nothing. A decrease of up to `NEGLIGIBLE` of the channel's residual is ignored. Of
the significantly better alternatives, the simplest not beaten by another sets the standard; the
simplest of all with equal predictions, up to `NEGLIGIBLE`, is chosen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.least_squares.normal_equations import successive
from hil.least_squares.solving import solved

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hil.arrays import Array, Indices, Mask
    from hil.least_squares.normal_equations import Normal

FOLDS = 12
"""Number of folds of the groups for cross-validation."""
NEGLIGIBLE = 0.01
"""Negligible growth of the held-out residual (rms): the filters' corners cause up to 0.008 even for
exact Coulomb and viscous friction (two axes, white noise)."""


def simplest(errors: Mapping[str, Array], n_channels: int = 1) -> str:
    """Return the simplest alternative without a significantly better alternative.

    Parameters
    ----------
    errors : mapping of name to ndarray, shape (n_blocks,)
        Squared errors on held-out blocks by alternative, the simplest first.
    n_channels : int
        Number of equally weighted channels in the errors, if the alternatives concern only one
        channel: its share of the residual is 1 / `n_channels`.
    """
    names, squares = list(errors), np.array(list(errors.values()))
    total = sums = squares.sum(axis=1)
    enough = ((1.0 + NEGLIGIBLE) ** 2 - 1.0) * sums.min() / n_channels
    better = _certainly_positive(squares[0] - squares) & (sums[0] - sums > enough)
    if not better.any():
        better[0] = True
    squares, sums = squares[better], sums[better]
    found = next(
        k
        for k, error in enumerate(squares)
        if sums[k] - sums.min() <= enough or not _certainly_positive(error - squares).any()
    )
    return names[int(np.flatnonzero(total <= sums[found] + enough)[0])]


class HeldOut:
    """Prediction errors on held-out blocks.

    Parameters
    ----------
    fitted : Normal
        Equations for the fit.
    scored : Normal
        Equations of the scored samples, for the same blocks.
    """

    def __init__(self, fitted: Normal, scored: Normal) -> None:
        self._scored = scored
        self._folds = folds(len(fitted.v))
        N, v = fitted.information, fitted.vector
        self._N = [N - fitted.N[fold].sum(axis=0) for fold in self._folds]
        self._v = [v - fitted.v[fold].sum(axis=0) for fold in self._folds]

    def error(self, kept: Indices) -> Array:
        """Compute the squared error per block, fitting the `kept` unknowns to remaining folds."""
        return self.errors({"": kept})[""]

    def errors(self, alternatives: Mapping[str, Indices]) -> dict[str, Array]:
        """Compute the errors of several sets of unknowns, with one pass over the blocks."""
        scored, names = self._scored, list(alternatives)
        found = np.zeros((len(scored.v), len(names)))
        for fold, N, v in zip(self._folds, self._N, self._v, strict=True):
            x = np.zeros((len(v), len(names)))
            for k, kept in enumerate(alternatives.values()):
                x[kept, k] = solved(N[np.ix_(kept, kept)], v[kept])
            left = np.einsum("bik,ik->bk", scored.N[fold] @ x, x) - 2.0 * scored.v[fold] @ x
            found[fold] = scored.square[fold, np.newaxis] + left
        return dict(zip(names, np.maximum(found, 0.0).T, strict=True))


def folds(n: int) -> list[slice]:
    """Return the successive blocks of every fold."""
    return successive(0, n, min(FOLDS, n))


def _certainly_positive(gains: Array) -> Mask:
    """Test if the mean over blocks is significantly positive, per row of gains (n_rows, n)."""
    n = gains.shape[1]
    # number of sign draws: standard error of the probability 0.0025
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(4096, n))
    t = _t(gains, np.ones((1, n)))[0]
    greatest = _t(gains, signs).max(axis=1, keepdims=True)
    by_chance = greatest >= t * (1.0 - np.sqrt(np.finfo(float).eps))
    # significance level of 5 %, two-sided
    return np.asarray((t > 0.0) & (by_chance.mean(axis=0) <= 0.025))


def _t(gains: Array, signs: Array) -> Array:
    """Compute t of every row of gains under every row of signs."""
    n = gains.shape[1]
    mean = signs @ gains.T / n
    variance = ((gains**2).mean(axis=1) - mean**2) / max(n - 1, 1)
    return np.asarray(mean / np.sqrt(np.maximum(variance, np.finfo(float).tiny)))
