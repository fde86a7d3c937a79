"""Normal equations of two runs of one robot, without and with a load at its last link.

With s = 0 and 1 for the run without and with the load,

    g_i y_i - Qm_i - s A_i K_n phi_known = A_i p + s A_i K_n phi + C_i c_s + F_i a_is - d_i tau_i,

phi being the load's parameters as far as they are unknown, K_n their columns in the base
parameters. Parameters, load and gains are shared; friction has the same law in both runs, the
richer of those that either chooses, but a level of its own in each. Unknown gains are linearised
as in `scaling`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.choice import kept_by
from hil.estimation.free_motion.columns import ROTOR
from hil.estimation.free_motion.friction_terms import COLUMNS, LAWS
from hil.estimation.free_motion.scaling import CONVERGED, ROUNDS, STRIDE, Scaling
from hil.estimation.free_motion.solution import BLOCKS
from hil.least_squares.layout import Layout, embedded
from hil.least_squares.normal_equations import Normal
from hil.least_squares.regression import Regression
from hil.least_squares.solving import solved

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.estimation.free_motion.gathering import Gathered
    from hil.least_squares.blocks import Blocks


@dataclass(frozen=True, slots=True, eq=False)
class LoadTerms:
    """How a load enters the base parameters: ``known + columns theta``.

    Attributes
    ----------
    known : ndarray, shape (n_base,)
    columns : ndarray, shape (n_base, k)
    """

    known: Array
    columns: Array


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Gains of all axes and the solution that belongs to them.

    Attributes
    ----------
    gains : ndarray, shape (n_joints,)
        [N m or N for one unit of the signal].
    x : ndarray, shape (n,)
        Base parameters, theta, the gains' changes, then coupled motors' and own friction of the run
        without and of the run with the load.
    """

    gains: Array
    x: Array


