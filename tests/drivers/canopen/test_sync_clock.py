"""Source of SYNC's time: lock-step or wall clock."""

from __future__ import annotations

from itertools import pairwise

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.canopen.sync_clock import choose_sync_clock
from drivers.fieldbus import TOO_LATE
from drivers.sync_clock import PATIENCE, PAUSE, WINDOW, LockStep, WallClock

PERIOD = 0.01


class Clock:
    def __init__(self) -> None:
        self.time = 100.0

    def __call__(self) -> float:
        return self.time


class SteppedBus(can.bus.BusABC):
    lock_step = True

    def __init__(self) -> None:
        super().__init__("stepped")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        raise NotImplementedError


@pytest.fixture
def virtual() -> can.BusABC:
    return can.Bus("pacing", "virtual", ignore_config=True)


def test_a_bus_that_offers_lock_step_is_taken_at_its_word() -> None:
    bus = SteppedBus()
    pacing = choose_sync_clock(bus, "auto", PERIOD)
    bus.shutdown()
    assert isinstance(pacing, LockStep)
    assert pacing.synchronous


def test_every_other_bus_keeps_the_wall_clock(virtual: can.BusABC) -> None:
    with virtual:
        assert isinstance(choose_sync_clock(virtual, "auto", PERIOD), WallClock)


def test_lock_step_on_request_waits_patiently_for_a_plant_in_another_thread(
    virtual: can.BusABC,
) -> None:
    with virtual:
        pacing = choose_sync_clock(virtual, "lock-step", PERIOD)
    assert isinstance(pacing, LockStep)
    assert not pacing.synchronous


def test_the_wall_clock_on_request_is_kept_even_on_a_stepped_bus() -> None:
    bus = SteppedBus()
    assert isinstance(choose_sync_clock(bus, "wall-clock", PERIOD), WallClock)
    bus.shutdown()


def test_lock_step_counts_periods_and_is_always_due() -> None:
    pacing = LockStep(PERIOD, synchronous=True)
    assert pacing.due() == 0.0
    assert [pacing.note_sent() for _ in range(3)] == [1 * PERIOD, 2 * PERIOD, 3 * PERIOD]
    assert pacing.now() == 3 * PERIOD
    assert pacing.window() == 0.0


def test_lock_step_with_another_thread_gives_it_a_limited_time() -> None:
    clock = Clock()
    pacing = LockStep(PERIOD, synchronous=False, clock=clock)
    pacing.note_sent()
    assert pacing.window() == pytest.approx(PATIENCE)
    clock.time += PATIENCE + 1
    assert pacing.window() == 0.0


def test_the_wall_clock_keeps_absolute_deadlines_without_drift() -> None:
    clock = Clock()
    pacing = WallClock(PERIOD, clock=clock)
    for number in range(100):
        clock.time += pacing.due()
        assert clock.time == pytest.approx(100.0 + number * PERIOD)
        pacing.note_sent()
        clock.time += 0.3 * PERIOD


def test_a_sync_that_is_a_little_late_does_not_shift_the_next_deadline() -> None:
    clock = Clock()
    pacing = WallClock(PERIOD, clock=clock)
    clock.time += 0.4 * PERIOD
    assert pacing.due() == 0.0
    assert pacing.note_sent() == pytest.approx(0.4 * PERIOD)
    assert pacing.due() == pytest.approx(0.6 * PERIOD)
    assert pacing.skipped == 0


def test_missed_deadlines_are_skipped_and_counted_never_made_up_for() -> None:
    clock = Clock()
    pacing = WallClock(PERIOD, clock=clock)
    pacing.due()
    pacing.note_sent()
    clock.time += 4.7 * PERIOD
    assert pacing.due() == pytest.approx(0.3 * PERIOD)
    assert pacing.skipped == 4
    clock.time += pacing.due()
    pacing.note_sent()
    assert pacing.due() == pytest.approx(PERIOD)


def test_after_a_pause_the_grid_goes_on_and_nothing_counts_as_skipped() -> None:
    clock = Clock()
    pacing = WallClock(PERIOD, clock=clock)
    pacing.due()
    pacing.note_sent()
    clock.time += PAUSE + 3.7 * PERIOD
    left = pacing.due()
    assert left == pytest.approx(0.3 * PERIOD)
    clock.time += left
    pacing.note_sent()
    assert pacing.skipped == 0
    assert pacing.due() == pytest.approx(PERIOD)


def test_answers_have_a_share_of_the_period() -> None:
    clock = Clock()
    pacing = WallClock(PERIOD, clock=clock)
    pacing.note_sent()
    assert pacing.window() == pytest.approx(WINDOW * PERIOD)
    clock.time += PERIOD
    assert pacing.window() == 0.0


def test_a_sync_that_its_sender_woke_too_late_for_takes_the_place_of_the_next() -> None:
    clock = Clock()
    pacing = WallClock(PERIOD, clock=clock)
    clock.time += pacing.due() + 0.8 * PERIOD
    assert pacing.note_sent() == pytest.approx(0.8 * PERIOD)
    assert pacing.due() == pytest.approx(1.2 * PERIOD)
    assert pacing.skipped == 1


@given(st.lists(st.tuples(st.floats(0, 0.6), st.floats(0, 0.6)), min_size=2, max_size=50))
def test_however_late_the_caller_comes_or_wakes_syncs_never_come_in_bursts(
    late: list[tuple[float, float]],
) -> None:
    clock = Clock()
    pacing = WallClock(PERIOD, clock=clock)
    instants = []
    for overslept, stay in late:
        due = pacing.due()
        clock.time += due + overslept * (due > 0)
        instants.append(pacing.note_sent())
        clock.time += stay
    gaps = [after - before for before, after in pairwise(instants)]
    assert min(gaps) >= (1 - TOO_LATE) * PERIOD * (1 - 1e-6)
