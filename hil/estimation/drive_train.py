"""Estimate torque delay, gear compliance and load friction of each axis.

Drives filter or queue the reported current, but not the positions: a delay of 4 ms changes the
inertias by half a percent and leaves residuals similar to friction. Gears are elastic, and a share
mu_j of the torque transmitted by a gear is friction.

Lags and compliances (`hil.estimation.nuisances`) are estimated from measurements of inertia and
trajectories: without acceleration of the measured axis neither is visible. Both have the largest
effect at the corners of the trapezoids, which the estimate itself leaves out, because lag and
compliance would have to be known there. Errors come from the scores of the measurements; the effect
of lag errors on the base parameters is returned, so that it can be included in their errors.

The twist of a gear follows from the transmitted torque, which is the motor torque less rotor torque
and friction. Measured torques contain vibrations of the arm on its gears, torques calculated from
motor motion do not. Links are therefore positioned by measured torques. The existence of soft gears
is tested with columns of calculated torques: with
measured torques, noise would make such a column similar to the explained torque. If a gear is soft,
compliances are first estimated with measured torques, which contain the vibrations, then again from
corrected link positions, with columns of the torque calculated from link motion.

A torque sampled every T shows a corner of the motion only at the next sample. If the corners fall
anywhere between samples, as `hil plan` arranges, this is noise. The remaining mean effect resembles
a compliance: a variance T^2/12 of the instant smooths the torque by T^2/24 times its second
derivative. A compliance must be well above the equivalent value.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.estimation.condensed import condensed_blocks, stack_axes
from hil.estimation.intervals import Edge
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
from hil.friction.equation import SLOW, speed_scale
from hil.least_squares.solving import inverse
from hil.least_squares.window import half_window, widen
from hil.model.base_parameters import base_parameters
from hil.model.dependencies import DIAGONAL
from hil.model.dynamics import inverse_dynamics, mass_matrix
from hil.model.motors import motor_inertia, motor_torque
from hil.planning.measurement import shows_element

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Indices, Mask
    from hil.estimation.condensed import Stacked
    from hil.estimation.signals import Prepared, Signals
    from hil.least_squares.blocks import Blocks
    from hil.least_squares.normal_equations import Normal
    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMotion

EARLIEST, LATEST = -0.002, 0.012
"""Search range of lags [s]: drives queue a current for a few samples of the bus."""
RANK = 1e-6
"""Smallest relevant share of information: measurements of inertia excite some combinations of
parameters so weakly that these would fit the corners of the motion in place of the lag.
"""
CERTAIN = 5.0
"""Smallest significant ratio of compliance or load friction to its standard error."""
MOST_TWIST = 0.05
"""Largest twist of a gear at the torque limit [rad]; a larger twist is an artefact of noise in few
measurements.
"""
LAG_OF_TORQUE = "lag of the torque"
MOST_ROUNDS = 5
"""Maximum number of rounds of compliances and link positions: gears of 20 Hz need three."""
PASSES = 2
"""Number of smoothing passes: K contains the fourth derivative of positions, whose noise also
enters the motor's part."""


