"""Nuisances beside all other unknowns: lags of torques, soft gears, presliding.

Each is a column, or a value whose derivative is one, of any blocks (`hil.least_squares.blocks`),
whatever signals these were made of.

*Lag.* With the lag s of an axis its recorded torque is y(t) = f(t - s). What is explained is
y(t + s), interpolated between shifts at which the torque is condensed, so a lag need not be a
number of samples. Near a first s the rest of it is linear, y(t + s) = W(t) x - ds y'(t + s), so ds
is found with all other unknowns and s by Gauss and Newton's method.

*Soft gears.* Encoders sit on the motors' side of gears that give way: with a compliance c_j of the
gear of axis j, which transmits Q_t,j, the link is at q_j = theta_j - c_j Q_t,j. To first order that
changes the torque of axis i by

    sum_j c_j K_ij,   K_ij = -(M_ij Q_t,j'' + dQ_t,i/dq_j Q_t,j + dQ_t,i/dqd_j Q_t,j'),

which is one more column that all axes share.

*Presliding.* Surfaces that touch bend their asperities before they slide, so that friction turns
round over the presliding distance d. Dahl's model has its direction z, from -1 to 1, follow the way
alone,

    dz / dq = (1 - z sign(dq)) / d,      z = s - (s - z_0) exp(-|q - q_0| / d)

while the axis moves in direction s from q_0 on, where it was z_0 (P. R. Dahl, Solid friction
damping of mechanical vibrations, AIAA Journal 14 (1976) 1675-1682). With d = 0 it is the sign of
the velocity. Directions over some distances are condensed, too.
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
"""Compliance for which a column K is calculated, by differences [rad/(N m)]: the angle is far
above rounding and far below what bends K."""
AROUND = 3
"""Shifts that interpolation needs beyond any lag."""
WORST = 0.2
"""Growth of the residual (rms) of one axis that no gain of others is worth: by so much the default
may leave more than weighted least squares on any axis (`benchmarks/real_machines.py`)."""
KEPT = 4
"""States of an axis whose inner products are kept: those that are compared, and as many before."""
LAG = "lag"
_SHIFT, _OVER, _SOFT = "shift", "over", "compliance {}"


def shift_names(times: Array) -> list[str]:
    """Own columns of the torque at all but the first of some times."""
    return [f"{_SHIFT} {k}" for k in range(1, len(times))]


def over_names(distances: Sequence[float] | Array) -> list[str]:
    """Own columns of the direction of friction over some distances."""
    return [f"{_OVER} {k}" for k in range(len(distances))]


def compliance_names(robot: Robot) -> tuple[str, ...]:
    """Shared columns of the gears' compliances, in `STEP`."""
    return tuple(_SOFT.format(axis + 1) for axis in range(robot.n_joints))


