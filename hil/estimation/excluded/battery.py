r"""Score tests of causes adjusted for the estimated columns, with the covariance of groups.

Rows y of all channels, weighted with the reciprocals of their residual standard deviations, obey

    y = Z x + D_j theta_j + e,

with the base parameters' and the channels' own columns Z, and the columns D_j of one cause at a
time. Let Q be an orthonormal basis of Z, r = y - QQ'y and D~ = D - QQ'D. The rows of group k give

    score s_kj = D~_kj' r_k,   information I_kj = D~_kj'D~_kj,   theta_j = sum s_kj / sum I_kj.

Noise is not white: friction wanders, and laws of friction are never exact. The scatter between
groups gives the factor of the variance 1 / I_j, the *dispersion* of the cause,

    phi_j = sum_k ((s_kj - I_kj theta_j) / (1 - I_kj / I_j))^2 / I_j,

where r_k is enlarged by (1 - Q_k Q_k')^(-1/2) as for CR2 (`hil.least_squares.uncertainty`). The
power of 1 - I_kj / I_j is 1, as in the jackknife: wandering friction adds to a score in proportion
to I_kj, not to its root, so a group with a large share of I_j leaves a small difference (at a
dispersion of 4, the power 1/2 gives p < 0.01 in 3 % of tests on clean runs, the power 1 in 1 %).
Residuals are *adjusted for the cause itself*, r_k less D~_kj theta_j: a cause of any size changes
neither the dispersion nor the variance 1 of white noise.

Dispersion has few degrees of freedom if few groups carry a cause: with two groups and a hundred
tests nothing is ever found. But all causes of an axis have the same noise. So variances are
moderated (Smyth, Statistical Applications in Genetics and Molecular Biology 3 (2004) 3): phi_j of
d_j degrees of freedom scatters about a common phi_0, as if phi_0 had been observed with d_0 degrees
of freedom. The moderated dispersion is

    (d_0 phi_0 + d_j phi_j) / (d_0 + d_j), with d_0 + d_j degrees of freedom,

but no more degrees than the number of groups of the axis, less one, since wandering noise is the
same in all columns of a group.

phi_0 and d_0 follow from the scatter of log phi_j over the causes of the axis (`moderated`).

Models of real machines are not exact. Model error is a smooth function of the state, and groups of
the same motion repeat it, so they do not scatter by it. Two other scales show model error, and a
cause counts only if it exceeds these as well as phi.

Model error does not prefer one cause to another. The first scale is the mean square explained by
the other causes of an axis, adjusted for the cause under test (the empirical null of Efron, J. Am.
Stat. Assoc. 99 (2004) 96)

    psi = (1 / m) sum_j z_j^2,   z_j^2 = (sum_k s_kj)^2 / I_j,   d = m^2 / sum_ij R_ij^2,

over m columns of correlations R, with the degrees of freedom of a quadratic form of as many
correlated normals.

Model error also makes parts of unchanged recordings differ. Let the cause act in one of K parts
alone: its columns D~_k, adjusted for Z, explain z_jk^2. If nothing changed, z_jk^2 is due to model
error and noise, so

    omega_j = (d psi_0 + K r_j mean_k z_jk^2 / r_j) / (d + K r_j)

is the scale of a cause of r_j columns, moderated by the mean psi_0 over all causes of the axis
(`part_scales`). If the model is exact, psi and omega estimate the same variance as phi.
"""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special

from hil.estimation.excluded.backlash import nearest
from hil.estimation.excluded.basis import Basis
from hil.estimation.excluded.dispersion import (
    Common,
    dispersion,
    freedom,
    moderated,
    orthonormal,
)
from hil.least_squares.regression import Regression
from hil.least_squares.solving import inverse_root
from hil.least_squares.uncertainty import ALMOST_NONE

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from hil.arrays import Array, Indices, Mask
    from hil.estimation.excluded.causes import Key
    from hil.estimation.excluded.columns import Columns
    from hil.estimation.excluded.encoder_noise import EncoderNoise
    from hil.estimation.excluded.evidence import Evidence

