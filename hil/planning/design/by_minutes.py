"""Design of a campaign of limited duration: the most informative measurements of all kinds.

The budget includes measurements, travels and warm-up. First each group of base parameters gets
`CORE` measurements of its own kind per parameter, so that the group can be identified by its own
kind, as in the two-step method, and any measurement can be left out. Then each axis gets the
measurements needed for its friction law. The rest of the time is filled with the largest increase
per second of log det of the information about all base parameters (`Selection`).

With trajectories the core is half as large. Trajectories usually get most of the time, since a
minute with all axes in motion gives more information than strokes of one axis. Strokes remain
necessary where friction, equal in both directions, must cancel.

A refinement starts with the information of an earlier run, and adds measurements for the imprecise
parameters, by the decrease of the variance of torques.

With the information N of the measurements chosen so far, over base parameters p and common terms b,
adding a measurement with information I changes

det
    log det of the information of p, b eliminated: log det(N) - log det(N_bb). Its growth is a ratio
    of two small determinants, since a measurement touches one or two axes (Fedorov, *Theory of
    Optimal Experiments*, 1972);
torque
    the variance of torques, sum of (scale sd)^2 over the parameters: imprecise parameters with a
    large torque count most.

Both criteria are divided by the duration of the measurement and of the travel from the nearest
chosen one, since a tour of many measurements goes from neighbour to neighbour.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from itertools import count
from typing import TYPE_CHECKING, Literal

import numpy as np

from hil.friction.equation import n_unknowns
from hil.least_squares.solving import solved
from hil.model.base_parameters import base_parameters
from hil.planning.design.by_counts import TRAVEL, greedy, guarded_tour, nearest_first, places
from hil.planning.design.candidates import pool, trajectories, weigh
from hil.planning.measurement import ELEMENT_KINDS, FOR_A_LAW, axes_lacking_law
from hil.planning.plan import Plan, make_plan
from hil.planning.prediction.information import torque_scale
from hil.planning.timetable import SETTLING, timetable, travel_times
from hil.planning.workspace import narrow_ranges

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Indices
    from hil.model.robot import Robot
    from hil.planning.design.candidates import Option
    from hil.planning.measurement import Measurement, ParameterMeasurement
    from hil.planning.prediction.information import Information
    from hil.planning.prediction.noise import Noise
    from hil.planning.workspace import Workspace


SelectionCriterion = Literal["det", "torque"]


class Selection:
    """Chosen options, and the gains of the remaining options.

    Parameters
    ----------
    criterion : {"det", "torque"}
    known : ndarray, shape (n, n), optional
        Information of earlier measurements.
    """

    def __init__(
        self,
        robot: Robot,
        options: Sequence[Option],
        criterion: SelectionCriterion = "det",
        known: Array | None = None,
    ) -> None:
        self._robot, self._criterion = robot, criterion
        self._n_base = len(base_parameters(robot))
        self._scale = torque_scale(robot)
        self._starts = np.array([option.measurement.start for option in options])
        self._durations = np.array([option.measurement.duration for option in options])
        joints = range(robot.n_joints)
        self._moves = np.array([[j in each.measurement.moved for j in joints] for each in options])
        self._blocks = _blocks(options)
        # a prior small enough to be negligible, large enough for finite determinants
        diagonal = np.zeros(n_unknowns(robot))
        for option in options:
            for at, worth in option.worth:
                diagonal[at] += np.diag(worth) / len(options)
        # negligible information: a millionth of the mean option's
        self._information = np.diag(np.where(diagonal > 0, 1e-6 * diagonal, 1.0))
        if known is not None:
            self._information += known
        self._options = options
        self._worth = [option.worth for option in options]
        self._free = np.ones(len(options), dtype=bool)
        self._way = np.full(len(options), np.inf)
        self.chosen: list[int] = []
        self.duration = 0.0
        """Estimated duration of the chosen options, travels included [s]."""

    @property
    def measurements(self) -> list[ParameterMeasurement]:
        """Chosen measurements, in the order of choice."""
        return [self._options[number].measurement for number in self.chosen]

    def take(self, number: int) -> None:
        """Choose option `number`."""
        self.duration += float(self._costs()[number])
        for at, worth in self._worth[number]:
            self._information[np.ix_(at, at)] += worth
        way = travel_times(self._robot, self._starts[number], self._starts, TRAVEL)
        self._way = np.minimum(self._way, way)
        self._free[number] = False
        if not self._free.any():
            self._free[:] = True
        self.chosen.append(number)

    def take_best(self, axis: int | None = None) -> None:
        """Choose the option with the largest gain per second, among those moving `axis` if given.

        If no option moves `axis`, nothing is chosen.
        """
        wanted = self._free if axis is None else self._moves[:, axis] & self._free
        if axis is not None and not wanted.any():
            wanted = self._moves[:, axis]
        if wanted.any():
            rate = self.gains() / self._costs()
            self.take(int(np.argmax(np.where(wanted, rate, -np.inf))))

    def gains(self) -> Array:
        """Compute the gain of every option in the criterion, shape (n_options,)."""
        inverse = solved(self._information, np.eye(len(self._information)))
        nuisance = self._information[self._n_base :, self._n_base :]
        common = solved(nuisance, np.eye(len(nuisance)))
        found = np.empty(len(self._worth))
        for at, numbers, worth in self._blocks:
            if self._criterion == "det":
                # growth of log det
                unit = np.eye(len(at))
                inner = at >= self._n_base
                own = at[inner] - self._n_base
                _, whole = np.linalg.slogdet(unit + worth @ inverse[np.ix_(at, at)])
                nuisance = worth[:, inner][:, :, inner] @ common[np.ix_(own, own)]
                _, part = np.linalg.slogdet(np.eye(len(own)) + nuisance)
                found[numbers] = whole - part
            else:
                # relative decrease in the variance of torques
                rows = self._scale[:, np.newaxis] * inverse[: self._n_base, at]
                inside = np.linalg.solve(np.eye(len(at)) + worth @ inverse[np.ix_(at, at)], worth)
                fall: Array = np.einsum("ki,nij,kj->n", rows, inside, rows, optimize=True)
                variance = self._scale**2 @ np.diag(inverse)[: self._n_base]
                found[numbers] = fall / variance
        return found

    def _costs(self) -> Array:
        way = np.where(np.isfinite(self._way), self._way, 0.0)
        return self._durations + way + SETTLING


def _blocks(options: Sequence[Option]) -> list[tuple[Indices, Indices, Array]]:
    """Group options by unknowns: unknowns, option numbers, information."""
    touched: dict[tuple[int, ...], list[int]] = {}
    for number, option in enumerate(options):
        unknowns = sorted({int(k) for its, _ in option.worth for k in its})
        touched.setdefault(tuple(unknowns), []).append(number)
    found = []
    for key, numbers in touched.items():
        at: Indices = np.array(key, dtype=np.intp)
        worth: Array = np.zeros((len(numbers), len(at), len(at)))
        for row, number in enumerate(numbers):
            for its, matrix in options[number].worth:
                inside = np.searchsorted(at, its)
                worth[row][np.ix_(inside, inside)] += matrix
        found.append((at, np.array(numbers, dtype=np.intp), worth))
    return found


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
    if not with_trajectories:  # each period of a trajectory moves all axes of a branch
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
    """Choose `each` options per parameter to identify each group by its own kind of measurement."""
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
    # the number of leading measurements within budget [s]; refuse fewer than least
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
