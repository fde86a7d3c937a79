r"""Measurements that make causes visible and distinguish them, added to a plan.

Of the column of a cause, another one that is named leaves the share s^2 = I' / I of its
information, I' being that beside base parameters and all columns of the other. A flaw theta of it,
with z^2 = theta^2 I / phi, is explained by its own column as (z + e)^2, by the other so much worse:
z^2 s^2 + 2 z s e', e' standard normal. The two are distinguished if that exceeds
`finding.TOGETHER`, with the probability `limits.POWER` from

    theta = a sqrt(phi / I'),    a^2 - 2 a Phi^-1(.8) = 3.84,

on, if s^2 is twice what a correlation of `finding.SAME` leaves, at least: of less the lead must be
a share of all that is explained, and theta grows beyond all bounds.

Inner products of candidates add up (`hil.least_squares.blocks`). So one after the other is taken
that lowers most, in its time, the logarithms by which sizes exceed what is wanted: what is usual of
the cause, or, where nothing is, that it is distinguished from the others as soon as it is found.
The sizes that are stated are those of the whole plan by the battery (`foreseen`), which is asked
again until it agrees.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special

from hil.errors import NotIdentifiable, UnknownName
from hil.estimation.excluded.battery import LEVEL, NOTHING, SPAN
from hil.estimation.excluded.causes import CAUSES, FITTED, SHOWN_BY
from hil.estimation.excluded.columns import Column, columns
from hil.estimation.excluded.finding import SAME, TOGETHER
from hil.estimation.excluded.foreseen import expected_evidence, foreseen_tests, recorded
from hil.estimation.excluded.limits import POWER, noncentrality, smallest
from hil.estimation.excluded.words import in_words, name_of, unit_of
from hil.estimation.signals import signals
from hil.planning.design.by_minutes import assign_ids, order_by_travel, total_duration
from hil.planning.design.candidates import strokes
from hil.planning.design.tour import TRAVEL, guarded_tour
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
"""Candidates of an element: each takes some 50 ms to judge, and of more the first ones, which
spread over all ranges, are still those chosen."""
QUANTILE = float(special.ndtri(POWER))
LEAD = QUANTILE + float(np.sqrt(QUANTILE**2 + TOGETHER))
"""The module's a."""
APART = 2.0 * (1.0 - SAME**2)
"""Least share of a cause's information beside another one, for the two to be distinguished."""
ROUNDS = 6
"""How often more is added and the whole plan is tested, each time as much of what may be added."""
FEW = 20
"""Degrees of freedom that the test of a cause is taken to have before it shows at all."""
ALL_AXES = Column("torques of all axes", -1)
RIDGE, TINY = 1e-9, 1e-12
"""Beside unit diagonals: what of singular products is taken for rounding, and least shares."""
NEVER = "base parameters, friction or other columns explain it whatever is measured"
BY_TIME = ("drift of torque constant", "slip")
"""Causes that depend on when something is measured, not on where."""
PLANNED = tuple(
    name for name, each in CAUSES.items()
    if each.unit and name not in (*FITTED, *BY_TIME, "torque at its limit")
)  # fmt: skip
"""Causes that measurements are chosen for."""


class Reached(NamedTuple):
    """What a plan shows of a cause that was named, or of one of its columns.

    Attributes
    ----------
    name, unit : str
        Such as ``zero of axis 4``.
    usual : float
        Size that is usual, 0 where none is known.
    shown : float
        Smallest size that is found; infinite where none is.
    distinct : float
        Smallest size that is distinguished from all others named; infinite where it is like one of
        them.
    like : str
        The one of these that it is most alike; empty where there are no others.
    remedy : str
        What would show it, if no candidate does; empty where one does.
    """

    name: str
    unit: str
    usual: float
    shown: float
    distinct: float
    like: str
    remedy: str

    @property
    def enough(self) -> bool:
        """Whether a usual size, or else each that is found, is found and distinguished."""
        return max(self.shown, self.distinct) <= (self.usual or self.shown) < np.inf


class Distinguished(NamedTuple):
    """A plan with what was added, and what it shows of the causes named.

    Attributes
    ----------
    plan : Plan
    added : tuple of str
        Ids of the measurements that were added.
    durations : tuple of float
        Of all measurements and the ways between them, before and after [s].
    before, after : tuple of Reached
        In the same order.
    """

    plan: Plan
    added: tuple[str, ...]
    durations: tuple[float, float]
    before: tuple[Reached, ...]
    after: tuple[Reached, ...]