class TwoRuns:
    """Equations of both runs.

    Parameters
    ----------
    runs : sequence of Gathered
        Without and with the load.
    axes : tuple of int
        From 0, whose gains are unknown.
    """

    def __init__(self, runs: Sequence[Gathered], n_base: int, axes: tuple[int, ...]) -> None:
        self.n_base, self.axes = n_base, axes
        first = runs[0].recorded
        self.n_joints = first.n_joints
        self._n_coupled = len(first.layout.shared) - 1 - n_base
        order = list(LAWS)
        self.laws = tuple(
            max(pair, key=order.index) for pair in zip(*(r.choice.laws for r in runs), strict=True)
        )
        slowest = max(run.choice.slowest for run in runs)
        self._own = kept_by(Layout((), COLUMNS, first.layout.channels), self.laws)
        self._pieces = [run.recorded.pieces[slowest].grouped(BLOCKS) for run in runs]
        self._cells = [run.recorded.cells[slowest] for run in runs]
        self._weights = [self._weights_of(run, slowest) for run in runs]

    @property
    def n_own(self) -> int:
        """Unknowns that belong to one run alone."""
        return self._n_coupled + len(self._own)

    def solved(self, terms: LoadTerms, gains: Array) -> State:
        """Solution by Gauss and Newton's method, from gains to begin with."""
        k, n = terms.columns.shape[1], len(self.axes)
        first = self.n_base + k
        state = State(gains.copy(), np.zeros(first + n + 2 * self.n_own))
        totals = [run.total for run in self._pieces]
        # as if the gains were right: until there is a solution their columns are not those of one
        linear = np.delete(np.arange(len(state.x)), np.arange(first, first + n))
        whole = self._equations(terms, state, totals)
        state = State(state.gains, whole.solution(linear))
        for _ in range(ROUNDS if n else 0):
            whole = self._equations(terms, state, totals)
            x = whole.solution()
            change = np.clip(x[first : first + n], -STRIDE, STRIDE)
            gains = state.gains.copy()
            gains[list(self.axes)] *= np.exp(change)
            x[first : first + n] = 0.0
            state = State(gains, x)
            if np.abs(change).max(initial=0.0) < CONVERGED:
                break
        return state

    def pieces(self, terms: LoadTerms, state: State) -> Normal:
        """Equations by blocks of time, those of the run without the load first."""
        return self._equations(terms, state, self._pieces)

    def cells(self, terms: LoadTerms, state: State) -> Normal:
        """The same by cells of states."""
        return self._equations(terms, state, self._cells)

    def effect(self, terms: LoadTerms, state: State, shares: Array) -> Array:
        """Change of all unknowns by a share of each axis's gain, shape (n, n_joints)."""
        N = self.pieces(terms, state).information
        found = np.zeros((len(N), self.n_joints))
        for axis in np.flatnonzero(shares):
            alone = np.where(np.arange(self.n_joints) == axis, 1.0, 0.0)
            v = self._equations(terms, state, self._pieces, signal=alone).vector
            found[:, axis] = shares[axis] * solved(N, v)
        return found

    def _equations(
        self,
        terms: LoadTerms,
        state: State,
        blocks: Sequence[Blocks],
        signal: Array | None = None,
    ) -> Normal:
        """Equations of given products; where `signal` is given, of the signals of those axes."""
        parts = []
        for s, taken in enumerate(blocks):
            weights = self._weights[s] * (1.0 if signal is None else signal)
            parts.append(self._placed(self._of_run(terms, state, taken, s, weights, signal), s))
        return Normal(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    def _of_run(
        self,
        terms: LoadTerms,
        state: State,
        run: Blocks,
        s: int,
        weights: Array,
        signal: Array | None,
    ) -> Normal:
        scaling = Scaling(state.gains, self.axes, self._solution(terms, state, s))
        first = scaling.signal(run.layout)
        if signal is None:
            first[:, 1 + run.layout.at(ROTOR)] = -1.0
            first[:, 1 : 1 + self.n_base] = -s * terms.known
        load = {f"load {k}": np.zeros_like(first) for k in range(terms.columns.shape[1])}
        for each, column in zip(load.values(), terms.columns.T, strict=True):
            each[:, 1 : 1 + self.n_base] = s * column
        blocks = run.recast(first, load | scaling.columns(run.layout), (ROTOR,))
        return blocks.normal(weights).only(kept_by(blocks.layout, self.laws))

    def _solution(self, terms: LoadTerms, state: State, s: int) -> Array:
        """Base parameters and friction of one run, as `Scaling` takes them."""
        n, k = self.n_base, terms.columns.shape[1]
        p = state.x[:n] + s * (terms.known + terms.columns @ state.x[n : n + k])
        own = state.x[n + k + len(self.axes) + s * self.n_own :][: self.n_own]
        friction = embedded(own[self._n_coupled :], self._own, self.n_joints * len(COLUMNS))
        return np.concatenate([p, own[: self._n_coupled], friction])

    def _placed(self, system: Normal, s: int) -> tuple[Array, Array, Array]:
        """Equations of one run among the unknowns of both."""
        n, c = self.n_base, self._n_coupled
        n_shared = system.N.shape[1] - self.n_own
        size, own = n_shared + 2 * self.n_own, n_shared + s * self.n_own
        place = np.concatenate([
            np.arange(n), own + np.arange(c), np.arange(n, n_shared),
            own + c + np.arange(len(self._own)),
        ])  # fmt: skip
        N, v = np.zeros((len(system.v), size, size)), np.zeros((len(system.v), size))
        N[:, place[:, np.newaxis], place], v[:, place] = system.N, system.v
        return N, v, system.square

    def _weights_of(self, run: Gathered, slowest: int) -> Array:
        """Reciprocal residual variances by a fit of this run alone."""
        blocks = run.scaling.applied(run.recorded.pieces[slowest].total)
        return Regression.weighed(blocks, kept_by(blocks.layout, self.laws)).weights
