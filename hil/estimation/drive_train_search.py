"""Lags and compliances, found from the measurements in which axes accelerate.

Measurements of inertia and trajectories are used: where the axis that is read does not accelerate
neither shows. Both show most at the corners of the trapezoids, which the estimate itself leaves
out, because there it would have to know them. What gears transmit comes from a first solution that
takes them for rigid (`hil.estimation.drive_train_likelihood` finds both).

A torque that is sampled every T shows a corner of the motion where the next sample is. As long as
corners fall anywhere between samples, as `hil plan` arranges it, that is noise. What remains of it
looks like a compliance: a variance T^2/12 of the instant smooths the torque by T^2/24 times its
second derivative. A compliance must be well above what amounts to the same.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.condensed import groups, stack_axis
from hil.estimation.drive_train import directly_driven
from hil.estimation.drive_train_likelihood import EARLIEST, LATEST, STEP, Likelihood
from hil.estimation.signals import derivatives, interpolation
from hil.least_squares.window import half_window, widened
from hil.model.dynamics import inverse_dynamics, mass_matrix, regressor
from hil.model.motors import motor_inertia, motor_torque
from hil.planning.measurement import shows_element

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from hil.arrays import Array
    from hil.estimation.condensed import Condensed, Stacked
    from hil.estimation.drive_train import DriveTrain
    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMotion

    Prepared = Sequence[tuple[ParameterMotion, Signals]]

SOFT = 2.0
"""A compliance over its standard error from which on a gear counts as soft."""
MOST_TWIST = 0.05
"""At the torque limit [rad]: more is no gear, but what few measurements make of their noise."""
PASSES = 2
"""How often everything is smoothed: K holds the fourth derivative of positions, whose noise the
motor's part shares."""


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
    p = Likelihood(robot, items, shifts, period).drive_train().p
    items = [item for s, own in stacks if own for item in _with_springs(robot, s, own, p, loaded)]
    joints = np.arange(robot.n_joints)
    found = Likelihood(robot, items, shifts, period, joints).drive_train()
    found = _judged(robot, found, accelerated, period)
    # columns that nothing calls for make lags uncertain: gears that are not soft lose theirs
    rigid = 1 + len(shifts) + len(p) + np.flatnonzero(~found.soft)
    items = [item.without(rigid) for item in items]
    last = Likelihood(robot, items, shifts, period, np.flatnonzero(found.soft)).drive_train()
    return replace(
        found, lag=last.lag, lag_error=last.lag_error, covariance=last.covariance, p=last.p
    )


def _shows_lag(measurement: ParameterMotion) -> bool:
    """Whether the axis whose torque is read accelerates."""
    if shows_element(measurement):
        return bool(measurement.unit_acceleration[measurement.index])
    return True


def _stacked(
    robot: Robot, m: ParameterMotion, s: Signals, shifts: NDArray[np.intp]
) -> Iterator[Stacked]:
    """Torques at whole shifts and the motor's part, beside all columns: of every axis read."""
    reach = int(np.abs(shifts).max()) + (PASSES - 1) * half_window(s.period)
    motors, periods = motor_torque(robot, s.q, s.qd, s.qdd), list(groups(s))
    for axis in m.read:
        spoilt = ~s.moving(robot, axis)
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
    step = STEP * np.stack([load, *derivatives(load, s.period)])
    motion, joints = np.stack([s.q, s.qd, s.qdd]), np.arange(robot.n_joints)
    found = []
    for each in stacked:
        at = each.index
        moved = np.repeat(motion[:, np.newaxis, at], 1 + robot.n_joints, axis=1)
        moved[:, 1 + joints, :, joints] -= np.moveaxis(step[:, at], -1, 0)
        q, qd, qdd = moved
        torque = regressor(robot, q, qd, qdd, joints=[each.axis])[..., 0, :] @ p
        K = (torque[1:] - torque[0]).T
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
    soft &= np.nan_to_num(found.compliance) * robot.torque_limit < MOST_TWIST
    return replace(found, compliance_error=error, soft=soft)
