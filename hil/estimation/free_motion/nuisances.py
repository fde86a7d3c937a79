"""Lags of torques and presliding of free motions, found beside all terms of friction.

*Lag.* With the lag s of an axis its recorded torque is y(t) = f(t - s). What is explained is
y(t + s), interpolated between shifts at which the torque is condensed, so a lag need not be a
number of samples. Near a first s the rest of it is linear, y(t + s) = W(t) x - ds y'(t + s), so ds
is found with all other unknowns and s by Gauss and Newton's method.

*Presliding.* Surfaces that touch bend their asperities before they slide, so that friction turns
round over the presliding distance d. Dahl's model has its direction z, from -1 to 1, follow the way
alone,

    dz / dq = (1 - z sign(dq)) / d,      z = s - (s - z_0) exp(-|q - q_0| / d)

while the axis moves in direction s from q_0 on, where it was z_0 (P. R. Dahl, Solid friction
damping of mechanical vibrations, AIAA Journal 14 (1976) 1675-1682). With d = 0 it is the sign of
the velocity. Directions over some distances are condensed, too; what lies between is left to the
column of how the direction bends with the distance, which the estimate itself has.

Beside a law of friction that is too poor, either makes up for what the law lacks: of 3 minutes of
an arm without any lag, lags of -1.9 and -4.4 ms were found beside Coulomb's friction at all speeds,
and torques of its bodies 1.1 % off; beside all terms and above the least dead zone, 0.4 ± 0.4 ms.
So a lag is looked for on fast samples, where friction after a reversal cannot be taken for it, and
then presliding, with lags taken back, on all samples, where it shows. Both are admitted one axis
after the other: that which predicts held-out blocks best, if it does so certainly better than
without it (`hil.least_squares.choice`), all that was admitted being found anew with it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.accumulation import SPEEDS, division, recorded_products
from hil.estimation.free_motion.choice import dead_zone_of, usual
from hil.estimation.free_motion.columns import ROTOR, axis_columns, shared_names
from hil.estimation.free_motion.motion import filtered_motion, low_passed
from hil.estimation.free_motion.scaling import Scaling
from hil.estimation.options import NUISANCES
from hil.estimation.signals import interpolation
from hil.friction.terms import BENT, CLASSICAL, COLUMNS, TERMS
from hil.least_squares.blocks import Blocks
from hil.least_squares.choice import FOLDS, HeldOut, simplest
from hil.least_squares.normal_equations import successive
from hil.least_squares.regression import Regression
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from hil.arrays import Array, Indices
    from hil.estimation.free_motion.motion import Motion, Processing
    from hil.estimation.free_motion.survey import Survey
    from hil.model.robot import Robot

MOST = 0.03
"""Largest lag, either way [s]: beyond, a log's columns do not belong together."""
SHARE = 0.5
"""Largest lag as a share of a period of the equation's cut-off frequency: beyond, Gauss and
Newton's method may end a period off."""
SHIFTS = 8.0
"""Condensed shifts of the torque in a period of the cut-off frequency: six of them interpolate the
torque at it within 1e-4."""
SURE = 3.0
"""Standard errors that a lag is at least: every axis is tried, and soft gears look like one."""
CONVERGED = 1e-6
"""Change of a lag after which the next no longer matters [s]: a hundredth of its standard error."""
ROUNDS = 12
"""Rounds of Gauss and Newton's method, at most."""
DISTANCES = 2.0 ** np.arange(-15.0, -9.75, 0.5)
"""Presliding distances that are tried, as ways at the axis's speed [s]: gears and bearings turn
round within 1e-5 to 1e-3 rad (twins of seven robots: 5e-5 to 3e-4 s). Over less, friction turns
round between two samples, and what seems to follow is a better sign of a slow velocity."""
GROUPS = 4 * FOLDS
"""Pieces of time, at most: some in each part that is held out."""
_LAG = "lag"


@dataclass(frozen=True, slots=True, eq=False)
class Nuisances:
    """What was found, as a fit takes it.

    Attributes
    ----------
    processing : Processing
        With lags and presliding distances.
    lag_error : ndarray, shape (n_joints,)
        Standard errors of the lags [s]; 0 where there is none.
    plain : ndarray, shape (n_joints,), optional
        Mean square of what weighted least squares leaves without presliding; None where friction
        turns round at once.
    """

    processing: Processing
    lag_error: Array
    plain: Array | None = None