LEVEL = 0.05
"""Probability of any false finding."""
FAMILIES = 3
"""Number of families of tests for a change, which share `LEVEL` (Bonferroni): columns, finite
readings, and friction."""
SPAN = 1e-4
"""Share of a column's square left after adjustment for the estimated columns, below which the
column is within their span. Columns use the smoothed motion, columns of base parameters are
smoothed themselves. The two differ by some 1e-3; an amplitude of less than ten times that shows
nothing."""
ANOTHER_SHAPE = 0.25
"""Share x of a change's square outside its column, such as changed Coulomb friction where the
column is 1 % of all friction. It counts as rest, so a size s must obey (1 - x) s^2 > rest + x s^2.
"""
NOTHING = 1e-10
"""Largest root mean square of a column of rounding errors, relative to the largest column."""


class Test(NamedTuple):
    """Score test of a cause: sizes with errors, p-value and dispersion.

    Attributes
    ----------
    columns : ndarray of int, shape (k,)
        Columns of the cause outside the span of the estimated columns.
    size, error : ndarray, shape (k,)
        Sizes and standard errors, in the columns' units.
    degrees : float
        Degrees of freedom.
    drop : float
        Explained part of the weighted sum of squares.
    p : float
        Probability of a size at least as large by chance.
    rank : int
        Number of independent columns.
    dispersion : float
        Moderated dispersion.
    white : float
        Dispersion of white noise, the lower limit of `dispersion`.
    """

    columns: Indices
    size: Array
    error: Array
    degrees: float
    drop: float
    p: float
    rank: int
    dispersion: float
    white: float


class _AxisColumns(NamedTuple):
    """Visible columns of an axis, for the axis's noise; axis -1 has the columns of all axes.

    `left` holds the columns adjusted for the estimated columns, `alike` the correlations of their
    dispersions for white noise within groups, `n_groups` the number of groups with rows of the
    axis, and `products` the inner products of `left`.
    """

    columns: Indices
    left: Array
    alike: Array
    n_groups: int
    products: Array


