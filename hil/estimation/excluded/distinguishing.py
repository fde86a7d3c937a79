r"""Additional measurements of a plan for visible and distinguishable causes.

A column has the information I adjusted for base parameters, and I' adjusted for all columns of
another named cause, too; the share s^2 = I' / I remains. A cause of size theta, with
z^2 = theta^2 I / phi, explains the sum of squares (z + e)^2 by its own column; the other cause
explains less, by z^2 s^2 + 2 z s e', with e and e' standard normal. The causes are distinguished if
this difference exceeds `finding.TOGETHER`. The probability of that is `limits.POWER` for the size

    theta = a sqrt(phi / I'),    a^2 - 2 a Phi^-1(.8) = 3.84,

if s^2 is at least twice the share that a correlation of `finding.SAME` leaves. For a smaller s^2
the necessary difference grows with the explained sum of squares, and no size is large enough.

Inner products of candidates add up (`hil.least_squares.blocks`). So the search adds candidates one
by one: in each step the candidate with the largest decrease, per time, of the logarithms of
detectable over wanted sizes. The wanted size of a cause is its usual size or, if there is none, a
size at which a found cause is also distinguished from the other named causes. Stated sizes come
from tests of the whole plan by the battery (`foreseen`); the search repeats until these tests
confirm the wanted sizes.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special

from hil.errors import NotIdentifiable, UnknownName
from hil.estimation.excluded.battery import LEVEL, NOTHING, SPAN
from hil.estimation.excluded.causes import CAUSES, FITTED, SHOWN_BY
from hil.estimation.excluded.columns import Column, columns
from hil.estimation.excluded.finding import SAME, TOGETHER
from hil.estimation.excluded.foreseen import expected_evidence, foreseen_tests, recorded
from hil.estimation.excluded.limits import (
    POWER,
    limit_of,
    noncentrality,
    smallest,
    torque_shares,
)
from hil.estimation.excluded.words import describe_cause, name_of
from hil.estimation.signals import signals
from hil.planning.design.by_counts import TRAVEL, guarded_tour
from hil.planning.design.by_minutes import assign_ids, order_by_travel, total_duration
from hil.planning.design.candidates import strokes
from hil.planning.measurement import shows_parameters
from hil.planning.timetable import SETTLING, travel_times
from hil.planning.workspace import narrow_ranges

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.estimation.excluded.battery import Battery
    from hil.estimation.excluded.causes import Key
    from hil.model.robot import Robot
    from hil.planning.measurement import ElementMeasurement, ParameterMeasurement
    from hil.planning.plan import Plan
    from hil.planning.prediction.noise import Noise

EACH = 12
"""Number of candidates per element: the test of a candidate takes some 50 ms, and with more
candidates the choice remains among the first ones, which cover all ranges.
"""
QUANTILE = float(special.ndtri(POWER))
LEAD = QUANTILE + float(np.sqrt(QUANTILE**2 + TOGETHER))
"""Factor a of the module's docstring."""
APART = 2.0 * (1.0 - SAME**2)
"""Minimum share of a cause's information beside another cause, for the two to be distinguished."""
ROUNDS = 6
"""Number of rounds: each adds an equal part of the time available and tests the whole plan."""
FEW = 20
"""Assumed degrees of freedom of the test of a cause that is not visible yet."""
ALL_AXES = Column("torques of all axes", -1)
RIDGE, TINY = 1e-9, 1e-12
"""Ridge on unit diagonals, which treats singular products as rounding errors, and minimum share."""
NEVER = "base parameters, friction or other causes explain its effect in any measurement"
BY_TIME = ("drift of torque constant", "slip")
"""Causes that depend on the time of a measurement, not on its configuration."""
PLANNED = tuple(
    name for name, each in CAUSES.items()
    if each.unit and name not in (*FITTED, *BY_TIME, "torque at its limit", "sampling rate")
)  # fmt: skip
"""Causes for which measurements are chosen."""


class Reached(NamedTuple):
    """Visibility of a named cause, or of a single column of the cause, in a plan.

    Attributes
    ----------
    name, unit : str
        Name of the cause, such as ``joint offset of axis 4``, and unit of its size.
    usual : float
        Usual size, 0 if none is known.
    shown : float
        Smallest size that is found; infinite if none is.
    distinct : float
        Smallest size that is distinguished from all other named causes; infinite if none is.
    like : str
        Most similar of the other named causes; empty if there are none.
    remedy : str
        Evidence that would show the cause, if no candidate does; empty if one does.
    resting : int
        Axis from 1 that moves too little for the cause, see `Limit.testable`; 0 if it moves enough.
    """

    name: str
    unit: str
    usual: float
    shown: float
    distinct: float
    like: str
    remedy: str
    resting: int

    @property
    def enough(self) -> bool:
        """True if the cause is found and distinguished at `usual`, or at `shown` for `usual` 0."""
        return max(self.shown, self.distinct) <= (self.usual or self.shown) < np.inf


