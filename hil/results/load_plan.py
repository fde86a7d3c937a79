"""The two stages of measuring a load: slow strokes first, then as fast as the load allows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import InvalidValue, NotEnoughData
from hil.estimation.payload_figures import FIRST_MOMENTS, INERTIAS, MASS
from hil.least_squares.terms import n_unknowns
from hil.model.dynamics import inverse_dynamics
from hil.model.motors import motor_torque
from hil.model.robot_file import LINK_PARAMETERS
from hil.planning.clearance import are_clear
from hil.planning.design.candidates import judged, pool, weighed
from hil.planning.design.load import (
    HOLD,
    choose,
    embedded,
    embedding,
    is_slow,
    of_load,
    within_torque,
)
from hil.planning.measurement import shows_parameters
from hil.planning.path_clearance import JointBoxes
from hil.planning.prediction.predicted_samples import forecast
from hil.planning.strokes import Strokes
from hil.planning.timetable import timetable
from hil.planning.workspace import narrowed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.payload_figures import Payload
    from hil.model.robot import Robot
    from hil.planning.design.candidates import Option
    from hil.planning.measurement import ParameterMeasurement
    from hil.planning.plan import Plan
    from hil.planning.workspace import Workspace
    from hil.results.bare_run import BareRun

    Array = NDArray[np.float64]
    Poses = tuple[tuple[int, float], ...]

SLOW_SHARE = 0.4
"""Of the time, for slow strokes."""
IN_TIME = 0.9
"""Share of what is left of the time that the fast stage plans with: drives take a little longer for
many short strokes than their profiles do."""
REACH = 0.2
"""Radius of gyration that a load may have, and distance of its centre from the last frame, as long
as they are unknown [m]."""
SURE = 3.0
"""Standard errors that an estimate may be off."""
_EACH = 24
"""Configurations of every element that are chosen from."""
_LEAST = 1e-6
"""Information that counts as nothing, as share of a mean option's."""
_PERIOD = 0.02
"""Of instants at which torques are looked at [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class LoadPlan:
    """One stage.

    Attributes
    ----------
    plan : Plan
    deviation : ndarray, shape (n_free,)
        Predicted standard deviations of the load's free parameters, after it.
    """

    plan: Plan
    deviation: Array


def slow_plan(
    bare: BareRun, minutes: float, heaviest: float | None = None, poses: Poses = ()
) -> LoadPlan:
    """Choose strokes at constant velocity, a tenth of the limits.

    Parameters
    ----------
    minutes : float
        Of both stages, ways included.
    heaviest : float, optional
        Mass that the load has at most [kg].
    poses : tuple of (int, float)
        Axes, indices from 0, that are held where stated [rad or m].

    Raises
    ------
    InvalidValue
        Too little time, a pose out of an axis's range, or no stroke in which all axes hold
        `heaviest`.
    """
    loads = [np.zeros(10), *([] if heaviest is None else _points(bare, heaviest))]
    options = [each for each in _options(bare, poses) if is_slow(each.measurement)]
    fitting = _fitting(bare, options, loads)
    if not fitting:
        load = "" if heaviest is None else f"a load of {heaviest:g} kg, its centre up to {REACH:g}"
        raise InvalidValue(
            f"{load and load + ' m from the last frame, overloads an axis: '}every slow stroke"
            f" calls for more than {HOLD:.0%} of a torque limit; mount a lighter load, or correct"
            " torque_limit in the robot file"
        )
    return _chosen(bare, fitting, without_load(bare, fitting), 60 * SLOW_SHARE * minutes)


def fast_plan(
    bare: BareRun, minutes: float, slow: Plan, found: Payload, poses: Poses = ()
) -> LoadPlan:
    """Choose what is still missing, as fast as the axes can move the load found.

    Raises
    ------
    NotEnoughData
        A mass that the slow stage leaves open, or no measurement in which all axes can move it.
    InvalidValue
        Too little time.
    """
    if LINK_PARAMETERS[MASS] in found.unidentifiable:
        raise NotEnoughData(
            f"{bare.robot.name}: the slow strokes leave the mass of the load open, so that nothing"
            " says how fast it may be moved; measure again with more --minutes, or without --pose"
        )
    options = _options(bare, poses)
    fitting = _fitting(bare, options, _possible(found))
    if not fitting:
        raise NotEnoughData(
            f"{bare.robot.name}: with {found.phi[MASS]:.3g} kg no measurement stays within"
            f" {HOLD:.0%} of the torque limits, however slow: this load overloads an axis; mount a"
            " lighter one"
        )
    known = without_load(bare, fitting)
    E = embedding(bare.robot, bare.shown)
    noise = bare.levels.noise
    for measurement in slow.measurements:
        if shows_parameters(measurement):
            worth = judged(bare.robot, measurement, slow.sample_period, noise)
            known = known + embedded(worth, E)
    spent = sum(each.travel + each.duration for each in timetable(slow, bare.robot,
                                                                  slow.measurements))  # fmt: skip
    return _chosen(bare, fitting, known, IN_TIME * (60 * minutes - spent))


def holds(bare: BareRun, plan: Plan) -> float:
    """Mass that all axes hold in a plan, its centre up to `REACH` from the last frame [kg]."""
    robot, friction, found = bare.robot, bare.friction(), np.inf
    p, loads = bare.estimate.p, _points(bare, 1.0)
    for measurement in filter(shows_parameters, plan.measurements):
        planned = forecast(measurement, _PERIOD)
        motion = planned.q, planned.qd, planned.qdd
        tau = inverse_dynamics(robot, p, *motion) + motor_torque(robot, *motion)
        left = HOLD * robot.torque_limit - friction - np.abs(tau)
        for phi in loads:
            of_one = np.abs(inverse_dynamics(robot, bare.columns @ phi, *motion))
            found = min(found, float((left / np.maximum(of_one, 1e-9)).min()))
    return max(found, 0.0)


def allowed(
    bare: BareRun, found: Payload | None = None, options: Sequence[Option] | None = None
) -> list[Option]:
    """Measurements that could be made, with a load in which all axes can move it."""
    options = _options(bare) if options is None else list(options)
    return options if found is None else _fitting(bare, options, _possible(found))


def at_position(
    measurement: ParameterMeasurement, axis: int, position: float
) -> ParameterMeasurement:
    """Return strokes with an axis held elsewhere; what moves all axes stays as it is."""
    if not isinstance(measurement, Strokes):
        return measurement
    q = list(measurement.q)
    q[axis] = position
    return measurement.model_copy(update={"q": tuple(q)})


@lru_cache(maxsize=4)
def _options(bare: BareRun, poses: Poses = ()) -> list[Option]:
    """All that both stages choose from."""
    if poses:
        return _held(bare, _options(bare, poses[:-1]), *poses[-1])
    plan, levels = bare.run.planned, bare.levels
    guarded = narrowed(bare.robot, plan.workspace)
    return pool(guarded, plan.workspace, plan.sample_period, levels.noise, _EACH)


def _held(bare: BareRun, options: Sequence[Option], axis: int, position: float) -> list[Option]:
    """Options that do not move an axis, with it held at a position, clear of all boxes."""
    robot, plan = narrowed(bare.robot, bare.run.planned.workspace), bare.run.planned
    low, high = robot.q_min[axis], robot.q_max[axis]
    if not low <= position <= high:
        raise InvalidValue(
            f"axis {axis + 1} at {position:.4g} must be within {low:.4g} ... {high:.4g}"
            f" {'rad' if robot.revolute[axis] else 'm'}, its range; correct --pose"
        )
    found = []
    for option in (each for each in options if axis not in each.measurement.moved):
        held = at_position(option.measurement, axis, position)
        if plan.workspace is None or _is_clear(robot, plan.workspace, held):
            worth = judged(robot, held, plan.sample_period, bare.levels.noise)
            found.append(replace(option, measurement=held, worth=worth))
    if not found:
        raise InvalidValue(
            f"no measurement with axis {axis + 1} at {position:.4g} keeps clear of the workspace's"
            " boxes; take another --pose"
        )
    return found


def _is_clear(robot: Robot, workspace: Workspace, measurement: ParameterMeasurement) -> bool:
    q = forecast(measurement, _PERIOD).q
    return bool(are_clear(robot, workspace, JointBoxes(q[:-1], q[1:])).all())


def _fitting(bare: BareRun, options: Sequence[Option], loads: Sequence[Array]) -> list[Option]:
    """Options in which all axes hold all `loads`; judged anew where they had to be slower."""
    with_loads = [bare.estimate.p + bare.columns @ phi for phi in loads]
    return within_torque(
        bare.robot, options, with_loads, bare.friction(),
        bare.run.planned.sample_period, bare.levels.noise,
    )  # fmt: skip


def _chosen(bare: BareRun, options: Sequence[Option], known: Array, seconds: float) -> LoadPlan:
    n = n_unknowns(bare.robot)
    E, load = embedding(bare.robot, bare.shown), slice(n, n + bare.shown.shape[1])
    guard = bare.run.planned.workspace
    try:
        plan, information = choose(bare.robot, options, E, known, load, seconds, guard)
    except ValueError as error:
        raise InvalidValue(str(error)) from error
    plan = plan.model_copy(update={"sample_period": bare.run.planned.sample_period})
    deviation = np.sqrt(np.diag(np.linalg.inv(of_load(information, load))))
    return LoadPlan(plan, deviation)


def without_load(bare: BareRun, options: Sequence[Option]) -> Array:
    """Information about all unknowns by the run without the load; nearly none about a load."""
    E, n = embedding(bare.robot, bare.shown), n_unknowns(bare.robot)
    mean = np.mean([np.diag(embedded(option.worth, E)) for option in options], axis=0)
    known = np.diag(np.where(mean > 0, _LEAST * mean, 1.0))
    known[:n, :n] += weighed(bare.levels.known.matrix, bare.levels.known.scatter)
    return known


def _points(bare: BareRun, mass: float) -> list[Array]:
    """Loads of this mass with their centre in the last frame and `REACH` off it, each way."""
    shown = np.abs(bare.free).max(axis=1) > 0
    loads = [_body(mass, np.zeros(3), shown)]
    for k, at in enumerate(FIRST_MOMENTS):
        if shown[at]:
            loads += [_body(mass, sign * REACH * np.eye(3)[k], shown) for sign in (1, -1)]
    return loads


def _possible(found: Payload) -> list[Array]:
    """The load found, and the largest that it may be: heavier, and of `REACH` about its centre."""
    shown = np.abs(found.phi) + np.diag(found.phi_covariance) > 0
    shown[list(INERTIAS)] = True
    error = float(np.sqrt(found.phi_covariance[MASS, MASS]))
    most = max(found.phi[MASS] + SURE * error, 0.1)
    centre = found.phi[list(FIRST_MOMENTS)] / max(found.phi[MASS], most / 2)
    return [_body(mass, centre, shown) for mass in (max(found.phi[MASS], 0.0), most)]


def _body(mass: float, centre: Array, shown: NDArray[np.bool_]) -> Array:
    """Standard parameters of a load with radius of gyration `REACH`, shape (10,)."""
    phi = np.zeros(10)
    phi[MASS], phi[list(FIRST_MOMENTS)] = mass, mass * centre
    about = mass * (float(centre @ centre) * np.eye(3) - np.outer(centre, centre))
    about += mass * REACH**2 * np.eye(3)
    phi[list(INERTIAS)] = about[np.triu_indices(3)]
    return np.where(shown, phi, 0.0)
