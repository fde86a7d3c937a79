"""Torques that are recorded later than positions, by a constant lag of each axis.

With the lag s of an axis its recorded torque is y(t) = f(t - s). What is explained is y(t + s),
shifted by the phase of its spectrum, so a lag need not be a number of samples. Near a first s the
rest of it is linear,

    y(t + s) = W(t) x - ds W'(t) x,

W' being the rate of change of the columns, so ds is found with all other unknowns and s by Gauss
and Newton's method, all axes together, since they share parameters. It is the rate of the model's
torque and not that of the recorded one, whose noise would make ds too small.

An axis has a lag where that predicts held-out blocks better than none by more than chance, and
where the lag is `SURE` standard errors or more. Where it
has one, the presliding distance is looked for again: each looks a little like the other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.columns import axis_columns, shared_names
from hil.estimation.free_motion.friction_terms import COLUMNS
from hil.estimation.free_motion.motion import filtered_motion, low_passed
from hil.estimation.free_motion.presliding import blocks, with_presliding
from hil.estimation.options import NUISANCES
from hil.least_squares.blocks import Blocks
from hil.least_squares.choice import HeldOut, folds, simplest
from hil.least_squares.layout import Layout, axis_names
from hil.least_squares.normal_equations import Normal
from hil.least_squares.regression import Regression
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from hil.arrays import Array, Indices
    from hil.estimation.free_motion.motion import Motion, Processing
    from hil.estimation.free_motion.survey import Survey
    from hil.model.robot import Robot
    from hil.runs.recording import Recording


MOST = 0.03
"""Of a lag, either way [s]."""
SHARE = 0.5
"""Of a period of the equation's cut-off frequency that a lag is at most."""
SURE = 3.0
"""Standard errors that a lag is at least: every axis is tried, and soft gears look like one."""
ROUNDS = 8
"""Of Gauss and Newton's method, at most."""
CONVERGED = 1e-5
"""Change of a lag after which the next no longer matters [s]."""
_FRICTION = tuple(term for term in COLUMNS if not term.startswith(("cosine", "sine")))
"""Ripple is left out: it is periodic and hardly resembles a lag."""


def with_lag(
    robot: Robot, found: Survey, processing: Processing, nuisance: Collection[str] = NUISANCES
) -> tuple[Processing, Array]:
    """Settings with presliding distances and lags of every axis that moves.

    Where gains are unknown there are neither.

    Returns
    -------
    Processing
    error : ndarray, shape (n_joints,)
        Standard errors of the lags [s]; 0 where there is none.
    """
    bends = "presliding" in nuisance
    at_once = with_presliding(robot, found, processing) if bends else processing
    if "lag" not in nuisance:
        return at_once, np.zeros(robot.n_joints)
    lag, error = _lags(robot, found, at_once)
    if not lag.any() or not bends:
        at_once = replace(at_once, lag=lag)
        return at_once, error
    late = with_presliding(robot, found, replace(processing, lag=lag))
    lag, error = _lags(robot, found, late)
    return (replace(late, lag=lag) if lag.any() else at_once), error


def _lags(robot: Robot, found: Survey, processing: Processing) -> tuple[Array, Array]:
    none = np.zeros(robot.n_joints)
    filtered = [(each, filtered_motion(each, processing)) for each in found.stretches]
    filtered = [(each, motion) for each, motion in filtered if motion.used.any()]
    if found.unknown_gains or not filtered:
        return none, none
    search = _Search(robot, [_Stretch.of(robot, *each) for each in filtered])
    axes = [axis for axis in range(robot.n_joints) if axis not in found.still]
    return search.found(axes, min(MOST, SHARE / processing.band))


@dataclass(frozen=True, slots=True, eq=False)
class _Stretch:
    """Columns of all axes and their rates of change, shape (n, m) each, filtered."""

    recording: Recording
    motion: Motion
    columns: list[Array]
    rates: list[Array]
    rotors: Array
    parts: list[slice]

    @classmethod
    def of(cls, robot: Robot, recording: Recording, motion: Motion) -> _Stretch:
        first, k = np.zeros(len(base_parameters(robot))), len(shared_names(robot))
        kept = [*range(k), *(k + 1 + COLUMNS.index(term) for term in _FRICTION)]
        period, every = motion.period, motion.rates.coarse
        band, columns, rates, rotors = motion.processing.band, [], [], []
        for axis in range(robot.n_joints):
            rows = axis_columns(robot, motion, axis, first)
            both = low_passed(rows[:, [*kept, k]], period, band, every, derivatives=1)
            columns.append(both[0][:, :-1])
            rates.append(both[1][:, :-1])
            rotors.append(both[0][:, -1])
        return cls(recording, motion, columns, rates, np.column_stack(rotors), blocks(motion))

    def explained(self, lag: Array) -> Array:
        """Torque, its lag taken back, less that of rotors of known inertia."""
        rates, band = self.motion.rates, self.motion.processing.band
        every = rates.fine * rates.coarse
        tau = low_passed(self.recording.tau, rates.period, band, every, ahead=lag)[0]
        n = min(len(tau), len(self.rotors))
        return np.asarray(tau[:n] - self.rotors[:n])


