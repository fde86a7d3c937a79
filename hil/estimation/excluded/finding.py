"""All causes tested: what is found, and what would have been.

Causes are tested beside what is estimated (`battery`), all of them at a familywise level of 5 %
(Holm, Scand. J. Statist. 6 (1979) 65-70). The one that explains most is found if it is significant
beside itself: with the dispersion of what is left once it is taken into account. Then the others
are tested beside it, again and again, until none is. What explains as much as the one found, as far
as the data can tell, is named with it.

Columns are of the first order. Where what is found is large, or friction would drive an axis, other
readings of the recordings are tried too (`alternatives`), and one of them that explains as much as
all columns together takes their place.

Of the others is stated what they would have to be in order to be found with a probability of 80 %,
and how much torque that is. A cause within the span of what is estimated never shows.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy import special, stats

from hil.errors import NotEnoughData, NotIdentifiable
from hil.estimation.excluded.alternatives import ROWS, Reading, alternatives, explained
from hil.estimation.excluded.battery import Battery
from hil.estimation.excluded.causes import CAUSES
from hil.estimation.excluded.columns import columns
from hil.estimation.excluded.evidence import measured
from hil.estimation.excluded.result import Excluded, Found, Limit, located
from hil.estimation.excluded.saturation import saturated
from hil.estimation.signals import signals
from hil.estimation.simultaneous import SimultaneousFit
from hil.planning.free_motion import FreeMotion
from hil.planning.measurement import shows_parameters

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from hil.arrays import Array
    from hil.estimation.drive_train import DriveTrain
    from hil.estimation.excluded.alternatives import Alternative, Explained
    from hil.estimation.excluded.battery import Common, Test
    from hil.estimation.excluded.columns import Columns
    from hil.estimation.excluded.evidence import Evidence
    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMotion, RecordedMotion
    from hil.runs.recording import Recording

    Key = tuple[str, int]
    Tests = dict[Key, list[int]]

LEVEL = 0.05
"""Probability that anything is found where nothing is wrong."""
POWER = 0.8
"""Probability with which a cause of the stated size is found (Cohen, Statistical Power Analysis
for the Behavioral Sciences, 1988, p. 56)."""
FITTED = ("late torque",)
"""Causes that every estimate looks for and takes into account: they stay free beside the others."""
TRIED = 2
"""Causes that are tried as the next one."""
MOST = 5
"""Causes that are found at most: beyond, the model is wrong as a whole."""
LARGE = 0.95
"""Share of the sum of squares that is left beside a cause, below which it may be too large for a
column of the first order, and other readings are tried."""
SI = {"I": "kg m²", "s": "kg m", "m": "kg"}
"""Units of a link's parameters by their first letters."""
LEAVES = 0.5
"""Share of the mean square of an axis that a cause leaves at most, where somebody else recorded:
friction that is eliminated here contradicts every model a little where samples are slow or motion
turns often (public recordings of five machines: 0.75 and more)."""
TOGETHER = 4.0
"""Difference of chi squares below which two causes explain as much: their likelihoods differ by a
factor of e^2, which by chance happens in 5 %."""
SAME = 0.98
"""Correlation of two causes beyond which data do not tell them apart: a column of the first order
is not exact to 2 % where a cause is of any size."""


def excluded(robot: Robot, p: Array, evidence: Evidence) -> Excluded:
    """Test all causes.

    Parameters
    ----------
    p : ndarray, shape (n_base,)
        Base parameters as they were estimated.
    """
    every = columns(robot, p, evidence)
    battery = first = Battery(
        evidence, every, [k for k, name in enumerate(every.names) if name.cause in FITTED]
    )
    tests = {key: at for key, at in every.tests.items() if first.visible[at].any()}
    found: list[_Step] = []
    while len(found) < MOST:
        step = _likeliest(robot, battery, tests, LEVEL / max(len(tests) - len(found), 1))
        if step is None or (found and step.taken < (1.0 - SAME**2) * found[0].taken):
            break  # what a column of the first order leaves of the first
        found.append(step)
        battery = step.beside
    causes = tuple(step.found for step in found)
    causes = _Instead(robot, evidence, battery, tests, causes).found
    return Excluded(
        found=causes,
        limits=_limits(robot, battery, every, len(tests)),
        tests=len(tests),
    )


