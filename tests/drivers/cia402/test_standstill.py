"""Standstill and arrival of an axis: the edges of band and window are included."""

from __future__ import annotations

import pytest

from drivers.cia402.set_point import Phase, SetPoint, Standstill
from drivers.cia402.states import Status

REACHED, ACKNOWLEDGE = Status.TARGET_REACHED, Status.SET_POINT_ACKNOWLEDGE


def arrived_at(position: int) -> SetPoint:
    """Return a set-point of 1000 with tolerance 10 whose axis came to rest at `position`."""
    set_point = SetPoint(1000, window=10.0, rest=Standstill(band=2.0, count=2))
    for word in (0, ACKNOWLEDGE, 0, *[REACHED] * 4):
        set_point.step(word, position)
    return set_point


def test_an_axis_rests_that_stays_as_far_from_one_value_as_its_band_is_wide() -> None:
    rest = Standstill(band=2.0, count=3)
    assert [rest.update(position) for position in (0, 2, -2, 2)] == [False, False, False, True]


def test_an_axis_that_leaves_its_band_has_to_keep_still_from_there_on_anew() -> None:
    rest = Standstill(band=2.0, count=3)
    shown = [rest.update(position) for position in (0, 0, 0, 3, 3, 3, 3)]
    assert shown == [False] * 6 + [True]


@pytest.mark.parametrize("position", [990, 1010])
def test_the_edge_of_the_position_window_is_still_the_target(position: int) -> None:
    assert arrived_at(position).phase is Phase.REACHED


@pytest.mark.parametrize("position", [989, 1011])
def test_an_axis_that_rests_one_count_beside_its_window_has_not_arrived(position: int) -> None:
    assert arrived_at(position).phase is Phase.TRAVELLING
