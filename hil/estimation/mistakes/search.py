"""Unknowns of a candidate: found from several starts by Gauss-Newton, with standard errors.

Base parameters and friction are solved for under every reading (variable projection, Golub and
Pereyra, SIAM J. Numer. Anal. 10 (1973) 413-432), so the residual depends on the few unknowns alone
and its derivative is a difference of two residuals. Standard errors come from the scores of the
parts (`hil.least_squares.uncertainty`), which hold friction that wanders from one part to the next.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.least_squares.uncertainty import sandwich, scatter

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.estimation.mistakes.candidates import Candidate
    from hil.estimation.mistakes.misfit import Campaign, Explanation


ROUNDS = 6
FARTHEST = 1.0
"""Longest step: where unknowns hardly show, the linear one leads anywhere."""
SHORTER = 3
"""Steps that are tried, each a third of the one before."""
ENOUGH = 1e-4
"""Relative decrease of the sum of squares below which a search ends."""


@dataclass(frozen=True, slots=True, eq=False)
class Tried:
    """A candidate with its unknowns as they explain the campaign best.

    Attributes
    ----------
    candidate : Candidate
    theta, error : ndarray, shape (k,)
        Unknowns and their standard errors.
    explanation : Explanation
    """

    candidate: Candidate
    theta: Array
    error: Array
    explanation: Explanation

    @property
    def t(self) -> float:
        """Size over standard error; infinite where there is nothing to estimate."""
        if not self.theta.size:
            return np.inf
        sizes = np.abs(self.theta) / np.maximum(self.error, 1e-12)
        return float(sizes.max())

    @property
    def large(self) -> bool:
        """Whether it is of a size that counts."""
        return not self.theta.size or float(np.linalg.norm(self.theta)) > self.candidate.least


def tried(campaign: Campaign, candidate: Candidate, stated: Explanation, wide: bool) -> Tried:
    """Search the unknowns of a candidate.

    Parameters
    ----------
    stated : Explanation
        Of zero unknowns.
    wide : bool
        Whether to start far from zero too.
    """
    best, explained = np.zeros(candidate.k), stated
    if not candidate.k:
        return Tried(candidate, best, best, campaign.explain(candidate.reading(best)))
    for start in candidate.starts if wide else ():
        other = np.array(start)
        found = campaign.explain(candidate.reading(other))
        if found.chi_square < explained.chi_square:
            best, explained = other, found
    return _refined(campaign, candidate, best, explained)


def linear(campaign: Campaign, candidate: Candidate, stated: Explanation) -> tuple[float, float]:
    """One step from zero: the share of the sum of squares that it takes away, and its t."""
    theta = np.zeros(candidate.k)
    J = _derivative(campaign, candidate, theta, stated)
    step, error = _step(campaign, J, stated.residual)
    taken = float(np.linalg.norm(J @ step) ** 2) / stated.chi_square
    return taken, float(np.max(np.abs(step) / np.maximum(error, 1e-12)))


def _refined(
    campaign: Campaign, candidate: Candidate, theta: Array, explained: Explanation
) -> Tried:
    error = np.full(candidate.k, np.inf)
    for _ in range(ROUNDS):
        J = _derivative(campaign, candidate, theta, explained)
        step, error = _step(campaign, J, explained.residual)
        before = explained.chi_square
        theta, explained = _descended(campaign, candidate, theta, explained, step)
        if explained.chi_square > (1 - ENOUGH) * before:
            break
    return Tried(candidate, theta, error, explained)


def _descended(
    campaign: Campaign, candidate: Candidate, theta: Array, explained: Explanation, step: Array
) -> tuple[Array, Explanation]:
    """Go as far along a step as the sum of squares decreases; stay where it does not."""
    step = step * min(1.0, FARTHEST / max(float(np.linalg.norm(step)), ENOUGH))
    for _ in range(SHORTER):
        found = campaign.explain(candidate.reading(theta + step))
        if found.chi_square < explained.chi_square:
            return theta + step, found
        step = step / 3
    return theta, explained


def _derivative(
    campaign: Campaign, candidate: Candidate, theta: Array, explained: Explanation
) -> Array:
    steps = candidate.step * np.eye(candidate.k)
    return np.column_stack([
        (campaign.explain(candidate.reading(theta + step)).residual - explained.residual)
        / candidate.step
        for step in steps
    ])  # fmt: skip


def _step(campaign: Campaign, J: Array, residual: Array) -> tuple[Array, Array]:
    """Gauss-Newton step, and standard errors of where it leads."""
    inverse = np.linalg.pinv(J.T @ J)
    step = -inverse @ (J.T @ residual)
    left = residual + J @ step
    scores = [J[rows].T @ left[rows] for rows in campaign.parts]
    covariance = sandwich(np.asarray(inverse), scatter(np.array(scores)))
    return step, np.sqrt(np.diag(covariance))