@dataclass(frozen=True, slots=True, eq=False)
class DriveTrain:
    """Torque delays and gear compliances of the axes.

    Attributes
    ----------
    lag : ndarray, shape (n_joints,)
        Delay of the torque [s], positive for a late torque; zero if not identifiable.
    lag_error : ndarray, shape (n_joints,)
        Standard errors [s]; NaN if the lag is not identifiable.
    compliance : ndarray, shape (n_joints,)
        Measured compliance of each gear [rad/(N m)], also for gears that are not `soft`.
    compliance_error : ndarray, shape (n_joints,)
        Standard errors [rad/(N m)]; NaN without information on a compliance.
    soft : ndarray of bool, shape (n_joints,)
        Significantly elastic gears. The others count as rigid.
    covariance : ndarray, shape (n_base, n_base)
        Covariance of the base parameters from errors of the lags.
    p : ndarray, shape (n_base,)
        Base parameters used to calculate the gear torques.
    """

    lag: Array
    lag_error: Array
    compliance: Array
    compliance_error: Array
    soft: Mask
    covariance: Array
    p: Array

    @property
    def soft_compliance(self) -> Array:
        """Compliance of soft gears, shape (n_joints,) [rad/(N m)]; 0 for rigid gears."""
        return np.where(self.soft, self.compliance, 0.0)

    def applied(self, robot: Robot, s: Signals, compliance: Array | None = None) -> Signals:
        """Return signals with compensated torque delays and gear twists.

        Parameters
        ----------
        compliance : ndarray, shape (n_joints,), optional
            Compliances in place of those of the soft gears.
        """
        return self.placed(robot, s, compliance).torque_advanced(self.lag)

    def placed(self, robot: Robot, s: Signals, compliance: Array | None = None) -> Signals:
        """Return signals with compensated gear twists, but recorded torques."""
        c = self.soft_compliance if compliance is None else compliance
        if not c.any():
            return s
        return replace(s, twist=c * _transmitted(robot, self.p, s.torque_advanced(self.lag), c))

    def edges(self, robot: Robot) -> tuple[Edge, ...]:
        """Return the lags and compliances at the edge of the search range."""
        found = [
            Edge(axis=k + 1, what=LAG_OF_TORQUE, value=1e3 * lag, bound=1e3 * bound, unit="ms")
            for k, (lag, known) in enumerate(zip(self.lag, self.lag_error, strict=True))
            for bound in (EARLIEST, LATEST)
            if np.isfinite(known) and np.isclose(lag, bound, rtol=1e-6)
        ]
        twist, sure = self.compliance * robot.torque_limit, CERTAIN * self.compliance_error
        too_far = (twist >= MOST_TWIST) & (self.compliance > sure)
        return (*found, *(twist_edge(robot, k, twist[k]) for k in np.flatnonzero(too_far).tolist()))


def twist_edge(robot: Robot, axis: int, twist: float) -> Edge:
    """Return the edge for a gear, from 0, with an excessive twist at its torque limit."""
    unit, what = robot.position_unit(axis), "twist of the gear at the torque limit"
    return Edge(axis=axis + 1, what=what, value=float(twist), bound=MOST_TWIST, unit=unit)


class LoadFriction(NamedTuple):
    """Share of the transmitted torque lost to friction, with standard error, by axis.

    Share and error have shape (n_joints,); NaN without a transmitted torque.
    """

    mu: Array
    standard_error: Array


def directly_driven(robot: Robot) -> DriveTrain:
    """Return a drive train without delay and with rigid gears."""
    n, n_base = robot.n_joints, len(base_parameters(robot))
    zero, unknown = np.zeros(n), np.full(n, np.nan)
    soft = np.zeros(n, dtype=bool)
    return DriveTrain(
        zero, unknown, zero, unknown, soft, np.zeros((n_base, n_base)), np.zeros(n_base)
    )


def compliance_units(robot: Robot) -> str:
    """Return the unit for a table column of the joints' compliances, in millionths."""
    each = ("µrad/(N m)" if robot.revolute[axis] else "µm/N" for axis in range(robot.n_joints))
    return " or ".join(dict.fromkeys(each))


def find_drive_train(
    robot: Robot, prepared: Prepared, loaded: Mask | None = None, start: DriveTrain | None = None
) -> DriveTrain:
    """Estimate the lag and the compliance of every axis.

    Parameters
    ----------
    loaded : ndarray of bool, shape (n_joints,), optional
        Axes with load-dependent friction; none by default.
    start : DriveTrain, optional
        Earlier estimate with the torques transmitted by soft gears.
    """
    loaded = np.zeros(robot.n_joints, dtype=bool) if loaded is None else loaded
    # a stroke shows the lag if its measured axis accelerates, a trajectory always does
    accelerated = [
        (m, s) for m, s in prepared if not shows_element(m) or m.unit_acceleration[m.index]
    ]
    if start is None or not start.soft.any():
        first = _found(robot, accelerated, loaded, None, calculated=True)
        if not first.soft.any():
            return first
    placed = np.zeros(robot.n_joints) if start is None else start.soft_compliance
    found = _found(robot, accelerated, loaded, start)
    soft = found.soft | (placed != 0.0)
    for _ in range(MOST_ROUNDS):
        train = replace(found, soft=soft)
        change = np.abs(train.soft_compliance - placed)
        if (change <= np.nan_to_num(train.compliance_error)).all():
            break  # compliances agree with those used for the link positions
        placed = train.soft_compliance
        found = _found(robot, accelerated, loaded, train)
        soft = soft | found.soft  # soft gears stay soft, or two gears might alternate forever
    if (soft & ~found.soft).any():
        again = _found(robot, accelerated, loaded, found)
        return replace(again, soft=again.soft & found.soft)
    return found


