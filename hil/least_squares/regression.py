"""Weighted regression over blocks: channel weights, kept unknowns, solution and uncertainty.

The unknowns of all channels are estimated together,

    N x = v,    N = sum_j w_j W_j'W_j,    v = sum_j w_j W_j'y_j,

each channel weighted with the reciprocal of its residual variance, w_j, iterated with the solution
(`weighed`). The uncertainty depends on the assumed covariance, an argument of `fit`; the rules are
those of `hil.least_squares.uncertainty`, and the groups decide what they account for:

jackknife
    groups left out in turn: all differences between groups;
clusters
    Huber's sandwich over groups: equal to first order, faster for many groups;
CR2
    scores corrected for the influence of a group on the solution: for few groups per unknown;
white
    white residuals: for predictions and for comparison.

Model error, such as a missing shape of friction, repeats with the motion and shows in no group of
time. But it differs between parts of the state space. Cells of that space show model error as
groups of time show noise: each cell has a score, which is small for a complete model. If each
sample has noise, an error of its group of time and one of its cell, the variances over groups are
noise + time, over cells noise + state. The noise counts once: for the recordings with cells the
larger variance of each unknown counts,

    V = V_groups + C,    C_ii = max(over cells of each size, over groups of the same recordings)_ii
                                - (over groups of the same recordings)_ii,

with the correlations of C over cells, and the degrees of freedom of the groups. Cells that overlap
groups of time would show the noise itself (Cameron, Gelbach and Miller, J. Bus. Econ. Stat. 29
(2011) 238-249), but need all samples. Model error of an extent of several cells shows only in
larger ones, so neighbours are merged as well (`MERGED`). Cells of several partitions, labelled so,
show errors of several kinds; the largest of the variances counts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy import special

from hil.errors import InvalidArray
from hil.least_squares.layout import embedded
from hil.least_squares.normal_equations import Normal, reweighted
from hil.least_squares.solving import condition, inverse, inverse_root, solved
from hil.least_squares.uncertainty import (
    Solved,
    bias_reduced,
    corrected,
    degrees_if_white,
    jackknife,
    leave_out,
    sandwich,
    scatter,
)

if TYPE_CHECKING:
    from hil.arrays import Array, Indices
    from hil.least_squares.blocks import Blocks
    from hil.least_squares.layout import Layout

Solver = Callable[["Normal"], "tuple[Normal, Array]"]
"""Solver that weights and solves the groups' equations."""
Covariance = Literal["jackknife", "clusters", "CR2", "white"]
MERGED = (1, 2, 4)
"""Neighbouring cells merged, since model error has any extent in the state space."""
ROUNDS = 20
"""Maximum number of reweighting iterations; normally the loop converges earlier."""


def least_squares(equations: Normal) -> tuple[Normal, Array]:
    """Solve the groups' equations without further weights."""
    return equations, equations.solution()