def causes_named(robot: Robot, text: str) -> list[Key]:
    """Causes of a list such as ``load, zero of axis 4``; the axis (from 0) is -1 where it is open.

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
                f"{name}: depends on when something is measured, not on where; measure longer, or"
                " come back to the first configurations at the end"
            )
        if name not in PLANNED:
            raise UnknownName(
                f"cause {name!r} must be one of: {', '.join(PLANNED)}; with an axis it is 'zero of"
                " axis 4'"
            )
        if axis and not (axis.isdecimal() and 1 <= int(axis) <= robot.n_joints):
            raise UnknownName(f"{part.strip()}: axis must be 1 to {robot.n_joints}")
        found.append((name, int(axis) - 1 if axis else -1))
    return found


def distinguish(
    plan: Plan, robot: Robot, noise: Noise, p: Array, named: Sequence[Key]
) -> Distinguished:
    """Add measurements to a plan, as long as itself at most.

    Parameters
    ----------
    noise : Noise
        That torques are expected to have.
    p : ndarray, shape (n_base,)
        Base parameters as they are expected.
    named : sequence of Key
        As `causes_named` returns them.

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
    """A plan that grows, the tests of what it will record, and candidates to be added."""

    def __init__(
        self, robot: Robot, plan: Plan, noise: Noise, p: Array, named: Sequence[Key]
    ) -> None:
        self.robot, self.plan, self.noise, self.p = robot, plan, noise, p
        self.taken: list[int] = []
        """Candidates that were added."""
        self.most = total_duration(robot, plan.measurements) / ROUNDS
        """Time that may be added in a round [s]."""
        self.battery, self.tests = self._tested()
        every = self.battery.columns.tests
        self.keys = [
            key for key in every
            if any(cause == name_of(key) and axis in (-1, key[1]) for cause, axis in named)
        ]  # fmt: skip
        self.columns = [k for key in self.keys for k in every[key]]
        self.names = [self.battery.columns.names[k] for k in self.columns]
        self.cause = np.repeat(np.arange(len(self.keys)), [len(every[key]) for key in self.keys])
        """Which of the causes each column is of, shape (n_columns,)."""
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
        """Of candidates and plan; columns have unit length in all of them together."""
        self.visible = np.diag(self._beside(self.there + self.worth.sum(axis=0))) > SPAN
        """Columns that all candidates together show, shape (n_columns,)."""

    def _tested(self) -> tuple[Battery, int]:
        found = foreseen_tests(self.plan, self.robot, self.noise, self.p)
        if found is None:
            raise NotIdentifiable("0 measurements show parameters; plan some (see: hil plan)")
        return found

    def _candidates(self) -> list[ElementMeasurement]:
        """Strokes among which a plan chooses; if a load is named, they vary what shows it, too."""
        guard = self.plan.workspace
        robot = narrow_ranges(self.robot, guard)
        if any(cause == "load" for cause, _ in self.keys):
            robot = robot.free_links([robot.n_joints - 1])
        return [measurement for _, measurement, _ in strokes(robot, guard, EACH)]

    def _products(self, measurement: ParameterMeasurement) -> Array:
        """Weighted inner products of a measurement: of the named columns, then of all others."""
        robot, rng, period = self.robot, np.random.default_rng(0), self.plan.sample_period
        made = recorded(robot, measurement, period, self.noise, self.p, rng, 0.0)
        evidence = expected_evidence(robot, [(measurement, signals(made))])
        found = columns(robot, self.p, evidence)
        value = dict(zip(found.names, found.values.T, strict=True))
        if ALL_AXES not in value:  # of one axis alone it is not stated
            value[ALL_AXES] = -0.01 * evidence.recorded
        given = [self.battery.columns.names[k] for k in self.battery.given]
        none = np.zeros(len(evidence.axis))
        shared = [value.get(name, none) for name in (*self.names, *given)]
        rows = np.column_stack([none, *shared, evidence.X, evidence.own])
        n_shared = len(shared) + evidence.X.shape[1]
        blocks = evidence.blocks(evidence.without_friction(rows), n_shared)
        return blocks.normal(self.battery.weights).information

    def _beside(self, N: Array) -> Array:
        """Inner products of the named columns beside all that is estimated, shape (..., m, m)."""
        m = len(self.names)
        inner = N[..., m:, m:] + RIDGE * np.eye(N.shape[-1] - m)
        return N[..., :m, :m] - N[..., :m, m:] @ np.linalg.solve(inner, N[..., m:, :m])

    def _left(self, S: Array) -> Array:
        """Information of each column beside each other cause, shape (..., m, n_causes).

        Beside its own cause it is that beside none.
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
        """Information, smallest size that is found, and dispersion of each column."""
        information = np.diag(self.battery.gram(self.columns))
        shown, phi = np.full(len(self.names), np.inf), np.ones(len(self.names))
        for j, key in enumerate(self.keys):
            at = self.battery.columns.tests[key]
            if (test := self.battery.test(at)) is not None:
                shown[self.cause == j] = smallest(self.battery, at, self.tests)
                phi[self.cause == j] = test.dispersion
        return information, shown, phi

    def reached(self) -> tuple[Reached, ...]:
        """What the plan shows, by the battery."""
        information, shown, phi = self._sizes()
        left, found = self._left(self.battery.gram(self.columns)), list[Reached]()
        for k, (cause, axis, part) in enumerate(self.names):
            others = [j for j in range(len(self.keys)) if j != self.cause[k]]
            like = min(others, key=lambda j: float(left[k, j]), default=None)
            distinct = 0.0
            if like is not None:
                apart = np.isfinite(shown[k]) and left[k, like] >= APART * information[k]
                distinct = LEAD * float(np.sqrt(phi[k] / left[k, like])) if apart else np.inf
            found.append(Reached(
                name=in_words((cause, axis), part),
                unit=unit_of(self.robot, (cause, axis), part),
                usual=float(self.usual[k]),
                shown=float(shown[k]),
                distinct=distinct,
                like="" if like is None else in_words(self.keys[like]),
                remedy="" if self.visible[k] else SHOWN_BY.get(cause, NEVER),
            ))  # fmt: skip
        return tuple(found)

    def add(self) -> bool:
        """Add what brings sizes down to those wanted; whether there was anything."""
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
            self.plan = _with(self.robot, self.plan, [self.options[k] for k in chosen])
            self.battery, self.tests = self._tested()
        return bool(chosen)

    def _wanted(self) -> tuple[Array, Array, Array]:
        """Information wanted of each column, that beside each other cause, and its least share."""
        information, shown, phi = self._sizes()
        now, seen = np.diag(self._beside(self.there)), np.isfinite(shown)
        known = (self.usual > 0) & self.visible
        # the battery thins rows out, and so knows less by about one factor
        ratio = now[seen] / information[seen]
        unit = np.full(len(now), np.median(ratio) if len(ratio) else 1.0)
        unit[seen] = ratio
        need = np.full(len(now), noncentrality(1, FEW, LEVEL / self.tests))
        need[seen] = shown[seen] ** 2 * information[seen] / phi[seen]
        each = np.where(known, unit * phi / np.where(known, self.usual, 1.0) ** 2, 0.0)
        share = np.where(known, APART, np.maximum(APART, LEAD**2 / need))
        return need * each, LEAD**2 * each, np.where(self.visible, share, 0.0)

    def _lacking(self, N: Array, wanted: Array, apart: Array, share: Array) -> Array:
        """Sum of the logarithms by which sizes exceed what is wanted, shape (...)."""
        S = self._beside(N)
        own = np.maximum(np.einsum("...ii->...i", S), TINY)
        left = self._left(S)
        least = np.maximum(apart[:, np.newaxis], share[:, np.newaxis] * own[..., np.newaxis])
        distinct = np.where(self.cause[:, np.newaxis] == np.arange(len(self.keys)), 0.0,
                            _excess(least, left))  # fmt: skip
        found: Array = _excess(wanted, own).sum(axis=-1) + distinct.sum(axis=(-2, -1))
        return found


def _excess(wanted: Array, there: Array) -> Array:
    """Logarithm by which a size exceeds the one that is wanted, by information on both."""
    return np.maximum(np.log(np.maximum(wanted, TINY) / there), 0.0) / 2


def _with(robot: Robot, plan: Plan, more: Sequence[ElementMeasurement]) -> Plan:
    """The plan with more measurements behind its own; in a guarded workspace in one tour of all."""
    named = assign_ids(order_by_travel(robot, more), {each.id for each in plan.measurements})
    every = [*plan.measurements, *named]
    if plan.workspace is not None:
        every = guarded_tour(narrow_ranges(robot, plan.workspace), plan.workspace, every)
    return plan.model_copy(update={"measurements": tuple(every)})
