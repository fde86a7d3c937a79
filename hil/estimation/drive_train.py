"""What lies between the current and the arm: late readings and soft gears, axis by axis.

Drives filter or queue the current that they report, positions they do not: 4 ms between the two
cost half a percent of the inertias and leave residuals that look like friction. And encoders sit on
the motors' side of gears that give way: with a compliance c_j of the gear of axis j, which
transmits Q_t,j, the link is at q_j = theta_j - c_j Q_t,j where the encoder says theta_j. To first
order the torque of axis i then changes by

    sum_j c_j K_ij,   K_ij = -(M_ij Q_t,j'' + dQ_t,i/dq_j Q_t,j + dQ_t,i/dqd_j Q_t,j'),

which is one more column of the regression. With the torque of axis a taken delta_a later, all axes
together minimise

    J(delta) = min over p, c, b, a of
        sum_a w_a || Q_a(t + delta_a) - Qm_a - A_a p - K_a c - G_a b - F a ||^2,

the improved method's own least squares. The torque at any shift is a combination of the torques
shifted by whole samples, so all that J needs is condensed once (`hil.estimation.condensed`), and
searching costs next to nothing. Measurements of inertia and trajectories are used: where the axis
that is read does not accelerate neither shows. Both show most at the corners of the trapezoids,
which the estimate itself leaves out, because there it would have to know them. Weights are the
reciprocal residual variances, which maximises the likelihood.

A torque that is sampled every T shows a corner of the motion where the next sample is. As long as
corners fall anywhere between samples, as `hil plan` arranges it, that is noise. What remains of it
looks like a compliance: a variance T^2/12 of the instant smooths the torque by T^2/24 times its
second derivative. A compliance must be well above what amounts to the same.

Standard errors come from the scores of the measurements (sandwich). What an error of the lags does
to the base parameters, dp/ddelta, comes along, so that it can be counted with theirs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebpts2, chebroots, chebval, chebvander

from hil.estimation.condensed import periods_of, stack_axis
from hil.estimation.signals import derivatives, interpolation
from hil.model.base_parameters import base_parameters
from hil.model.dependencies import DIAGONAL
from hil.model.dynamics import inverse_dynamics, mass_matrix
from hil.model.motors import motor_inertia, motor_torque
from hil.planning.measurement import shows_element
from hil.regression.least_squares import eliminated, inverse
from hil.regression.terms import moving, n_unknowns, place
from hil.regression.uncertainty import sandwich, scatter
from hil.regression.window import half_window, widened

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from hil.estimation.condensed import Condensed, Stacked
    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMeasurement

    Array = NDArray[np.float64]
    Prepared = Sequence[tuple[ParameterMeasurement, Signals]]

EARLIEST, LATEST = -0.002, 0.012
"""Range that is searched [s]."""
UNIDENTIFIABLE = 0.0005
"""Standard error from which on a lag is taken as zero [s]."""
SOFT = 2.0
"""A compliance over its standard error from which on a gear counts as soft."""
PASSES = 2
"""How often everything is smoothed: K holds the fourth derivative of positions, whose noise the
motor's part shares."""
_DEGREE = 10
"""Of J over one axis's lag between two samples: twice that of the weights."""
_INSTANT = 1e-9
"""From an end of the range, within which a sample is taken to lie on it [s]."""
_ROUNDS = 3
_RANK = 1e-6
"""Least share of information that counts: measurements of inertia show some combinations of
parameters so faintly that these would follow the corners of the motion as the lag does."""
_STEP = 1e-6
"""Compliance for which a column K is calculated, by differences [rad/(N m)]."""