@dataclass(frozen=True, eq=False)
class Regression:
    """Regression over blocks.

    Attributes
    ----------
    blocks : Blocks
    weights : ndarray, shape (n_channels,)
        Reciprocal residual variances.
    kept : ndarray of int
        Estimated unknowns; the others are zero.
    solver : callable
        Function that weights and solves the equations of groups.
    """

    blocks: Blocks
    weights: Array
    kept: Indices
    solver: Solver = least_squares

    @classmethod
    def weighed(
        cls,
        blocks: Blocks,
        kept: Indices | None = None,
        first: Array | None = None,
        rounds: int = ROUNDS,
    ) -> Regression:
        """Fit a regression with weights from the channels' residual variances.

        Parameters
        ----------
        kept : ndarray of int, optional
            Unknowns to estimate; by default all.
        first : ndarray, shape (n_channels,), optional
            Initial weights; by default the reciprocal mean squares of the torque.
        rounds : int
            Maximum number of iterations.
        """
        if kept is None:
            kept = np.arange(blocks.layout.size)
        # unweighted normal equations by channel instead of by group
        layout, total = blocks.layout, blocks.products.sum(axis=0)
        products = np.zeros((blocks.n_channels, 1 + layout.size, 1 + layout.size))
        for channel, owner in enumerate(blocks.owner.tolist()):
            at = np.concatenate([[0], 1 + layout.place(owner)])
            products[channel, at[:, np.newaxis], at] = total[channel]
        channels = Normal.split(products).only(kept)
        counts, heard = np.maximum(blocks.counts.sum(axis=0), 1.0), channels.square > 0
        squares = np.where(heard, channels.square, 1.0)
        # lower bound of a residual variance: rounding error of the torque
        least = np.finfo(float).eps * squares / counts
        if first is None:
            first = np.where(heard, counts / squares, 0.0)

        def weigh(weights: Array) -> Array:
            left = channels.error(channels.weighted(weights).solution()) / counts
            return np.asarray(np.where(heard, 1.0 / np.maximum(left, least), 0.0))

        return cls(blocks, reweighted(weigh, first, rounds), kept)

    def transfer(self, blocks: Blocks) -> Regression:
        """Create a regression of other blocks with the current weights."""
        return Regression(blocks, self.weights, self.kept, self.solver)

    @property
    def layout(self) -> Layout:
        """Layout of the unknowns, kept or not."""
        return self.blocks.layout

    @cached_property
    def _solved(self) -> tuple[Normal, Array]:
        return self.solver(self.blocks.normal(self.weights).only(self.kept))

    @property
    def normal(self) -> Normal:
        """Normal equations of the kept unknowns by group, with the solver's weights."""
        return self._solved[0]

    @cached_property
    def solution(self) -> Array:
        """Solution for the whole layout, shape (n,), zero for unknowns not kept."""
        return embedded(self._solved[1], self.kept, self.layout.size)

    def moved(self, torques: Blocks) -> Array:
        """Compute the change of the unknowns by additional torque on one axis at a time.

        Parameters
        ----------
        torques : Blocks
            Blocks with the additional torque in place of the torque.

        Returns
        -------
        ndarray, shape (n, n_axes)
        """
        total, of = torques.total, torques.owner
        found = np.zeros((self.layout.size, self.layout.n_channels))
        for axis in range(found.shape[1]):
            side = total.normal(np.where(of == axis, self.weights, 0.0)).vector[self.kept]
            found[self.kept, axis] = solved(self.normal.information, side)
        return found

    def uncertainty(
        self,
        covariance: Covariance = "jackknife",
        cells: Blocks | None = None,
        most: int | None = None,
    ) -> Solved:
        """Compute the kept unknowns, with covariance and degrees of freedom.

        Parameters
        ----------
        covariance : str
            Covariance rule.
        cells : Blocks, optional
            Samples grouped in cells, successive ones neighbours; not for white noise. The label
            "partition" tells apart several divisions of the same samples.
        most : int, optional
            Maximum number of groups: successive groups are merged to include longer disturbances.
        """
        normal = self.normal if most is None else self.normal.grouped(most)
        x = self.solution[self.kept]
        inverted = inverse(normal.information)
        degrees = degrees_if_white(inverted, normal.N)
        if covariance == "jackknife":
            found = jackknife(leave_out(normal.N, normal.scores(x)))
        elif covariance == "clusters":
            found = sandwich(inverted, scatter(normal.scores(x), few=True))
        elif covariance == "CR2":
            found = bias_reduced(normal.N, normal.v).covariance
        else:
            found = inverted
            freedom = self.blocks.counts.sum() - len(self.kept)
            degrees = np.full(len(x), max(float(freedom), 1.0))
        if cells is not None and covariance != "white":
            found = found + self._beyond_groups(cells, covariance, most)
        return Solved(x, found, degrees)

    def _beyond_groups(self, cells: Blocks, covariance: Covariance, most: int | None) -> Array:
        """Compute the covariance that cells show beyond the groups of the same recordings."""
        every = inverse(self.normal.information)

        def spread(equations: Normal) -> Array:
            # cells hold other samples at the ends of pieces, and no columns of time: the solution
            # and the shares of each are those of its own equations
            scores, own = equations.scores(equations.solution()), equations.information
            if covariance == "CR2":
                scores = corrected(inverse_root(own), equations.N, scores) @ own
            return scatter((scores @ every)[equations.square > 0], few=True)

        weights = np.where(cells.counts.any(axis=0), self.weights, 0.0)
        of = cells.labels.get("partition", np.zeros(len(cells)))
        parts = (self.blocks, *(cells.where(of == number) for number in np.unique(of)))
        groups, *every_way = (part.normal(weights).only(self.kept) for part in parts)
        noise = spread(groups if most is None else groups.grouped(most))
        sizes = [
            spread(each.grouped(-(-len(each.N) // merged)))
            for each in every_way
            for merged in MERGED
        ]
        variances = np.diagonal([noise, *sizes], axis1=1, axis2=2)
        beyond, whole = variances.max(axis=0) - variances[0], np.sum(sizes, axis=0)
        scale = np.sqrt(beyond / np.maximum(np.diag(whole), np.finfo(float).tiny))
        return np.asarray(scale[:, np.newaxis] * whole * scale)

    def fit(
        self,
        covariance: Covariance = "jackknife",
        cells: Blocks | None = None,
        most: int | None = None,
    ) -> Fit:
        """Solve and compute the uncertainty; parameters as in `uncertainty`."""
        error, n = self.uncertainty(covariance, cells, most), self.layout.size
        return Fit(
            layout=self.layout,
            kept=self.kept,
            x=self.solution,
            covariance=embedded(error.covariance, self.kept, n),
            degrees_of_freedom=embedded(error.degrees_of_freedom, self.kept, n),
            condition=condition(self.normal.information),
        )


class ByName:
    """Named unknowns: values, standard errors and intervals, in SI."""

    @property
    def _found(self) -> dict[str, tuple[float, float]]:
        """Value and standard error by name."""
        raise NotImplementedError

    def _half_widths(self, level: float) -> dict[str, float]:
        """Return half-widths by name for unknowns with degrees of freedom; the rest are normal."""
        raise NotImplementedError

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the estimated unknowns."""
        return tuple(self._found)

    @property
    def params(self) -> dict[str, float]:
        """Values by name."""
        return {name: value for name, (value, _) in self._found.items()}

    @property
    def bse(self) -> dict[str, float]:
        """Standard errors by name, as statsmodels calls them."""
        return {name: error for name, (_, error) in self._found.items()}

    @property
    def tvalues(self) -> dict[str, float]:
        """Values divided by standard errors, by name."""
        return {n: x / error if error else float("nan") for n, (x, error) in self._found.items()}

    def conf_int(self, alpha: float = 0.05) -> dict[str, tuple[float, float]]:
        """Compute confidence intervals by name, from Student's t for few degrees of freedom.

        Parameters
        ----------
        alpha : float
            Probability that an interval misses the value, as in statsmodels: 0.05 for 95 %
            intervals.

        Raises
        ------
        InvalidArray
            `alpha` is not above 0 and at most 0.5.
        """
        if not 0 < alpha <= 0.5:
            raise InvalidArray(
                f"alpha {alpha} must be above 0 and at most 0.5: 0.05 is for intervals of 95 %"
            )
        normal, half = float(special.ndtri(1 - alpha / 2)), self._half_widths(1 - alpha)
        found = {}
        for name, (value, error) in self._found.items():
            width = half.get(name, normal * error)
            found[name] = value - width, value + width
        return found


@dataclass(frozen=True, eq=False)
class Fit(ByName):
    """Named unknowns with uncertainty; unknowns not kept are left out.

    Attributes
    ----------
    layout : Layout
    kept : ndarray of int
        Estimated unknowns; the others are zero and not part of the results.
    x : ndarray, shape (n,)
    covariance : ndarray, shape (n, n)
    degrees_of_freedom : ndarray, shape (n,)
    condition : float
        Condition number of the weighted columns at unit length.
    """

    layout: Layout
    kept: Indices
    x: Array
    covariance: Array
    degrees_of_freedom: Array
    condition: float

    @cached_property
    def _found(self) -> dict[str, tuple[float, float]]:
        names = [self.layout.names[k] for k in self.kept]
        errors = np.sqrt(np.diag(self.covariance)[self.kept].clip(0.0)).tolist()
        pairs = zip(self.x[self.kept].tolist(), errors, strict=True)
        return dict(zip(names, pairs, strict=True))

    def _half_widths(self, level: float) -> dict[str, float]:
        t = special.stdtrit(self.degrees_of_freedom[self.kept], 0.5 + level / 2).tolist()
        errors = self.bse.items()
        return {name: each * error for each, (name, error) in zip(t, errors, strict=True)}