def gear_columns(robot: Robot, p: Array, motion: Sequence[Array], load: Sequence[Array]) -> Array:
    """K: torque of each axis by a compliance `STEP` of each gear, shape (n, n_joints, n_joints).

    Parameters
    ----------
    p : ndarray, shape (n_base,)
    motion, load : sequence (3,) of ndarray, shape (n, n_joints)
        Positions and the torques that gears transmit, and two derivatives of either.
    """
    rigid = inverse_dynamics(robot, p, *motion)
    found = np.empty((*rigid.shape, robot.n_joints))
    for joint, alone in enumerate(np.eye(robot.n_joints)):
        moved = (x - STEP * part * alone for x, part in zip(motion, load, strict=True))
        found[:, :, joint] = inverse_dynamics(robot, p, *moved) - rigid
    return found


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Lags [s], axes of unknown lag, soft gears, and each axis's distance from 1 on, or 0.

    All of shape (n_joints,).
    """

    lag: Array
    late: Mask
    soft: Mask
    direction: Indices

    @classmethod
    def of(cls, n: int, *, late: bool = False) -> State:
        """All lags unknown or none, all gears rigid, all friction turning round at once."""
        rigid, at_once = np.zeros(n, dtype=bool), np.zeros(n, dtype=np.intp)
        return cls(np.zeros(n), np.full(n, late), rigid, at_once)

    def with_one(self, what: str, axis: int, value: int = 1) -> State:
        """The same with `late`, `soft` or `direction` of one axis changed."""
        other = getattr(self, what).copy()
        other[axis] = value
        found = replace(self, **{what: other})
        return replace(found, lag=np.where(found.late, found.lag, 0.0))


class Search:
    """Regressions over blocks of which the columns depend on a state.

    Parameters
    ----------
    blocks : Blocks
        Of the torque at the first of `times`; own columns are those of `shift_names` and
        `over_names` besides terms of friction.
    times : ndarray, shape (k,)
        Instants, evenly apart, by which the torque is condensed later [s]; `AROUND` of them beyond
        either bound.
    bounds : tuple of float
        Least and largest lag [s].
    distances : ndarray, shape (k,), optional
        Over which directions of friction are condensed.
    solver : callable
        As of `hil.least_squares.regression.Regression`.
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
        self._over = blocks.place(*over_names(self._distances))
        self._names = tuple(name for name in blocks.shared if name != ROTOR)
        # states that are compared differ on one axis
        self._seen: list[dict[tuple[float, int], Array]] = [{} for _ in range(blocks.n_channels)]
        self.weights = self.weighed(State.of(blocks.n_channels))
        self._ended: dict[int, State] = {}

    def weighed(self, state: State) -> Array:
        """Weights of the axes by what a state leaves."""
        blocks = self._at(self._total, state)
        return Regression.weighed(blocks, self._kept(blocks.layout, state)).weights

    def regression(self, state: State, *, total: bool = False) -> Regression:
        """Regression over all groups, or their total."""
        blocks = self._at(self._total if total else self._blocks, state)
        return Regression(blocks, self.weights, self._kept(blocks.layout, state), self._solver)

    def converged(self, state: State) -> State:
        """State with lags by Gauss and Newton's method."""
        # rounds of Gauss and Newton's method, at most
        for _ in range(12 if state.late.any() else 0):
            change = self.lags_of(self.regression(state, total=True).solution) * state.late
            before, state = (
                state.lag,
                replace(state, lag=np.clip(state.lag + change, *self._bounds)),
            )
            # change of a lag after which the next no longer matters [s]: a hundredth of its
            # standard error
            if np.abs(state.lag - before).max() < 1e-6:
                break
        return state

    def settled(self, state: State) -> State:
        """State with lags and weights found from each other."""
        # times that lags and weights are found from each other: weights of axes hardly depend on
        # lags
        for _ in range(3):
            self.weights = self.weighed(state)
            state = self.converged(state)
        return state

    def values(
        self, what: str, state: State, covariance: Covariance, most: int | None
    ) -> tuple[Array, Array]:
        """Lags [s] of `late` axes or compliances [rad/(N m)] of `soft` ones, and their errors.

        Both are 0 where none is unknown.
        """
        fit = self.regression(state).fit(covariance, most=most)
        error = np.sqrt(np.diag(fit.covariance).clip(0.0))
        if what == "late":
            return state.lag, self.lags_of(error)
        gears = [fit.layout.index(_SOFT.format(axis + 1)) for axis in range(fit.layout.n_channels)]
        return STEP * fit.x[gears], STEP * error[gears]

    def lags_of(self, x: Array) -> Array:
        """What stands at the lags among all unknowns, shape (n_joints,)."""
        n, first = self._blocks.n_channels, len(self._names)
        return np.asarray(x[first + (len(self._terms) + 1) * np.arange(1, n + 1) - 1])

    def grown(
        self, state: State, axes: Sequence[int], more: Callable[[State, int], State | None]
    ) -> State:
        """State with what predicts held-out blocks certainly better, axis by axis.

        Blocks that are held out have others of the same motion nearby. So either half of the
        recordings must be predicted from the other better, too, and on no axis by `WORST` worse.
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
        """Axis of the state that predicts held-out blocks certainly better and best, if any."""
        states = {"none": state} | {str(axis): each for axis, each in others.items()}
        errors = {name: self._held_out(each) for name, each in states.items()}
        if simplest(errors, self._blocks.n_channels) == "none":
            return None
        before, least = self._by_halves(state), float(errors["none"].sum())
        better = {
            int(name): float(error.sum())
            for name, error in errors.items()
            if error.sum() < least and _no_worse(self._by_halves(states[name]), before)
        }
        return min(better, key=lambda axis: better[axis]) if better else None

    def edges(self, state: State) -> dict[int, float]:
        """Lags of axes [s] that end at a bound of the search, and predict certainly better there.

        None of them is admitted by `with_lag`: beyond the bound it might be better yet.
        """
        found = {}
        for axis in [axis for axis in self._ended if not state.late[axis]]:
            if self.with_lag(state, axis) is None:
                at_bound = self._ended[axis]
                self.weights = self.weighed(state)
                if self._best(state, {axis: at_bound}) is not None:
                    found[axis] = float(at_bound.lag[axis])
        return found

    def with_lag(self, state: State, axis: int) -> State | None:
        """State with a lag of one more axis; None where it is beyond all that is looked for."""
        found = self.converged(state.with_one("late", axis))
        if self._bounds[0] < found.lag[axis] < self._bounds[1]:
            return found
        self._ended[axis] = found
        return None

    def with_soft(self, state: State, axis: int) -> State | None:
        """State with one more gear that gives way; None where it would stiffen with the torque."""
        found = self.converged(state.with_one("soft", axis))
        fit = self.regression(found, total=True)
        return found if fit.solution[fit.layout.index(_SOFT.format(axis + 1))] > 0 else None

    def with_distance(self, state: State, axis: int) -> State | None:
        """State with the presliding distance of one axis that fits best.

        None where the usual law leaves no less of the axis with it: another law than all terms may
        be chosen in the end, or none.
        """
        tried = [state.with_one("direction", axis, k + 1) for k in range(len(self._over))]
        best = min(tried, key=lambda other: float(self.weights @ self._left(other)))
        with_it, without = (self._left(each, CLASSICAL)[axis] for each in (best, state))
        return best if with_it < without else None

    def _left(self, state: State, terms: Sequence[str] = ()) -> Array:
        """Squares that a state leaves of each axis, with all or some terms of friction."""
        found = self.regression(state, total=True)
        if terms:
            found = replace(found, kept=self._kept(found.layout, state, terms))
        return np.asarray(found.blocks.squares_left(found.solution)[0])

    def _held_out(self, state: State) -> Array:
        """Squared errors on blocks that were held out, lags fitted without them."""
        found = self.regression(state)
        system = found.blocks.normal(self.weights)
        heard = np.einsum("bkk->k", system.N)[found.kept] > 0
        return HeldOut(system, system).error(found.kept[heard])

    def _by_halves(self, state: State) -> Array:
        """Weighted squares of each axis that a fit to one half leaves of the other."""
        found = self.regression(state)
        half = np.arange(len(found.blocks)) < len(found.blocks) // 2
        left = np.zeros(found.blocks.n_channels)
        for seen in (half, ~half):
            x = found.transfer(found.blocks.where(seen)).solution
            left += self.weights * found.blocks.where(~seen).total.squares_left(x)[0]
        return left

    def _kept(self, layout: Layout, state: State, terms: Sequence[str] = ()) -> Indices:
        """Unknowns of a state."""
        rigid = [_SOFT.format(axis + 1) for axis in np.flatnonzero(~state.soft)]
        own = dict.fromkeys((*(terms or self._terms), BENT, LAG))
        gone = zip(np.where(state.direction, "", BENT), np.where(state.late, "", LAG), strict=True)
        return layout.kept(
            [[term for term in own if term not in each and term in layout.own] for each in gone],
            [name for name in layout.shared if name not in rigid],
        )

    @cached_property
    def _unchanged(self) -> Array:
        """Combinations that no state changes, shape (m, m')."""
        columns = (*self._names, *self._terms)
        T = np.zeros((self._blocks.products.shape[-1], 2 + len(columns)))
        T[self._blocks.place(*columns), 1 + np.arange(len(columns))] = 1.0
        T[self._blocks.place(ROTOR), 0] = -1.0
        return T

    def _at(self, of: Blocks, state: State) -> Blocks:
        """Blocks of torques as early as positions, directions over the state's distances."""
        each = zip(state.lag.tolist(), state.direction.tolist(), strict=True)
        made = [self._of_axis(of, axis, *one) for axis, one in enumerate(each)]
        own, products = (*self._terms, LAG), np.stack(made, axis=1)
        return replace(of, shared=self._names, own=own, products=products)

    def _of_axis(self, of: Blocks, axis: int, lag: float, distance: int) -> Array:
        """Inner products of one axis with its lag and distance, shape (n_groups, m', m')."""
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
        """Torque as a combination of shifts, and what a greater lag takes from it [1/s]."""
        apart = float(self._times[1] - self._times[0])

        def weights(lag: float) -> Array:
            first, own = interpolation((lag - self._times[0]) / apart)
            found = np.zeros(len(self._times))
            found[first : first + len(own)] = own
            return found

        step = 1e-3 * apart
        slope = (weights(lag + step) - weights(lag - step)) / (2.0 * step)
        return weights(lag), -slope


def _no_worse(squares: Array, before: Array) -> bool:
    """Whether squares of all axes are fewer in sum, and on none more than `WORST` allows."""
    most = (1.0 + WORST) ** 2 * before
    return bool(squares.sum() < before.sum() and (squares <= most).all())
