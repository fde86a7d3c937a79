r"""Score tests of causes beside what is estimated, with the covariance of groups.

Rows y of all channels, weighted with the reciprocals of their residual standard deviations, obey

    y = Z x + D_j theta_j + e,

with the base parameters' and the channels' own columns Z, and one column D_j of a cause in turn.
Let Q be an orthonormal basis of Z, r = y - QQ'y and D~ = D - QQ'D. Then, of the rows of group k,

    score s_kj = D~_kj' r_k,   information I_kj = D~_kj'D~_kj,   theta_j = sum s_kj / sum I_kj.

Noise is not white: friction wanders, laws of it are never exact. What scatters between groups shows
by how much the variance 1 / I_j is to be multiplied, the *dispersion* of the cause,

    phi_j = sum_k (s_kj - I_kj theta_j)^2 / (1 - I_kj / I_j) / I_j,

in which r_k is enlarged by (1 - Q_k Q_k')^(-1/2) as for CR2 (`hil.least_squares.uncertainty`), so
that its expectation is 1 where noise is white. It has few degrees of freedom, where few groups
carry a cause: with two of them and a hundred tests nothing is ever found. But all causes of an axis
suffer from one and the same noise. So variances are moderated (Smyth, Statistical Applications in
Genetics and Molecular Biology 3 (2004) 3): phi_j of d_j degrees of freedom scatters about a common
phi_0 as if that had been seen with d_0 of them, and what counts is

    (d_0 phi_0 + d_j phi_j) / (d_0 + d_j), with d_0 + d_j degrees of freedom.

phi_0 and d_0 are found from the scatter of log phi_j over the causes of the axis. Columns of them
resemble each other, so their phi_j scatter less than they are uncertain; d_0 therefore is limited,
and is no more than there are groups of the axis.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special

from hil.least_squares.regression import Regression
from hil.least_squares.solving import inverse_root
from hil.least_squares.uncertainty import ALMOST_NONE, effective_degrees

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from hil.arrays import Array, Indices, Mask
    from hil.estimation.excluded.columns import Columns
    from hil.estimation.excluded.evidence import Evidence

LEVEL = 0.05
"""Probability that anything is found where nothing is wrong."""
SPAN = 1e-4
"""Share of a column's square beside what is estimated below which it is within its span: columns
are of the smoothed motion, those of the base parameters are smoothed themselves, and the two differ
by some 1e-3; of less than ten times that nothing can be said."""
NOTHING = 1e-10
"""Largest root mean square of a column, over that of all of its cause, which is rounding."""
ALIKE = 1e-6
"""Share of the largest eigenvalue below which columns of one cause are one and the same."""
TRUSTED = 20.0
"""Degrees of freedom of the common dispersion at most. On runs 801 to 806 of strokes and of
trajectories, without any flaw, 1000 found something in 2 of 12, 20 and less in none."""
LEVERAGE = 1e-3
"""Least share of a group's variance that the fit leaves, below which it shows nothing."""


class Test(NamedTuple):
    """What the rows say of one cause.

    Attributes
    ----------
    columns : ndarray of int, shape (k,)
        Those of the cause that are not within the span of what is estimated.
    size, error : ndarray, shape (k,)
        Its size and standard errors, in the columns' units.
    degrees : float
        Of freedom.
    drop : float
        Of the weighted sum of squares.
    p : float
        Probability of as large a size by chance.
    rank : int
        Columns that differ.
    dispersion : float
        Moderated.
    """

    columns: Indices
    size: Array
    error: Array
    degrees: float
    drop: float
    p: float
    rank: int
    dispersion: float


class Common(NamedTuple):
    """Dispersion that causes have in common, and its degrees of freedom, each (n_columns,)."""

    dispersion: Array
    degrees: Array