class Battery:
    """Tests of columns adjusted for base parameters, channels' own columns and given causes."""

    def __init__(
        self,
        evidence: Evidence,
        columns: Columns,
        given: Iterable[int] = (),
        unchanged: dict[Key, Common] | None = None,
        noise: EncoderNoise | None = None,
    ) -> None:
        self.evidence, self.columns, self.given = evidence, columns, tuple(given)
        self._noise = noise
        self.unchanged = unchanged or {}
        """Omega of each cause, if known from unchanged recordings."""
        e = evidence
        self._order = order = np.argsort(e.group, kind="stable")
        self._y, self._X, self._own = (
            e.project_out_friction(x)[order] for x in (e.torque[:, None], e.X, e.own)
        )
        # stored column by column, since only a few of the many columns are used repeatedly
        self._D = np.asfortranarray(e.project_out_friction(columns.values)[order])
        self._channel, group = e.axis[order], e.group[order]
        self._starts = np.flatnonzero(np.diff(group, prepend=-1))
        self._axis = np.array([name.axis for name in columns.names])
        self._fit()

    def extend(self, more: Sequence[int]) -> Battery:
        """Return the tests adjusted for further causes."""
        other = object.__new__(Battery)
        other.__dict__.update({k: v for k, v in self.__dict__.items() if k not in CACHED})
        other.given = (*self.given, *more)
        other._fit()
        return other

    @property
    def level(self) -> float:
        """Probability of any false finding among the columns."""
        return LEVEL if self.evidence.later is None else LEVEL / FAMILIES

    def _fit(self) -> None:
        """Compute the weights of channels, and project out the estimated columns."""
        e, shared = self.evidence, np.hstack([self._X, self._D[:, self.given]])
        rows, n_shared = np.hstack([self._y, shared, self._own]), shared.shape[1]
        blocks = e.blocks(rows, n_shared, self._channel)
        regression = Regression.weighed(blocks)
        least = e.finest**2
        self.weights = np.minimum(regression.weights, 1.0 / least)
        """Weights of the channels, shape (n_channels,)."""
        regression = Regression(blocks, self.weights, regression.kept)
        self.solution = regression.solution[: self._X.shape[1]]
        """Base parameters, shape (n_base,)."""
        self._root = root = np.sqrt(self.weights)[self._channel]
        self.covariance_root = inverse_root(regression.normal.information)
        """Root of the covariance of all fitted unknowns, base parameters first."""
        self._estimated = Basis(
            rows[:, 1:] * root[:, None],
            self._channel,
            self._starts,
            [blocks.layout.place(channel) for channel in range(e.n_channels)],
            self.covariance_root,
        )
        y, D = self._y[:, 0] * root, self._weighted
        self._residual = self._estimated.project_out(y)
        before = np.einsum("ij,ij->j", D, D)
        D = self._estimated.project_out(D)
        self._counts = blocks.counts[0]
        self._respond(D, root)
        self._left, self.information = D, np.einsum("ij,ij->j", D, D)
        self._scores = D.T @ self._residual
        silent = before <= NOTHING**2 * before.max(initial=0.0)
        self.visible: Mask = ~silent & (self.information > SPAN * before)
        """Columns outside the span of the estimated columns, shape (n_columns,)."""
        self.visible[list(self.given)] = False
        self.left = np.maximum(blocks.mean_squares(regression.solution), least)
        """Residual mean square of each channel, shape (n_channels,)."""
        self.misfit = float(self._counts @ np.log(self.left))
        """Log-likelihood times -2, except for a constant: differences are chi squares."""
        self._pieces = [slice(a, b) for a, b in pairwise([*self._starts.tolist(), len(y)])]
        self.shares = self._group_sums(D**2)
        """Information of each column by group, shape (n_groups, n_columns)."""

    def _respond(self, left: Array, root: Array) -> None:
        """Scale columns of delays and of backlash to the effect of these causes.

        Columns use the modelled torque, but a delay moves all of the torque. Adjusted for friction
        and base parameters, the derivatives of modelled and recorded torque may differ. So the
        column of a delay is an instrument (Wooldridge, Introductory Econometrics, 15.1) for the
        derivative of the recorded torque, which is too noisy to be the column itself. A backlash
        acts within milliseconds of a change of sign of the transmitted torque. So its column is an
        instrument for that by the parameters of all recordings with what these leave. The rest of
        the effect adds to the mean square of the axis.
        """
        self.elsewhere = np.zeros(left.shape[1])
        """Effect of a unit of each cause outside its column, as a share of its axis's mean square.
        """
        rate = -1e-3 * self.evidence.rate[self._order]
        for k, name in enumerate(self.columns.names):
            square = float(left[:, k] @ left[:, k])
            if k in self.columns.instead:
                effect = self.columns.instead[k][self._order]
            elif name.cause == "torque delay" and self.evidence.rate.any():
                effect = np.where(self._D[:, k] != 0.0, rate, 0.0)
            else:
                continue
            if square > 0.0:
                moved = self._estimated.project_out(effect * root)
                response = max(float(left[:, k] @ moved) / square, 0.0)
                left[:, k] *= response
                beside = float(moved @ moved) - response**2 * square
                self.elsewhere[k] = beside / self._counts[name.axis]

    def square(self, test: Test) -> float:
        """Return the weighted sum of squares of the torque of a cause."""
        torque = (self._D[:, test.columns] @ test.size) * self._root
        return float(torque @ torque)

    @property
    def _weighted(self) -> Array:
        """Return weighted columns, shape (n, n_columns)."""
        return np.asarray(self._D * self._root[:, None])

    def _group_sums(self, rows: Array) -> Array:
        return np.add.reduceat(rows, self._starts, axis=0)

    @cached_property
    def common(self) -> dict[int, Common]:
        """Return the common dispersion of causes by axis; -1 stands for all axes."""
        scores = self._group_sums(self._left * self._estimated.enlarge(self._residual)[:, None])
        return {
            axis: self._shared(
                axis, own, scores[:, own], self.shares[:, own], self.information[own]
            )
            for axis, (own, *_) in self._axes.items()
        }

    @cached_property
    def _axes(self) -> dict[int, _AxisColumns]:
        e, every = self.evidence, np.flatnonzero(self.visible)
        left = self._left[:, every]
        unit = left / np.sqrt(self.information[every])
        # dispersions are quadratic forms of the groups' scores; scores of columns i and j have the
        # covariance I_kij
        square = sum((D.T @ D) ** 2 for D in np.split(unit, self._starts[1:]))
        del unit  # free the memory
        length, products = np.sqrt(np.diag(square)), left.T @ left
        alike, found = square / np.outer(length, length), {}
        for axis in np.unique(self._axis).tolist():
            own = np.flatnonzero((self._axis[every] == axis) | (axis < 0))
            n_groups = len(np.unique(e.group[(e.axis == axis) | (axis < 0)]))
            block = np.ix_(own, own)
            mine = left if axis < 0 else left[:, own]
            found[axis] = _AxisColumns(every[own], mine, alike[block], n_groups, products[block])
        return found

    def _basis(self, columns: Sequence[int]) -> tuple[Indices, Array]:
        """Return visible columns among `columns`, and an orthonormalising matrix (k, rank)."""
        at = np.array([k for k in columns if self.visible[k]], dtype=np.intp)
        if not len(at):
            return at, np.zeros((0, 0))
        return at, orthonormal(self._left[:, at].T @ self._left[:, at])

    def gram(self, columns: Sequence[int]) -> Array:
        """Return inner products of columns adjusted for the estimated columns; 0 if invisible."""
        left = self._left[:, columns] * self.visible[list(columns)]
        return left.T @ left

    def drop(self, columns: Sequence[int]) -> tuple[float, int]:
        """Return the explained part of the weighted sum of squares, and the rank of a cause."""
        at, B = self._basis(columns)
        along = B.T @ self._scores[at]
        return float(along @ along), B.shape[1]

    @property
    def sizes(self) -> dict[tuple[str, int], float]:
        """Return the sizes of single-column causes, acting alone."""
        return {
            key: float(self.alone([k])[0])
            for key, (k, *more) in self.columns.tests.items()
            if not more and self.visible[k]
        }

    def alone(self, columns: Indices | list[int]) -> Array:
        """Return the sizes of columns, acting alone."""
        found: Array = self._scores[columns] / self.information[columns]
        return found

    def squares(self, columns: Indices) -> Array:
        """Return sums of squares of columns, adjusted and weighted, by axis, (n_channels, n)."""
        return self._squares[:, columns]

    @cached_property
    def _squares(self) -> Array:
        every = range(self.evidence.n_channels)
        own = (self._left[self._channel == channel] for channel in every)
        return np.array([np.einsum("ij,ij->j", D, D) for D in own])

    def most(self, squares: Array) -> Array:
        """Return the largest share of sums of squares in an axis's mean square."""
        found: Array = (squares / np.maximum(self._counts, 1.0)[:, None]).max(axis=0)
        return found

    def exceeds_the_rest(self, test: Test) -> bool:
        """Return True if a change makes more torque than the rest of the later rows, on some axis.

        Model error takes any smooth form, so a smaller change may be part of it.
        """
        effect = self._left[:, test.columns] @ test.size
        rest, effect = self._later_squares(np.column_stack([self._residual - effect, effect])).T
        return bool((effect > np.maximum(rest, np.finfo(float).tiny)).any())

    def least_change(self, columns: Indices) -> Array:
        """Return the sizes from which on `exceeds_the_rest` holds, also for `ANOTHER_SHAPE`."""
        rows = np.column_stack([self._residual, self._left[:, columns]])
        rest, *squares = self._later_squares(rows).T
        # the effect outside the column is part of the rest
        beside = np.outer(self.elsewhere[columns], self._counts)
        inside = np.maximum(np.array(squares) - beside, 0.0)
        with np.errstate(divide="ignore"):
            size = (inside / np.maximum(rest, np.finfo(float).tiny)).max(axis=1) ** -0.5
        return np.asarray(size / np.sqrt(1.0 - 2.0 * ANOTHER_SHAPE))

    def _later_squares(self, rows: Array) -> Array:
        """Return sums of squares of the later rows by axis, shape (n_channels, k)."""
        later = self.evidence.is_later[self._order]
        found = np.zeros((self.evidence.n_channels, rows.shape[1]))
        np.add.at(found, self._channel[later], rows[later] ** 2)
        return found

    def outweighed(self, squares: Array, size: Array) -> Array:
        """Return the ratio of the errors of causes at a size to the errors at small sizes.

        Axes are weighted by their residual torques, which include a cause of several axes until it
        is found. With weights w_a in place of 1, the error of the cause's size is larger by
        sqrt(sum_a I_a sum_a I_a w_a^2) / sum_a I_a w_a.

        Parameters
        ----------
        squares : ndarray, shape (n_channels, n)
        size : ndarray, shape (n,)
        """
        w = 1.0 / (1.0 + squares * size**2 / np.maximum(self._counts, 1.0)[:, None])
        total = squares.sum(axis=0) * (squares * w**2).sum(axis=0)
        found: Array = np.sqrt(total) / (squares * w).sum(axis=0)
        return found

    def test(self, columns: Sequence[int], *, itself: bool = False) -> Test | None:
        """Test a cause; return None if no part of it is visible.

        Parameters
        ----------
        itself : bool
            True for dispersion and noise after the cause is fitted.
        """
        at, B = self._basis(columns)
        if not len(at):
            return None
        cause, of_axis = self.columns.names[at[0]][:2]
        # gaps of a backlash are one cause
        same = np.array(self.columns.gaps(of_axis)) if cause.startswith("backlash ") else at
        U = self._left[:, at] @ B
        along, rank, axis = U.T @ self._residual, U.shape[1], int(self._axis[at[0]])
        rest = self._residual - U @ along
        enlarged = self._estimated.enlarge(rest)[:, None]
        shares = (self.shares[:, at] / self.information[at]).mean(axis=1, keepdims=True)
        each, d = dispersion(
            self._group_sums(U * enlarged), np.repeat(shares, rank, axis=1), np.ones(rank)
        )
        if itself:
            common = self._common_beside(axis, same, U, enlarged)
            # white noise of the residual without the cause, along the orthonormal U
            e, counts = self.evidence, np.maximum(self._counts, 1.0)
            square = np.bincount(self._channel, rest**2, e.n_channels) / counts
            square = np.maximum(square, e.finest**2 * self.weights)
            white = float(square[self._channel] @ (U**2).mean(axis=1))
        else:
            common, white = self.common[axis], 1.0
        others = self._others(axis, same, U if itself else None)
        degrees = max(float(common.degrees + d[0]), ALMOST_NONE)
        phi = (common.degrees * common.dispersion + d[0] * each.mean()) / degrees
        # wandering noise is the same in all columns of a group
        degrees = min(degrees, max(self._axes[axis].n_groups - 1.0, ALMOST_NONE))
        noise = Common(max(float(phi), white), degrees)
        # omega is relative to the residual, here to that without the cause
        omega = self.unchanged.get(nearest(self.columns.names[at[0]][:2]))
        parts = noise if omega is None else Common(white * omega.dispersion, omega.degrees)
        # the largest critical value of the three scales (F quantile)
        level = 1.0 - self.level / len(self.columns.tests)
        phi, degrees = max(
            (noise, others, parts),
            key=lambda scale: scale.dispersion * special.fdtri(rank, scale.degrees, level),
        )
        drop = float(along @ along)
        return Test(
            columns=at,
            size=B @ along,
            error=np.sqrt(phi * np.einsum("ij,ij->i", B, B)),
            degrees=degrees,
            drop=drop,
            p=float(special.fdtrc(rank, degrees, drop / rank / phi)),
            rank=rank,
            dispersion=phi,
            white=white,
        )

    def confirm(self, test: Test) -> Test:
        """Return a test with the bias by encoder noise removed, see `encoder_noise`."""
        if self._noise is None:
            return test
        at, B = self._basis(test.columns.tolist())
        bias = B.T @ self._bias(self._noise, at)
        along, spread = B.T @ self._scores[at] - bias / 2, bias / np.sqrt(12)
        # along has the covariance phi 1 + spread spread'; its inverse by Sherman and Morrison
        drop = along @ along - (along @ spread) ** 2 / (test.dispersion + spread @ spread)
        return test._replace(
            size=B @ along,
            error=np.hypot(test.error, B @ spread),
            drop=float(drop),
            p=float(special.fdtrc(test.rank, test.degrees, drop / test.rank / test.dispersion)),
        )

    def _bias(self, noise: EncoderNoise, at: Indices) -> Array:
        """Return the expected bias of the scores of columns by encoder noise, shape (k,)."""
        names = self.columns.names
        products = [noise.column_products(names[k]) for k in (*at, *self.given)]
        own, given = np.split(np.column_stack(products), [len(at)], axis=1)
        estimated = np.hstack([noise.parameter_products, given])
        weighted = self._D[:, at] * self._root[:, None]
        along = self._estimated.unknowns(weighted)[: estimated.shape[1]]
        return -self.weights @ (own - estimated @ along)

    def _common_beside(self, axis: int, at: Indices, U: Array, enlarged: Array) -> Common:
        """Return the common dispersion of an axis's columns without `at`, adjusted for `U`."""
        own, D, *_ = self._axes[axis]
        other = ~np.isin(own, at)
        own = own[other]
        along = (U.T @ D)[:, other]
        # inner products of D - U U'D within groups, from those of D and U
        beside = np.column_stack([enlarged, U])
        with_D, with_U = (
            np.stack([x[rows].T @ beside[rows] for rows in self._pieces]) for x in (D, U)
        )
        with_D = with_D[:, other]
        scores = with_D[..., 0] - with_U[..., 0] @ along
        shares = self.shares[:, own] + np.einsum(
            "gjr,rj->gj", (with_U[..., 1:] @ along).swapaxes(1, 2) - 2.0 * with_D[..., 1:], along
        )
        return self._shared(
            axis, own, scores, shares, self.information[own] - np.einsum("rj,rj->j", along, along)
        )

    def _others(self, axis: int, at: Indices, U: Array | None) -> Common:
        """Return psi: mean square explained by an axis's other columns, adjusted for `U`."""
        own, D, *_, products = self._axes[axis]
        other = ~np.isin(own, at)
        own, products, scores = own[other], products[np.ix_(other, other)], self._scores[own[other]]
        if U is not None:
            along = (U.T @ D)[:, other]
            products = products - along.T @ along
            scores = scores - along.T @ (U.T @ self._residual)
        information = np.diag(products)
        seen = information > SPAN * self.information[own]
        if not seen.any():
            return Common(0.0, ALMOST_NONE)
        z2 = scores[seen] ** 2 / information[seen]
        return Common(float(z2.mean()), freedom(products[np.ix_(seen, seen)]))

    def part_scales(self, part: Indices) -> dict[Key, Common]:
        """Return omega of each cause, from parts of unchanged recordings.

        Parameters
        ----------
        part : ndarray of int, shape (n,)
            Part of each row of the evidence, from 0.
        """
        part, weighted = part[self._order], self._weighted
        drops: dict[Key, list[tuple[float, int]]] = {key: [] for key in self.columns.tests}
        every, n_parts = np.zeros(len(self.columns.names)), int(part.max()) + 1
        seen = np.zeros(len(every))
        for k in range(n_parts):
            rows = part == k
            D, Q = weighted[rows], self._estimated.some(rows)
            left = D - Q @ (Q.T @ D)  # rows of other parts are -Q Q_k'D
            beside = D.T @ left
            scores, information = D.T @ self._residual[rows], np.diag(beside)
            before = np.einsum("ij,ij->j", D, D)
            visible = information > np.maximum(SPAN * before, np.finfo(float).tiny)
            every += np.where(visible, scores**2 / np.where(visible, information, 1.0), 0.0)
            seen += visible
            for key, columns in self.columns.tests.items():
                at = [each for each in columns if visible[each]]
                B = orthonormal(beside[np.ix_(at, at)])
                along = B.T @ scores[at]
                drops[key].append((float(along @ along), B.shape[1]))
        products = weighted.T @ weighted
        found: dict[Key, Common] = {}
        for key, each in drops.items():
            drop, n = np.sum(each, axis=0)
            same = (self._axis == key[1]) if key[1] >= 0 else np.ones(len(seen), dtype=bool)
            same &= seen > 0
            if not same.any() or not n:
                found[key] = Common(0.0, ALMOST_NONE)
                continue
            # psi_0 and its degrees of freedom, from all causes of the axis
            psi = float((every[same] / seen[same]).mean())
            degrees = freedom(products[np.ix_(same, same)])
            total = degrees + float(n)
            found[key] = Common((degrees * psi + float(drop)) / total, total)
        return found

    def _shared(
        self, axis: int, own: Indices, scores: Array, shares: Array, information: Array
    ) -> Common:
        """Return common dispersion from scores and information by group, (n_groups, n_own)."""
        seen = information > SPAN * self.information[own]
        if not seen.any():
            return Common(1.0, 0.0)
        scores, shares, information = scores[:, seen], shares[:, seen], information[seen]
        left = scores - shares / information * scores.sum(axis=0)
        phi, degrees = dispersion(left, shares, information)
        several = degrees >= ALMOST_NONE
        if not several.any():
            return Common(1.0, 0.0)
        place = np.searchsorted(self._axes[axis].columns, own[seen][several])
        alike = self._axes[axis].alike[np.ix_(place, place)]
        return moderated(phi[several], degrees[several], alike)


CACHED = ("common", "_axes", "_squares")
"""Attributes of a `Battery` that depend on the given causes."""