def proved(
    robot: Robot,
    recorded: Iterable[tuple[RecordedMotion, Recording]],
    p: Array | None = None,
    drive_train: DriveTrain | None = None,
) -> Excluded | None:
    """What recordings prove; None where too little was recorded to contradict itself.

    Parameters
    ----------
    p : ndarray, shape (n_base,), optional
        Base parameters, if they were estimated.
    drive_train : DriveTrain, optional
        What lies between currents and arm, if that is known.
    """
    prepared = list(_prepared(recorded))
    imported = any(isinstance(motion, FreeMotion) for motion, _ in prepared)
    if drive_train is not None:
        prepared = [(motion, drive_train.applied(robot, s)) for motion, s in prepared]
    try:
        solver = SimultaneousFit(robot, prepared)
    except NotIdentifiable:
        return None
    evidence = measured(robot, solver, prepared)
    found = excluded(robot, solver.solve() if p is None else p, evidence)
    limit = saturated(prepared, robot.n_joints) if found.found else None
    if limit is None:
        large = [each for each in found.found if each.left <= LEAVES or not imported]
        return found.model_copy(update={"found": tuple(large)})
    axis, share, top = limit
    words = f"{share:.0%} of its samples have one and the same greatest torque, {top:.3g}"
    first = Found(
        cause="torque at its limit",
        axes=(axis + 1,),
        detail=f"{words} {robot.torque_unit(axis)}",
        size=100.0 * share,
    )
    return found.model_copy(update={"found": (first,)})


def _prepared(
    recorded: Iterable[tuple[RecordedMotion, Recording]],
) -> Iterator[tuple[ParameterMotion, Signals]]:
    for measurement, recording in recorded:
        unknown = isinstance(measurement, FreeMotion) and measurement.unknown_gains
        if shows_parameters(measurement) and not unknown:
            with suppress(NotEnoughData):
                yield measurement, signals(recording)


def gains(battery: Battery, tests: Tests, common: Common) -> dict[Key, float]:
    """What each cause explains, as chi square beyond what chance lets the best explain."""
    each = {key: battery.test(at, common) for key, at in tests.items()}
    one = _typical(battery, common)
    return {
        key: test.drop / one - chance(test.rank, len(tests))
        for key, test in each.items()
        if test is not None
    }


def _typical(battery: Battery, common: Common) -> float:
    return max(float(np.median(common.dispersion[battery.visible])), 1.0)


@cache
def chance(rank: int, n_tests: int) -> float:
    """Chi square that the best of so many tests of a rank has by chance."""
    return float(stats.chi2.isf(LEVEL / max(n_tests, 1), rank))


def alike(gain: float, best: float) -> bool:
    """Whether two causes explain as much as far as the data can tell."""
    return gain > min(best - TOGETHER, SAME**2 * best)


@dataclass(frozen=True)
class _Step:
    """A cause that was found, the battery before it, and that beside it."""

    robot: Robot
    key: Key
    battery: Battery
    beside: Battery
    tests: Tests

    @property
    def left(self) -> float:
        """Share of the mean square that is left of the axis where that is least."""
        return float((self.beside.left / self.battery.left).min())

    @property
    def taken(self) -> float:
        """Chi square that is explained."""
        return self.battery.misfit - self.beside.misfit

    @property
    def found(self) -> Found:
        """In words, together with what explains as much."""
        common = self.beside.common
        explains = gains(self.battery, self.tests, common)
        same = [k for k, gain in explains.items() if alike(gain, explains[self.key])]
        told = [
            (key, test, _words(self.robot, self.battery.columns, key, test))
            for key in sorted(same, key=lambda k: _order(*k))
            if (test := self.battery.test(self.tests[key], common)) is not None
        ]
        (key, test, detail), *others = told
        largest = int(np.argmax(np.abs(test.size)))
        corrected = self.battery.beside(test.columns.tolist()).solution
        return Found(
            cause=_name(key),
            axes=_axes(self.robot, key),
            detail=detail,
            left=self.left,
            others=tuple(located(_axes(self.robot, key), words) for key, _, words in others),
            change=tuple((corrected - self.battery.solution).tolist()),
            size=float(test.size[largest]),
            error=float(test.error[largest]),
        )