class Distinguished(NamedTuple):
    """Extended plan, with the visibility of the named causes before and after.

    Attributes
    ----------
    plan : Plan
    added : tuple of str
        Ids of the measurements that were added.
    durations : tuple of float
        Duration of all measurements and travels, before and after [s].
    before, after : tuple of Reached
        Visibility of the named causes, in the same order.
    """

    plan: Plan
    added: tuple[str, ...]
    durations: tuple[float, float]
    before: tuple[Reached, ...]
    after: tuple[Reached, ...]


def causes_named(robot: Robot, text: str) -> list[Key]:
    """Parse causes such as ``load, joint offset of axis 4``; return axes from 0, -1 for any axis.

    Raises
    ------
    UnknownName
        There is no such cause or axis, or no configuration makes it visible.
    """
    found = []
    for part in text.split(","):
        name, _, axis = (each.strip() for each in part.partition(" of axis "))
        if name in BY_TIME:
            raise UnknownName(
                f"{name}: depends on the time of a measurement, not on the configuration; "
                "measure longer, or repeat the first configurations at the end"
            )
        if name not in PLANNED:
            raise UnknownName(
                f"cause {name!r} must be one of: {', '.join(PLANNED)}; for one axis"
                " write 'joint offset of axis 4'"
            )
        if axis and not (axis.isdecimal() and 1 <= int(axis) <= robot.n_joints):
            raise UnknownName(f"{part.strip()}: axis must be 1 to {robot.n_joints}")
        found.append((name, int(axis) - 1 if axis else -1))
    return found


def distinguish(
    plan: Plan, robot: Robot, noise: Noise, p: Array, named: Sequence[Key]
) -> Distinguished:
    """Add measurements to a plan that take at most as long as the plan.

    Parameters
    ----------
    noise : Noise
        Expected noise of torques.
    p : ndarray, shape (n_base,)
        Expected base parameters.
    named : sequence of Key
        Causes, as returned by `causes_named`.

    Raises
    ------
    NotIdentifiable
        The plan identifies nothing.
    """
    search = _Search(robot, plan, noise, p, named)
    each = [search.reached()]
    while len(each) <= ROUNDS and search.add():
        each.append(search.reached())
    ids = {m.id for m in plan.measurements}
    return Distinguished(
        plan=search.plan,
        added=tuple(m.id for m in search.plan.measurements if m.id not in ids),
        durations=(
            total_duration(robot, plan.measurements),
            total_duration(robot, search.plan.measurements),
        ),
        before=each[0],
        after=each[-1],
    )