def find_nuisances(
    robot: Robot, found: Survey, processing: Processing, wanted: Collection[str] = NUISANCES
) -> Nuisances:
    """Lags and presliding distances of every axis that moves.

    Where gains are unknown there are neither.
    """
    none = Nuisances(processing, np.zeros(robot.n_joints))
    motions = [filtered_motion(each, processing) for each in found.stretches]
    motions = [motion for motion in motions if motion.used.any()]
    if found.unknown_gains or not motions or not {"lag", "presliding"} & set(wanted):
        return none
    first = np.zeros(len(base_parameters(robot)))
    divided = division(processing, found.duration)
    products = Scaling.known(np.ones(robot.n_joints)).applied(
        recorded_products(robot, motions, divided, first)
    )
    plain = usual(products.pieces[0])
    slowest = max(dead_zone_of(products, plain.weights), 1)
    most = min(MOST, SHARE / processing.band)
    first = plain.solution[: len(first)]
    whole, fast = (_Search(each, most) for each in _condensed(robot, motions, first, slowest, most))
    axes = [axis for axis in range(robot.n_joints) if axis not in found.still]
    state, error = _State.none(robot.n_joints), none.lag_error
    if "lag" in wanted:
        state, error = fast.lags(state, axes)
    if "presliding" in wanted:
        state = whole.grown(state, axes, whole.with_distance)
    distance = np.append(0.0, DISTANCES)[state.direction] * processing.speed
    return Nuisances(
        replace(processing, lag=state.lag, presliding=distance),
        error,
        plain.blocks.mean_squares(plain.solution) if distance.any() else None,
    )


def _condensed(
    robot: Robot, motions: Sequence[Motion], first: Array, slowest: int, most: float
) -> tuple[Blocks, Blocks]:
    """Torques at all shifts, columns, directions over all distances: all samples, and fast ones."""
    band, n = motions[0].processing.band, robot.n_joints
    shifts = _shifts(band, most)
    distances = [f"over {k}" for k in range(len(DISTANCES))]
    shared = (*shared_names(robot), ROTOR)
    own = (*(f"shift {k}" for k in range(1, len(shifts))), *COLUMNS, *distances)
    m = 1 + len(shared) + len(own)
    duration = sum(int(motion.used.sum()) / _rate(motion) for motion in motions)
    products, counts = [], []
    for motion in motions:
        used = np.flatnonzero(motion.used)
        n_parts = max(1, round(GROUPS * len(used) / _rate(motion) / duration))
        every = motion.rates.fine * motion.rates.coarse
        recorded, period = motion.recording.tau, motion.recording.period
        tau = np.stack(
            [low_passed(recorded, period, band, every, ahead=np.full(n, s))[0] for s in shifts]
        )
        share, count = np.zeros((2, n_parts, n, m, m)), np.zeros((2, n_parts, n))
        for axis in range(n):
            ways = DISTANCES * motion.processing.speed[axis]
            z = np.column_stack([motion.direction_after(axis, way) for way in ways])
            columns = motion.passed(np.hstack([axis_columns(robot, motion, axis, first), z]))
            y = tau[:, : len(columns), axis].T
            k = len(shared)
            rows = np.hstack([y[:, :1], columns[:, :k], y[:, 1:], columns[:, k:]])
            is_fast = motion.slowest[: len(rows), axis] >= SPEEDS[slowest - 1]
            for number, part in enumerate(successive(int(used[0]), int(used[-1]) + 1, n_parts)):
                for kind, taken in enumerate((rows[part], rows[part][is_fast[part]])):
                    share[kind, number, axis] = taken.T @ taken
                    count[kind, number, axis] = len(taken)
        products.append(share)
        counts.append(count)
    both = zip(np.concatenate(products, axis=1), np.concatenate(counts, axis=1), strict=True)
    whole, fast = (Blocks(shared, own, *each).grouped(GROUPS) for each in both)
    return whole, fast


