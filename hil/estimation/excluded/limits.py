"""Exclusion limits: smallest detectable sizes of causes, and the torque at these sizes.

A cause at its limit is found with a probability of 80 %, from the noncentral F of the cause's own
test. For a change, the insignificant size that recordings show is added: this size hides a change
of the other sign, and models of real machines are never exact. A cause within the span of the
estimated columns never shows.
"""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from hil.estimation.excluded.backlash import WITHIN, half_gap
from hil.estimation.excluded.causes import CAUSES
from hil.estimation.excluded.result import Limit
from hil.estimation.excluded.words import name_of, rank_of, unit_of
from hil.friction.equation import LOAD

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array
    from hil.estimation.excluded.battery import Battery
    from hil.estimation.excluded.causes import Key
    from hil.estimation.excluded.columns import Columns
    from hil.model.robot import Robot

POWER = 0.8
"""Probability of finding a cause of the stated size (Cohen, Statistical Power Analysis for the
Behavioral Sciences, 1988, p. 56)."""
ROUNDS, SETTLED = 100, 0.01
"""Maximum number of corrections of sizes for their own part in the weights, and the largest final
relative change: 20 000 random cases, with axes that differ in information and mean square by a
log-normal factor of sigma 3, converge within 56 corrections."""
ROOT = 1e-5
"""Relative accuracy of the root of a squared size."""
MIDDLES = (np.arange(200) + 0.5) / 200
"""Probabilities for the quadrature over a chi square."""


def limits(
    robot: Robot, battery: Battery, every: Columns, n_tests: int, leaves: float = 1.0
) -> tuple[Limit, ...]:
    """Return the smallest detectable sizes; `leaves` as in `finding.excluded`."""
    torque = torque_shares(battery)
    found = [
        limit_of(robot, battery, key, part, size, each)
        for key, at in every.tests.items()
        if key[0] not in every.free
        # friction of the load that is fitted anyway shows no cause
        and not (
            key[0] == "friction of the load"
            and battery.evidence.own[battery.evidence.axis == key[1], LOAD:].any()
        )
        for part, size, each in _sizes(battery, key, at, torque, n_tests, leaves)
    ]
    hardest: dict[tuple[str, int, str], Limit] = {}  # size of torque ripple over all orders
    for each in sorted(found, key=lambda each: rank_of(each.cause, each.axis)):
        at = each.cause, each.axis, each.part
        # one visible gap suffices, regardless of larger gaps
        rank = -1.0 if each.cause == "backlash" else 1.0
        if at not in hardest or rank * _hard(each) > rank * _hard(hardest[at]):
            hardest[at] = each
    return tuple(hardest.values())


def limit_of(
    robot: Robot, battery: Battery, key: Key, part: str, size: float, torque: float
) -> Limit:
    """Return the limit of a cause with a first-order size, and the torque share of a unit."""
    size = _true_size(robot, battery, key, size)
    return Limit(
        cause=name_of(key),
        axis=key[1] + 1,
        part=part,
        unit=unit_of(robot, key, part),
        size=size if np.isfinite(size) else None,
        torque=torque,
    )


def _true_size(robot: Robot, battery: Battery, key: Key, size: float) -> float:
    """Return the size of a cause with the first-order size `size`.

    For a gain 1 / (1 + x) the column shows x / (1 + x), less than x in one direction and more in
    the other. A size too large for its column is rejected (`finding.possible`), so no such size is
    found.
    """
    cause, gap = CAUSES[name_of(key)], half_gap(robot, key)
    if gap is not None:
        return max(size, gap / WITHIN) if size <= gap * WITHIN else np.inf
    hours = float(np.ptp(battery.evidence.time)) / 3600.0
    largest = cause.largest(robot, key[1], hours)
    if cause.unit_of(robot, key[1]) == "%":
        size = size / (1.0 - size / 100.0) if size < 100.0 else np.inf
        largest /= 1.0 + largest / 100.0
    return size if size <= largest else np.inf


