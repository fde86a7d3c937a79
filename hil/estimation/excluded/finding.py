"""Tests of all causes: found causes, and exclusion limits (`limits`).

Causes are tested, adjusted for the estimated columns (`battery`), at a familywise level of 5 %
(Holm, Scand. J. Statist. 6 (1979) 65-70). The cause that explains most is found if it is
significant for the dispersion of the residual without this cause. The remaining causes are then
tested with the found ones included, until none is significant. Causes that explain the data equally
well are named together with the found cause.

Columns are of the first order. Other readings of the recordings are tried too (`alternatives`) if a
found cause is large, if groups or axes contradict each other for any reason, or if friction would
drive an axis. A reading that explains as much as all columns together replaces the columns.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from hil.estimation.excluded.alternatives import ROWS, Reading, alternatives, explained
from hil.estimation.excluded.backlash import WITHIN, half_gap
from hil.estimation.excluded.battery import LEVEL, Battery
from hil.estimation.excluded.causes import CAUSES, FIRST_ORDER, FITTED
from hil.estimation.excluded.columns import columns, finer, late
from hil.estimation.excluded.deviation import Deviation, parts_of
from hil.estimation.excluded.encoder_noise import EncoderNoise
from hil.estimation.excluded.finite_size import FINITE, misread_battery
from hil.estimation.excluded.friction_change import friction_changes
from hil.estimation.excluded.limits import SETTLED, limits
from hil.estimation.excluded.result import Excluded, Found, located
from hil.estimation.excluded.words import axes_of, describe_reading, describe_size, name_of, rank_of
from hil.least_squares.uncertainty import shrunk

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from hil.arrays import Array
    from hil.estimation.excluded.alternatives import Alternative, Explained
    from hil.estimation.excluded.battery import Test
    from hil.estimation.excluded.causes import Key
    from hil.estimation.excluded.dispersion import Common
    from hil.estimation.excluded.evidence import Evidence
    from hil.estimation.excluded.result import Limit
    from hil.model.robot import Robot

    Tests = dict[Key, list[int]]

LEAVES = 0.5
"""Maximum share of an axis's mean square that a cause leaves, to be distinguished from model error.
Eliminated friction contradicts every model a little if samples are slow or motion reverses often
(public recordings of five machines: 0.75 and more)."""
EXPLAINS = 1.0 / 9.0
"""Share of the mean square of an axis left by a reading that contradicts a possible map. On
recordings of an arm without a valid model, wrong readings leave 0.2; on those of a UR10 with one
wrong sign, the right reading leaves at most 0.01, unless no parameter depends on the sign.
"""
MOST = 5
"""Maximum number of found causes; with more, the model is wrong as a whole."""
LARGE = 0.95
"""Share of the sum of squares left by a cause, below which the cause may be too large for a
first-order column, and other readings are tried. The shares 0.5 and 0.99 give the same findings on
clean runs 1000 and 1001 of `benchmarks/excluded.py`, and with six causes put into each."""
BOUNCES = 0.25
"""Largest share of the residual due to a backlash that the column leaves: the column contains one
impact without rebound, and links with a restitution of 0.5 rebound with a quarter of the energy.
"""
CONTRADICTS = 4.0
"""Median dispersion of causes from which on groups contradict each other for any reason: they
scatter twice as much as the noise within groups explains. Then nothing may be significant, since
everything is uncertain. The median is at most `USUAL` without any cause; up to 3.5 with a cause
that a column explains; and 13 to 18 with a reversed axis, two exchanged axes or a joint offset of
90 degrees. The bounds 2.5 and 9 give the same findings on the runs of `LARGE`."""
USUAL = 1.5
"""Largest median dispersion without any cause, even with strong drift of friction, as a multiple of
the dispersion of white noise: that is 3.5 at a SYNC of 16 ms (`Evidence.overlap`)."""
TOGETHER = float(special.chdtri(1, 0.05))
"""Difference of chi squares below which two causes explain the data equally well. If the true cause
explains z^2, another cause with correlation r explains (r z + sqrt(1 - r^2) e)^2, e standard
normal. For any r this exceeds z^2 by less than e^2, so the wrong cause leads by more than this
bound in less than 5 % of cases.
"""
SAME = 0.98
"""Correlation beyond which data do not distinguish two causes: a first-order column is not exact to
2 % for a cause of any size. On the runs of `LARGE` 0.99 gives the same findings; at 0.95 a load is
named in place of an offset of joint 5 by 90 degrees, at 0.995 a slip in place of an offset of joint
2 by 0.1 degrees."""


def excluded(
    robot: Robot,
    p: Array,
    evidence: Evidence,
    leaves: float = 1.0,
    known: Sequence[str] = (),
    both: Array | None = None,
) -> Excluded:
    """Test all causes; return found causes and exclusion limits.

    Parameters
    ----------
    p : ndarray, shape (n_base,)
        Estimated base parameters.
    leaves : float
        Maximum share of some axis's mean square that a cause may leave, for the limits.
    known : sequence of str
        Causes fitted together with every tested cause.
    both : ndarray, shape (n_base,), optional
        Base parameters of earlier and later rows together, for the test of changed friction; by
        default `p`.
    """
    if evidence.later is None:
        every = columns(robot, p, evidence, (*FITTED, *known))
    else:  # lags of all recordings are free; a changed lag is a cause
        evidence = replace(evidence, own=np.column_stack([evidence.own, late(robot, p, evidence)]))
        every = columns(robot, p, evidence, known, both)
    unchanged = scales_of_parts(robot, p, evidence) if evidence.later is not None else None
    noise = EncoderNoise(robot, p, evidence)
    battery = first = Battery(evidence, every, every.fitted, unchanged, noise)
    tests = {key: at for key, at in every.tests.items() if first.visible[at].any()}
    level = battery.level / max(len(tests), 1)
    if gaps := list(_best_gaps(robot, battery, tests, level)):
        for key in gaps:
            every = finer(robot, p, evidence, every, key, both)
        battery = first = Battery(evidence, every, every.fitted, unchanged, noise)
        tests = {key: at for key, at in every.tests.items() if first.visible[at].any()}
    found: list[Step] = []
    while len(found) < MOST:
        level = battery.level / max(len(tests) - len(found), 1)
        likely = likeliest(battery, tests, level, partial(possible, robot, evidence))
        if likely is None or not (evidence.later is None or battery.exceeds_the_rest(likely[1])):
            break
        key, test = likely
        of_gaps = half_gap(robot, key) is not None  # together with all gaps of the axis
        given = every.gaps(key[1]) if of_gaps else test.columns.tolist()
        beside = battery.extend([k for k in given if battery.visible[k]])
        step = Step(robot, key, test, battery, beside, tests)
        if found and step.taken < found[0].unexplained * found[0].taken:
            break  # remainder of the first cause, outside its column
        found.append(step)
        battery = step.beside
    # a size beyond the validity of every column
    beyond = not found and evidence.later is None and likeliest(battery, tests, level) is not None
    steps = tuple(step.found for step in found)
    instead = _Instead(robot, evidence, first, battery, tests, steps, beyond=beyond)
    causes, stated = instead.found, limits(robot, battery, every, len(tests), leaves)
    if evidence.later is not None and not instead.shows_changes:
        stated = tuple(each.model_copy(update={"size": None}) for each in stated)
    elif evidence.later is not None:
        stated = tuple(_testable(robot, p, battery, each) for each in stated)
    if evidence.later is not None and not instead.deviates:
        friction, more, shared = friction_changes(
            robot, p if both is None else both, evidence, every, list(battery.given)
        )
        friction = tuple(_explained_better(robot, shared, each) for each in friction if shared)
        # a change of all torques of an axis includes its friction
        explained = {axis for each in causes for axis in each.axes}
        causes = (*causes, *(each for each in friction if not explained & {*each.axes}))
        stated = (*stated, *more)
    unexplained = not causes and instead.deviates
    return Excluded(found=causes, limits=stated, tests=len(tests), unexplained=unexplained)


def _explained_better(robot: Robot, shared: Battery, friction: Found) -> Found:
    """Return the cause that explains a change of an axis's friction better, if any.

    Torques that are late by T lack T dtau/dt, which has the sign of the speed where gravity acts
    and hides behind friction of each recording. Friction that all recordings share separates them.
    """
    own = friction.cause, friction.axes[0] - 1
    tests = {
        key: at
        for key, at in shared.columns.tests.items()
        if key[1] == own[1] and shared.visible[at].any()
    }
    level = shared.level / len(shared.columns.tests)
    likely = likeliest(shared, tests, level, partial(possible, robot, shared.evidence))
    if likely is None or likely[0] == own:
        return friction
    key, test = likely
    explains = explained_by(shared, tests, test.dispersion)
    if alike(explains.pop(own), explains[key]):
        return friction
    others = {each: tests[each] for each in explains}
    return Step(robot, key, test, shared, shared.extend(test.columns.tolist()), others).found


def _testable(robot: Robot, p: Array, battery: Battery, limit: Limit) -> Limit:
    """Return a limit; remove its size if recordings misread by this size would not show the cause.

    A first-order column holds for small sizes only. A size below `SETTLED`, in rad or as a share,
    needs no test: it changes the column by less than `SETTLED`, the accuracy of stated sizes.
    """
    if limit.cause not in FINITE or limit.size is None:
        return limit
    hours = float(np.ptp(battery.evidence.time)) / 3600.0
    largest = CAUSES[limit.cause].largest(robot, limit.axis - 1, hours)
    if limit.size < SETTLED / FIRST_ORDER * largest < np.inf:
        return limit
    key = limit.cause, limit.axis - 1
    k = min(battery.columns.tests[key], key=lambda k: float(battery.information[k]))
    for size in (limit.size, -limit.size):
        read = misread_battery(robot, p, battery, k, size)
        tests = {key: at for key, at in read.columns.tests.items() if read.visible[at].any()}
        level = battery.level / len(battery.columns.tests)
        likely = likeliest(read, tests, level, partial(possible, robot, read.evidence))
        explains = explained_by(read, tests, likely[1].dispersion) if likely else {}
        if not likely or key not in explains or not alike(explains[key], explains[likely[0]]):
            return limit.model_copy(update={"size": None})
    return limit


def explained_by(battery: Battery, tests: Tests, dispersion: float) -> dict[Key, float]:
    """Return the chi square explained by causes, beyond the average by chance.

    A slip happens once, so it explains the part of two successive instants.
    """

    def gain(columns: Sequence[int]) -> float:
        drop, rank = battery.drop(columns)
        return drop / dispersion - rank

    return {
        key: max(map(gain, pairwise(at))) if key[0] == "slip" else gain(at)
        for key, at in tests.items()
    }


@cache
def chance(rank: int, n_tests: int) -> float:
    """Return the greatest chi square expected by chance in several tests of a rank."""
    return float(special.chdtri(rank, LEVEL / max(n_tests, 1)))


def alike(gain: float, best: float) -> bool:
    """Return True if the data do not favour one of two causes."""
    return gain > min(best - TOGETHER, SAME**2 * best)


@dataclass(frozen=True)
class Step:
    """Found cause, with the test, and the batteries without and with the cause."""

    robot: Robot
    key: Key
    test: Test
    battery: Battery
    beside: Battery
    tests: Tests

    @property
    def left(self) -> float:
        """Least ratio over axes of residual mean squares with and without the cause."""
        return float((self.beside.left / self.battery.left).min())

    @property
    def unexplained(self) -> float:
        """Share of the explained part left by the cause's inexact column."""
        return (1.0 - SAME**2) if half_gap(self.robot, self.key) is None else BOUNCES

    @property
    def taken(self) -> float:
        """Chi square explained by the cause."""
        return self.battery.misfit - self.beside.misfit

    @property
    def found(self) -> Found:
        """Finding in words, with causes that explain the data equally well."""
        explains = explained_by(self.battery, self.tests, self.test.dispersion)
        same = [k for k, gain in explains.items() if alike(gain, explains[self.key])]
        tests = {k: self.battery.test(self.tests[k], itself=True) for k in same}
        confirmed = {k: self.battery.confirm(test) for k, test in tests.items() if test}
        may_be = {
            k: test
            for k, test in confirmed.items()
            if possible(self.robot, self.battery.evidence, k, test)
        }
        named = [
            (key, may_be[key], describe_size(self.robot, self.battery.columns, key, may_be[key]))
            for key in sorted(may_be, key=lambda k: rank_of(*k))
            # a slip before the first visible motion of an axis is a joint offset
            if key[0] != "slip" or ("joint offset", key[1]) not in may_be
            # for several gaps of an axis, the best one
            if half_gap(self.robot, key) is None
            or explains[key] == max(explains[k] for k in may_be if _is_gap(self.robot, k, key[1]))
        ]
        (key, test, detail), *others = named
        largest = int(np.argmax(np.abs(test.size)))
        # one battery at a time, since each holds all columns
        change, *other_changes = (self._change(key, test) for key, test, _ in named)
        return Found(
            cause=name_of(key),
            axes=axes_of(self.robot, key),
            detail=detail,
            left=self.left,
            others=tuple(located(axes_of(self.robot, key), words) for key, _, words in others),
            change=change,
            other_changes=tuple(other_changes),
            size=float(test.size[largest]),
            error=float(test.error[largest]),
        )

    def _change(self, key: Key, test: Test) -> tuple[float, ...]:
        """Return the likeliest change of the base parameters by fitting a cause in addition."""
        beside = self.beside if key == self.key else self.battery.extend(test.columns.tolist())
        change = beside.solution - self.battery.solution
        return tuple(shrunk(change, beside.covariance_root, self.battery.square(test)).tolist())


