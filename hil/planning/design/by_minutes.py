"""Design of a campaign of limited duration: the most informative measurements of all kinds.

The budget includes measurements, travels and warm-up. First each group of base parameters gets
`CORE` measurements of its own kind per parameter, so that the group can be identified by its own
kind, as in the two-step method, and any measurement can be left out. Then each axis gets the
measurements needed for its friction law. The rest of the time is filled with the largest increase
per second of log det of the information about all base parameters
(`hil.planning.design.selection`).

With trajectories the core is half as large. Trajectories usually get most of the time, since a
minute with all axes in motion gives more information than strokes of one axis. Strokes remain
necessary where friction, equal in both directions, must cancel.

A refinement starts with the information of an earlier run, and adds measurements for the imprecise
parameters, by the decrease of the variance of torques.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from itertools import count
from typing import TYPE_CHECKING

import numpy as np

from hil.planning.design.by_counts import greedy, places
from hil.planning.design.candidates import pool, trajectories, weigh
from hil.planning.design.selection import Selection
from hil.planning.design.tour import guarded_tour, nearest_first
from hil.planning.measurement import ELEMENT_KINDS, FOR_A_LAW, axes_lacking_law
from hil.planning.plan import Plan, make_plan
from hil.planning.timetable import timetable
from hil.planning.workspace import narrow_ranges

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.model.robot import Robot
    from hil.planning.design.candidates import Option
    from hil.planning.measurement import Measurement, ParameterMeasurement
    from hil.planning.prediction.noise import Noise
    from hil.planning.prediction.precision import Information
    from hil.planning.workspace import Workspace


CORE = 2
"""Measurements per parameter of a group, by the group's own kind."""
OF_TRAJECTORIES = "t"
"""First letter of trajectory ids."""
SAMPLE_PERIOD: float = Plan.model_fields["sample_period"].default
"""Default sample period of plans [s]."""
CORE_BESIDE_TRAJECTORIES = CORE // 2
"""Core measurements per parameter when trajectories are measured too."""


def design_within(
    robot: Robot,
    minutes: float,
    noise: Noise,
    warm_up: float = 0.0,
    workspace: Workspace | None = None,
    *,
    with_trajectories: bool = False,
) -> Plan:
    """Plan a campaign of at most `minutes`.

    Parameters
    ----------
    robot : Robot
    minutes : float
        Duration including travel and warm-up [min].
    noise : Noise
        Disturbances of the torques.
    warm_up : float
        Motion before the first measurement; 0 for none [s].
    workspace : Workspace, optional
        Workspace to keep clear, stored in the plan.
    with_trajectories : bool
        Choose among trajectories too, which need drives that follow streams of set-points.

    Raises
    ------
    ValueError
        Too little time to identify all parameters, or no clear configurations.
    """
    guarded = narrow_ranges(robot, workspace)
    options = pool(guarded, workspace, SAMPLE_PERIOD, noise)
    core = _core(guarded, options, CORE_BESIDE_TRAJECTORIES if with_trajectories else CORE)
    if with_trajectories:
        options += trajectories(guarded, workspace, SAMPLE_PERIOD, noise, minutes)
    selection = Selection(guarded, options)
    for number in core:
        selection.take(number)
    if not with_trajectories:  # each period of a trajectory moves all axes
        _reserve(robot, selection)
    budget, least = 60 * minutes - warm_up, len(selection.chosen)
    order = _fill(robot, selection, budget, least, workspace)
    return make_plan(robot, assign_ids(order, set()), warm_up, workspace)


def refine(
    robot: Robot,
    minutes: float,
    noise: Noise,
    known: Information,
    run: Plan,
    taken: set[str] | None = None,
) -> Plan:
    """Plan further measurements of at most `minutes`.

    Parameters
    ----------
    robot : Robot
    minutes : float
        Duration including travel [min].
    noise : Noise
        Disturbances of the torques, preferably estimated from the run.
    known : Information
        Information of the run's measurements.
    run : Plan
        Plan of the run, source of workspace and sampling.
    taken : set of str, optional
        Existing ids; those of the run by default.

    Raises
    ------
    ValueError
        The time is too short for any measurement.
    """
    guarded = narrow_ranges(robot, run.workspace)
    options = pool(guarded, run.workspace, run.sample_period, noise)
    worth = weigh(known.matrix, known.scatter)
    selection = Selection(guarded, options, "torque", worth)
    _reserve(robot, selection, run.measurements)
    least = max(1, len(selection.chosen))
    order = _fill(robot, selection, 60 * minutes, least, run.workspace)
    avoided = {m.id for m in run.measurements} if taken is None else taken
    plan = make_plan(robot, assign_ids(order, avoided), workspace=run.workspace)
    return plan.model_copy(update={"sample_period": run.sample_period})