class Battery:
    """Tests of all columns beside base parameters, channels' own columns and causes given."""

    def __init__(self, evidence: Evidence, columns: Columns, given: Iterable[int] = ()) -> None:
        self.evidence, self.columns, self.given = evidence, columns, tuple(given)
        e = evidence
        cut = (e.X.shape[1], e.X.shape[1] + e.own.shape[1])
        rows = e.without_friction(np.hstack([e.torque[:, None], e.X, e.own, columns.values]))
        self._y, self._D = rows[:, 0], rows[:, 1 + cut[1] :]
        self._X, self._own = rows[:, 1 : 1 + cut[0]], rows[:, 1 + cut[0] : 1 + cut[1]]
        self._fit()

    def beside(self, more: Sequence[int]) -> Battery:
        """The same tests beside further causes."""
        other = object.__new__(Battery)
        other.__dict__.update(
            {k: v for k, v in self.__dict__.items() if k not in ("common", "dispersion")}
        )
        other.given = (*self.given, *more)
        other._fit()
        return other

    def _fit(self) -> None:
        """Weigh channels, and project out what is estimated."""
        e, shared = self.evidence, np.hstack([self._X, self._D[:, self.given]])
        rows, n_shared = np.hstack([self._y[:, None], shared, self._own]), shared.shape[1]
        blocks = e.blocks(rows, n_shared)
        regression = Regression.weighed(blocks)
        least = np.maximum(e.finest, np.finfo(float).tiny) ** 2
        self.weights = np.minimum(regression.weights, 1.0 / least)
        """Of the channels, shape (n_channels,)."""
        regression = Regression(blocks, self.weights, regression.kept)
        self.solution = regression.solution[: self._X.shape[1]]
        """Base parameters, shape (n_base,)."""
        Z = np.zeros((len(self._y), blocks.layout.size))
        Z[:, :n_shared] = shared
        for channel in range(e.n_channels):
            at = np.flatnonzero(e.axis == channel)
            Z[at[:, None], blocks.layout.place(channel)[n_shared:]] = self._own[at]
        root = np.sqrt(self.weights)[e.axis]
        Q = (Z * root[:, None]) @ inverse_root(regression.normal.information)
        y, D = self._y * root, self._D * root[:, None]
        residual = y - Q @ (Q.T @ y)
        self._left = D - Q @ (Q.T @ D)
        before, after = (np.einsum("ij,ij->j", x, x) for x in (D, self._left))
        self.information = after
        silent = before <= NOTHING**2 * before.max(initial=0.0)
        self.visible: Mask = ~silent & (after > SPAN * before)
        """Columns that what is estimated does not span, shape (n_columns,)."""
        self.visible[list(self.given)] = False
        self.left = np.maximum(blocks.mean_squares(regression.solution), least)
        """Mean square that is left of each channel, shape (n_channels,)."""
        self.misfit = float(blocks.counts[0] @ np.log(self.left))
        """Differences of which are chi squares."""
        order = np.argsort(e.group, kind="stable")
        groups = np.split(order, np.flatnonzero(np.diff(e.group[order])) + 1)
        found = [(self._left[k], _enlarged(residual[k], Q[k])) for k in groups]
        self.scores = np.array([r @ D for D, r in found])
        """Shape (n_groups, n_columns)."""
        self.shares = np.array([np.einsum("ij,ij->j", D, D) for D, _ in found])
        """Of the groups in the information, shape (n_groups, n_columns)."""

    @cached_property
    def dispersion(self) -> tuple[Array, Array]:
        """Each column's own dispersion and its degrees of freedom, each (n_columns,)."""
        return _dispersion(self.scores, self.shares, self.information)

    @cached_property
    def common(self) -> Common:
        """What the causes of each axis have in common; those of no axis are as all are."""
        axis = np.array([name.axis for name in self.columns.names])
        phi, degrees = self.dispersion
        found = Common(np.ones(len(axis)), np.zeros(len(axis)))
        for one in np.unique(axis):
            own = self.visible & ((axis == one) | (one < 0))
            if own.any():
                place = axis == one
                found.dispersion[place], d = moderated(phi[own], degrees[own])
                rows = (self.evidence.axis == one) | (one < 0)
                groups = len(np.unique(self.evidence.group[rows]))
                found.degrees[place] = min(d, max(groups - 1.0, ALMOST_NONE))
        return found

    def test(self, columns: Sequence[int], common: Common | None = None) -> Test | None:
        """Test one cause; None where nothing of it shows.

        Parameters
        ----------
        common : Common, optional
            By default that of this battery: which is larger than of one beside the cause, if that
            is there.
        """
        at = np.array([k for k in columns if self.visible[k]], dtype=np.intp)
        if not len(at):
            return None
        common = self.common if common is None else common
        length = np.sqrt(self.information[at])
        R = (self._left[:, at].T @ self._left[:, at]) / np.outer(length, length)
        values, vectors = np.linalg.eigh(R)
        kept = values > ALIKE * values.max()
        B = vectors[:, kept] / np.sqrt(values[kept]) / length[:, None]
        scores = self.scores[:, at] @ B
        along, rank = scores.sum(axis=0), scores.shape[1]
        shares = (self.shares[:, at] / self.information[at]).mean(axis=1, keepdims=True)
        each, d = _dispersion(scores, np.repeat(shares, rank, axis=1), np.ones(rank))
        phi_0, d_0 = common.dispersion[at].mean(), common.degrees[at].mean()
        phi = max((d_0 * phi_0 + d[0] * each.mean()) / (d_0 + d[0]), 1.0)
        drop, degrees = float(along @ along), float(d_0 + d[0])
        return Test(
            columns=at,
            size=B @ along,
            error=np.sqrt(phi * np.einsum("ij,ij->i", B, B)),
            degrees=degrees,
            drop=drop,
            p=float(special.fdtrc(rank, degrees, drop / rank / phi)),
            rank=rank,
            dispersion=phi,
        )


