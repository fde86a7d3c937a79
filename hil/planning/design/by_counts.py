"""Choice of configurations and motions from g(q) and M(q), section 6.2.

From the candidates of an element (`hil.planning.design.measurable_elements`) those with the largest
increase of the determinant of the group's information matrix are taken in turn (Fedorov's greedy
D-optimal choice). Each element gets measurements in proportion to the number of parameters in its
rows. The number of measurements of each kind is given here, and chosen to fit a duration in
`hil.planning.design.by_minutes`.

A constant gravity torque cannot be distinguished from a torque offset by any number of
measurements: such an axis gets few measurements, and its parameters are determined from moments of
inertia (`Dependencies.hidden`).

The order minimises travel: the nearest neighbour comes next. In a guarded
workspace every travel keeps clear of the forbidden boxes: the next configuration is the nearest one
with a clear travel. Configurations not reached this way are inserted afterwards, between two
measurements with clear travels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from hil.model.base_parameters import base_parameters
from hil.planning.design.measurable_elements import ELEMENTS, candidates
from hil.planning.measurement import ELEMENT_KINDS
from hil.planning.plan import Plan, make_plan
from hil.planning.timetable import travel_times, travels
from hil.planning.workspace import are_clear, narrow_ranges

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.design.measurable_elements import Element
    from hil.planning.measurement import Measurement
    from hil.planning.workspace import Workspace

    Chosen = tuple[Element, list[float], int]
    """Element, configuration and number of a measurement."""
    from hil.arrays import Mask
    from hil.planning.timetable import Travels


COUNTS = {name: kind.count for name, kind in ELEMENT_KINDS.items()}
"""Default number of measurements of each kind, for a campaign as long as that of section 8."""
LEAST_SHARE = 4
"""Minimum number of measurements of an element, however few parameters its row holds."""


def design(
    robot: Robot,
    counts: Mapping[str, int] | None = None,
    warm_up: float = 0.0,
    workspace: Workspace | None = None,
) -> Plan:
    """Plan a campaign for `robot`.

    Parameters
    ----------
    counts : mapping, optional
        Number of measurements by kind. The default of a kind is in `COUNTS`, increased for many
        parameters, and reduced for constant gravity. A kind without parameters is left out.
    warm_up : float
        Motion before the first measurement; 0 for none [s].
    workspace : Workspace, optional
        Workspace to keep clear, stored in the plan.

    Raises
    ------
    ValueError
        A count too small to identify the group's parameters, or no clear configurations.
    """
    groups = base_parameters(robot).groups
    for name, count in (counts or {}).items():
        least = len(groups[group := ELEMENT_KINDS[name].group])
        if count < least:
            raise ValueError(
                f"{count} measurements for the {group} group must be at least {least}, one for "
                "each parameter; raise the count"
            )
    sought = base_parameters(robot).dependencies.sought()
    guarded = narrow_ranges(robot, workspace)
    measurements: list[Measurement] = []
    for name, kind in ELEMENT_KINDS.items():
        columns = sought[kind.group]
        if columns:
            elements = ELEMENTS[name](guarded, list(columns))
            # by default at least 3 measurements per parameter
            usual = max(COUNTS[name], 3 * len(columns))
            wanted = (counts or {}).get(name)
            spread = [candidates(guarded, element, workspace) for element in elements]
            weighted = [
                element.row(q) / guarded.torque_limit[element.axis]
                for element, q in zip(elements, spread, strict=True)
            ]
            scale = np.sqrt(np.mean(np.concatenate(weighted) ** 2, axis=0))
            covariance = 1e3 * np.eye(len(scale))
            chosen: list[Chosen] = []
            for element, q, rows, share in zip(
                elements, spread, weighted, _shares(elements, weighted, wanted, usual), strict=True
            ):
                picked = greedy(rows / scale, places(guarded, q), covariance, share)
                chosen += [
                    (element, element.turn_motors(guarded, q[index], k), k)
                    for k, index in enumerate(picked, start=1)
                ]
            middle = (guarded.q_min + guarded.q_max) / 2
            order = nearest_first(guarded, middle, np.array([q for _, q, _ in chosen]))
            measurements += [
                element.measure(f"{kind.letter}{k:02d}", q, number)
                for k, (element, q, number) in enumerate((chosen[i] for i in order), start=1)
            ]
    if workspace:
        measurements = guarded_tour(guarded, workspace, measurements)
    return make_plan(robot, measurements, warm_up, workspace)


def greedy(rows: Array, places: Array, covariance: Array, count: int) -> list[int]:
    """Choose `count` rows in turn by the largest increase of det(information).

    Candidates close to a chosen one are passed over while there are others, so that the
    measurements show a dependence on the configuration that the model lacks. `covariance`, the
    inverse of the information so far, is updated in place.
    """
    left = np.ones(len(rows), dtype=bool)
    picked: list[int] = []
    for _ in range(count):
        if not left.any():
            left[:] = True
        gain = np.einsum("ij,jk,ik->i", rows, covariance, rows)
        best = int(np.argmax(np.where(left, gain, -1.0)))
        direction = covariance @ rows[best]
        covariance -= np.outer(direction, direction) / (1.0 + gain[best])
        # minimum distance between configurations: 6 % of the range in at least one joint
        left &= np.abs(places - places[best]).max(axis=1, initial=0.0) > 0.06
        picked.append(best)
    return picked


def places(robot: Robot, q: Array) -> Array:
    """Return configurations as shares of the joint ranges, without joints held constant."""
    varied = np.ptp(q, axis=0) > 0
    return (q / (robot.q_max - robot.q_min))[:, varied]


def _shares(
    elements: Sequence[Element], rows: Sequence[Array], count: int | None, usual: int
) -> list[int]:
    """Divide `count` among elements in proportion to the parameters in every row.

    Elements that cannot be distinguished from an offset get few measurements, unless all elements
    are of this kind.
    """
    varying = [
        not e.like_offset or bool(np.ptp(r, axis=0).any())
        for e, r in zip(elements, rows, strict=True)
    ]
    if not any(varying):
        count = count or LEAST_SHARE * len(rows)
        varying = [True] * len(rows)
    held = [max(1, int(np.any(np.abs(r) > 1e-12, axis=0).sum())) for r in rows]
    shown = [own if varies else 0 for own, varies in zip(held, varying, strict=True)]
    # in proportion, with a minimum share
    total = count or usual
    least = min(LEAST_SHARE, total // len(shown))
    spare = total - least * len(shown)
    exact = [spare * h / sum(shown) for h in shown]
    shares = [least + int(e) for e in exact]
    by_rest = sorted(range(len(exact)), key=lambda j: int(exact[j]) - exact[j])
    for i in by_rest[: total - sum(shares)]:
        shares[i] += 1
    return shares


M = TypeVar("M", bound="Measurement")
TRAVEL: float = Plan.model_fields["travel"].default
"""Share of the limits used between configurations."""


def nearest_first(robot: Robot, here: Array, places: Array) -> list[int]:
    """Return the numbers of `places` (n, n_joints) in nearest-neighbour order of travel time.

    The first place is the nearest to `here`.
    """
    left, tour = list(range(len(places))), list[int]()
    while left:
        times = travel_times(robot, here, places[left], TRAVEL)
        tour.append(left.pop(int(np.argmin(times))))
        here = places[tour[-1]]
    return tour


def guarded_tour(robot: Robot, workspace: Workspace, measurements: Sequence[M]) -> list[M]:
    """Order `measurements` so that travels are clear.

    Raises
    ------
    ValueError
        No clear travel leads to a measurement.
    """
    starts = np.array([measurement.start for measurement in measurements])
    ways = _Ways(robot, workspace, starts)
    tour: list[int] = []
    # up to 8 measurements are tried as the first
    for first in range(min(8, len(measurements))):
        tour = max(tour, ways.greedy(first), key=len)
        if len(tour) == len(measurements):
            break
    for stray in sorted(set(range(len(measurements))) - set(tour)):
        if not ways.insert(tour, stray):
            raise ValueError(
                f"{measurements[stray].id}: no collision-free travel to or from it; make "
                "boxes or margin smaller, or narrow the joint ranges of the workspace to one "
                "side of the obstacle"
            )
    return [measurements[number] for number in tour]


@dataclass(frozen=True, eq=False)
class _Ways:
    """Travels between configurations `starts`, shape (n, n_joints)."""

    robot: Robot
    workspace: Workspace
    starts: Array

    def greedy(self, first: int) -> list[int]:
        """Visit the nearest remaining configuration from `first` on while travels are clear."""
        left = [number for number in range(len(self.starts)) if number != first]
        tour = [first]
        while (following := self._nearest(tour[-1], left)) is not None:
            left.remove(following)
            tour.append(following)
        return tour

    def insert(self, tour: list[int], stray: int) -> bool:
        """Insert `stray` where both travels are clear; return False if there is no such place."""
        strays = [stray] * len(tour)
        to = np.append(True, self._clear(tour, strays))
        back = np.append(self._clear(strays, tour), True)
        places = np.flatnonzero(to & back)
        if len(places):
            tour.insert(int(places[-1]), stray)
        return len(places) > 0

    def _nearest(self, here: int, left: list[int], at_once: int = 4) -> int | None:
        """Return the nearest reachable configuration; travels are checked in small groups."""
        durations = self._travels([here] * len(left), left).high[:, 0]
        order: list[int] = np.argsort(durations, kind="stable").tolist()
        for first in range(0, len(left), at_once):
            some = [left[k] for k in order[first : first + at_once]]
            clear = self._clear([here] * len(some), some)
            if clear.any():
                return some[int(clear.argmax())]
        return None

    def _clear(self, begins: list[int], ends: list[int]) -> Mask:
        return are_clear(self.robot, self.workspace, self._travels(begins, ends))

    def _travels(self, begins: list[int], ends: list[int]) -> Travels:
        return travels(self.starts[begins], self.starts[ends], TRAVEL, self.robot)