def _core(robot: Robot, options: Sequence[Option], each: int) -> list[int]:
    """Choose options to identify every group by its own kind of measurement.

    Parameters
    ----------
    each : int
        Measurements for each parameter.
    """
    found: list[int] = []
    for group in dict.fromkeys(option.group for option in options):
        numbers = [k for k, option in enumerate(options) if option.group == group]
        rows = np.array([options[k].row for k in numbers])
        scale = np.sqrt(np.mean(rows**2, axis=0))
        q = np.array([options[k].measurement.q for k in numbers])
        covariance = 1e3 * np.eye(len(scale))
        wanted = each * rows.shape[1]
        # strokes of another axis at the same configuration are independent: no spacing needed
        moved = [options[k].measurement.moved for k in numbers]
        apart = [sorted(set(moved)).index(axes) for axes in moved]
        spread = np.column_stack([places(robot, q), apart])
        picked = greedy(rows / scale, spread, covariance, wanted)
        found += [numbers[k] for k in dict.fromkeys(picked)]
    return found


def _reserve(robot: Robot, selection: Selection, before: Sequence[Measurement] = ()) -> None:
    """Choose the additional measurements needed for a friction law per axis."""
    chosen = [*before, *selection.measurements]
    for axis, there in axes_lacking_law(chosen, robot.n_joints).items():
        for _ in range(FOR_A_LAW - there):
            selection.take_best(axis)


def _fill(
    robot: Robot, selection: Selection, budget: float, least: int, workspace: Workspace | None
) -> list[ParameterMeasurement]:
    """Fill the `budget` [s] with measurements, and drop the last ones in excess."""
    # choose for 15 % more than the budget; the number that fits depends on the travels
    while selection.duration < 1.15 * budget or len(selection.chosen) < least:
        selection.take_best()
    chosen = selection.measurements
    fits = _count_fitting(robot, chosen, least, budget)
    if workspace is None:
        return _tour(robot, chosen[:fits])
    guarded = narrow_ranges(robot, workspace)
    while True:
        order = guarded_tour(guarded, workspace, _merge(chosen[:fits]))
        excess = total_duration(robot, order) - budget
        if excess <= 0 or fits <= least:
            return order
        fits = max(least, fits - max(1, round(fits * excess / budget)))


def _tour(robot: Robot, chosen: Sequence[ParameterMeasurement]) -> list[ParameterMeasurement]:
    """Merge and order the chosen measurements for an unguarded workspace."""
    return order_by_travel(robot, _merge(chosen))


def _merge(chosen: Sequence[ParameterMeasurement]) -> list[ParameterMeasurement]:
    """Merge the blocks of a trajectory into one measurement, in place of the first block."""
    periods = Counter[str]()
    for each in chosen:
        periods[each.id] += each.cycles
    streamed = {each.id: each for each in reversed(chosen) if each.streamed}
    found: list[ParameterMeasurement] = []
    for each in chosen:
        if not each.streamed:
            found.append(each)
        elif first := streamed.pop(each.id, None):
            found.append(first.model_copy(update={"cycles": periods[each.id]}))
    return found


def _count_fitting(
    robot: Robot, chosen: Sequence[ParameterMeasurement], least: int, budget: float
) -> int:
    """Return the number of leading measurements of `chosen` that fit into `budget` [s].

    Raises
    ------
    ValueError
        Fewer than `least` measurements fit.
    """
    needed = total_duration(robot, _tour(robot, chosen[:least]))
    if needed > budget:
        raise ValueError(
            f"{budget / 60:.3g} minutes for measurements must be at least {needed / 60:.3g}, for "
            f"{least} measurements and the travel between; give more --minutes"
        )
    fits, exceeds = least, len(chosen) + 1
    while exceeds - fits > 1:
        middle = (fits + exceeds) // 2
        if total_duration(robot, _tour(robot, chosen[:middle])) > budget:
            exceeds = middle
        else:
            fits = middle
    return fits


def order_by_travel(
    robot: Robot, measurements: Sequence[ParameterMeasurement]
) -> list[ParameterMeasurement]:
    """Order measurements by nearest neighbour in travel time, starting near zero joint angles."""
    starts = np.array([measurement.start for measurement in measurements])
    order = nearest_first(robot, np.zeros(robot.n_joints), starts)
    return [measurements[number] for number in order]


def total_duration(robot: Robot, measurements: Sequence[Measurement]) -> float:
    """Compute the duration of measurements in this order, travels included [s]."""
    plan = make_plan(robot, measurements[:1])
    return sum(each.travel + each.duration for each in timetable(plan, robot, measurements))


def assign_ids(
    measurements: Sequence[ParameterMeasurement], taken: set[str]
) -> list[ParameterMeasurement]:
    """Assign ids in order, kind by kind, skipping `taken` ids."""
    letters = {kind: row.letter for kind, row in ELEMENT_KINDS.items()}
    numbers: dict[str, Iterator[int]] = defaultdict(lambda: count(1))
    named = []
    for measurement in measurements:
        letter = letters.get(measurement.kind, OF_TRAJECTORIES)
        number = numbers[letter]
        name = next(name for k in number if (name := f"{letter}{k:02d}") not in taken)
        named.append(measurement.model_copy(update={"id": name}))
    return named