def _is_gap(robot: Robot, key: Key, axis: int) -> bool:
    return key[1] == axis and half_gap(robot, key) is not None


def _best_gaps(robot: Robot, battery: Battery, tests: Tests, level: float) -> Iterator[Key]:
    """Yield the best gap of each axis with significant backlash."""
    for axis in range(robot.n_joints):
        own = [key for key in tests if _is_gap(robot, key, axis)]
        key = max(own, key=lambda key: battery.drop(tests[key])[0], default=None)
        test = battery.test(tests[key], itself=True) if key else None
        if key and test and test.p < level and test.size[0] > 0.0:
            yield key


def scales_of_parts(robot: Robot, p: Array, evidence: Evidence) -> dict[Key, Common]:
    """Return the scales of causes from parts of the earlier recordings, see `battery`."""
    early = evidence.only(~evidence.is_later)
    early = replace(early, later=np.ones(len(early.axis), dtype=bool))
    every = columns(robot, p, early, ())
    return Battery(early, every, every.fitted).part_scales(parts_of(early.time))


def possible(robot: Robot, evidence: Evidence, key: Key, test: Test) -> bool:
    """Return True if a size is mechanically possible and within the validity of the column."""
    cause = CAUSES[name_of(key)]
    if (test.size < cause.least).any():
        return False
    gap = half_gap(robot, key)
    if gap is not None and not gap / WITHIN <= test.size[0] <= gap * WITHIN:
        return False
    hours = float(np.ptp(evidence.time)) / 3600.0
    return bool(np.abs(test.size).max() <= cause.largest(robot, key[1], hours))


