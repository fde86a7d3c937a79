"""Order of measurements by nearest neighbour.

In a guarded workspace every travel keeps clear of the forbidden boxes: the next configuration is
the nearest one with a clear travel. Configurations not reached this way are inserted afterwards,
between two measurements with clear travels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from hil.planning.clearance import are_clear
from hil.planning.plan import Plan
from hil.planning.timetable import travel_times, travels

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Mask
    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.planning.timetable import Travels
    from hil.planning.workspace import Workspace


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