@dataclass(frozen=True, slots=True, eq=False)
class DriveTrain:
    """By how much torque readings lag behind positions, and how far gears give way.

    Attributes
    ----------
    lag : ndarray, shape (n_joints,)
        Positive where the torque is late [s]; zero where it is not identifiable.
    lag_error : ndarray, shape (n_joints,)
        Standard errors [s]; NaN where the lag is not identifiable.
    compliance : ndarray, shape (n_joints,)
        Of each axis's gear [rad/(N m)], as measured: also where it is not `soft`.
    compliance_error : ndarray, shape (n_joints,)
        Standard errors [rad/(N m)]; NaN where nothing shows a compliance.
    soft : ndarray of bool, shape (n_joints,)
        Gears that give way significantly. The others count as rigid.
    covariance : ndarray, shape (n_base, n_base)
        Of the base parameters, from errors of the lags.
    p : ndarray, shape (n_base,)
        Base parameters by which the gears' torques are calculated.
    """

    lag: Array
    lag_error: Array
    compliance: Array
    compliance_error: Array
    soft: NDArray[np.bool_]
    covariance: Array
    p: Array

    def applied(self, robot: Robot, s: Signals, compliance: Array | None = None) -> Signals:
        """Signals with torques as early as positions, and with links where soft gears let them.

        Parameters
        ----------
        compliance : ndarray, shape (n_joints,), optional
            Others than those of the gears that are soft.
        """
        found = s.torque_advanced(self.lag)
        c = np.where(self.soft, self.compliance, 0.0) if compliance is None else compliance
        if not c.any():
            return found
        twist = c * inverse_dynamics(robot, self.p, s.q, s.qd, s.qdd)
        # what is transmitted is that of the links' own motion, so once more
        moved = replace(found, twist=twist)
        return replace(found, twist=c * inverse_dynamics(robot, self.p, *moved.link))


def directly_driven(robot: Robot) -> DriveTrain:
    """Torque taken as it was read, gears taken as rigid."""
    n, n_base = robot.n_joints, len(base_parameters(robot))
    zero, unknown = np.zeros(n), np.full(n, np.nan)
    soft = np.zeros(n, dtype=bool)
    return DriveTrain(
        zero, unknown, zero, unknown, soft, np.zeros((n_base, n_base)), np.zeros(n_base)
    )


def find_drive_train(
    robot: Robot, prepared: Prepared, loaded: NDArray[np.bool_] | None = None
) -> DriveTrain:
    """Estimate the lag and the compliance of every axis.

    Parameters
    ----------
    loaded : ndarray of bool, shape (n_joints,), optional
        Axes whose friction grows with the transmitted torque; none by default.
    """
    loaded = np.zeros(robot.n_joints, dtype=bool) if loaded is None else loaded
    accelerated = [(m, s) for m, s in prepared if _shows_lag(m)]
    if not accelerated:
        return directly_driven(robot)
    period = max(s.period for _, s in accelerated)
    shifts = np.arange(interpolation(EARLIEST / period)[0], interpolation(LATEST / period)[0] + 6)
    stacks = [(s, list(_stacked(robot, m, s, shifts))) for m, s in accelerated]
    if not any(stacked for _, stacked in stacks):
        return directly_driven(robot)
    items = [each.condensed() for _, own in stacks for each in own]
    p = _Likelihood(robot, items, shifts, period).drive_train().p
    items = [item for s, own in stacks if own for item in _with_springs(robot, s, own, p, loaded)]
    joints = np.arange(robot.n_joints)
    found = _Likelihood(robot, items, shifts, period, joints).drive_train()
    found = _judged(robot, found, accelerated, period)
    # columns that nothing calls for make lags uncertain: gears that are not soft lose theirs
    rigid = 1 + len(shifts) + len(p) + np.flatnonzero(~found.soft)
    items = [item.without(rigid) for item in items]
    last = _Likelihood(robot, items, shifts, period, np.flatnonzero(found.soft)).drive_train()
    return replace(
        found, lag=last.lag, lag_error=last.lag_error, covariance=last.covariance, p=last.p
    )


def _shows_lag(measurement: ParameterMeasurement) -> bool:
    """Whether the axis whose torque is read accelerates."""
    if shows_element(measurement):
        return bool(measurement.unit_acceleration[measurement.index])
    return True


