"""What lies between the current and the arm, axis by axis: late readings, soft gears, friction.

Drives filter or queue the current that they report, positions they do not: 4 ms between the two
cost half a percent of the inertias and leave residuals that look like friction. Gears give way, and
a share mu_j of what a gear transmits is friction.

Lags and compliances (`hil.estimation.nuisances`) are found from measurements of inertia and
trajectories: where the axis that is read does not accelerate neither shows. Both show most at the
corners of the trapezoids, which the estimate itself leaves out, because there it would have to know
them. What gears transmit comes from a first solution that takes them for rigid. Errors come from
the scores of the measurements; what an error of the lags does to the base parameters comes along,
so that it can be counted with theirs.

A torque that is sampled every T shows a corner of the motion where the next sample is. As long as
corners fall anywhere between samples, as `hil plan` arranges it, that is noise. What remains of it
looks like a compliance: a variance T^2/12 of the instant smooths the torque by T^2/24 times its
second derivative. A compliance must be well above what amounts to the same.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.estimation.condensed import condensed_blocks, stack_axes
from hil.estimation.nuisances import (
    AROUND,
    LAG,
    STEP,
    Search,
    State,
    compliance_names,
    gear_columns,
    shift_names,
)
from hil.estimation.signals import derivatives
from hil.least_squares.solving import inverse
from hil.least_squares.window import half_window, widened
from hil.model.base_parameters import base_parameters
from hil.model.dependencies import DIAGONAL
from hil.model.dynamics import inverse_dynamics, mass_matrix
from hil.model.motors import motor_inertia, motor_torque
from hil.planning.measurement import shows_element

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Indices, Mask
    from hil.estimation.condensed import Stacked
    from hil.estimation.signals import Signals
    from hil.least_squares.blocks import Blocks
    from hil.least_squares.normal_equations import Normal
    from hil.least_squares.regression import Regression
    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMotion

    Prepared = Sequence[tuple[ParameterMotion, Signals]]

EARLIEST, LATEST = -0.002, 0.012
"""Range of lags that is searched [s]: drives queue a current for a few samples of the bus."""
UNIDENTIFIABLE = 0.0005
"""Standard error from which on a lag is taken as zero [s]."""
RANK = 1e-6
"""Least share of information that counts: measurements of inertia show some combinations of
parameters so faintly that these would follow the corners of the motion as the lag does."""
SOFT = 2.0
"""A compliance over its standard error from which on a gear counts as soft."""
CERTAIN = 5.0
"""Compliance or friction of the load over its standard error from which on it counts."""
MOST_TWIST = 0.05
"""At the torque limit [rad]: more is no gear, but what few measurements make of their noise."""
PASSES = 2
"""How often everything is smoothed: K holds the fourth derivative of positions, whose noise the
motor's part shares."""


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
    soft: Mask
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


class LoadFriction(NamedTuple):
    """Share of the transmitted torque that is friction, axis by axis, and its standard error.

    Both of shape (n_joints,); NaN where no transmitted torque shows it.
    """

    mu: Array
    standard_error: Array


def directly_driven(robot: Robot) -> DriveTrain:
    """Torque taken as it was read, gears taken as rigid."""
    n, n_base = robot.n_joints, len(base_parameters(robot))
    zero, unknown = np.zeros(n), np.full(n, np.nan)
    soft = np.zeros(n, dtype=bool)
    return DriveTrain(
        zero, unknown, zero, unknown, soft, np.zeros((n_base, n_base)), np.zeros(n_base)
    )


def compliance_units(robot: Robot) -> str:
    """Unit of a column of compliances of all joints, in millionths."""
    each = ("µrad/(N m)" if robot.revolute[axis] else "µm/N" for axis in range(robot.n_joints))
    return " or ".join(dict.fromkeys(each))


def find_drive_train(robot: Robot, prepared: Prepared, loaded: Mask | None = None) -> DriveTrain:
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
    first, last = (round(np.floor(bound / period)) for bound in (EARLIEST, LATEST))
    shifts = np.arange(first - AROUND, last + AROUND + 2)
    stacks = [(s, axes) for m, s in accelerated for axes in _stacked(robot, m, s, shifts)]
    if not stacks:
        return directly_driven(robot)

    def found(blocks: Blocks, soft: Mask) -> DriveTrain:
        search = Search(blocks, period * shifts, (EARLIEST, LATEST), solver=_without_faint)
        return _read(robot, search, search.settled(replace(all_late, soft=soft)))

    all_late = State.of(robot.n_joints, late=True)
    late = shift_names(shifts)
    p = found(condensed_blocks(robot, (axes for _, axes in stacks), late), all_late.soft).p
    rows = _with_gears(robot, stacks, p, loaded)
    blocks = condensed_blocks(robot, rows, late, compliance_names(robot))
    judged = _judged(robot, found(blocks, ~all_late.soft), accelerated, period)
    # columns that nothing calls for make lags uncertain: gears that are not soft lose theirs
    last_one = found(blocks, judged.soft)
    return replace(
        judged, lag=last_one.lag, lag_error=last_one.lag_error,
        covariance=last_one.covariance, p=last_one.p,
    )  # fmt: skip


def _shows_lag(measurement: ParameterMotion) -> bool:
    """Whether the axis whose torque is read accelerates."""
    if shows_element(measurement):
        return bool(measurement.unit_acceleration[measurement.index])
    return True


