"""Homing mode of the plant's drives, with ideal axes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from sim_plant.canopen.abort_codes import SdoAbort

if TYPE_CHECKING:
    from desk import Desk

START, ENABLED, HALTED = 0x1F, 0x0F, 0x10F
REACHED, ATTAINED = 1 << 10, 1 << 12
SWITCH = 1_000_000
"""Positions of the limit switches of the ideal drives, on either side [increments]."""


@pytest.fixture
def homing(desk: Desk) -> Desk:
    """Return a drive enabled in homing mode, at some distance from its switches."""
    desk.machine.axes[0].demand = 950_000.0
    desk.write(0x6060, 6)
    desk.write(0x6099, 400_000, subindex=1)
    desk.write(0x6099, 20_000, subindex=2)
    for deceleration in (0x609A, 0x6084, 0x6085):
        desk.write(deceleration, 4_000_000)
    desk.sync(2)
    desk.enable()
    desk.sync(2)
    return desk


def bits(desk: Desk) -> int:
    return desk.status() & (REACHED | ATTAINED)


def test_before_it_was_started_nothing_is_attained(homing: Desk) -> None:
    assert bits(homing) == REACHED


def test_the_present_position_is_home_at_once(homing: Desk) -> None:
    homing.write(0x607C, -500)
    homing.write(0x6040, START)
    homing.sync(2)
    assert homing.read(0x6064) == -500
    assert bits(homing) == REACHED | ATTAINED


def test_the_edge_of_the_switch_is_home_and_the_axis_rests_beside_it(homing: Desk) -> None:
    homing.write(0x6098, 18)
    homing.write(0x607C, 7_000)
    homing.write(0x6040, START)
    homing.sync(10)
    assert bits(homing) == 0
    homing.sync(500)
    assert bits(homing) == REACHED | ATTAINED
    assert 6_000 < homing.read(0x6064) <= 7_000


def test_the_switch_stays_where_it_is_whatever_it_is_called(homing: Desk) -> None:
    homing.write(0x6098, 18)
    homing.write(0x607C, 0)
    for _ in range(2):
        homing.write(0x6040, ENABLED)
        homing.write(0x6040, START)
        homing.sync(500)
        assert bits(homing) == REACHED | ATTAINED
        assert -1_000 < homing.read(0x6064) <= 0


@pytest.mark.parametrize("word", [ENABLED, HALTED | 0x10])
def test_the_search_ends_when_the_start_bit_falls_or_by_halt(homing: Desk, word: int) -> None:
    homing.write(0x6098, 17)
    homing.write(0x6040, START)
    homing.sync(20)
    homing.write(0x6040, word)
    homing.sync(200)
    before = homing.read(0x6064)
    homing.sync(50)
    assert homing.read(0x6064) == before
    assert not homing.status() & ATTAINED


def test_leaving_the_mode_stops_a_search(homing: Desk) -> None:
    homing.write(0x6098, 17)
    homing.write(0x6040, START)
    homing.sync(20)
    homing.write(0x6060, 1)
    homing.sync(200)
    before = homing.read(0x6064)
    homing.sync(50)
    assert homing.read(0x6064) == before


def test_a_method_that_does_not_exist_is_refused(homing: Desk) -> None:
    with pytest.raises(SdoAbort):
        homing.write(0x6098, 3)


def test_a_reset_leads_back_to_profile_position(homing: Desk) -> None:
    homing.nmt(129, 1)
    homing.sync(2)
    assert homing.read(0x6061) == 1