def _hard(limit: Limit) -> float:
    return np.inf if limit.size is None else limit.size


def _sizes(
    battery: Battery, key: Key, at: Sequence[int], torque: Array, n_tests: int, leaves: float
) -> Iterator[tuple[str, float, float]]:
    """Yield parts of a cause, with the smallest detectable size and the torque of a unit."""
    each = smallest(battery, at, n_tests, leaves)
    size = dict(zip(at, each.tolist(), strict=True))
    if key[0] == "load":
        for k in at:
            yield battery.columns.names[k].part, size[k], float(torque[k])
    else:  # the least visible of several columns
        worst = max(at, key=size.__getitem__)
        yield "", size[worst], float(torque[worst])


def smallest(battery: Battery, at: Sequence[int], n_tests: int, leaves: float = 1.0) -> Array:
    """Return the smallest size found with `POWER` for each column of a cause, acting alone.

    A cause that leaves at most the share `leaves` of some axis's mean square adds at least
    1 / leaves - 1 times the mean square without the cause.
    """
    change = battery.evidence.later is not None
    test, found = battery.test(at, itself=change), np.full(len(at), np.inf)
    if test is not None:
        degrees, level = math.floor(10.0 * test.degrees) / 10.0, battery.level / n_tests
        columns = test.columns
        need = noncentrality(test.rank, degrees, level) * test.dispersion
        # noise grows with a cause's effect outside its column: s^2 I = need (1 + s^2 elsewhere)
        information = battery.information[columns] - need * battery.elsewhere[columns]
        seen = np.abs(battery.alone(columns)) if change else 0.0
        small = np.sqrt(need / np.where(information > 0.0, information, np.nan)) + seen
        squares, each = battery.squares(columns), small
        for _ in range(ROUNDS):
            before, each = each, small * battery.outweighed(squares, each)
            if not (np.abs(each / before - 1.0) > SETTLED).any():
                break
        if change:
            each = np.maximum(each, battery.least_change(columns) + seen)
        if leaves < 1.0:
            each = np.maximum(each, np.sqrt((1.0 / leaves - 1.0) / battery.most(squares)))
        found[np.isin(at, columns)] = np.where(information > 0.0, each, np.inf)
    return found


@cache
def noncentrality(rank: int, degrees: float, level: float) -> float:
    r"""Return the squared size, over the estimated variance, for detection with `POWER`.

    Noncentral F assumes a known variance. Here size and limit use the same estimate of the
    variance, :math:`s` times the true one, with :math:`d s` distributed as chi square with
    :math:`d` degrees of freedom,

    .. math:: P = \int P(\chi'^2_r(\lambda s) > r F s) \, p(s) \, ds ,

    which for one column is Student's t about :math:`\sqrt\lambda`.
    """
    limit = rank * float(special.fdtri(rank, degrees, 1.0 - level))
    s = special.chdtri(degrees, MIDDLES) / degrees

    def missed(root: float) -> float:
        return float(special.ndtri(special.chndtr(limit * s, rank, root**2 * s).mean()))

    # the probit of the probability is almost linear in the root: the secant method converges; at
    # one degree of freedom, SciPy's brentq and newton go on to sizes whose probability is NaN
    at, goal = math.sqrt(limit), float(special.ndtri(1.0 - POWER))
    value, step = missed(at), -goal
    while abs(step) > ROOT * at:
        at, before = at + step, value
        value = missed(at)
        step *= (goal - value) / (value - before)
    return (at + step) ** 2


def torque_shares(battery: Battery) -> Array:
    """Return the share of recorded torque due to a unit of each column, largest over axes."""
    e, found = battery.evidence, np.zeros(len(battery.columns.names))
    for axis in np.unique(e.axis):
        rows = e.axis == axis
        square = float(e.recorded[rows] @ e.recorded[rows])
        if square > 0:
            values = battery.columns.values[rows]
            found = np.maximum(found, np.sqrt(np.einsum("ij,ij->j", values, values) / square))
    return found