def _stacked(
    robot: Robot, m: ParameterMeasurement, s: Signals, shifts: NDArray[np.intp]
) -> Iterator[Stacked]:
    """Torques at whole shifts and the motor's part, beside all columns: of every axis read."""
    reach = int(np.abs(shifts).max()) + (PASSES - 1) * half_window(s.period)
    motors, periods = motor_torque(robot, s.q, s.qd, s.qdd), list(periods_of(m, s))
    for axis in m.read:
        spoilt = ~(s.valid & moving(robot, s, axis))
        clear = ~widened(spoilt, reach, beyond=True)
        padded = np.pad(s.tau[:, axis], reach, mode="edge")
        torques = [padded[reach + k : reach + k + len(s.tau)] for k in shifts]
        columns = np.column_stack([*torques, motors[:, axis]])
        found = stack_axis(robot, s, axis, columns, clear, periods, PASSES)
        yield from (each for each in found if each is not None)


def _with_springs(
    robot: Robot, s: Signals, stacked: Sequence[Stacked], p: Array, loaded: NDArray[np.bool_]
) -> list[Condensed]:
    """The same condensed, with columns of load friction where it is, and K behind those of p."""
    load = inverse_dynamics(robot, p, s.q, s.qd, s.qdd)
    friction = _of_load(s, load) if loaded.any() else load
    for _ in range(PASSES):
        load = s.smoothed(load)
    rates = derivatives(load, s.period)
    found = []
    for each in stacked:
        at = each.index
        K = np.empty((len(at), robot.n_joints))
        rigid = inverse_dynamics(robot, p, s.q[at], s.qd[at], s.qdd[at])[:, each.axis]
        for joint in range(robot.n_joints):
            moved = []
            for motion, part in zip((s.q, s.qd, s.qdd), (load, *rates), strict=True):
                other = motion[at].copy()
                other[:, joint] -= _STEP * part[at, joint]
                moved.append(other)
            K[:, joint] = inverse_dynamics(robot, p, *moved)[:, each.axis] - rigid
        own = each.loaded(friction[at, each.axis]) if loaded[each.axis] else each
        X = np.insert(own.X, [each.n_base] * robot.n_joints, K, axis=1)
        found.append(replace(each, X=X).condensed())
    return found


def _of_load(s: Signals, load: Array) -> Array:
    """Absolute values of the transmitted torque, smoothed.

    Where it changes its sign, at many a corner, that of the smoothed torque dips for as long as
    the window reaches, which looks like a lag; that of the unsmoothed one rectifies noise. So the
    sign alone is taken from the smoothed torque.
    """
    friction = load * np.sign(s.smoothed(load))
    for _ in range(PASSES):
        friction = s.smoothed(friction)
    return friction


def _judged(robot: Robot, found: DriveTrain, measured: Prepared, period: float) -> DriveTrain:
    """Which gears count as soft, an error of sampling being counted."""
    q = np.array([s.q.mean(axis=0) for _, s in measured])
    links = np.einsum("njj->nj", mass_matrix(robot, found.p, q)).mean(axis=0)
    motors = np.diag(motor_inertia(robot, q[0]))
    with np.errstate(divide="ignore", invalid="ignore"):
        sampled = period**2 / 24 * np.where(links > 0, (links + motors) / links**2, np.inf)
    error = np.hypot(found.compliance_error, sampled)
    soft = np.nan_to_num(found.compliance / error) > SOFT
    return replace(found, compliance_error=error, soft=soft)


class _Likelihood:
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
        compliance[self._joints] = _STEP * x[self._springs]
        compliance_error[self._joints] = _STEP * np.where(of_springs > 0, of_springs, np.nan)
        return DriveTrain(
            lag=np.where(identifiable, lag, 0.0),
            lag_error=np.where(identifiable, error, np.nan),
            compliance=compliance,
            compliance_error=compliance_error,
            soft=np.zeros(n, dtype=bool),
            covariance=effect @ covariance @ effect.T,
            p=x[: self._n_base],
        )

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