def likeliest(
    battery: Battery,
    tests: Tests,
    level: float,
    admit: Callable[[Key, Test], bool] = lambda *_: True,
) -> tuple[Key, Test] | None:
    """Return the best admissible significant cause, tested with its own dispersion."""
    best: tuple[Key, Test] | None = None
    gain, white, n = 0.0, 1.0, len(tests)
    each = {key: battery.drop(at) for key, at in tests.items()}
    for key, (drop, rank) in sorted(each.items(), key=lambda item: -item[1][0]):
        if drop / white - chance(rank, n) <= gain:
            continue  # not significant even with the least possible dispersion
        test = battery.test(tests[key], itself=True)
        if test and test.p < level:
            test = battery.confirm(test)
        if test and test.p < level and admit(key, test):
            own = test.drop / test.dispersion - chance(rank, n)
            if own > gain:
                best, gain, white = (key, test), own, test.white
    return best


@dataclass(frozen=True)
class _Instead:
    """Comparison of found causes with other readings of the recordings."""

    robot: Robot
    evidence: Evidence
    first: Battery
    battery: Battery
    tests: Tests
    causes: tuple[Found, ...]
    beyond: bool

    @property
    def found(self) -> tuple[Found, ...]:
        """Findings after the comparison with other readings."""
        if self._deviation is not None:
            return self._find_change(self._deviation)
        white = self.evidence.overlap
        sound = self._scatter < max(CONTRADICTS, USUAL * white) and self._stated.possible
        large = any(each.left < LARGE for each in self.causes)
        beyond = self.beyond or (not large and self._stated.torn)
        if sound and not (beyond or large):
            return self.causes
        found = self._likeliest()
        if sound and beyond:
            return () if found is None or found.left > EXPLAINS else (found,)
        if found is not None:
            return (found,)
        if self.causes or sound:
            return self.causes
        times = np.sqrt(self._scatter / white)
        words = f"scatter between measurements is {times:.1f} times the scatter expected from noise"
        if not self._stated.possible:
            words = (
                "friction would accelerate an axis, or some motions would have negative "
                "kinetic energy"
            )
        return (Found(cause="unknown", axes=(), detail=words),)

    def _find_change(self, deviation: Deviation) -> tuple[Found, ...]:
        """Return the change that makes later recordings similar to earlier recordings, if any."""
        thin, _ = self._thin
        if self.causes and self.shows_changes:
            return self.causes
        if self._stated.possible and not deviation.significant(thin, self._stated.residual):
            return ()
        found = self._likeliest()
        return () if found is None else (found,)

    @property
    def shows_changes(self) -> bool:
        """True if the given causes are possible and explain the later recordings."""
        return self._explain(self.battery.given).possible and not self.deviates

    @cached_property
    def deviates(self) -> bool:
        """True if later recordings deviate from the earlier ones despite the given causes."""
        residual = self._explain(self.battery.given).residual
        return bool(self._deviation and self._deviation.significant(self._thin[0], residual))

    def _restores(self, deviation: Deviation, each: Alternative) -> bool:
        """Return True if a reading makes later recordings similar to the earlier ones."""
        thin, read = self._thin[0], each.explained.residual
        # the earlier recordings are read as stated, and dilute the mean squares of both together
        left = deviation.least_left(thin, read, self._stated.residual)
        return left <= LEAVES and not deviation.significant(thin, read)

    def _spoils(self, each: Alternative) -> bool:
        """Return True if a reading leaves more of an axis: the right one leaves noise alone."""
        degrees = np.maximum(self._stated.counts / self._scatter, 1.0)
        most = special.fdtri(degrees, degrees, 1.0 - LEVEL / len(self.tests))
        return bool((each.explained.left > most * self._stated.left).any())

    @cached_property
    def _deviation(self) -> Deviation | None:
        if self.evidence.later is None:
            return None
        thin, _ = self.evidence.thinned(ROWS)
        return Deviation.measure(self.robot, thin)

    @cached_property
    def _thin(self) -> tuple[Evidence, Array]:
        thin, at = self.evidence.thinned(ROWS)
        return thin.project_out_own(), self.battery.columns.values[at]

    @cached_property
    def _stated(self) -> Explained:
        return self._explain(self.battery.columns.fitted)

    def _explain(self, given: Sequence[int]) -> Explained:
        """Fit the stated reading with the given columns."""
        thin, values = self._thin
        stated, more = Reading.stated(self.robot), values[:, list(given)]
        return explained(self.robot, thin, stated, more, dispersion=self._scatter)

    @cached_property
    def _scatter(self) -> float:
        """Median dispersion; for a change, at least that of parts of the earlier recordings."""
        scales = (self.battery.common.values(), self.battery.unchanged.values())
        medians = [np.median([each.dispersion for each in scale]) for scale in scales if scale]
        return max(1.0, *map(float, medians))

    def _gain(self, each: Explained, n: int) -> float:
        """Return the chi square explained by a reading, or by columns, with `n` unknowns."""
        explains = self._stated.misfit - each.misfit
        return explains - chance(n, len(self.tests)) if n else explains

    def _likeliest(self) -> Found | None:
        """Return the best reading and equally good readings, unless columns explain more."""
        tests = self.battery.columns.tests
        # the axis whose slip explains most to first order
        slips = [key for key in tests if key[0] == "slip"]
        slipped = max(slips, key=lambda key: self.first.drop(tests[key]))[1]
        every = [
            (self._gain(each.explained, int(not np.isnan(each.size))), each)
            for each in alternatives(self._stated, self.first.sizes, slipped)
            # a size must be as significant as that of a column
            if np.isnan(each.size) or each.chi_square > chance(1, len(self.tests))
            if self._deviation is None or self._restores(self._deviation, each)
            if not self._spoils(each)
        ]
        best = max((gain for gain, _ in every), default=-np.inf)
        if best < (chance(1, len(self.tests)) if self._stated.possible else -TOGETHER):
            return None
        given = self._explain(self.battery.given)
        rival = self.causes and given.possible and self._deviation is None
        if rival and not alike(best, self._gain(given, 0)):
            return None
        same = [each for gain, each in every if alike(gain, best)]
        zeros = [each.axes for each in same if each.cause == "joint offset"]
        # a slip before the first measurement is a joint offset
        same = [each for each in same if each.cause != "slip" or each.axes not in zeros]
        same.sort(key=lambda each: rank_of(each.cause, *each.axes))
        words = [describe_reading(self.robot, each) for each in same]
        named = [
            located([axis + 1 for axis in each.axes], text)
            for each, text in zip(same, words, strict=True)
        ]
        for cause in self.causes:  # a load explains the data like a joint offset of the last axes
            if cause.cause == "load":
                at = self.tests["load", -1]
                load = self._explain([*self.battery.columns.fitted, *at])
                if load.possible and alike(self._gain(load, len(at)), best):
                    return cause.model_copy(update={"others": tuple(named)})
        first = same[0]
        change, *other_changes = (
            tuple((each.explained.p - self._stated.p).tolist()) for each in same
        )
        return Found(
            cause=first.cause,
            axes=tuple(axis + 1 for axis in first.axes),
            detail=words[0],
            left=float((first.explained.left / self._stated.left).min()),
            others=tuple(named[1:]),
            change=change,
            other_changes=tuple(other_changes),
            size=None if np.isnan(first.size) else first.size,
            error=None if np.isnan(first.error) else first.error,
        )
