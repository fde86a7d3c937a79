"""Wrapped buses: a sample of a streamed path costs no additional requests."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from drivers.drive_bus import DriveRefused
from hil.measuring.feeding import BusInFront

if TYPE_CHECKING:
    from conftest import IdealBus


class Streamed:
    """Bus that follows set-points, and counts requests for positions."""

    period, axes, notes = 0.004, (), ()

    def __init__(self) -> None:
        self.asked = 0

    @property
    def path_index(self) -> float:
        self.asked += 1
        return 7.0

    def stream(self, *path: object) -> None:
        self.path = path

    def nothing(self, *_: object) -> None:
        """Do nothing: substitute for unused methods of a bus."""

    __enter__ = __exit__ = move = sample = samples = halt = reset = nothing


def test_where_a_path_is_is_asked_of_the_bus_behind_once() -> None:
    behind = Streamed()
    bus = BusInFront(BusInFront(BusInFront(BusInFront(behind))))  # type: ignore[arg-type]
    bus.stream([[0.0]])
    behind.asked = 0
    assert bus.path_index == 7.0
    assert behind.asked == 1


def test_without_a_path_it_is_at_its_beginning(ideal_bus: IdealBus) -> None:
    assert BusInFront(ideal_bus).path_index == 0.0


def test_drives_that_follow_no_set_points_are_refused(ideal_bus: IdealBus) -> None:
    with pytest.raises(DriveRefused, match="accept no cyclic set-points"):
        BusInFront(BusInFront(ideal_bus)).stream([[0.0]])