def _likeliest(robot: Robot, battery: Battery, tests: Tests, level: float) -> _Step | None:
    """The cause that explains most, if that is significant."""
    explains = gains(battery, tests, battery.common)
    for key in sorted(explains, key=explains.__getitem__, reverse=True)[:TRIED]:
        beside = battery.beside([k for k in tests[key] if battery.visible[k]])
        test = battery.test(tests[key], beside.common)
        if test is not None and test.p < level:
            return _Step(robot, key, battery, beside, tests)
    return None


@dataclass(frozen=True)
class _Instead:
    """Other readings of the recordings beside causes that were found."""

    robot: Robot
    evidence: Evidence
    battery: Battery
    tests: Tests
    causes: tuple[Found, ...]

    @property
    def found(self) -> tuple[Found, ...]:
        """What is found after all."""
        large = any(each.left < LARGE for each in self.causes)
        if not large and self._stated.possible:
            return self.causes
        found = self._likeliest()
        if found is not None:
            return (found,)
        if not self.causes and not self._stated.possible:
            words = "friction would drive an axis, or some motions would have a negative energy"
            return (Found(cause="unknown", axes=(), detail=words),)
        return self.causes

    @cached_property
    def _thin(self) -> tuple[Evidence, Array]:
        thin, at = self.evidence.thinned(ROWS)
        return thin, self.battery.columns.values[at]

    @cached_property
    def _stated(self) -> Explained:
        return self._of(self._fitted)

    @cached_property
    def _fitted(self) -> list[int]:
        names = self.battery.columns.names
        return [k for k, name in enumerate(names) if name.cause in FITTED]

    def _of(self, given: Sequence[int]) -> Explained:
        """What is stated explains with some columns."""
        thin, values = self._thin
        return explained(self.robot, thin, Reading.stated(self.robot), values[:, list(given)])

    def _gain(self, each: Explained, n: int) -> float:
        """What a reading, or columns, with `n` unknowns explain."""
        explains = self._stated.misfit - each.misfit
        return explains - chance(n, len(self.tests)) if n else explains

    def _likeliest(self) -> Found | None:
        """The reading that explains most with its like, if columns do not explain more."""
        thin, values = self._thin
        one = _typical(self.battery, self.battery.common)
        fitted = values[:, self._fitted]
        sizes = {
            (each.cause, each.axes[0] - 1): each.size
            for each in self.causes
            if len(each.axes) == 1 and each.size is not None
        }
        every = [
            (self._gain(each.explained, int(not np.isnan(each.size))), each)
            for each in alternatives(self.robot, thin, fitted, self._stated, one, sizes)
        ]
        best = max((gain for gain, _ in every), default=-np.inf)
        if best < (chance(1, len(self.tests)) if self._stated.possible else -TOGETHER):
            return None
        given = self._of(self.battery.given)
        if self.causes and given.possible and not alike(best, self._gain(given, 0)):
            return None
        same = [each for gain, each in every if alike(gain, best)]
        same.sort(key=lambda each: _order(each.cause, *each.axes))
        words = [_alternative(self.robot, each) for each in same]
        told = [
            located([axis + 1 for axis in each.axes], text)
            for each, text in zip(same, words, strict=True)
        ]
        for cause in self.causes:  # a load explains what a zero of the last axes does
            if cause.cause == "load":
                at = self.tests["load", -1]
                load = self._of([*self._fitted, *at])
                if alike(self._gain(load, len(at)), best):
                    return cause.model_copy(update={"others": tuple(told)})
        first = same[0]
        return Found(
            cause=first.cause,
            axes=tuple(axis + 1 for axis in first.axes),
            detail=words[0],
            left=float((first.explained.left / self._stated.left).min()),
            others=tuple(told[1:]),
            change=tuple((first.explained.p - self._stated.p).tolist()),
            size=None if np.isnan(first.size) else first.size,
            error=None if np.isnan(first.error) else first.error,
        )


def _order(cause: str, *axes: int) -> tuple[int, ...]:
    return list(CAUSES).index(_name((cause, 0))), *axes


def _name(key: Key) -> str:
    """Name of a cause in the table."""
    return key[0].rstrip(" 0123456789")


