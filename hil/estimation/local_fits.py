"""Fit an element of g(q) or M(q) to a measurement, as in the paper (step 1).

gravity, eq. (14)
    Friction is symmetric, so half the sum of the mean torques forward and backward at constant
    velocity is the gravity torque; half the difference is friction.
inertia, eq. (19), (20)
    The gravity torque is compensated by the model found from the gravity measurements; the
    remainder is fitted by ``M_ii qdd + a1 qd + a2 sign(qd) + a3 cbrt(qd)``.
coupling, eq. (21)
    The torque is measured on the creeping axis j while axis i accelerates: ``M_ji qdd_i`` and, for
    each stroke of the creeping axis, a friction level (the paper's ``a1 qd_j`` at constant
    ``qd_j``), gravity being compensated.

Much of the torque is in none of these terms: load-dependent or direction-dependent friction,
ripple, gear elasticity, accelerations of other axes. The improved method models these effects, and
its values of step 1 lie close to a correct model (`believed_fit`).

Samples slower than 5 % of the axis's speed limit are left out: presliding is not a function of
velocity. The row of a value is the mean of the regressor's rows over the used samples, not the row
at the nominal configuration, since a window covers a range of q.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from checked_files.yaml_file import FileModel
from hil.errors import NotEnoughData
from hil.friction.equation import LOAD, SLOW, own_friction
from hil.least_squares.layout import embedded
from hil.least_squares.solving import orthonormal
from hil.model.base_parameters import base_parameters
from hil.model.dependencies import GRAVITY
from hil.model.dynamics import regressors
from hil.model.motors import motor_torque
from hil.planning.measurement import ELEMENT_KINDS, Coupling, Inertia

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from hil.arrays import Array
    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.measurement import ElementMeasurement, Gravity


class LocalValue(FileModel):
    """Measured element of g(q) or M(q).

    Attributes
    ----------
    axis, partner : int
        Measured joint, accelerated joint; indices from 0, in `model.yaml` from 1.
    q : tuple of float, shape (n_joints,)
        Mean configuration [rad].
    time : float
        Middle of the recording, since the start of the bus [s].
    value, model : float
        Measured value, and value by the base parameters: g_i [N m], M_ii or M_ji [kg m^2].
    standard_error : float or None
        Standard error of `value`, from the scatter inside the measurement; None without scatter.
    friction : float
        Friction level at `hil.estimation.local_fits.REFERENCE_SPEED`, or at creep speed for a
        creeping axis, mean of both directions [N m].
    residual : float
        Root mean square residual of the local model [N m].
    believed, believed_error : float or None
        Value and standard error after subtraction of further estimated effects
        (`hil.estimation.local_fits.believed_fit`); None for methods without such effects, and in
        `model.yaml`.
    """

    id: str
    kind: str
    axis: int
    partner: int
    q: tuple[float, ...]
    time: float
    value: float
    model: float
    standard_error: float | None
    friction: float
    residual: float
    believed: float | None = None
    believed_error: float | None = None

    @property
    def shown(self) -> tuple[float, float]:
        """Value and standard error for comparison with the model; NaN without scatter."""
        value, error = self.believed, self.believed_error
        if value is None:
            value, error = self.value, self.standard_error
        return value, np.nan if error is None else error

    @property
    def symbol(self) -> Literal["g", "M"]:
        """Symbol of the vector or matrix of the element."""
        return ELEMENT_KINDS[self.kind].symbol


@dataclass(frozen=True, slots=True, eq=False)
class LocalFit:
    """Evaluated measurement, linear in the unknown base parameters of gravity.

    The right-hand side of the fit has several columns: the measured torque, the motors' part of the
    torque, and the gravity torque of one unit of each base parameter.

    Attributes
    ----------
    q : ndarray, shape (n_joints,)
        Mean configuration [rad or m].
    time : float
        See `LocalValue`.
    sides : ndarray, shape (2 + n_base,)
        Value of the element for each column. The gravity columns of a gravity measurement are zero,
        since gravity is the measured quantity.
    friction : ndarray, shape (2 + n_base,)
        Friction level for each column.
    gram : ndarray, shape (2 + n_base, 2 + n_base)
        Mean products of the columns' residuals.
    leverage : float
        Ratio of the element's standard error to the residual.
    row : ndarray, shape (n_base,)
        Row of the element in the model: ``row @ p``.
    """

    measurement: ElementMeasurement
    q: Array
    time: float
    sides: Array
    friction: Array
    gram: Array
    leverage: float
    row: Array

    def evaluate(self, p: Array) -> LocalValue:
        """Return values with gravity compensated by base parameters `p`."""
        weights = np.concatenate([[1.0, -1.0], -p])
        residual, m = float(np.sqrt(max(weights @ self.gram @ weights, 0.0))), self.measurement
        error = float(self.leverage * residual)
        return LocalValue(
            id=m.id,
            kind=m.kind,
            axis=m.index,
            partner=m.partner.index if isinstance(m, Coupling) else m.index,
            q=tuple(self.q.tolist()),
            time=self.time,
            value=float(self.sides @ weights),
            model=float(self.row @ p),
            standard_error=None if np.isnan(error) else error,
            friction=float(self.friction @ weights),
            residual=residual,
        )


SETTLING = 0.16
"""Settling time after a ramp until constant velocity [s]."""
FEWEST = 5
"""Fewest samples per coefficient of a fit."""
REFERENCE_SPEED = 0.1
"""Reference speed of friction levels, as a share of the speed limit."""


def local_fit(robot: Robot, measurement: ElementMeasurement, s: Signals) -> LocalFit:
    """Evaluate a measurement.

    Raises
    ------
    NotEnoughData
        Too few usable samples.
    """
    found: LocalFit = LOCAL_FITS[measurement.kind](robot, measurement, s)
    return found


def believed_fit(
    robot: Robot, measurement: ElementMeasurement, s: Signals, p: Array, common: Array
) -> LocalFit:
    """Evaluate a measurement after subtraction of effects found by the improved method.

    The terms common to the axis's measurements are subtracted, and the rigid-body torque except
    gravity and the element itself. The friction terms of the measurement are those of the improved
    method.

    Parameters
    ----------
    p : ndarray, shape (n_base,)
    common : ndarray, shape (N_COMMON,)
        Coefficients of the common terms of the axis.

    Raises
    ------
    NotEnoughData
        See `local_fit`.
    """
    axis = measurement.index
    rows, columns, _ = s.terms(robot, axis)
    weight, element = _static_rows(robot, s, axis, *np.flatnonzero(measurement.unit_acceleration))
    qdd = s.qdd @ np.abs(measurement.unit_acceleration)
    own = weight @ p[list(base_parameters(robot).groups[GRAVITY])] + qdd * (element @ p)
    rigid, v = rows @ p, s.smoothed(s.qd[:, axis])
    of_load = np.abs(s.smoothed(rigid)) * (common[LOAD] * np.sign(v) + common[LOAD + 1])
    tau = s.tau.copy()
    tau[:, axis] -= columns[:, :LOAD] @ common[:LOAD] + of_load + rigid - own
    seen = replace(s, tau=tau)
    if isinstance(measurement, Inertia):
        return _inertia(robot, measurement, seen, own_friction(s, v / robot.velocity_limit[axis]))
    return local_fit(robot, measurement, seen)


def _gravity(robot: Robot, m: Gravity, s: Signals) -> LocalFit:
    i = m.index
    signals = _filtered(robot, s, i)
    sides, v = signals.sides, signals.v
    means: tuple[list[Array], list[Array]] = ([], [])
    for stroke in range(m.n_strokes):
        # samples at constant velocity, without the transient after the ramp
        wanted = m.velocity if stroke % 2 == 0 else -m.velocity
        # largest relative deviation from the profile velocity at constant velocity
        off = (s.stroke != stroke) | (np.abs(v - wanted) > 0.1 * m.velocity)
        window: NDArray[np.bool_] = ~off & s.valid
        if window.any():
            first = int(np.flatnonzero(window)[0])
            window[first : first + round(SETTLING / s.period)] = False
        # shortest window of constant velocity [s]
        if window.sum() * s.period >= 0.1:
            means[stroke % 2].append(sides[window].mean(axis=0))
    pairs = min(len(means[0]), len(means[1]))
    if not pairs:
        raise NotEnoughData(
            "no window of constant velocity in both directions; plan a longer "
            "stroke, and repeat the measurement"
        )
    forward, backward = np.array(means[0][:pairs]), np.array(means[1][:pairs])
    half_sums, half_differences = (forward + backward) / 2, (forward - backward) / 2
    mean = half_sums.mean(axis=0)
    n = 2 + len(base_parameters(robot))
    torques = half_sums[:, :2] - mean[:2]
    return LocalFit(
        measurement=m,
        q=_mean_q(s, s.stroke >= 0),
        time=float(s.time.mean()),
        sides=embedded(mean[:2], np.arange(2), n),
        friction=embedded(half_differences.mean(axis=0), signals.place, n),
        gram=embedded(torques.T @ torques / max(pairs - 1, 1), np.arange(2), n),
        leverage=1.0 / np.sqrt(pairs) if pairs > 1 else np.nan,
        row=embedded(mean, signals.place, n)[2:],
    )


def _inertia(robot: Robot, m: Inertia, s: Signals, friction: Array | None = None) -> LocalFit:
    i = m.index
    v = s.qd[:, i]
    reference = REFERENCE_SPEED * robot.velocity_limit[i]
    columns = np.column_stack([s.qdd[:, i], v, np.sign(v), np.cbrt(v)])
    levels = np.array([0.0, reference, 1.0, np.cbrt(reference)])
    if friction is not None:  # the friction level is defined for the published terms only
        columns = np.column_stack([s.qdd[:, i], friction])
        levels = np.zeros(columns.shape[1])
    return _mass_element(robot, m, s, (i, i), columns, levels, s.valid)


def _coupling(robot: Robot, m: Coupling, s: Signals) -> LocalFit:
    j, i = m.index, m.partner.index
    used = s.valid & (s.partner_stroke >= 0) & (s.stroke >= 0)
    strokes = (s.stroke[:, np.newaxis] == np.arange(m.n_strokes)).astype(float)
    columns = np.column_stack([s.qdd[:, i], strokes])
    levels = np.concatenate([[0.0], np.resize([1.0, -1.0], m.n_strokes) / m.n_strokes])
    return _mass_element(robot, m, s, (j, i), columns, levels, used)


def _mass_element(
    robot: Robot,
    m: Inertia | Coupling,
    s: Signals,
    element: tuple[int, int],
    columns: Array,
    levels: Array,
    used: NDArray[np.bool_],
) -> LocalFit:
    """Fit eq. (20) for an element of M(q), from the samples `used`.

    The acceleration is the first of the `columns`; `levels` are the weights of the coefficients in
    the friction level.
    """
    signals = _filtered(robot, s, element[0], columns, element[1])
    # away from reversals by the reach of the filter
    used = used & s.away_from(np.abs(signals.v) < SLOW * robot.velocity_limit[element[0]])
    W, C, n = signals.columns[used], signals.sides[used], 2 + len(base_parameters(robot))
    if len(W) < FEWEST * W.shape[1]:
        raise NotEnoughData(
            f"{len(W)} usable samples must be at least {FEWEST * W.shape[1]}; repeat the "
            "measurement with a longer stroke or a higher velocity"
        )
    Q, root = orthonormal(W)
    pr = root @ (Q.T @ C)
    left = C - W @ pr
    weight = s.qdd[used, element[1]] ** 2
    weights = np.zeros(len(used))
    weights[used] = Q @ root[0]
    # of white noise e before the filter h, the error of the sum of a_i (h * e)_i is |h * a|, and
    # that of one sample |h|
    one = np.zeros_like(weights)
    one[len(one) // 2] = 1.0
    return LocalFit(
        measurement=m,
        q=_mean_q(s, used),
        time=float(s.time.mean()),
        sides=embedded(pr[0], signals.place, n),
        friction=embedded(levels @ pr, signals.place, n),
        gram=embedded(left.T @ left / (len(W) - W.shape[1]), signals.place, n),
        leverage=float(np.linalg.norm(s.filtered(weights)) / np.linalg.norm(s.filtered(one))),
        row=weight @ signals.element[used] / weight.sum(),
    )


class _Filtered(NamedTuple):
    """Filtered signals and columns of an axis in a measurement.

    Attributes
    ----------
    sides : ndarray, shape (n, k)
        Nonzero columns of the right-hand side: see `LocalFit`.
    place : ndarray of int, shape (k,)
        Indices of the columns of `sides` among all columns.
    v : ndarray, shape (n,)
        Velocity [rad/s].
    columns : ndarray, shape (n, m)
        Columns of the observation matrix.
    element : ndarray, shape (n, n_base)
        Element of M(q) by the model, per unit of each base parameter; not filtered.
    """

    sides: Array
    place: NDArray[np.intp]
    v: Array
    columns: Array
    element: Array


def _filtered(
    robot: Robot,
    s: Signals,
    axis: int,
    columns: Array | None = None,
    accelerated: int | None = None,
) -> _Filtered:
    """Filter the signals and `columns` of an axis, while only joint `accelerated` accelerates."""
    weight, element = _static_rows(robot, s, axis, *([] if accelerated is None else [accelerated]))

    def filter_motion() -> Array:
        motor = motor_torque(robot, s.q, s.qd, s.qdd)[:, axis]
        given = [s.qd[:, axis], motor, weight, *([] if columns is None else [columns])]
        return s.filtered(np.column_stack(given))

    # columns of a measurement are labelled by the measurement's number
    n_columns = 0 if columns is None else columns.shape[1]
    found = s.once((_filtered, robot, axis, n_columns), filter_motion)
    shown = np.array(base_parameters(robot).groups[GRAVITY], dtype=int)
    k = 2 + len(shown)
    sides = np.column_stack([s.filtered(s.tau[:, axis]), found[:, 1:k]])
    return _Filtered(sides, np.append([0, 1], 2 + shown), found[:, 0], found[:, k:], element)


def _static_rows(robot: Robot, s: Signals, axis: int, *accelerated: int) -> tuple[Array, Array]:
    """Return rows of an axis for gravity, (n, n_gravity), and for a unit acceleration."""

    def compute_rows() -> tuple[Array, Array]:
        still = np.zeros(robot.n_joints)
        rates = [(still, still), *((still, np.eye(robot.n_joints)[each]) for each in accelerated)]
        rows = [each[:, 0] for each in regressors(robot, s.q, rates, joints=[axis])]
        return rows[0][:, list(base_parameters(robot).groups[GRAVITY])], rows[-1] - rows[0]

    return s.once((_static_rows, robot, axis), compute_rows)


def _mean_q(s: Signals, used: NDArray[np.bool_]) -> Array:
    mean: Array = s.q[used].mean(axis=0)
    return mean


LOCAL_FITS: dict[str, Callable[[Robot, Any, Signals], LocalFit]] = {
    "gravity": _gravity,
    "inertia": _inertia,
    "coupling": _coupling,
}
"""Fit by kind of measurement, for kinds with an element of g(q) or M(q)."""
ELSEWHERE = {
    "friction": "",
    "trajectory": "the published method uses only strokes; use --method improved",
    "free": "the published method uses only strokes; the improved method uses free motions too",
}
"""Remark by kind of measurement without base parameters in step 1."""