def _stacked(robot: Robot, m: ParameterMotion, s: Signals, shifts: Indices) -> list[list[Stacked]]:
    """Torques at whole shifts, the motor's part behind the first, beside all columns."""
    reach = int(np.abs(shifts).max()) + (PASSES - 1) * half_window(s.period)
    motors = motor_torque(robot, s.q, s.qd, s.qdd)

    def part(axis: int) -> tuple[Array, Mask]:
        padded = np.pad(s.tau[:, axis], reach, mode="edge")
        first, *later = (padded[reach + k : reach + k + len(s.tau)] for k in shifts)
        clear = ~widened(~s.moving(robot, axis), reach, beyond=True)
        return np.column_stack([first, motors[:, axis], *later]), clear

    return stack_axes(robot, s, m.read, part, PASSES)


def _with_gears(
    robot: Robot, stacks: Sequence[tuple[Signals, Sequence[Stacked]]], p: Array, loaded: Mask
) -> Iterator[list[Stacked]]:
    """The same with columns of load friction where it is, and K behind those of p."""
    transmitted = [_transmitted(robot, s, p, loaded) for s, _ in stacks]
    rows = [
        np.stack([x[each.index] for x in (s.q, s.qd, s.qdd, *twist)])
        for (s, axes), (twist, _) in zip(stacks, transmitted, strict=True)
        for each in axes
    ]
    every = np.concatenate(rows, axis=1)
    ends = np.cumsum([x.shape[1] for x in rows])[:-1]
    # of all measurements at once: a call takes as long as a thousand samples do
    K = iter(np.split(gear_columns(robot, p, [*every[:3]], [*every[3:]]), ends))
    for (_, axes), (_, friction) in zip(stacks, transmitted, strict=True):
        found = []
        for each in axes:
            own = each.loaded(friction[each.index, each.axis]) if loaded[each.axis] else each
            gears = next(K)[:, each.axis]
            X = np.insert(own.X, [each.n_base] * robot.n_joints, gears, axis=1)
            found.append(replace(own, X=X))
        yield found


def _transmitted(
    robot: Robot, s: Signals, p: Array, loaded: Mask
) -> tuple[tuple[Array, Array, Array], Array]:
    """Torque that gears transmit, smoothed, with two derivatives, and what friction knows of it."""
    load = inverse_dynamics(robot, p, s.q, s.qd, s.qdd)
    friction = _of_load(s, load) if loaded.any() else load
    for _ in range(PASSES):
        load = s.smoothed(load)
    return (load, *derivatives(load, s.period)), friction


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


def _without_faint(equations: Normal) -> tuple[Normal, Array]:
    """Solve without combinations of unknowns that show too faintly."""
    return equations, inverse(equations.information, RANK) @ equations.vector


def _read(robot: Robot, search: Search, state: State) -> DriveTrain:
    """Lags and compliances of a search, and what errors of the lags do to the base parameters."""
    regression = search.regression(state)
    fit, n_base = regression.fit("clusters"), len(base_parameters(robot))
    lags = [fit.layout.at(LAG, axis) for axis in range(robot.n_joints)]
    error = np.sqrt(np.diag(fit.covariance).clip(0.0))
    identifiable = (error[lags] > 0) & (error[lags] < UNIDENTIFIABLE)
    certain = fit.covariance[np.ix_(lags, lags)] * np.outer(identifiable, identifiable)
    effect = _effect(robot, regression)
    compliance, compliance_error = np.full((2, robot.n_joints), np.nan)
    for axis, name in enumerate(compliance_names(robot)):
        if state.soft[axis] and error[place := fit.layout.at(name)] > 0:
            compliance[axis], compliance_error[axis] = STEP * fit.x[place], STEP * error[place]
    return DriveTrain(
        lag=np.where(identifiable, state.lag, 0.0),
        lag_error=np.where(identifiable, error[lags], np.nan),
        compliance=compliance,
        compliance_error=compliance_error,
        soft=np.zeros(robot.n_joints, dtype=bool),
        covariance=effect @ certain @ effect.T,
        p=fit.x[:n_base],
    )


def _effect(robot: Robot, regression: Regression) -> Array:
    """Change of the base parameters of the diagonal group by the lags, shape (n_base, n_joints).

    The others are held: measurements without acceleration identify them.
    """
    layout, kept = regression.layout, regression.kept
    shared = len(layout.shared)
    lags = np.array([layout.at(LAG, axis) for axis in range(robot.n_joints)])
    free = np.append(base_parameters(robot).groups[DIAGONAL], np.arange(shared, layout.size))
    free = np.setdiff1d(np.intersect1d(free, kept), lags).astype(int)
    N = regression.blocks.total.normal(regression.weights).information
    found = np.zeros((layout.size, robot.n_joints))
    found[free] = -inverse(N[np.ix_(free, free)], RANK) @ N[free][:, lags]
    return found[: len(base_parameters(robot))]


def _judged(robot: Robot, found: DriveTrain, measured: Prepared, period: float) -> DriveTrain:
    """Which gears count as soft, an error of sampling being counted."""
    q = np.array([s.q.mean(axis=0) for _, s in measured])
    links = np.einsum("njj->nj", mass_matrix(robot, found.p, q)).mean(axis=0)
    motors = np.diag(motor_inertia(robot, q[0]))
    with np.errstate(divide="ignore", invalid="ignore"):
        sampled = period**2 / 24 * np.where(links > 0, (links + motors) / links**2, np.inf)
    error = np.hypot(found.compliance_error, sampled)
    soft = np.nan_to_num(found.compliance / error) > SOFT
    soft &= np.nan_to_num(found.compliance) * robot.torque_limit < MOST_TWIST
    return replace(found, compliance_error=error, soft=soft)
