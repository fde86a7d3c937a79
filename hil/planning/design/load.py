"""Plan of a few minutes with a load: the most informative measurements in addition to a bare run.

Both runs share base parameters p, torque ripple and friction of the transmitted torque; the loaded
one has p + K phi and offsets of its own, since the asymmetry of friction changes from day to day.
The normal equations of one run over the unknowns x of `hil.friction.equation` become those of both
runs by

    x = E z,    z = (x of the run without, phi, offsets of the loaded run).

Measurements are chosen by the largest increase per second of log det of the information about phi,
all else eliminated, a criterion independent of the scales of mass and inertia. Slow strokes come
first. From these the load is estimated, and the next strokes are as fast as the axes can move it.
Torques of a measurement are computed for the possible loads; accelerations beyond the torque limits
are reduced.

For an imprecise parameter of the load, `helpful_poses` finds the axis position that best determines
it. From all measurements feasible with the load, the one with the largest decrease of the
parameter's predicted standard deviation is taken. Then the position of each axis at rest in this
measurement is varied. The result is the axis with the largest effect, at its best position.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from hil.errors import InvalidValue, NotEnoughData
from hil.friction.equation import N_COMMON, n_unknowns
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import inverse_dynamics
from hil.model.load import FIRST_MOMENTS, INERTIAS, MASS, LoadColumns, load_columns
from hil.model.motors import motor_torque
from hil.model.robot_file import LINK_PARAMETERS
from hil.planning.design.by_counts import TRAVEL, guarded_tour
from hil.planning.design.by_minutes import assign_ids, order_by_travel, total_duration
from hil.planning.design.candidates import judge, keeps_clear, pool
from hil.planning.measurement import shows_parameters
from hil.planning.plan import make_plan
from hil.planning.plan_values import replace_values
from hil.planning.prediction.information import forecast
from hil.planning.strokes import Strokes
from hil.planning.timetable import SETTLING, timetable, travel_times
from hil.planning.workspace import narrow_ranges

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from hil.arrays import Array, Indices, Mask
    from hil.model.robot import Robot
    from hil.planning.design.candidates import Option
    from hil.planning.measurement import ParameterMeasurement
    from hil.planning.plan import Plan
    from hil.planning.prediction.noise import Noise

    Poses = tuple[tuple[int, float], ...]
    Worth = tuple[tuple[Indices, Array], ...]
    from hil.arrays import Array


STEP = math.radians(15)
"""Step between positions of a revolute axis."""


class Pose(NamedTuple):
    """Pose for another measurement of the load.

    Attributes
    ----------
    axis : int
        Axis to be held, from 1; if no position matters, the moving axis.
    position : float or None
        Position of the held axis [rad or m]; None if no position matters.
    share : float
        Predicted standard deviation after another measurement, relative to the present one.
    """

    axis: int
    position: float | None
    share: float


def helpful_poses(
    bare: WithoutLoad, plans: Sequence[Plan], found: FoundLoad, names: Sequence[str]
) -> dict[str, Pose]:
    """Find the pose that best shows each load parameter in `names`.

    Parameters
    ----------
    plans : sequence of Plan
        Plans measured so far.
    names : sequence of str
        Names as in the robot file, without the link's number; names absent there are ignored.
    """
    free = bare.columns.free
    columns = {name: free[LINK_PARAMETERS.index(name)] for name in names}
    search = _Search(bare, plans, found)
    poses = {
        name: search.best_pose(int(np.argmax(np.abs(row))))
        for name, row in columns.items()
        if row.any()
    }
    return {name: pose for name, pose in poses.items() if pose is not None}


class _Search:
    def __init__(self, bare: WithoutLoad, plans: Sequence[Plan], found: FoundLoad) -> None:
        self.bare, self.found = bare, found
        self.options = feasible_options(bare)
        self.known = bare.before(self.options, plans)

    def deviation(self, k: int, more: Worth = ()) -> float:
        left = self.bare.load_information(self.known + self.bare.embed(more))
        return float(np.sqrt(np.linalg.inv(left)[k, k]))

    def best_pose(self, k: int) -> Pose | None:
        now = self.deviation(k)
        gains = [self.deviation(k, each.worth) for each in self.options]
        # torques are checked only for the 40 most promising measurements, for speed
        best = [self.options[at] for at in np.argsort(gains)[:40]]
        fitting = feasible_options(self.bare, self.found, best)
        if not fitting:
            return None
        measurement = fitting[0].measurement
        still = [a for a in range(self.bare.robot.n_joints) if a not in measurement.moved]
        # the standard deviation after the measurement, over the position of each axis at rest
        curves = []
        for a in still:
            low, high = self.bare.robot.q_min[a], self.bare.robot.q_max[a]
            stops: Array = STEP * np.arange(math.ceil(low / STEP), math.floor(high / STEP) + 1)
            if not self.bare.robot.revolute[a]:
                stops = np.linspace(low, high, 9)
            turned = (hold_axis(measurement, a, float(at)) for at in stops)
            deviations = [self.deviation(k, self.bare.judge(each)) for each in turned]
            curves.append((a, stops, np.array(deviations)))
        axis, places, sizes = max(curves, key=lambda each: float(each[2].max() / each[2].min()))
        # an axis's position matters if it changes the deviation by a fifth
        if sizes.max() < 1.2 * sizes.min():
            share = self.deviation(k, self.bare.judge(measurement)) / now
            return Pose(measurement.moved[0] + 1, None, share)
        return Pose(axis + 1, float(places[np.argmin(sizes)]), float(sizes.min() / now))


OFFSETS = 2
"""Number of common terms estimated separately per run and axis: a constant, and one with |qd|."""
HOLD = 0.9
"""Maximum share of an axis's torque limit in a measurement."""
SLOWER = (1.0, 0.7, 0.5, 0.35, 0.25)
"""Shares of a candidate's acceleration to try, in steps of about sqrt(2); velocity scales with the
square root of the share."""
SLOW_SHARE = 0.4
"""Share of the time for slow strokes."""
REACH = 0.2
"""Assumed radius of gyration and centre's distance from the last frame of an unknown load [m]."""
_INSTANT = 0.02
"""Interval between torque evaluations [s]."""