class _Search:
    """Equations of all axes, of which the torques depend on the lags."""

    def __init__(self, robot: Robot, stretches: Sequence[_Stretch]) -> None:
        self._stretches, self._n = stretches, robot.n_joints
        own = (*_FRICTION, "rate")
        self._layout = Layout(shared_names(robot), own, axis_names(self._n))
        self._rates = np.array([self._layout.at("rate", axis) for axis in range(self._n)])
        self._linear = np.setdiff1d(np.arange(self._layout.size), self._rates)
        self._x, self._weights = np.zeros(self._layout.size), np.ones(self._n)

    def found(self, axes: Sequence[int], most: float) -> tuple[Array, Array]:
        """Lags of those `axes` that have one, and their standard errors [s]."""
        lag = self._converged(axes, most)
        chosen = [axis for axis in axes if 0 < abs(lag[axis]) < most]
        for axis in list(chosen):
            fewer = [each for each in chosen if each != axis]
            tried = {
                "none": self._error(np.where(np.isin(np.arange(self._n), fewer), lag, 0.0), fewer),
                "lag": self._error(np.where(np.isin(np.arange(self._n), chosen), lag, 0.0), chosen),
            }
            chosen = fewer if simplest(tried, self._n) == "none" else chosen
        lag, error = self._refined(chosen, most)
        sure = [axis for axis in chosen if abs(lag[axis]) > SURE * error[axis]]
        return (lag, error) if sure == chosen else self._refined(sure, most)

    def _refined(self, axes: Sequence[int], most: float) -> tuple[Array, Array]:
        lag = self._converged(axes, most)
        return lag, self._standard_error(lag, axes)

    def _converged(self, axes: Sequence[int], most: float) -> Array:
        lag = np.zeros(self._n)
        self._solve(lag)
        if not axes:
            return lag
        kept = self._kept(axes)
        for _ in range(ROUNDS):
            x = self._system(lag).solution(kept)
            self._x, change = x, x[self._rates[list(axes)]]
            lag[list(axes)] = np.clip(lag[list(axes)] + change, -most, most)
            if np.abs(change).max() < CONVERGED:
                break
        self._solve(lag)
        return lag

    def _kept(self, axes: Sequence[int]) -> Indices:
        """All linear unknowns, the rest of the lags of some axes behind them."""
        return np.concatenate([self._linear, self._rates[list(axes)]])

    def _solve(self, lag: Array) -> None:
        """Find solution and weights with given lags."""
        found = Regression.weighed(self._blocks(lag), self._linear)
        self._x, self._weights = found.solution, found.weights

    def _system(self, lag: Array) -> Normal:
        return self._blocks(lag).normal(self._weights)

    def _blocks(self, lag: Array) -> Blocks:
        """Products of torque, columns and the rate of what is modelled, of each block."""
        found = []
        for stretch in self._stretches:
            y = stretch.explained(lag)
            rows = [self._rows(stretch, axis, y) for axis in range(self._n)]
            found += [np.array([each[part].T @ each[part] for each in rows])
                      for part in stretch.parts]  # fmt: skip
        products = np.array(found)
        return Blocks(self._layout.shared, self._layout.own, products, np.ones(products.shape[:2]))

    def _rows(self, stretch: _Stretch, axis: int, y: Array) -> Array:
        rate = -stretch.rates[axis] @ self._x[self._layout.place(axis)[:-1]]
        return np.column_stack([y[:, axis], stretch.columns[axis][: len(y)], rate[: len(y)]])

    def _error(self, lag: Array, axes: Sequence[int]) -> Array:
        """Squared errors on blocks that were held out, lags fitted without them."""
        system, kept = self._system(lag), self._kept(axes)
        heard = np.einsum("bkk->k", system.N)[kept] > 0
        return HeldOut(system, system).error(kept[heard])

    def _standard_error(self, lag: Array, axes: Sequence[int]) -> Array:
        """Of each lag, by leaving out successive blocks (jackknife)."""
        error = np.zeros(self._n)
        if not axes:
            return error
        system = self._system(lag).only(self._kept(axes))
        parts = folds(len(system.v))
        found = np.array([_without(system, part).solution()[-len(axes) :] for part in parts])
        n = len(parts)
        error[list(axes)] = np.sqrt((n - 1) * found.var(axis=0)) if n > 1 else np.nan
        return error


def _without(system: Normal, part: slice) -> Normal:
    return Normal(*(np.delete(x, part, axis=0) for x in (system.N, system.v, system.square)))
