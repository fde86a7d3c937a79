"""Foreseen exclusion limits of a plan, from its motion with expected torques and noise.

The tests of causes need rows and their scatter. Both come from expected recordings: axes that
follow their profiles exactly, positions in the encoders' increments, and the torque of expected
base parameters. The noise is that of every prediction of this plan
(`hil.planning.prediction.noise`): white noise and a wandering level of friction. Expected
recordings pass through the same estimator and the same battery as measured ones, so sizes stated
before and after a run mean the same. The level of friction makes no difference: any law of speed is
projected out of each measurement.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotIdentifiable
from hil.estimation.condensed import groups, rows_used, stack
from hil.estimation.excluded.battery import Battery
from hil.estimation.excluded.columns import columns
from hil.estimation.excluded.evidence import rows_of, step_of
from hil.estimation.excluded.limits import limits
from hil.estimation.excluded.result import Excluded
from hil.estimation.signals import signals
from hil.model.dynamics import inverse_dynamics
from hil.model.motors import motor_torque
from hil.planning.measurement import shows_parameters
from hil.planning.prediction.information import forecast
from hil.planning.timetable import timetable
from hil.runs.recording import IDLE, Recording

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from hil.arrays import Array
    from hil.estimation.excluded.evidence import Evidence
    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMeasurement, ParameterMotion
    from hil.planning.plan import Plan
    from hil.planning.prediction.noise import Noise


def foreseen(plan: Plan, robot: Robot, noise: Noise, p: Array, seed: int = 0) -> Excluded | None:
    """Return the exclusion limits of a plan; None if the plan identifies nothing.

    Parameters
    ----------
    noise : Noise
        Expected noise of torques.
    p : ndarray, shape (n_base,)
        Expected base parameters.
    seed : int
        Seed of the noise.
    """
    found = foreseen_tests(plan, robot, noise, p, seed)
    if found is None:
        return None
    battery, tests = found
    return Excluded(found=(), limits=limits(robot, battery, battery.columns, tests), tests=tests)


def foreseen_tests(
    plan: Plan, robot: Robot, noise: Noise, p: Array, seed: int = 0
) -> tuple[Battery, int] | None:
    """Return tests of a plan's expected recordings, and the number of visible causes."""
    try:
        evidence = expected_evidence(robot, _expected(plan, robot, noise, p, seed))
    except NotIdentifiable:
        return None
    every = columns(robot, p, evidence)
    battery = Battery(evidence, every, every.fitted)
    return battery, sum(bool(battery.visible[at].any()) for at in every.tests.values())


def _expected(
    plan: Plan, robot: Robot, noise: Noise, p: Array, seed: int
) -> Iterator[tuple[ParameterMeasurement, Signals]]:
    """Yield the expected signals of a plan, measurement by measurement."""
    rng, time = np.random.default_rng(seed), 0.0
    for entry in timetable(plan, robot, plan.measurements):
        time += entry.travel
        if shows_parameters(entry.measurement):
            made = recorded(robot, entry.measurement, plan.sample_period, noise, p, rng, time)
            yield entry.measurement, signals(made)
        time += entry.duration


def expected_evidence(
    robot: Robot, prepared: Iterable[tuple[ParameterMotion, Signals]]
) -> Evidence:
    """Return rows of expected recordings, without friction of the load.

    Only real recordings show whether a load has friction.

    Raises
    ------
    NotIdentifiable
        No expected recording has any visible parameter.
    """
    kept, n_rows, stacked = list(prepared), [0] * robot.n_joints, []
    for motion, s in kept:
        for axis in motion.moved:
            used = s.usable(robot, axis)
            n_rows[axis] += sum(len(rows_used(used & each, s.period)) for each in groups(s))
    thin = [step_of(n) for n in n_rows]
    for motion, s in kept:
        stacked += [(s, axes) for axes in stack(robot, motion, s, thin)]
        s.kept.clear()  # frees the cache of all samples, since the rows use few of them
    if not stacked:
        raise NotIdentifiable(
            "no measurement is long enough to identify parameters; plan longer strokes"
        )
    return rows_of(robot, stacked, np.zeros(robot.n_joints, dtype=bool))


def recorded(
    robot: Robot,
    measurement: ParameterMeasurement,
    period: float,
    noise: Noise,
    p: Array,
    rng: np.random.Generator,
    begin: float,
) -> Recording:
    """Return the expected recording of one measurement."""
    group = None
    if measurement.streamed:
        # a single period, which need not be a whole number of samples
        instants = np.arange(0.0, measurement.cycles * measurement.period, period)
        q, qd, qdd = measurement.motion(instants)
        group = (instants // measurement.period).astype(np.int16)
    else:
        planned = forecast(measurement, period)
        q, qd, qdd = planned.q, planned.qd, planned.qdd
    walk = np.sqrt(noise.walk * period) * np.cumsum(rng.standard_normal(q.shape), axis=0)
    tau = inverse_dynamics(robot, p, q, qd, qdd) + motor_torque(robot, q, qd, qdd)
    tau = tau + np.sign(qd) * walk + noise.torque * rng.standard_normal(q.shape)
    if noise.rounding is not None:
        step = np.maximum(np.sqrt(12.0) * noise.rounding, np.finfo(float).eps)
        q = step * np.rint(q / step)
    idle = np.full(len(q), IDLE, np.int16)
    time: Array = begin + period * np.arange(len(q), dtype=np.float64)
    return Recording(time, q, tau, np.zeros(q.shape, np.uint8), idle, idle, group=group)