class FoundLoad(Protocol):
    """Current estimate of the load, such as `hil.estimation.loads.figures.Load`."""

    @property
    def phi(self) -> Array:
        """Standard parameters, shape (10,)."""

    @property
    def covariance(self) -> Array:
        """Covariance of the standard parameters, shape (10, 10)."""

    @property
    def unidentifiable(self) -> tuple[str, ...]:
        """Names of the unidentifiable parameters."""


@dataclass(frozen=True, eq=False)
class WithoutLoad:
    """Information from a run without load, for the design of a run with load.

    Attributes
    ----------
    plan : Plan
        Plan of the run: source of workspace and sample period.
    p : ndarray, shape (n_base,)
    friction : ndarray, shape (n_joints,)
        Highest friction of each axis [N m or N].
    information : ndarray, shape (n_unknowns, n_unknowns)
        Information on all unknowns, under `noise`.
    """

    robot: Robot
    plan: Plan
    p: Array
    friction: Array
    noise: Noise
    information: Array

    @cached_property
    def columns(self) -> LoadColumns:
        """Base-parameter columns changed by a load."""
        return load_columns(self.robot)

    @cached_property
    def load_slice(self) -> slice:
        """Slice of the load's free parameters in the unknowns z."""
        n = n_unknowns(self.robot)
        return slice(n, n + self.columns.free.shape[1])

    @cached_property
    def embedding(self) -> Array:
        """Embedding E, shape (n_unknowns, n_unknowns + n_free + OFFSETS n_joints)."""
        n, n_base = n_unknowns(self.robot), len(base_parameters(self.robot))
        offsets = OFFSETS * self.robot.n_joints
        E = np.hstack([np.eye(n, self.load_slice.stop), np.zeros((n, offsets))])
        E[:n_base, self.load_slice] = self.columns.shown
        for axis in range(self.robot.n_joints):
            for k in range(OFFSETS):
                own = n_base + axis * N_COMMON + k
                E[own, own], E[own, self.load_slice.stop + OFFSETS * axis + k] = 0.0, 1.0
        return E

    def judge(self, measurement: ParameterMeasurement) -> Worth:
        """Compute the information of a measurement (`Option.worth`)."""
        return judge(self.robot, measurement, self.plan.sample_period, self.noise)

    def embed(self, worth: Worth) -> Array:
        """Compute the information about z from a measurement with load, shape (n_z, n_z)."""
        total = np.zeros((self.embedding.shape[1],) * 2)
        for at, each in worth:
            total += self.embedding[at].T @ each @ self.embedding[at]
        return total

    def before(self, options: Sequence[Option], measured: Iterable[Plan] = ()) -> Array:
        """Compute the information about z from the unloaded run and from plans with load.

        Parameters
        ----------
        options : sequence of Option
            Candidates. The prior of the load is a negligible fraction of their mean information.
        """
        n = n_unknowns(self.robot)
        mean = np.mean([np.diag(self.embed(option.worth)) for option in options], axis=0)
        # negligible information: a millionth of the mean option's
        known = np.diag(np.where(mean > 0, 1e-6 * mean, 1.0))
        known[:n, :n] += self.information
        for measurement in (m for plan in measured for m in plan.measurements):
            if shows_parameters(measurement):
                known += self.embed(self.judge(measurement))
        return known

    def load_information(self, information: Array) -> Array:
        """Compute the information about phi, eliminating the remaining unknowns."""
        inside = np.zeros(len(information), dtype=bool)
        inside[self.load_slice] = True
        across = information[np.ix_(inside, ~inside)]
        others = information[np.ix_(~inside, ~inside)]
        own = information[np.ix_(inside, inside)]
        left: Array = own - across @ np.linalg.solve(others, across.T)
        return left

    def torque(self, measurement: ParameterMeasurement) -> tuple[tuple[Array, ...], Array]:
        """Return motion and unloaded torques of a measurement, shape (n, n_joints)."""
        planned = forecast(measurement, _INSTANT)
        motion = planned.q, planned.qd, planned.qdd
        tau = inverse_dynamics(self.robot, self.p, *motion) + motor_torque(self.robot, *motion)
        return motion, tau

    def strain(self, measurement: ParameterMeasurement, loads: Sequence[Array]) -> float:
        """Compute the largest torque of any axis under any of the loads, as share of the limit."""
        motion, tau = self.torque(measurement)
        of_loads = [
            inverse_dynamics(self.robot, self.columns.K @ phi, *motion) if phi.any() else 0.0
            for phi in loads
        ]
        shares = [(np.abs(tau + each) + self.friction) / self.robot.torque_limit
                  for each in of_loads]  # fmt: skip
        return float(np.max(shares))

    def bodies(self, mass: float) -> list[Array]:
        """Return loads centred at the last frame's origin, and `REACH` off along each axis."""
        shown = np.abs(self.columns.free).max(axis=1) > 0
        loads = [_body(mass, np.zeros(3), shown)]
        for k, at in enumerate(FIRST_MOMENTS):
            if shown[at]:
                loads += [_body(mass, sign * REACH * np.eye(3)[k], shown) for sign in (1, -1)]
        return loads