def _shifts(band: float, most: float) -> Array:
    """Instants by which the torque is condensed later [s], three more than reach `most`."""
    n = int(np.ceil(most * SHIFTS * band))
    return np.arange(-n - 3, n + 4) * most / n


def _rate(motion: Motion) -> float:
    """Samples that are used in a second."""
    return 1.0 / (motion.period * motion.rates.coarse)


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """Lags [s], axes whose lag is unknown, and of each axis the number of its distance, 0 for none.

    All of shape (n_joints,).
    """

    lag: Array
    late: Indices
    direction: Indices

    @classmethod
    def none(cls, n: int) -> _State:
        zero = np.zeros(n, dtype=np.intp)
        return cls(np.zeros(n), zero, zero)

    def with_late(self, axis: int, late: int = 1) -> _State:
        """The same with an unknown lag of one axis, or without any of it."""
        other = self.late.copy()
        other[axis] = late
        return replace(self, late=other, lag=np.where(other, self.lag, 0.0))

    def over(self, axis: int, distance: int) -> _State:
        """The same with another distance of one axis."""
        other = self.direction.copy()
        other[axis] = distance
        return replace(self, direction=other)


class _Search:
    """Regressions over what is condensed, of which the columns depend on a state."""

    def __init__(self, blocks: Blocks, most: float) -> None:
        self._blocks, self._most, self._total = blocks, most, blocks.total
        self._n_shifts = sum(name.startswith("shift") for name in blocks.own) + 1
        self._weights = self._weighed(_State.none(blocks.n_channels)).weights

    def lags(self, state: _State, axes: Sequence[int]) -> tuple[_State, Array]:
        """State with the lags that are sure, and their standard errors [s]."""
        state = self.grown(state, axes, self.with_lag)
        while state.late.any():
            error = self._error_of_lags(state)
            size = np.where(
                state.late, np.abs(state.lag) / np.where(state.late, error, 1.0), np.inf
            )
            least = int(np.argmin(size))
            if size[least] > SURE:
                return state, error
            state = self._converged(state.with_late(least, 0))
        return state, np.zeros(len(state.lag))

    def grown(
        self, state: _State, axes: Sequence[int], more: Callable[[_State, int], _State | None]
    ) -> _State:
        """State with what predicts held-out blocks certainly better, axis by axis."""
        left = list(axes)
        while left:
            self._weights = self._weighed(state).weights
            states, errors = {"none": state}, {"none": self._held_out(state)}
            for axis in left:
                other = more(state, axis)
                if other is not None:
                    states[str(axis)], errors[str(axis)] = other, self._held_out(other)
            if simplest(errors, self._blocks.n_channels) == "none":
                break
            best = min(errors, key=lambda name: float(errors[name].sum()))
            state = states[best]
            left.remove(int(best))
        return state

    def with_lag(self, state: _State, axis: int) -> _State | None:
        """State with a lag of one more axis; None where it is beyond all that is looked for."""
        found = self._converged(state.with_late(axis))
        return found if abs(found.lag[axis]) < self._most else None

    def with_distance(self, state: _State, axis: int) -> _State | None:
        """State with the presliding distance of one axis that fits best.

        None where the usual law leaves no less of the axis with it: another law than this may be
        chosen in the end, or none.
        """
        tried = [state.over(axis, k + 1) for k in range(len(DISTANCES))]
        best = min(tried, key=lambda other: float(self._weights @ self._left(other)))
        with_it, without = (self._left(each, CLASSICAL)[axis] for each in (best, state))
        return best if with_it < without else None

    def _converged(self, state: _State) -> _State:
        """State with lags by Gauss and Newton's method."""
        for _ in range(ROUNDS if state.late.any() else 0):
            found, before = self._regression(self._total, state), state.lag
            change = found.solution[self._places(found)] * state.late
            state = replace(state, lag=np.clip(before + change, -self._most, self._most))
            if np.abs(state.lag - before).max() < CONVERGED:
                break
        return state

    def _left(self, state: _State, terms: tuple[str, ...] = TERMS) -> Array:
        """Squares that a state leaves of each axis, of all samples, with some terms of friction."""
        found = self._regression(self._total, state, terms)
        return np.asarray(found.blocks.squares_left(found.solution)[0])

    def _held_out(self, state: _State) -> Array:
        """Squared errors on blocks that were held out, lags fitted without them."""
        found = self._regression(self._blocks, state)
        system = self._blocks_at(self._blocks, state).normal(self._weights)
        heard = np.einsum("bkk->k", system.N)[found.kept] > 0
        return HeldOut(system, system).error(found.kept[heard])

    def _error_of_lags(self, state: _State) -> Array:
        """Standard errors of all lags [s], by leaving out successive blocks; 0 where none is."""
        found = self._regression(self._blocks, state)
        variance = np.diag(found.fit("jackknife", most=FOLDS).covariance)
        return np.asarray(np.sqrt(variance[self._places(found)].clip(0.0)))

    @staticmethod
    def _places(found: Regression) -> list[int]:
        """Where the lags stand among all unknowns."""
        return [found.layout.at(_LAG, axis) for axis in range(found.layout.n_channels)]

    def _weighed(self, state: _State) -> Regression:
        blocks = self._blocks_at(self._total, state)
        return Regression.weighed(blocks, self._kept(blocks, state))

    def _regression(self, of: Blocks, state: _State, terms: tuple[str, ...] = TERMS) -> Regression:
        blocks = self._blocks_at(of, state)
        return Regression(blocks, self._weights, self._kept(blocks, state, terms))

    def _kept(self, blocks: Blocks, state: _State, terms: tuple[str, ...] = TERMS) -> Indices:
        """Unknowns of a state: its lags, how friction bends where it turns over a distance."""
        return blocks.layout.kept(
            [
                (*terms, *([BENT] if distance else []), *([_LAG] if late else []))
                for late, distance in zip(state.late, state.direction, strict=True)
            ]
        )

    @cached_property
    def _unchanged(self) -> tuple[Array, tuple[str, ...], tuple[str, ...]]:
        """Combinations that no state changes, shape (m, m'), names of shared and own columns."""
        shared = tuple(name for name in self._blocks.shared if name != ROTOR)
        own = (*COLUMNS, _LAG)
        T = np.zeros((self._blocks.products.shape[-1], 1 + len(shared) + len(own)))
        T[self._blocks.place(*shared, *COLUMNS), 1 + np.arange(len(shared) + len(COLUMNS))] = 1.0
        T[self._blocks.place(ROTOR), 0] = -1.0
        return T, shared, own

    def _blocks_at(self, of: Blocks, state: _State) -> Blocks:
        """Blocks of torques as early as positions, directions over the state's distances."""
        fixed, shared, own = self._unchanged
        T = np.tile(fixed, (of.n_channels, 1, 1))
        torques = np.append(0, of.place(*(f"shift {k}" for k in range(1, self._n_shifts))))
        coulomb, bend, late = (1 + len(shared) + own.index(x) for x in ("Coulomb", BENT, _LAG))
        over = of.place(*(f"over {k}" for k in range(len(DISTANCES))))
        for axis, (lag, distance) in enumerate(zip(state.lag, state.direction, strict=True)):
            T[axis, torques, 0], T[axis, torques, late] = self._interpolated(float(lag))
            if distance:
                low, high = max(distance - 2, 0), min(distance, len(over) - 1)
                bent = 1.0 / np.log(DISTANCES[high] / DISTANCES[low])
                T[axis, :, coulomb] = 0.0
                T[axis, over[distance - 1], coulomb] = 1.0
                T[axis, over[[high, low]], bend] = bent, -bent
        return of.combined(T, shared, own)

    def _interpolated(self, lag: float) -> tuple[Array, Array]:
        """Torque as a combination of shifts, and what a greater lag takes from it [1/s]."""
        reach = (self._n_shifts - 1) // 2
        apart = self._most / (reach - 3)

        def weights(lag: float) -> Array:
            first, own = interpolation(lag / apart + reach)
            found = np.zeros(self._n_shifts)
            found[first : first + len(own)] = own
            return found

        step = 1e-3 * apart
        slope = (weights(lag + step) - weights(lag - step)) / (2.0 * step)
        return weights(lag), -slope