def _found(
    robot: Robot,
    accelerated: Prepared,
    loaded: Mask,
    before: DriveTrain | None,
    *,
    calculated: bool = False,
) -> DriveTrain:
    """Estimate a drive train from link positions corrected by an earlier estimate."""
    if not accelerated:
        return directly_driven(robot)
    period = max(s.period for _, s in accelerated)
    first, last = (round(np.floor(bound / period)) for bound in (EARLIEST, LATEST))
    shifts = np.arange(first - AROUND, last + AROUND + 2)
    if before is not None:
        accelerated = [(m, before.placed(robot, s)) for m, s in accelerated]
    stacks = [(s, axes) for m, s in accelerated for axes in _stacked(robot, m, s, shifts)]
    if not stacks:
        return directly_driven(robot)

    def excited(equations: Normal) -> tuple[Normal, Array]:
        return equations, inverse(equations.information, RANK) @ equations.vector

    def found(blocks: Blocks, soft: Mask) -> DriveTrain:
        search = Search(blocks, period * shifts, (EARLIEST, LATEST), solver=excited)
        return _read(robot, search, search.settled(replace(all_late, soft=soft)))

    all_late = State.start(robot.n_joints, late=True)
    late = shift_names(shifts)
    p = found(condensed_blocks(robot, (axes for _, axes in stacks), late), all_late.soft).p
    rows = _add_gear_columns(robot, stacks, p, loaded, calculated=calculated)
    blocks = condensed_blocks(robot, rows, late, compliance_names(robot))
    every = found(blocks, ~all_late.soft)
    if before is not None:
        every = replace(every, compliance=every.compliance + before.soft_compliance)
    judged = _judged(robot, every, accelerated, period)
    # rigid gears have no column, since superfluous columns make lags uncertain
    last_one = found(blocks, judged.soft)
    return replace(
        judged, lag=last_one.lag, lag_error=last_one.lag_error,
        covariance=last_one.covariance, p=last_one.p,
    )  # fmt: skip


def _stacked(robot: Robot, m: ParameterMotion, s: Signals, shifts: Indices) -> list[list[Stacked]]:
    """Stack torques shifted by whole samples, the motor's part in second place, and all columns."""
    reach = int(np.abs(shifts).max()) + (PASSES - 1) * half_window(s.period)
    motors = motor_torque(robot, s.q, s.qd, s.qdd)

    def part(axis: int) -> tuple[Array, Mask]:
        padded = np.pad(s.tau[:, axis], reach, mode="edge")
        first, *later = (padded[reach + k : reach + k + len(s.tau)] for k in shifts)
        clear = ~widen(~s.moving(robot, axis), reach, beyond=True)
        return np.column_stack([first, motors[:, axis], *later]), clear

    return stack_axes(robot, s, m.read, part, PASSES)


def _add_gear_columns(
    robot: Robot,
    stacks: Sequence[tuple[Signals, Sequence[Stacked]]],
    p: Array,
    loaded: Mask,
    *,
    calculated: bool,
) -> Iterator[list[Stacked]]:
    """Add columns of load friction, and columns K after the base-parameter columns."""
    transmitted = [_smooth_load(robot, s, p, loaded, calculated=calculated) for s, _ in stacks]
    rows = [
        np.stack([x[each.index] for x in (*s.link, *twist)])
        for (s, axes), (twist, _) in zip(stacks, transmitted, strict=True)
        for each in axes
    ]
    every = np.concatenate(rows, axis=1)
    ends = np.cumsum([x.shape[1] for x in rows])[:-1]
    # a single call for all measurements: the overhead of a call equals a thousand samples
    K = iter(np.split(gear_columns(robot, p, [*every[:3]], [*every[3:]]), ends))
    for (_, axes), (_, friction) in zip(stacks, transmitted, strict=True):
        found = []
        for each in axes:
            own = each.loaded(friction[each.index, each.axis]) if loaded[each.axis] else each
            gears = next(K)[:, each.axis]
            X = np.insert(own.X, [each.n_base] * robot.n_joints, gears, axis=1)
            found.append(replace(own, X=X))
        yield found