def slow_plan(
    bare: WithoutLoad, minutes: float, heaviest: float | None = None, poses: Poses = ()
) -> Plan:
    """Choose strokes at constant velocity, a tenth of the limits.

    Parameters
    ----------
    minutes : float
        Duration of both stages, travels included.
    heaviest : float, optional
        Upper bound of the load's mass [kg].
    poses : tuple of (int, float)
        Held axes, from 0, with their positions [rad or m].

    Raises
    ------
    InvalidValue
        Too little time, a pose outside an axis's range, or no stroke with `heaviest` within all
        torque limits.
    """
    loads = [np.zeros(10), *([] if heaviest is None else bare.bodies(heaviest))]
    options = [each for each in _options(bare, poses) if _is_slow(each.measurement)]
    fitting = _within_torque(bare, options, loads)
    if not fitting:
        load = (
            ""
            if heaviest is None
            else f"a load of {heaviest:g} kg, its centre of mass up to {REACH:g}"
        )
        raise InvalidValue(
            f"{load and load + ' m from the last frame, overloads an axis: '}every slow stroke "
            f"needs more than {HOLD:.0%} of a torque limit; mount a lighter load, or correct "
            "torque_limit in the robot file"
        )
    return _choose(bare, fitting, bare.before(fitting), 60 * SLOW_SHARE * minutes)