class _Search:
    """Growing plan, with tests of the expected recordings and candidates for addition."""

    def __init__(
        self, robot: Robot, plan: Plan, noise: Noise, p: Array, named: Sequence[Key]
    ) -> None:
        self.robot, self.plan, self.noise, self.p = robot, plan, noise, p
        self.taken: list[int] = []
        """Indices of added candidates."""
        self.most = total_duration(robot, plan.measurements) / ROUNDS
        """Maximum time added in a round [s]."""
        self.battery, self.tests = self._tested()
        every = self.battery.columns.tests
        self.keys = [
            key for key in every
            if any(cause == name_of(key) and axis in (-1, key[1]) for cause, axis in named)
        ]  # fmt: skip
        self.columns = [k for key in self.keys for k in every[key]]
        self.names = [self.battery.columns.names[k] for k in self.columns]
        self.cause = np.repeat(np.arange(len(self.keys)), [len(every[key]) for key in self.keys])
        """Index of each column's cause, shape (n_columns,)."""
        self.usual = np.array([CAUSES[name_of((cause, 0))].usual for cause, *_ in self.names])
        self.options = self._candidates()
        worth = np.array([self._products(each) for each in self.options])
        there = np.sum(
            [self._products(m) for m in plan.measurements if shows_parameters(m)], axis=0
        )
        size = np.diag(there + worth.sum(axis=0))
        heard = size > NOTHING**2 * size.max(initial=0.0)
        unit = np.where(heard, 1.0, 0.0) / np.sqrt(np.where(heard, size, 1.0))
        self.worth, self.there = worth * np.outer(unit, unit), there * np.outer(unit, unit)
        """Inner products of the columns, for each candidate and for the plan. Columns are scaled to
        unit length over plan and candidates together."""
        self.visible = np.diag(self._project(self.there + self.worth.sum(axis=0))) > SPAN
        """Columns visible in all candidates together, shape (n_columns,)."""

    def _tested(self) -> tuple[Battery, int]:
        found = foreseen_tests(self.plan, self.robot, self.noise, self.p)
        if found is None:
            raise NotIdentifiable(
                "the plan has 0 measurements for base parameters; add some (see: hil plan)"
            )
        return found

    def _candidates(self) -> list[ElementMeasurement]:
        """Return strokes of a plan, with strokes for load parameters if a load is named."""
        guard = self.plan.workspace
        robot = narrow_ranges(self.robot, guard)
        if any(cause == "load" for cause, _ in self.keys):
            robot = robot.free_links(robot.last_links)
        return [measurement for _, measurement, _ in strokes(robot, guard, EACH)]

    def _products(self, measurement: ParameterMeasurement) -> Array:
        """Return weighted inner products of a measurement: named columns, then the rest."""
        robot, rng, period = self.robot, np.random.default_rng(0), self.plan.sample_period
        made = recorded(robot, measurement, period, self.noise, self.p, rng, 0.0)
        evidence = expected_evidence(robot, [(measurement, signals(made))])
        found = columns(robot, self.p, evidence)
        value = dict(zip(found.names, found.values.T, strict=True))
        if ALL_AXES not in value:  # missing if only one axis moves
            value[ALL_AXES] = -0.01 * evidence.recorded
        given = [self.battery.columns.names[k] for k in self.battery.given]
        none = np.zeros(len(evidence.axis))
        shared = [value.get(name, none) for name in (*self.names, *given)]
        rows = np.column_stack([none, *shared, evidence.X, evidence.own])
        n_shared = len(shared) + evidence.X.shape[1]
        blocks = evidence.blocks(evidence.project_out_friction(rows), n_shared)
        return blocks.normal(self.battery.weights).information

    def _project(self, N: Array) -> Array:
        """Return inner products of named columns, adjusted for estimated columns, (..., m, m)."""
        m = len(self.names)
        inner = N[..., m:, m:] + RIDGE * np.eye(N.shape[-1] - m)
        return N[..., :m, :m] - N[..., :m, m:] @ np.linalg.solve(inner, N[..., m:, :m])

    def _left(self, S: Array) -> Array:
        """Return information of columns adjusted for other causes, shape (..., m, n_causes).

        Information for a column's own cause is not adjusted.
        """
        own = np.maximum(np.einsum("...ii->...i", S), TINY)
        found = np.repeat(own[..., np.newaxis], len(self.keys), axis=-1)
        unit = 1.0 / np.sqrt(own)
        S = S * unit[..., :, np.newaxis] * unit[..., np.newaxis, :]
        for j in range(len(self.keys)):
            at, others = np.flatnonzero(self.visible & (self.cause == j)), self.cause != j
            across = S[..., at, :][..., others]
            inner = S[..., at, :][..., at] + RIDGE * np.eye(len(at))
            taken = np.einsum("...ij,...ij->...j", across, np.linalg.solve(inner, across))
            found[..., others, j] *= np.maximum(1.0 - taken, TINY)
        return found

    def _sizes(self) -> tuple[Array, Array, Array]:
        """Return information, smallest size found, and dispersion of the columns."""
        information = np.diag(self.battery.gram(self.columns))
        shown, phi = np.full(len(self.names), np.inf), np.ones(len(self.names))
        for j, key in enumerate(self.keys):
            at = self.battery.columns.tests[key]
            if (test := self.battery.test(at)) is not None:
                shown[self.cause == j] = smallest(self.battery, at, self.tests)
                phi[self.cause == j] = test.dispersion
        return information, shown, phi

    def reached(self) -> tuple[Reached, ...]:
        """Return the visibility of named causes in the plan, by the battery."""
        information, shown, phi = self._sizes()
        left, found = self._left(self.battery.gram(self.columns)), list[Reached]()
        torque = torque_shares(self.battery)[self.columns]
        for k, (cause, axis, part) in enumerate(self.names):
            limit_at = partial(
                limit_of, self.robot, self.battery, (cause, axis), part, torque=float(torque[k])
            )
            limit = limit_at(float(shown[k]))
            others = [j for j in range(len(self.keys)) if j != self.cause[k]]
            like = min(others, key=lambda j: float(left[k, j]), default=None)
            distinct = 0.0
            if like is not None:
                apart = limit.size is not None and left[k, like] >= APART * information[k]
                distinct = LEAD * float(np.sqrt(phi[k] / left[k, like])) if apart else np.inf
                distinct = _size_or_inf(limit_at(distinct).size)
            found.append(Reached(
                name=describe_cause((cause, axis), part),
                unit=limit.unit,
                usual=float(self.usual[k]),
                shown=_size_or_inf(limit.size),
                distinct=distinct,
                like="" if like is None else describe_cause(self.keys[like]),
                remedy="" if self.visible[k] else SHOWN_BY.get(cause, NEVER),
                resting=0 if limit.testable else limit.axis,
            ))  # fmt: skip
        return tuple(found)

    def add(self) -> bool:
        """Add measurements to reach the wanted sizes; return True if any was added."""
        way, chosen = np.full(len(self.options), np.inf), list[int]()
        starts = np.array([each.start for each in self.options])
        for m in self.plan.measurements:
            way = np.minimum(way, travel_times(self.robot, np.array(m.start), starts, TRAVEL))
        cost = np.array([each.duration for each in self.options]) + SETTLING
        left, wanted = self.most, self._wanted()
        while (lacking := self._lacking(self.there, *wanted)) > 0.0:
            gain = lacking - self._lacking(self.there + self.worth, *wanted)
            fits = (cost + way <= left) & ~np.isin(np.arange(len(cost)), [*self.taken, *chosen])
            rate = np.where(fits, gain / (cost + way), 0.0)
            best = int(rate.argmax())
            if rate[best] <= 0.0:
                break
            chosen.append(best)
            left -= cost[best] + way[best]
            self.there = self.there + self.worth[best]
            way = np.minimum(way, travel_times(self.robot, starts[best], starts, TRAVEL))
        self.taken += chosen
        if chosen:
            self.plan = _extend_plan(self.robot, self.plan, [self.options[k] for k in chosen])
            self.battery, self.tests = self._tested()
        return bool(chosen)

    def _wanted(self) -> tuple[Array, Array, Array]:
        """Return wanted information, alone and adjusted for other causes, and the minimum share."""
        information, shown, phi = self._sizes()
        now, seen = np.diag(self._project(self.there)), np.isfinite(shown)
        known = (self.usual > 0) & self.visible
        # the battery uses thinned rows, so its information is smaller by a nearly common factor
        ratio = now[seen] / information[seen]
        unit = np.full(len(now), np.median(ratio) if len(ratio) else 1.0)
        unit[seen] = ratio
        need = np.full(len(now), noncentrality(1, FEW, LEVEL / self.tests))
        need[seen] = shown[seen] ** 2 * information[seen] / phi[seen]
        each = np.where(known, unit * phi / np.where(known, self.usual, 1.0) ** 2, 0.0)
        share = np.where(known, APART, np.maximum(APART, LEAD**2 / need))
        return need * each, LEAD**2 * each, np.where(self.visible, share, 0.0)

    def _lacking(self, N: Array, wanted: Array, apart: Array, share: Array) -> Array:
        """Return the sum of the logarithms of detectable over wanted sizes, shape (...)."""
        S = self._project(N)
        own = np.maximum(np.einsum("...ii->...i", S), TINY)
        left = self._left(S)
        least = np.maximum(apart[:, np.newaxis], share[:, np.newaxis] * own[..., np.newaxis])
        distinct = np.where(self.cause[:, np.newaxis] == np.arange(len(self.keys)), 0.0,
                            _excess(least, left))  # fmt: skip
        found: Array = _excess(wanted, own).sum(axis=-1) + distinct.sum(axis=(-2, -1))
        return found


def _size_or_inf(size: float | None) -> float:
    """Return a size; infinity if there is none."""
    return np.inf if size is None else size


def _excess(wanted: Array, there: Array) -> Array:
    """Return the logarithm of detectable over wanted size, at least 0, from the information."""
    return np.maximum(np.log(np.maximum(wanted, TINY) / there), 0.0) / 2


def _extend_plan(robot: Robot, plan: Plan, more: Sequence[ElementMeasurement]) -> Plan:
    """Append measurements to a plan; in a guarded workspace, plan a single tour of all."""
    named = assign_ids(order_by_travel(robot, more), {each.id for each in plan.measurements})
    every = [*plan.measurements, *named]
    if plan.workspace is not None:
        every = guarded_tour(narrow_ranges(robot, plan.workspace), plan.workspace, every)
    return plan.model_copy(update={"measurements": tuple(every)})