def moderated(phi: Array, degrees: Array) -> tuple[float, float]:
    """Common dispersion and its degrees of freedom, after Smyth (2004), section 6.2."""
    half = degrees / 2
    e = np.log(np.maximum(phi, np.finfo(float).tiny)) - special.digamma(half) + np.log(half)
    beyond = float(np.var(e) - special.polygamma(1, half).mean()) if len(e) > 1 else 0.0
    d = TRUSTED
    if beyond > 0:
        d = min(TRUSTED, 2.0 * _inverse_trigamma(beyond))
    return float(np.exp(e.mean() + special.digamma(d / 2) - np.log(d / 2))), d


def _inverse_trigamma(y: float) -> float:
    """X of ``trigamma(x) = y``, by Newton's method (Smyth 2004, appendix)."""
    x = 0.5 + 1.0 / y
    for _ in range(20):  # converges from there in a few steps, always from below
        value = float(special.polygamma(1, x))
        x += value * (1.0 - value / y) / float(special.polygamma(2, x))
    return x


def _dispersion(scores: Array, shares: Array, information: Array) -> tuple[Array, Array]:
    """Variance of the scores' sum over that of white noise, and degrees of freedom."""
    whole = np.maximum(information, np.finfo(float).tiny)
    h = shares / whole
    left = scores - h * scores.sum(axis=0)
    phi = (left**2 / np.maximum(1.0 - h, LEVERAGE)).sum(axis=0) / whole
    return phi, effective_degrees(h, ALMOST_NONE)


def _enlarged(residual: Array, Q: Array) -> Array:
    """(1 - QQ')^(-1/2) r of one group, by the smaller of QQ' and Q'Q."""
    if len(Q) <= Q.shape[1]:
        values, vectors = np.linalg.eigh(Q @ Q.T)
        factor = 1.0 / np.sqrt(np.clip(1.0 - values, LEVERAGE, 1.0))
        return np.asarray(vectors @ (factor * (vectors.T @ residual)))
    values, vectors = np.linalg.eigh(Q.T @ Q)
    factor = 1.0 / np.sqrt(np.clip(1.0 - values, LEVERAGE, 1.0)) - 1.0
    size = np.maximum(values, np.finfo(float).eps)
    return np.asarray(residual + Q @ (vectors @ (factor / size * (vectors.T @ (Q.T @ residual)))))