def fast_plan(
    bare: WithoutLoad, minutes: float, slow: Plan, found: FoundLoad, poses: Poses = ()
) -> Plan:
    """Choose the remaining measurements, as fast as the axes can move the estimated load.

    Raises
    ------
    NotEnoughData
        The slow stage did not determine the mass, or no measurement is within all torque limits.
    InvalidValue
        Too little time.
    """
    if LINK_PARAMETERS[MASS] in found.unidentifiable:
        raise NotEnoughData(
            f"{bare.robot.name}: the slow strokes do not identify the mass of the load, so its "
            "safe speed is unknown; measure again with more --minutes, or without --pose"
        )
    fitting = _within_torque(bare, _options(bare, poses), _possible(found))
    if not fitting:
        raise NotEnoughData(
            f"{bare.robot.name}: with {found.phi[MASS]:.3g} kg no measurement stays within"
            f" {HOLD:.0%} of the torque limits, however slow: this load overloads an axis; mount a"
            " lighter one"
        )
    entries = timetable(slow, bare.robot, slow.measurements)
    spent = sum(each.travel + each.duration for each in entries)
    # 0.9: for many short strokes, drives take longer than their profiles
    return _choose(bare, fitting, bare.before(fitting, [slow]), 0.9 * (60 * minutes - spent))


def load_capacity(bare: WithoutLoad, plan: Plan) -> float:
    """Compute the largest mass that the axes hold in a plan, `REACH` off the last frame [kg]."""
    found = np.inf
    for measurement in filter(shows_parameters, plan.measurements):
        motion, tau = bare.torque(measurement)
        left = HOLD * bare.robot.torque_limit - bare.friction - np.abs(tau)
        for phi in bare.bodies(1.0):
            of_one = np.abs(inverse_dynamics(bare.robot, bare.columns.K @ phi, *motion))
            found = min(found, float((left / np.maximum(of_one, 1e-9)).min()))
    return max(found, 0.0)


def feasible_options(
    bare: WithoutLoad, found: FoundLoad | None = None, options: Sequence[Option] | None = None
) -> list[Option]:
    """Return candidate measurements; with a load, only those within the torque limits."""
    options = _options(bare) if options is None else list(options)
    return options if found is None else _within_torque(bare, options, _possible(found))


def hold_axis(
    measurement: ParameterMeasurement, axis: int, position: float
) -> ParameterMeasurement:
    """Return strokes with an axis held at `position`; a trajectory is returned unchanged."""
    if not isinstance(measurement, Strokes):
        return measurement
    q = list(measurement.q)
    q[axis] = position
    return replace_values(measurement, q=tuple(q))


@lru_cache(maxsize=4)
def _options(bare: WithoutLoad, poses: Poses = ()) -> list[Option]:
    """Return the candidates for both stages, clear of all boxes, with axes held at `poses`."""
    plan, guarded = bare.plan, replace(bare, robot=narrow_ranges(bare.robot, bare.plan.workspace))
    if not poses:
        return pool(guarded.robot, plan.workspace, plan.sample_period, bare.noise, 24)
    axis, position = poses[-1]
    low, high = guarded.robot.q_min[axis], guarded.robot.q_max[axis]
    if not low <= position <= high:
        raise InvalidValue(
            f"axis {axis + 1} at {position:.4g} must be within {low:.4g} ... {high:.4g}"
            f" {'rad' if bare.robot.revolute[axis] else 'm'}, its range; correct --pose"
        )
    still = [
        option for option in _options(bare, poses[:-1]) if axis not in option.measurement.moved
    ]
    turned = [hold_axis(option.measurement, axis, position) for option in still]
    found = [
        replace(option, measurement=there, worth=guarded.judge(there))
        for option, there in zip(still, turned, strict=True)
        if keeps_clear(guarded.robot, plan.workspace, forecast(there, _INSTANT).q)
    ]
    if not found:
        raise InvalidValue(
            f"no measurement with axis {axis + 1} at {position:.4g} keeps clear of the workspace's"
            " boxes; take another --pose"
        )
    return found


