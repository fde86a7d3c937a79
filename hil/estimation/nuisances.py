"""Model torque lags, soft gears and presliding as columns of a regression.

Each nuisance is a column, or a value whose derivative is a column, of any blocks
(`hil.least_squares.blocks`), independent of the signals in the blocks.

*Lag.* With the lag s of an axis the recorded torque is y(t) = f(t - s). The torque to be explained
is y(t + s), interpolated between shifts of the condensed torque, so a lag need not be a number of
samples. Near a first s the remainder is linear, y(t + s) = W(t) x - ds y'(t + s), so ds is
estimated with all other unknowns and s by Gauss-Newton.

*Soft gears.* Encoders are on the motor side of elastic gears: with a compliance c_j of the gear of
axis j and the transmitted torque Q_t,j, the link is at q_j = theta_j - c_j Q_t,j. To first order
this changes the torque of axis i by

    sum_j c_j K_ij,   K_ij = -(M_ij Q_t,j'' + dQ_t,i/dq_j Q_t,j + dQ_t,i/dqd_j Q_t,j'),

which is one further column shared by all axes.

*Presliding.* Surfaces in contact bend their asperities before sliding, so that friction reverses
over the presliding distance d. In Dahl's model the direction z, from -1 to 1, depends on the path
alone,

    dz / dq = (1 - z sign(dq)) / d,      z = s - (s - z_0) exp(-|q - q_0| / d)

while the axis moves in direction s from q_0 on, with z = z_0 at q_0 (P. R. Dahl, Solid friction
damping of mechanical vibrations, AIAA Journal 14 (1976) 1675-1682). With d = 0, z is the sign of
the velocity. Directions for several distances are condensed, too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.condensed import ROTOR
from hil.estimation.signals import interpolation
from hil.friction.terms import BENT, CLASSICAL
from hil.least_squares.choice import HeldOut, simplest
from hil.least_squares.regression import Regression, least_squares
from hil.model.dynamics import inverse_dynamics

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from hil.arrays import Array, Indices, Mask
    from hil.least_squares.blocks import Blocks
    from hil.least_squares.layout import Layout
    from hil.least_squares.regression import Covariance, Solver
    from hil.model.robot import Robot

STEP = 1e-6
"""Compliance step for calculating a column K by differences [rad/(N m)]: the angle is far above
rounding and far below the nonlinearity of K."""
AROUND = 3
"""Additional shifts for interpolation beyond any lag."""
WORST = 0.2
"""Largest accepted growth of the residual (rms) of an axis if other axes improve: equal to the
bound of the default method's residual over that of weighted least squares
(`benchmarks/real_machines.py`).
"""
KEPT = 4
"""Number of cached states per axis: the compared states, and as many earlier states."""
LAG = "lag"
_SHIFT, _OVER, _SOFT = "shift", "over", "compliance {}"


def shift_names(times: Array) -> list[str]:
    """Return the names of the own columns of shifted torques, for times after the first."""
    return [f"{_SHIFT} {k}" for k in range(1, len(times))]


def direction_names(distances: Sequence[float] | Array) -> list[str]:
    """Return the names of the own columns of friction directions, by presliding distance."""
    return [f"{_OVER} {k}" for k in range(len(distances))]


def compliance_names(robot: Robot) -> tuple[str, ...]:
    """Return the names of the shared columns of gear compliances, in `STEP`."""
    return tuple(_SOFT.format(axis + 1) for axis in range(robot.n_joints))


def gear_columns(robot: Robot, p: Array, motion: Sequence[Array], load: Sequence[Array]) -> Array:
    """Return K: torques for a compliance `STEP` of every gear, (n, n_joints, n_joints).

    Parameters
    ----------
    p : ndarray, shape (n_base,)
    motion, load : sequence (3,) of ndarray, shape (n, n_joints)
        Positions and transmitted torques, each with two derivatives.
    """
    rigid = inverse_dynamics(robot, p, *motion)
    found = np.empty((*rigid.shape, robot.n_joints))
    for joint, alone in enumerate(np.eye(robot.n_joints)):
        moved = (x - STEP * part * alone for x, part in zip(motion, load, strict=True))
        found[:, :, joint] = inverse_dynamics(robot, p, *moved) - rigid
    return found


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """State of the search: lags [s], unknown lags, soft gears, presliding indices.

    All of shape (n_joints,). `direction` is the index of the distance from 1 on; 0 for immediate
    reversal of friction.
    """

    lag: Array
    late: Mask
    soft: Mask
    direction: Indices

    @classmethod
    def start(cls, n: int, *, late: bool = False) -> State:
        """Create a state with rigid gears and immediate friction reversal, lags unknown or none."""
        rigid, at_once = np.zeros(n, dtype=bool), np.zeros(n, dtype=np.intp)
        return cls(np.zeros(n), np.full(n, late), rigid, at_once)

    def change_axis(self, what: str, axis: int, value: int = 1) -> State:
        """Return a copy with a changed `late`, `soft` or `direction` of an axis."""
        other = getattr(self, what).copy()
        other[axis] = value
        found = replace(self, **{what: other})
        return replace(found, lag=np.where(found.late, found.lag, 0.0))


class Search:
    """Regressions over blocks with state-dependent columns.

    Parameters
    ----------
    blocks : Blocks
        Blocks with the torque at the first of `times`; own columns are those of `shift_names` and
        `direction_names` and the terms of friction.
    times : ndarray, shape (k,)
        Evenly spaced time shifts of the condensed torque [s]; `AROUND` of them beyond either bound.
    bounds : tuple of float
        Smallest and largest lag [s].
    distances : ndarray, shape (k,), optional
        Presliding distances of the condensed friction directions.
    solver : callable
        Solver of `hil.least_squares.regression.Regression`.
    """

    def __init__(
        self,
        blocks: Blocks,
        times: Array,
        bounds: tuple[float, float],
        distances: Array | None = None,
        solver: Solver = least_squares,
    ) -> None:
        self._blocks, self._total, self._times = blocks, blocks.total, times
        self._distances = np.zeros(0) if distances is None else distances
        self._bounds, self._solver = bounds, solver
        self._terms = tuple(x for x in blocks.own if not x.startswith((f"{_SHIFT} ", f"{_OVER} ")))
        self._over = blocks.place(*direction_names(self._distances))
        self._names = tuple(name for name in blocks.shared if name != ROTOR)
        # products are cached by axis, since compared states differ on one axis
        self._seen: list[dict[tuple[float, int], Array]] = [{} for _ in range(blocks.n_channels)]
        self.weights = self.weighed(State.start(blocks.n_channels))
        self._ended: dict[int, State] = {}

    def weighed(self, state: State) -> Array:
        """Return weights of the axes by the residuals of a state."""
        blocks = self._state_blocks(self._total, state)
        return Regression.weighed(blocks, self._kept(blocks.layout, state)).weights

    def regression(self, state: State, *, total: bool = False) -> Regression:
        """Return the regression over the groups, or over the total."""
        blocks = self._state_blocks(self._total if total else self._blocks, state)
        return Regression(blocks, self.weights, self._kept(blocks.layout, state), self._solver)

    def converged(self, state: State) -> State:
        """Iterate the lags of a state by Gauss-Newton."""
        # maximum number of Gauss-Newton rounds
        for _ in range(12 if state.late.any() else 0):
            change = self.lags_of(self.regression(state, total=True).solution) * state.late
            before, state = (
                state.lag,
                replace(state, lag=np.clip(state.lag + change, *self._bounds)),
            )
            # change of a lag at convergence [s]: a hundredth of the standard error
            if np.abs(state.lag - before).max() < 1e-6:
                break
        return state

    def settled(self, state: State) -> State:
        """Iterate lags and weights of a state alternately."""
        # few rounds suffice: weights of axes hardly depend on lags
        for _ in range(3):
            self.weights = self.weighed(state)
            state = self.converged(state)
        return state

    def values(
        self, what: str, state: State, covariance: Covariance, most: int | None
    ) -> tuple[Array, Array]:
        """Return lags [s] of `late` axes or compliances [rad/(N m)] of `soft` axes, with errors.

        Both are 0 for axes without an unknown lag or compliance.
        """
        fit = self.regression(state).fit(covariance, most=most)
        error = np.sqrt(np.diag(fit.covariance).clip(0.0))
        if what == "late":
            return state.lag, self.lags_of(error)
        gears = [fit.layout.index(_SOFT.format(axis + 1)) for axis in range(fit.layout.n_channels)]
        return STEP * fit.x[gears], STEP * error[gears]

    def lags_of(self, x: Array) -> Array:
        """Return the entries of the lags in a vector of unknowns, shape (n_joints,)."""
        n, first = self._blocks.n_channels, len(self._names)
        return np.asarray(x[first + (len(self._terms) + 1) * np.arange(1, n + 1) - 1])

    def grown(
        self, state: State, axes: Sequence[int], more: Callable[[State, int], State | None]
    ) -> State:
        """Add nuisances with certain improvements of held-out predictions, axis by axis.

        Held-out blocks have neighbours from the same motion. So the prediction of either half of
        the recordings from the other must improve, too, and on no axis become worse by more than
        `WORST`.
        """
        left = list(axes)
        while left:
            self.weights = self.weighed(state)
            others = {axis: more(state, axis) for axis in left}
            best = self._best(state, {k: each for k, each in others.items() if each is not None})
            if best is None:
                break
            state = others[best] or state
            left.remove(best)
        return state

    def _best(self, state: State, others: Mapping[int, State]) -> int | None:
        """Return the axis with the best certain improvement of held-out predictions, if any."""
        states = {"none": state} | {str(axis): each for axis, each in others.items()}
        errors = {}
        for name, each in states.items():
            # lags are fitted to the remaining blocks
            found = self.regression(each)
            system = found.blocks.normal(self.weights)
            heard = np.einsum("bkk->k", system.N)[found.kept] > 0
            errors[name] = HeldOut(system, system).error(found.kept[heard])
        if simplest(errors, self._blocks.n_channels) == "none":
            return None
        before, least = self._predict_halves(state), float(errors["none"].sum())
        better = {
            int(name): float(error.sum())
            for name, error in errors.items()
            # the squares decrease in sum, and grow on no axis beyond `WORST`
            if error.sum() < least
            and (squares := self._predict_halves(states[name])).sum() < before.sum()
            and (squares <= (1.0 + WORST) ** 2 * before).all()
        }
        return min(better, key=lambda axis: better[axis]) if better else None

    def shown(self, axes: Sequence[int]) -> list[int]:
        """Return the axes that have more samples than unknowns; fewer samples fit any lag."""
        whole, terms = self._total, self._total.place(*self._terms)
        squares = np.einsum("jkk->jk", whole.products[0])[:, terms]
        unknowns = 1 + np.count_nonzero(squares > 0, axis=1)
        if whole.counts.sum() <= unknowns.sum() + len(self._names):
            return []
        return [axis for axis in axes if whole.counts[0, axis] > unknowns[axis]]

    def edges(self, state: State) -> dict[int, float]:
        """Return lags [s] at a bound of the search range with certainly better predictions.

        `add_lag` rejects such lags: beyond the bound the prediction might improve further.
        """
        found = {}
        for axis in [axis for axis in self._ended if not state.late[axis]]:
            if self.add_lag(state, axis) is None:
                at_bound = self._ended[axis]
                self.weights = self.weighed(state)
                if self._best(state, {axis: at_bound}) is not None:
                    found[axis] = float(at_bound.lag[axis])
        return found

    def add_lag(self, state: State, axis: int) -> State | None:
        """Return the state with a lag of a further axis; None outside the search range."""
        found = self.converged(state.change_axis("late", axis))
        if self._bounds[0] < found.lag[axis] < self._bounds[1]:
            return found
        self._ended[axis] = found
        return None

    def add_soft_gear(self, state: State, axis: int) -> State | None:
        """Return the state with a further soft gear; None for a negative compliance."""
        found = self.converged(state.change_axis("soft", axis))
        fit = self.regression(found, total=True)
        return found if fit.solution[fit.layout.index(_SOFT.format(axis + 1))] > 0 else None

    def add_presliding(self, state: State, axis: int) -> State | None:
        """Return the state with the best presliding distance of an axis.

        None if presliding does not reduce the residual of the axis with the classical law, too: the
        search fits all terms of friction, but the final law may have few.
        """
        tried = [state.change_axis("direction", axis, k + 1) for k in range(len(self._over))]
        best = min(tried, key=lambda other: float(self.weights @ self._left(other)))
        with_it, without = (self._left(each, CLASSICAL)[axis] for each in (best, state))
        return best if with_it < without else None

    def _left(self, state: State, terms: Sequence[str] = ()) -> Array:
        """Return squared residuals of every axis, with all or some terms of friction."""
        found = self.regression(state, total=True)
        if terms:
            found = replace(found, kept=self._kept(found.layout, state, terms))
        return np.asarray(found.blocks.squares_left(found.solution)[0])

    def _predict_halves(self, state: State) -> Array:
        """Return weighted squared errors of mutual predictions of the halves, by axis."""
        found = self.regression(state)
        middle = len(found.blocks) // 2
        left = np.zeros(found.blocks.n_channels)
        halves = [found.blocks.where(each) for each in (slice(middle), slice(middle, None))]
        for seen, other in (halves, halves[::-1]):
            # without weights of groups their sum suffices, which is solved much faster
            whole = seen.total if self._solver is least_squares else seen
            left += self.weights * other.total.squares_left(found.transfer(whole).solution)[0]
        return left

    def _kept(self, layout: Layout, state: State, terms: Sequence[str] = ()) -> Indices:
        """Return the unknowns of a state."""
        rigid = [_SOFT.format(axis + 1) for axis in np.flatnonzero(~state.soft)]
        own = dict.fromkeys((*(terms or self._terms), BENT, LAG))
        gone = zip(np.where(state.direction, "", BENT), np.where(state.late, "", LAG), strict=True)
        return layout.kept(
            [[term for term in own if term not in each and term in layout.own] for each in gone],
            [name for name in layout.shared if name not in rigid],
        )

    @cached_property
    def _unchanged(self) -> Array:
        """Column combinations common to every state, shape (m, m')."""
        columns = (*self._names, *self._terms)
        T = np.zeros((self._blocks.products.shape[-1], 2 + len(columns)))
        T[self._blocks.place(*columns), 1 + np.arange(len(columns))] = 1.0
        T[self._blocks.place(ROTOR), 0] = -1.0
        return T

    def _state_blocks(self, of: Blocks, state: State) -> Blocks:
        """Return blocks with lags compensated and friction directions of the state."""
        each = zip(state.lag.tolist(), state.direction.tolist(), strict=True)
        made = [self._axis_products(of, axis, *one) for axis, one in enumerate(each)]
        own, products = (*self._terms, LAG), np.stack(made, axis=1)
        return replace(of, shared=self._names, own=own, products=products)

    def _axis_products(self, of: Blocks, axis: int, lag: float, distance: int) -> Array:
        """Return inner products of an axis for a lag and a distance, (n_groups, m', m')."""
        if of is not self._blocks:
            return self._combined(of, axis, lag, distance)
        seen, state = self._seen[axis], (lag, distance)
        if state not in seen:
            if len(seen) == KEPT:
                del seen[next(iter(seen))]
            seen[state] = self._combined(of, axis, lag, distance)
        return seen[state]

    def _combined(self, of: Blocks, axis: int, lag: float, distance: int) -> Array:
        T, own = self._unchanged.copy(), (*self._terms, LAG)
        torques = np.append(0, of.place(*shift_names(self._times)))
        T[torques, 0], T[torques, -1] = self._interpolated(lag)
        if distance:
            low, high = max(distance - 2, 0), min(distance, len(self._over) - 1)
            coulomb, bend = (1 + len(self._names) + own.index(x) for x in ("Coulomb", BENT))
            bent = 1.0 / np.log(self._distances[high] / self._distances[low])
            T[:, coulomb] = 0.0
            T[self._over[distance - 1], coulomb] = 1.0
            T[self._over[[high, low]], bend] = bent, -bent
        return np.asarray(T.T @ of.products[:, axis] @ T)

    def _interpolated(self, lag: float) -> tuple[Array, Array]:
        """Return the torque as a combination of shifts, and the derivative by the lag [1/s]."""
        apart = float(self._times[1] - self._times[0])

        def weights(lag: float) -> Array:
            first, own = interpolation((lag - self._times[0]) / apart)
            found = np.zeros(len(self._times))
            found[first : first + len(own)] = own
            return found

        step = 1e-3 * apart
        slope = (weights(lag + step) - weights(lag - step)) / (2.0 * step)
        return weights(lag), -slope
