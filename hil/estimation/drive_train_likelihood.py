"""Lags and compliances that make the measurements most likely.

To first order the soft gears of all axes j change the torque of axis i by

    sum_j c_j K_ij,   K_ij = -(M_ij Q_t,j'' + dQ_t,i/dq_j Q_t,j + dQ_t,i/dqd_j Q_t,j'),

which is one more column of the regression. With the torque of axis a taken delta_a later, all axes
together minimise

    J(delta) = min over p, c, b, a of
        sum_a w_a || Q_a(t + delta_a) - Qm_a - A_a p - K_a c - G_a b - F a ||^2,

the improved method's own least squares. The torque at any shift is a combination of the torques
shifted by whole samples, so all that J needs is condensed once (`hil.estimation.condensed`), and
searching costs next to nothing. Weights are the reciprocal residual variances, which maximises the
likelihood.

Standard errors come from the scores of the measurements (sandwich). What an error of the lags does
to the base parameters, dp/ddelta, comes along, so that it can be counted with theirs.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebpts2, chebroots, chebval, chebvander

from hil.estimation.drive_train import DriveTrain
from hil.estimation.signals import interpolation
from hil.friction.equation import n_unknowns, place
from hil.least_squares.solving import eliminated, inverse
from hil.least_squares.uncertainty import sandwich, scatter
from hil.model.base_parameters import base_parameters
from hil.model.dependencies import DIAGONAL

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.arrays import Array
    from hil.estimation.condensed import Condensed
    from hil.model.robot import Robot


EARLIEST, LATEST = -0.002, 0.012
"""Range that is searched [s]."""
UNIDENTIFIABLE = 0.0005
"""Standard error from which on a lag is taken as zero [s]."""
STEP = 1e-6
"""Compliance for which a column K is calculated, by differences [rad/(N m)]."""
_DEGREE = 10
"""Of J over one axis's lag between two samples: twice that of the weights."""
_INSTANT = 1e-9
"""From an end of the range, within which a sample is taken to lie on it [s]."""
_ROUNDS = 3
_RANK = 1e-6
"""Least share of information that counts: measurements of inertia show some combinations of
parameters so faintly that these would follow the corners of the motion as the lag does."""


class Likelihood:
    """J as a quadratic form in the weights of the shifted torques.

    Unknown are base parameters, compliances of the joints `springs` and the axes' common terms.
    """

    def __init__(
        self,
        robot: Robot,
        items: Sequence[Condensed],
        shifts: NDArray[np.intp],
        period: float,
        springs: Sequence[int] | NDArray[np.intp] = (),
    ) -> None:
        self._robot, self._items, self._n = robot, items, robot.n_joints
        self._n_base, self._joints = len(base_parameters(robot)), np.array(springs, dtype=int)
        self._shifts, self._period = shifts, period
        self._k = len(shifts) + 1
        self._nodes = chebpts2(_DEGREE + 1)
        self._to_series = np.linalg.inv(chebvander(self._nodes, _DEGREE))
        self._pieces = self._between_samples()
        self._size = n_unknowns(robot) + len(self._joints)
        self._weight = np.ones(self._n)
        self._axes = sorted({item.axis for item in items})
        self._total = {
            a: np.sum([item.product for item in items if item.axis == a], axis=0)
            for a in self._axes
        }

    def drive_train(self) -> DriveTrain:
        """Lags and compliances, their uncertainty and what it means for the base parameters."""
        lag = self._maximise()
        x, n = self._solution(lag), self._n
        slopes = [self._slope(each) for each in lag]
        weights = [self._coefficients(each) for each in lag]
        information = np.zeros((n + self._size, n + self._size))
        scores = []
        for item in self._items:
            J = np.zeros((len(item.product), n + self._size))
            J[: self._k, item.axis] = slopes[item.axis]
            J[self._k :, n + self._place(item.axis)] = -np.eye(len(item.product) - self._k)
            c = np.concatenate([weights[item.axis], -x[self._place(item.axis)]])
            w = self._weight[item.axis]
            scores.append(w * J.T @ item.product @ c)
            information += w * J.T @ item.product @ J
        both = sandwich(inverse(information)[: n + self._springs.stop], scatter(np.array(scores)))
        covariance, errors = both[:n, :n], np.sqrt(np.diag(both))
        error, of_springs = errors[:n], errors[n:][self._springs]
        identifiable = (error > 0) & (error < UNIDENTIFIABLE)
        covariance = covariance * np.outer(identifiable, identifiable)
        effect = self._effect(lag)
        compliance, compliance_error = np.full((2, n), np.nan)
        compliance[self._joints] = STEP * x[self._springs]
        compliance_error[self._joints] = STEP * np.where(of_springs > 0, of_springs, np.nan)
        return DriveTrain(
            lag=np.where(identifiable, lag, 0.0),
            lag_error=np.where(identifiable, error, np.nan),
            compliance=compliance,
            compliance_error=compliance_error,
            soft=np.zeros(n, dtype=bool),
            covariance=effect @ covariance @ effect.T,
            p=x[: self._n_base],
        )

    def _maximise(self) -> Array:
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

    @property
    def _springs(self) -> slice:
        """Where compliances stand among all unknowns."""
        return slice(self._n_base, self._n_base + len(self._joints))

    def _best(self, Q: Array, lag: Array, axis: int) -> float:
        """Lag of one axis that minimises J, those of the others as they are.

        Between two samples J is a polynomial of it, so its minimum is at a sample, at an end of
        what is searched or where the derivative has a root.
        """
        own = slice(axis * self._k, (axis + 1) * self._k)
        c = np.concatenate([self._coefficients(each) for each in lag])
        square, cross = Q[own, own], Q[own] @ c - Q[own, own] @ c[own]

        best = []
        for times, C in self._pieces:
            J = self._to_series @ np.sum(C * (C @ square + 2 * cross), axis=1)
            roots = chebroots(chebder(J))
            trials = [-1.0, *roots.real[np.isreal(roots) & (np.abs(roots) < 1.0)], 1.0]
            values = chebval(np.array(trials), J)
            at = np.interp(trials[int(np.argmin(values))], (-1.0, 1.0), (times[0], times[-1]))
            best.append((float(values.min()), float(at)))
        return min(best)[1]

    def _between_samples(self) -> list[tuple[Array, Array]]:
        """Lags that determine J between each two samples, and the weights of each of them."""
        whole = self._period * self._shifts
        inside = whole[(whole > EARLIEST + _INSTANT) & (whole < LATEST - _INSTANT)]
        found = []
        for low, high in pairwise([EARLIEST, *inside, LATEST]):
            times = (low + high) / 2 + (high - low) / 2 * self._nodes
            found.append((times, np.array([self._coefficients(each) for each in times])))
        return found

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

    def _effect(self, lag: Array) -> Array:
        """Change of the diagonal group by the lags, shape (n_base, n_joints).

        The others are held: measurements without acceleration identify them.
        """
        free = base_parameters(self._robot).groups[DIAGONAL]
        side = np.zeros((self._size, self._n))
        for axis in self._axes:
            rows = self._weight[axis] * self._total[axis][self._k :, : self._k]
            side[self._place(axis), axis] += rows @ self._slope(lag[axis])
        others = np.arange(self._springs.stop, self._size)
        kept = np.concatenate([np.asarray(free, int), others])
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
        at = place(self._robot, axis)
        springs = np.arange(self._springs.start, self._springs.stop)
        return np.concatenate([at[: self._n_base], springs, at[self._n_base :] + len(self._joints)])
