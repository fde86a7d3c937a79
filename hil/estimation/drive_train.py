"""What lies between the current and the arm, axis by axis: late readings, soft gears, friction.

Drives filter or queue the current that they report, positions they do not: 4 ms between the two
cost half a percent of the inertias and leave residuals that look like friction. Gears give way, and
a share mu_j of what a gear transmits is friction.

Lags and compliances (`hil.estimation.nuisances`) are found from measurements of inertia and
trajectories: where the axis that is read does not accelerate neither shows. Both show most at the
corners of the trapezoids, which the estimate itself leaves out, because there it would have to know
them. Errors come from the scores of the measurements; what an error of the lags does to the base
parameters comes along, so that it can be counted with theirs.

How far a gear gives way, what it transmits says, and that the motor's torque says: without that of
the rotor and friction it is what the arm takes, rings of the arm on its gears included, which no
torque that is calculated from the motors' motion holds. So links are placed by measured torques.
Whether any gear is soft, columns of calculated torques show: noise of measured ones would make such
a column alike to the torque that it is to explain. Where one is, compliances are first found by
measured torques, which hold the rings, then all again from links in their places, with columns of
the torque that is calculated from their motion.

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
    from hil.least_squares.regression import Regression
    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMotion

EARLIEST, LATEST = -0.002, 0.012
"""Range of lags that is searched [s]: drives queue a current for a few samples of the bus."""
RANK = 1e-6
"""Least share of information that counts: measurements of inertia show some combinations of
parameters so faintly that these would follow the corners of the motion as the lag does."""
CERTAIN = 5.0
"""Compliance or friction of the load over its standard error from which on it counts."""
MOST_TWIST = 0.05
"""At the torque limit [rad]: more is no gear, but what few measurements make of their noise."""
LAG_OF_TORQUE = "lag of the torque"
MOST_ROUNDS = 5
"""Times that all is found from links in their places: gears of 20 Hz need three."""
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

    @property
    def soft_compliance(self) -> Array:
        """That of gears that are soft, shape (n_joints,) [rad/(N m)]; 0 of the others."""
        return np.where(self.soft, self.compliance, 0.0)

    def applied(self, robot: Robot, s: Signals, compliance: Array | None = None) -> Signals:
        """Signals with torques as early as positions, and with links where soft gears let them.

        Parameters
        ----------
        compliance : ndarray, shape (n_joints,), optional
            Others than those of the gears that are soft.
        """
        return self.placed(robot, s, compliance).torque_advanced(self.lag)

    def placed(self, robot: Robot, s: Signals, compliance: Array | None = None) -> Signals:
        """The same with torques as late as they were read."""
        c = self.soft_compliance if compliance is None else compliance
        if not c.any():
            return s
        return replace(s, twist=c * _transmitted(robot, self.p, s.torque_advanced(self.lag), c))

    def edges(self, robot: Robot) -> tuple[Edge, ...]:
        """Return the lags and compliances that end at the edge of what is looked for."""
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
    """Return the edge of a gear, from 0, that would twist so far at its torque limit."""
    unit, what = robot.position_unit(axis), "twist of the gear at the torque limit"
    return Edge(axis=axis + 1, what=what, value=float(twist), bound=MOST_TWIST, unit=unit)


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


def find_drive_train(
    robot: Robot, prepared: Prepared, loaded: Mask | None = None, start: DriveTrain | None = None
) -> DriveTrain:
    """Estimate the lag and the compliance of every axis.

    Parameters
    ----------
    loaded : ndarray of bool, shape (n_joints,), optional
        Axes whose friction grows with the transmitted torque; none by default.
    start : DriveTrain, optional
        Where it is known already what soft gears transmit.
    """
    loaded = np.zeros(robot.n_joints, dtype=bool) if loaded is None else loaded
    accelerated = [(m, s) for m, s in prepared if _shows_lag(m)]
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
            break  # gears are as soft as links were placed by
        placed = train.soft_compliance
        found = _found(robot, accelerated, loaded, train)
        soft = soft | found.soft  # or two gears might take turns for ever
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
    """The same from links that are in their places as far as these are known."""
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

    def found(blocks: Blocks, soft: Mask) -> DriveTrain:
        search = Search(blocks, period * shifts, (EARLIEST, LATEST), solver=_without_faint)
        return _read(robot, search, search.settled(replace(all_late, soft=soft)))

    all_late = State.of(robot.n_joints, late=True)
    late = shift_names(shifts)
    p = found(condensed_blocks(robot, (axes for _, axes in stacks), late), all_late.soft).p
    rows = _with_gears(robot, stacks, p, loaded, calculated=calculated)
    blocks = condensed_blocks(robot, rows, late, compliance_names(robot))
    every = found(blocks, ~all_late.soft)
    if before is not None:
        every = replace(every, compliance=every.compliance + before.soft_compliance)
    judged = _judged(robot, every, accelerated, period)
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
        clear = ~widen(~s.moving(robot, axis), reach, beyond=True)
        return np.column_stack([first, motors[:, axis], *later]), clear

    return stack_axes(robot, s, m.read, part, PASSES)


def _with_gears(
    robot: Robot,
    stacks: Sequence[tuple[Signals, Sequence[Stacked]]],
    p: Array,
    loaded: Mask,
    *,
    calculated: bool,
) -> Iterator[list[Stacked]]:
    """The same with columns of load friction where it is, and K behind those of p."""
    transmitted = [_smooth_load(robot, s, p, loaded, calculated=calculated) for s, _ in stacks]
    rows = [
        np.stack([x[each.index] for x in (*s.link, *twist)])
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


def _smooth_load(
    robot: Robot, s: Signals, p: Array, loaded: Mask, *, calculated: bool
) -> tuple[tuple[Array, Array, Array], Array]:
    """Torque that gears transmit, smoothed, with two derivatives, and what friction knows of it."""
    load = of_links = inverse_dynamics(robot, p, *s.link)
    if s.twist is None and not calculated:
        load = _transmitted(robot, p, s)
    for _ in range(PASSES):
        load = s.smoothed(load)
    friction = _of_load(s, of_links) if loaded.any() else of_links
    return (load, *derivatives(load, s.period)), friction


def _transmitted(robot: Robot, p: Array, s: Signals, compliance: Array | float = 0.0) -> Array:
    """Torque that gears transmit, shape (n, n_joints).

    Of a stroke motors' torques say it. From them goes the rotors' part, and friction: half of what
    torques beside calculated ones differ by between the two directions of an axis, less where it
    turns round. What moves in one direction alone keeps its friction: a constant twists no gear any
    faster. Where all axes move at once, noise of all rotors' accelerations would come together in
    each torque, that of positions in either side of the equation: there it is calculated, from the
    motion of the links as far as `compliance` says it.
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
    lags = [fit.layout.index(LAG, axis) for axis in range(robot.n_joints)]
    error = np.sqrt(np.diag(fit.covariance).clip(0.0))
    # standard error from which on a lag is taken as zero [s]
    identifiable = (error[lags] > 0) & (error[lags] < 0.0005)
    certain = fit.covariance[np.ix_(lags, lags)] * np.outer(identifiable, identifiable)
    effect = _effect(robot, regression)
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


def _effect(robot: Robot, regression: Regression) -> Array:
    """Change of the base parameters of the diagonal group by the lags, shape (n_base, n_joints).

    The others are held: measurements without acceleration identify them.
    """
    layout, kept = regression.layout, regression.kept
    shared = len(layout.shared)
    lags = np.array([layout.index(LAG, axis) for axis in range(robot.n_joints)])
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
    # a compliance over its standard error from which on a gear counts as soft
    soft = np.nan_to_num(found.compliance / error) > 2.0
    soft &= np.nan_to_num(found.compliance) * robot.torque_limit < MOST_TWIST
    return replace(found, compliance_error=error, soft=soft)