def _possible(found: FoundLoad) -> list[Array]:
    """Return the estimated load, and the largest likely load: heavier, with radius `REACH`."""
    shown = np.abs(found.phi) + np.diag(found.covariance) > 0
    shown[list(INERTIAS)] = True
    error = float(np.sqrt(found.covariance[MASS, MASS]))
    # upper bound of the mass: three standard errors
    most = max(found.phi[MASS] + 3.0 * error, 0.1)
    centre = found.phi[list(FIRST_MOMENTS)] / max(found.phi[MASS], most / 2)
    return [_body(mass, centre, shown) for mass in (max(found.phi[MASS], 0.0), most)]


def _body(mass: float, centre: Array, shown: Mask) -> Array:
    """Return the standard parameters of a load with radius of gyration `REACH`, shape (10,)."""
    phi = np.zeros(10)
    phi[MASS], phi[list(FIRST_MOMENTS)] = mass, mass * centre
    about = mass * (float(centre @ centre) * np.eye(3) - np.outer(centre, centre))
    about += mass * REACH**2 * np.eye(3)
    phi[list(INERTIAS)] = about[np.triu_indices(3)]
    return np.where(shown, phi, 0.0)


def _within_torque(
    bare: WithoutLoad, options: Sequence[Option], loads: Sequence[Array]
) -> list[Option]:
    """Return options feasible with every load, slowed down where necessary."""
    found = []
    for option in options:
        for share in SLOWER[:1] if _is_slow(option.measurement) else SLOWER:
            slower = option.measurement
            if share != 1.0 and not slower.streamed:
                moved = slower.partners[0] if slower.partners else slower
                slow: dict[str, object] = {
                    "velocity": math.sqrt(share) * moved.velocity,
                    "acceleration": share * moved.acceleration,
                }
                if moved is not slower:
                    slow = {"partner": moved.model_dump() | slow}
                slower = replace_values(slower, **slow)
            if bare.strain(slower, loads) <= HOLD:
                worth = option.worth if share == 1.0 else bare.judge(slower)
                found.append(replace(option, measurement=slower, worth=worth))
                break
    return found


def _is_slow(measurement: ParameterMeasurement) -> bool:
    """Return True if torques are read only at constant velocity."""
    return not measurement.streamed and not any(measurement.unit_acceleration)


def _choose(bare: WithoutLoad, options: Sequence[Option], known: Array, seconds: float) -> Plan:
    """Choose measurements in turn within `seconds`, travels included; `known` has full rank."""
    robot, workspace = bare.robot, bare.plan.workspace
    worth = [bare.embed(option.worth) for option in options]
    starts = np.array([option.measurement.start for option in options])
    durations = np.array([option.measurement.duration for option in options]) + SETTLING
    free, chosen = np.ones(len(options), dtype=bool), list[int]()
    order: list[ParameterMeasurement] = []
    while free.any():
        now = _log_det(bare, known)
        gains = np.array([_log_det(bare, known + each) - now for each in worth])
        here = starts[chosen] if chosen else np.zeros((1, robot.n_joints))
        ways = np.min([travel_times(robot, each, starts, TRAVEL) for each in here], axis=0)
        best = int(np.argmax(np.where(free, gains / (durations + ways), -np.inf)))
        free[best] = False
        tried = [options[k].measurement for k in (*chosen, best)]
        tried = (
            guarded_tour(robot, workspace, tried) if workspace else order_by_travel(robot, tried)
        )
        if total_duration(robot, tried) > seconds:
            break
        chosen.append(best)
        order, known = tried, known + worth[best]
    if not order:
        raise InvalidValue(
            f"{seconds:.0f} s are too short for a measurement and the travel before; give more "
            "minutes"
        )
    plan = make_plan(robot, assign_ids(order, set()), 0.0, workspace)
    return plan.model_copy(update={"sample_period": bare.plan.sample_period})


def _log_det(bare: WithoutLoad, information: Array) -> float:
    return float(np.linalg.slogdet(bare.load_information(information))[1])
