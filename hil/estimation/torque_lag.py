"""How late the current is read, axis by axis, found from the measurements of inertia.

Drives filter or queue the current that they report, positions they do not: 4 ms between the two
cost half a percent of the inertias and leave residuals that look like friction. With the torque of
axis a taken delta_a later, all axes together minimise

    J(delta) = min over p, b, a of  sum_a w_a || Q_a(t + delta_a) - Qm_a - A_a p - G_a b - F a ||^2,

the improved method's own least squares. The torque at any shift is a combination of the torques
shifted by whole samples, so all that J needs is condensed once (`hil.estimation.condensed`), and
searching costs next to nothing. Measurements of inertia alone are used: where nothing accelerates
no lag shows. It shows most at the corners of the trapezoids, which the estimate itself leaves out,
because there it would have to know the lag. Weights are the reciprocal residual variances,
which maximises the likelihood.

Standard errors come from the scores of the measurements (sandwich). What an error of the lags does
to the base parameters, dp/ddelta, comes along, so that it can be counted with theirs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import optimize

from hil.estimation.condensed import products
from hil.estimation.signals import interpolation
from hil.model.base_parameters import base_parameters
from hil.model.dependencies import DIAGONAL
from hil.regression.least_squares import eliminated, inverse
from hil.regression.terms import FEWEST, moving, n_unknowns, place
from hil.regression.uncertainty import sandwich, scatter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.measurement import ElementMeasurement

    Array = NDArray[np.float64]
    Prepared = Sequence[tuple[ElementMeasurement, Signals]]

EARLIEST, LATEST = -0.002, 0.012
"""Range that is searched [s]."""
UNIDENTIFIABLE = 0.0005
"""Standard error from which on a lag is taken as zero [s]."""
THINNED = 3
"""Every so many samples are used: smoothed ones next to each other say the same."""
_GRID = 57
_ROUNDS = 3
_RANK = 1e-6
"""Least share of information that counts: measurements of inertia show some combinations of
parameters so faintly that these would follow the corners of the motion as the lag does."""


@dataclass(frozen=True, slots=True, eq=False)
class Lags:
    """By how much the torque readings lag behind the positions.

    Attributes
    ----------
    lag : ndarray, shape (n_joints,)
        Positive where the torque is late [s]; zero where it is not identifiable.
    standard_error : ndarray, shape (n_joints,)
        [s]; NaN where the lag is not identifiable.
    covariance : ndarray, shape (n_base, n_base)
        Of the base parameters, from the lags' errors.
    """

    lag: Array
    standard_error: Array
    covariance: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Item:
    """Inner products of one measurement: torques at whole shifts, motor, X."""

    axis: int
    product: Array
    n: int


def no_lags(robot: Robot) -> Lags:
    """Torque taken as it was read."""
    n, n_base = robot.n_joints, len(base_parameters(robot))
    return Lags(np.zeros(n), np.full(n, np.nan), np.zeros((n_base, n_base)))


def find_lags(robot: Robot, prepared: Prepared) -> Lags:
    """Estimate the lag of every axis."""
    inertial = [(m, s) for m, s in prepared if m.unit_acceleration[m.index]]
    if not inertial:
        return no_lags(robot)
    period = max(s.period for _, s in inertial)
    shifts = np.arange(interpolation(EARLIEST / period)[0], interpolation(LATEST / period)[0] + 6)
    found = (_item(robot, m.index, s, shifts) for m, s in inertial)
    items = [item for item in found if item is not None]
    if not items:
        return no_lags(robot)
    likelihood = _Likelihood(robot, items, shifts, period)
    return likelihood.lags(likelihood.maximise(), base_parameters(robot).groups[DIAGONAL])


def _item(robot: Robot, axis: int, s: Signals, shifts: NDArray[np.intp]) -> _Item | None:
    reach = int(np.abs(shifts).max())
    edge = np.ones(2 * reach + 1, dtype=bool)
    spoilt = ~(s.valid & moving(robot, s, axis))
    clear = np.convolve(spoilt, edge, mode="same") == 0
    clear[np.arange(len(clear)) % THINNED != 0] = False
    if clear.sum() < FEWEST:
        return None
    padded = np.pad(s.tau[:, axis], reach, mode="edge")
    torques = np.array([padded[reach + k : reach + k + len(s.tau)] for k in shifts]).T
    product, n = products(robot, s, axis, torques, clear)
    return _Item(axis, product, n)


class _Likelihood:
    """J as a quadratic form in the weights of the shifted torques."""

    def __init__(
        self, robot: Robot, items: Sequence[_Item], shifts: NDArray[np.intp], period: float
    ) -> None:
        self._robot, self._items, self._n = robot, items, robot.n_joints
        self._n_base = len(base_parameters(robot))
        self._shifts, self._period = shifts, period
        self._k = len(shifts) + 1
        self._size = n_unknowns(robot)
        self._weight = np.ones(self._n)
        self._axes = sorted({item.axis for item in items})
        self._total = {
            a: np.sum([item.product for item in items if item.axis == a], axis=0)
            for a in self._axes
        }

    def maximise(self) -> Array:
        """Lags of all axes [s], weights and lags found from each other."""
        lag = np.zeros(self._n)
        for _ in range(_ROUNDS):
            self._weigh(lag)
            Q = self._form()
            for _ in range(_ROUNDS):
                for axis in self._axes:
                    lag[axis] = self._best(Q, lag, axis)
        self._weigh(lag)
        return lag

    def lags(self, lag: Array, free: Sequence[int]) -> Lags:
        """Uncertainty of the lags and what it means for the base parameters."""
        x, n = self._solution(lag), self._n
        information = np.zeros((n + self._size, n + self._size))
        scores = []
        for item in self._items:
            J = np.zeros((len(item.product), n + self._size))
            J[: self._k, item.axis] = self._slope(lag[item.axis])
            J[self._k :, n + self._place(item.axis)] = -np.eye(len(item.product) - self._k)
            c = np.concatenate([self._coefficients(lag[item.axis]), -x[self._place(item.axis)]])
            w = self._weight[item.axis]
            scores.append(w * J.T @ item.product @ c)
            information += w * J.T @ item.product @ J
        covariance = sandwich(inverse(information)[:n], scatter(np.array(scores)))
        error = np.sqrt(np.diag(covariance))
        identifiable = (error > 0) & (error < UNIDENTIFIABLE)
        covariance = covariance * np.outer(identifiable, identifiable)
        effect = self._effect(lag, free)
        return Lags(
            lag=np.where(identifiable, lag, 0.0),
            standard_error=np.where(identifiable, error, np.nan),
            covariance=effect @ covariance @ effect.T,
        )

    def _best(self, Q: Array, lag: Array, axis: int) -> float:
        """Lag of one axis that minimises J, those of the others as they are."""
        own = slice(axis * self._k, (axis + 1) * self._k)
        c = np.concatenate([self._coefficients(each) for each in lag])
        square, cross = Q[own, own], Q[own] @ c - Q[own, own] @ c[own]

        def objective(trial: float) -> float:
            of_trial = self._coefficients(trial)
            return float(of_trial @ (square @ of_trial + 2 * cross))

        grid = np.linspace(EARLIEST, LATEST, _GRID)
        near = grid[int(np.argmin([objective(each) for each in grid]))]
        step = grid[1] - grid[0]
        refined = optimize.minimize_scalar(
            objective, bounds=(near - step, near + step), method="bounded",
            options={"xatol": 1e-8},
        )  # fmt: skip
        return float(np.clip(refined.x, EARLIEST, LATEST))

    def _form(self) -> Array:
        """Q of J = c'Qc, the weights of all axes' torques and motors being c."""
        n = self._n * self._k
        product = np.zeros((n + self._size, n + self._size))
        for axis in self._axes:
            own = np.arange(axis * self._k, (axis + 1) * self._k)
            at = np.concatenate([own, n + self._place(axis)])
            product[np.ix_(at, at)] += self._weight[axis] * self._total[axis]
        return eliminated(product, self._size, _RANK)[0]

    def _weigh(self, lag: Array) -> None:
        """Weights from the residuals at these lags."""
        x = self._solution(lag)
        for axis in self._axes:
            c = np.concatenate([self._coefficients(lag[axis]), -x[self._place(axis)]])
            n = sum(item.n for item in self._items if item.axis == axis)
            variance = float(c @ self._total[axis] @ c) / max(n, 1)
            self._weight[axis] = 1.0 / variance if variance > 0 else 1.0

    def _solution(self, lag: Array) -> Array:
        side = np.zeros(self._size)
        for axis in self._axes:
            rows = self._weight[axis] * self._total[axis][self._k :, : self._k]
            side[self._place(axis)] += rows @ self._coefficients(lag[axis])
        return inverse(self._information(), _RANK) @ side

    def _effect(self, lag: Array, free: Sequence[int]) -> Array:
        """Change of the `free` base parameters by the lags, shape (n_base, n_joints).

        The others are held: measurements without acceleration identify them.
        """
        side = np.zeros((self._size, self._n))
        for axis in self._axes:
            rows = self._weight[axis] * self._total[axis][self._k :, : self._k]
            side[self._place(axis), axis] += rows @ self._slope(lag[axis])
        kept = np.concatenate([np.asarray(free, int), np.arange(self._n_base, self._size)])
        effect = np.zeros((self._size, self._n))
        effect[kept] = inverse(self._information()[np.ix_(kept, kept)], _RANK) @ side[kept]
        return effect[: self._n_base]

    def _information(self) -> Array:
        N = np.zeros((self._size, self._size))
        for axis in self._axes:
            own = self._place(axis)
            N[np.ix_(own, own)] += self._weight[axis] * self._total[axis][self._k :, self._k :]
        return N

    def _coefficients(self, lag: float) -> Array:
        """Weights of the shifted torques, and of the motor's part."""
        first, weights = interpolation(lag / self._period)
        c = np.zeros(self._k)
        at = first - int(self._shifts[0])
        c[at : at + len(weights)] = weights
        c[-1] = -1.0
        return c

    def _slope(self, lag: float) -> Array:
        """Derivative of `_coefficients` by the lag [1/s]."""
        h = 1e-3 * self._period
        later, earlier = min(lag + h, LATEST), max(lag - h, EARLIEST)
        slope: Array = (self._coefficients(later) - self._coefficients(earlier)) / (later - earlier)
        return slope

    def _place(self, axis: int) -> NDArray[np.intp]:
        return place(self._robot, axis)