def _axes(robot: Robot, key: Key) -> tuple[int, ...]:
    if key[0] == "load":
        return (robot.n_joints,)
    return (key[1] + 1,) if key[1] >= 0 else ()


def _words(robot: Robot, every: Columns, key: Key, test: Test) -> str:
    """A cause and its size."""
    cause, unit = CAUSES[_name(key)], CAUSES[_name(key)].unit_of(robot, key[1])
    if key[0] == "load":
        return cause.words
    if _name(key) in ("repeats", "gravity"):
        size, error = float(np.hypot.reduce(test.size)), float(test.error.max())
        times = key[0].rsplit(maxsplit=1)[-1]
        often = "" if key[0] == "gravity" else " once" if times == "1" else f" {times} times"
        turn = f",{often} a turn" if often else ""
        return f"{cause.words} {size:.3g} ± {error:.1g} {unit}{turn}"
    at = int(np.argmax(np.abs(test.size / test.error)))
    after = ""
    if key[0] == "slip":
        instant = float(every.names[test.columns[at]].part)
        after = f" after some {instant / 60:.0f} min"
    return f"{cause.words} {test.size[at]:.3g} ± {test.error[at]:.1g} {unit}{after}"


def _alternative(robot: Robot, each: Alternative) -> str:
    cause = CAUSES[each.cause]
    if np.isnan(each.size):
        return cause.words
    unit = cause.unit_of(robot, each.axes[0] if each.axes else -1)
    after = f" after some {each.instant / 60:.0f} min" if each.cause == "slip" else ""
    return f"{cause.words} {each.size:.3g} ± {each.error:.1g} {unit}{after}"


def _limits(robot: Robot, battery: Battery, every: Columns, n_tests: int) -> tuple[Limit, ...]:
    """Smallest sizes that are found."""
    torque = _torque(battery)
    found = [
        Limit(
            cause=_name(key),
            axis=key[1] + 1,
            part=part,
            unit=SI[part[0]] if part else CAUSES[_name(key)].unit_of(robot, key[1]),
            size=size if np.isfinite(size) else None,
            torque=each,
        )
        for key, at in every.tests.items()
        if key[0] not in FITTED
        for part, size, each in _sizes(battery, key, at, torque, n_tests)
    ]
    hardest: dict[tuple[str, int, str], Limit] = {}  # of a torque that repeats, of all orders
    for each in sorted(found, key=lambda each: _order(each.cause, each.axis)):
        at = each.cause, each.axis, each.part
        if at not in hardest or _hard(each) > _hard(hardest[at]):
            hardest[at] = each
    return tuple(hardest.values())


def _hard(limit: Limit) -> float:
    return np.inf if limit.size is None else limit.size


def _sizes(
    battery: Battery, key: Key, at: Sequence[int], torque: Array, n_tests: int
) -> Iterator[tuple[str, float, float]]:
    """Parts of a cause: each one's smallest size that is found, and the torque of a unit."""
    test, size = battery.test(at), dict.fromkeys(at, np.inf)
    if test is not None:
        need = noncentrality(test.rank, round(test.degrees), LEVEL / n_tests)
        each = np.sqrt(need * test.dispersion / battery.information[test.columns])
        size.update(zip(test.columns.tolist(), each.tolist(), strict=True))
    if key[0] == "load":
        for k in at:
            yield battery.columns.names[k].part, size[k], float(torque[k])
    else:  # of several columns that which hardly shows
        worst = max(at, key=size.__getitem__)
        yield "", size[worst], float(torque[worst])


@cache
def noncentrality(rank: int, degrees: int, level: float) -> float:
    """Of F at which a test of a level has the power that is wanted."""
    limit = stats.f.isf(level, rank, degrees)
    return float(special.ncfdtrinc(rank, degrees, 1.0 - POWER, limit))


def _torque(battery: Battery) -> Array:
    """Share of the recorded torque that one unit of each column makes, where that is most."""
    e, found = battery.evidence, np.zeros(len(battery.columns.names))
    for axis in np.unique(e.axis):
        rows = e.axis == axis
        square = float(e.recorded[rows] @ e.recorded[rows])
        if square > 0:
            values = battery.columns.values[rows]
            found = np.maximum(found, np.sqrt(np.einsum("ij,ij->j", values, values) / square))
    return found