def _smooth_load(
    robot: Robot, s: Signals, p: Array, loaded: Mask, *, calculated: bool
) -> tuple[tuple[Array, Array, Array], Array]:
    """Return transmitted torques, smoothed, with two derivatives, and the load for friction."""
    load = of_links = inverse_dynamics(robot, p, *s.link)
    if s.twist is None and not calculated:
        load = _transmitted(robot, p, s)
    for _ in range(PASSES):
        load = s.smoothed(load)
    friction = of_links
    if loaded.any():
        # At sign changes, frequent at corners, the absolute value of the smoothed torque dips over
        # the length of the window, which resembles a lag; that of the unsmoothed torque contains
        # rectified noise. So only the sign is taken from the smoothed torque.
        friction = of_links * np.sign(s.smoothed(of_links))
        for _ in range(PASSES):
            friction = s.smoothed(friction)
    return (load, *derivatives(load, s.period)), friction


def _transmitted(robot: Robot, p: Array, s: Signals, compliance: Array | float = 0.0) -> Array:
    """Return the torque transmitted by the gears, shape (n, n_joints).

    For a stroke this is the motor torque less rotor torque and friction. The mean of measured minus
    calculated torque (by base parameters `p`) differs between the directions of an axis; half the
    difference is friction, reduced near reversals. For motion in one direction friction is kept: a
    constant does not change the rate of twist. If all axes move at once, the torque is calculated:
    a measured torque contains the acceleration noise of all rotors. With known `compliance` the
    motion of the links is used.
    """
    calculated = inverse_dynamics(robot, p, s.q, s.qd, s.qdd)
    if s.group is not None:
        return inverse_dynamics(robot, p, *replace(s, twist=compliance * calculated).link)
    found = s.tau - motor_torque(robot, s.q, s.qd, s.qdd)
    for axis, qd in enumerate(s.smoothed(s.qd).T):
        beyond = found[:, axis] - calculated[:, axis]
        direction = np.clip(qd / (SLOW * speed_scale(robot, s, axis)), -1.0, 1.0)
        forth, back = (beyond[direction == way] for way in (1.0, -1.0))
        if len(forth) and len(back):
            found[:, axis] -= (forth.mean() - back.mean()) / 2 * direction
    return found


def _read(robot: Robot, search: Search, state: State) -> DriveTrain:
    """Read lags and compliances from a search, with the effect of lag errors on parameters."""
    regression = search.regression(state)
    fit, n_base = regression.fit("clusters"), len(base_parameters(robot))
    lags = [fit.layout.index(LAG, axis) for axis in range(robot.n_joints)]
    # change of diagonal-group parameters by the lags, shape (n_base, n_joints), with the other
    # groups fixed: measurements without acceleration identify them
    free = np.arange(len(fit.layout.shared), fit.layout.size)
    free = np.append(base_parameters(robot).groups[DIAGONAL], free)
    free = np.setdiff1d(np.intersect1d(free, regression.kept), lags).astype(int)
    N = regression.blocks.total.normal(regression.weights).information
    effect = np.zeros((fit.layout.size, robot.n_joints))
    effect[free] = -inverse(N[np.ix_(free, free)], RANK) @ N[free][:, lags]
    effect = effect[:n_base]
    error = np.sqrt(np.diag(fit.covariance).clip(0.0))
    # largest standard error of an identifiable lag [s]
    identifiable = (error[lags] > 0) & (error[lags] < 0.0005)
    certain = fit.covariance[np.ix_(lags, lags)] * np.outer(identifiable, identifiable)
    compliance, compliance_error = np.full((2, robot.n_joints), np.nan)
    for axis, name in enumerate(compliance_names(robot)):
        if state.soft[axis] and error[place := fit.layout.index(name)] > 0:
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


def _judged(robot: Robot, found: DriveTrain, measured: Prepared, period: float) -> DriveTrain:
    """Select the significantly soft gears, with the sampling error included."""
    q = np.array([s.q.mean(axis=0) for _, s in measured])
    links = np.einsum("njj->nj", mass_matrix(robot, found.p, q)).mean(axis=0)
    motors = np.diag(motor_inertia(robot, q[0]))
    with np.errstate(divide="ignore", invalid="ignore"):
        sampled = period**2 / 24 * np.where(links > 0, (links + motors) / links**2, np.inf)
    error = np.hypot(found.compliance_error, sampled)
    # smallest ratio of compliance to standard error of a soft gear
    soft = np.nan_to_num(found.compliance / error) > 2.0
    soft &= np.nan_to_num(found.compliance) * robot.torque_limit < MOST_TWIST
    return replace(found, compliance_error=error, soft=soft)
