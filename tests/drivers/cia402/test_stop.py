"""Stop of one axis: commanded until obeyed, bounded in distance
and time, off only when confirmed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.cia402.set_point import Standstill
from drivers.cia402.states import Command
from drivers.cia402.stop import (
    OFF_TIME,
    OFF_TIME_MOVING,
    STOP_DELAY,
    UNSENT_TIME,
    AxisStop,
    StopBound,
    StopPhase,
)

if TYPE_CHECKING:
    from collections.abc import Callable

PERIOD = 0.004
SETTLED = 10
SETTLING = (SETTLED + 2) * PERIOD
ENABLED, STOPPING, READY, OFF, FAULT = 0x27, 0x07, 0x21, 0x40, 0x08
SPEED, DECELERATION, WINDOW = 1000.0, 5000.0, 20.0
WORDS = st.sampled_from([ENABLED, STOPPING, READY, OFF, FAULT, 0x23, 0x0F, 0x00, 0x6F])


def stop(speed: float = SPEED) -> AxisStop:
    return AxisStop(
        0.0,
        0.0,
        0,
        speed=speed,
        deceleration=DECELERATION,
        window=WINDOW,
        rest=Standstill(2.0, SETTLED),
        settling=SETTLING,
    )


def run(
    axis: AxisStop,
    word: Callable[[AxisStop, float], int],
    position: Callable[[float], float],
    *,
    fresh: Callable[[float], bool] = lambda _: True,
    sendable: Callable[[float], bool] = lambda _: True,
    until: Callable[[AxisStop], bool] = lambda axis: axis.ended,
    limit: float = 20.0,
) -> float:
    """Count SYNCs until a condition holds; return the instant [s]."""
    time = 0.0
    if sendable(time):
        axis.note_sent(time)
    while not until(axis):
        time += PERIOD
        assert time < limit, axis.phase
        if axis.unsent is not None and sendable(time):  # as before every SYNC
            axis.note_sent(time)
        command = axis.step(time, word(axis, time), round(position(time)), fresh=fresh(time))
        if command is not None and sendable(time):
            axis.note_sent(time)
    return time


def braking(time: float) -> float:
    """Return the position of an axis with the stated deceleration."""
    time = min(time, SPEED / DECELERATION)
    return SPEED * time - DECELERATION * time**2 / 2


def test_the_bound_follows_from_speed_and_stated_deceleration() -> None:
    bound = StopBound.compute(2.4, 15.0, 0.05)
    assert bound.time == pytest.approx(0.1 + 1.5 * 2.4 / 15.0)
    assert bound.way == pytest.approx(0.05 + 0.24 + 1.5 * 2.4**2 / 30.0)
    assert bound.time <= 0.5
    assert bound.way <= 1.0


def test_quick_stop_is_commanded_at_every_sync_until_the_drive_shows_that_it_obeys() -> None:
    axis = stop()
    axis.note_sent(0.0)
    commands = [axis.step(PERIOD * n, ENABLED, 0, fresh=True) for n in range(1, 6)]
    assert commands == [Command.QUICK_STOP] * 5
    assert axis.step(PERIOD * 6, STOPPING, 0, fresh=False) is Command.QUICK_STOP
    assert axis.step(PERIOD * 7, STOPPING, 0, fresh=True) is None


def test_an_axis_that_slows_down_as_stated_rests_within_its_bound() -> None:
    axis = stop()
    time = run(axis, lambda *_: STOPPING, braking, until=lambda a: a.phase is StopPhase.RESTING)
    assert time <= axis.bound.time + SETTLING
    assert axis.overrun is None


def test_an_axis_that_does_not_slow_down_loses_its_voltage_at_the_bound_of_its_way() -> None:
    axis = stop()
    time = run(
        axis,
        lambda *_: STOPPING,
        lambda t: SPEED * t,
        until=lambda a: a.phase is StopPhase.DISABLING,
    )
    assert SPEED * time <= axis.bound.way + SPEED * PERIOD
    assert axis.overrun is not None
    assert axis.step(time + PERIOD, STOPPING, 0, fresh=True) is Command.DISABLE_VOLTAGE


def test_an_axis_that_creeps_on_loses_its_voltage_at_the_bound_of_its_time() -> None:
    axis = stop()
    time = run(
        axis,
        lambda *_: STOPPING,
        lambda t: 600.0 * t,  # too slow for the bound on distance
        until=lambda a: a.phase is StopPhase.DISABLING,
    )
    assert time == pytest.approx(axis.bound.time + SETTLING, abs=2 * PERIOD)


def test_a_drive_that_keeps_its_voltage_is_given_up_sooner_while_its_axis_moves() -> None:
    moving, resting = stop(), stop(0.0)
    ended = run(moving, lambda *_: STOPPING, lambda t: SPEED * t)
    begun = moving.bound.way / SPEED
    assert moving.phase is StopPhase.LOST
    assert ended - begun <= OFF_TIME_MOVING + SETTLING + 3 * PERIOD
    run(resting, lambda *_: STOPPING, lambda _: 0.0, until=lambda a: a.phase is StopPhase.RESTING)
    resting.disable(1.0)
    resting.note_sent(1.0)
    assert resting.step(1.0 + OFF_TIME, STOPPING, 0, fresh=True) is Command.DISABLE_VOLTAGE
    resting.step(1.0 + OFF_TIME + SETTLING + PERIOD, STOPPING, 0, fresh=True)
    assert resting.phase is StopPhase.LOST


def test_a_drive_that_shows_nothing_is_unseen_and_not_off() -> None:
    axis = stop()
    time = run(axis, lambda *_: OFF, braking, fresh=lambda _: False)
    assert axis.phase is StopPhase.UNSEEN
    most = axis.bound.time + OFF_TIME_MOVING + 2 * SETTLING
    assert time == pytest.approx(most, abs=4 * PERIOD)


def test_the_bound_begins_when_the_command_goes_out_and_the_last_position_may_be_old() -> None:
    axis = stop()
    run(
        axis,
        lambda *_: ENABLED,
        lambda t: SPEED * t,
        fresh=lambda t: t > 0.2,
        sendable=lambda t: t > 0.2,
        until=lambda a: a.phase is StopPhase.DISABLING,
    )
    plain = StopBound.compute(SPEED, DECELERATION, WINDOW)
    assert axis.bound.way == pytest.approx(plain.way + 0.2 * SPEED, abs=2 * PERIOD * SPEED)
    assert axis.bound.time == plain.time


def test_a_bus_that_takes_nothing_is_given_up_after_a_while() -> None:
    axis = stop()
    time = run(axis, lambda *_: ENABLED, braking, fresh=lambda _: False, sendable=lambda _: False)
    assert axis.phase is StopPhase.UNSEEN
    assert time <= UNSENT_TIME + OFF_TIME_MOVING + 4 * PERIOD


@pytest.mark.parametrize("word", [OFF, FAULT])
def test_a_drive_that_is_off_is_told_to_stay_off_once(word: int) -> None:
    axis = stop()
    axis.note_sent(0.0)
    assert axis.step(PERIOD, word, 0, fresh=True) is Command.DISABLE_VOLTAGE
    axis.note_sent(PERIOD)
    assert axis.phase is StopPhase.OFF
    assert axis.step(2 * PERIOD, word, 0, fresh=True) is None


def test_a_drive_that_was_off_and_shows_power_again_is_switched_off_again() -> None:
    axis = stop()
    axis.step(PERIOD, OFF, 0, fresh=True)
    axis.note_sent(PERIOD)
    assert axis.step(2 * PERIOD, ENABLED, 0, fresh=True) is Command.DISABLE_VOLTAGE
    assert axis.phase is StopPhase.DISABLING


@given(
    st.lists(
        st.tuples(WORDS, st.integers(-3000, 3000), st.booleans(), st.booleans()),
        min_size=1,
        max_size=60,
    ),
    st.floats(0.0, 5000.0),
)
def test_whatever_drive_and_bus_do_the_stop_ends_and_off_was_shown(
    seen: list[tuple[int, int, bool, bool]], speed: float
) -> None:
    axis, time = stop(speed), 0.0
    most = UNSENT_TIME + axis.bound.time + OFF_TIME + 4 * SETTLING + STOP_DELAY
    turn, shown_off = 0, False
    while not axis.ended:
        word, position, fresh, sendable = seen[turn % len(seen)]
        turn, time = turn + 1, time + PERIOD
        command = axis.step(time, word, position, fresh=fresh)
        shown_off |= fresh and word in {OFF, FAULT, 0x00, READY}
        if axis.phase is StopPhase.RESTING:
            axis.disable(time)
        if command is not None and sendable:
            axis.note_sent(time)
        assert time <= 3 * most + 1.0
        assert math.isfinite(axis.bound.way)
    assert axis.phase is not StopPhase.OFF or shown_off


def test_a_drive_that_comes_back_again_and_again_is_given_up() -> None:
    axis, time, given_up = stop(), 0.0, False
    while not given_up:
        time += PERIOD
        word = OFF if round(time / PERIOD) % 8 == 0 else ENABLED
        if axis.step(time, word, 0, fresh=True) is not None:
            axis.note_sent(time)
        given_up = axis.phase is StopPhase.LOST
        assert time < 3.0


def test_a_drive_that_is_seen_to_ignore_quick_stop_loses_its_voltage_whatever_its_ramp() -> None:
    axis = AxisStop(
        0.0,
        0.0,
        0,
        speed=SPEED,
        deceleration=1.0,
        window=WINDOW,
        rest=Standstill(2.0, SETTLED),
        settling=SETTLING,
    )
    assert axis.bound.time > 1000.0
    time = run(
        axis,
        lambda *_: ENABLED,
        lambda t: SPEED * t,
        until=lambda a: a.phase is StopPhase.DISABLING,
    )
    assert time <= STOP_DELAY + SETTLING + 2 * PERIOD


def test_a_command_that_the_bus_refuses_counts_once_it_is_seen_that_nothing_happens() -> None:
    axis = stop()
    time = run(axis, lambda *_: ENABLED, lambda t: SPEED * t, sendable=lambda _: False)
    assert axis.phase is StopPhase.LOST
    assert time <= STOP_DELAY + OFF_TIME_MOVING + 2 * SETTLING + 4 * PERIOD


def test_the_time_for_a_command_begins_with_the_command_however_old_the_last_sync() -> None:
    axis = AxisStop(
        10.0,
        2.0,
        0,
        speed=SPEED,
        deceleration=DECELERATION,
        window=WINDOW,
        rest=Standstill(2.0, SETTLED),
        settling=SETTLING,
    )
    assert axis.step(10.0, 0, 0, fresh=False) is Command.QUICK_STOP
    axis.note_sent(10.0)
    assert axis.step(10.0 + PERIOD, STOPPING, 8000, fresh=True) is None
    assert axis.phase is StopPhase.SLOWING


def test_a_lost_axis_is_commanded_to_switch_off_for_as_long_as_it_shows_power() -> None:
    axis = stop()
    time = run(axis, lambda *_: ENABLED, lambda t: SPEED * t)
    assert axis.phase is StopPhase.LOST
    for sync in range(1, 1000):
        later = time + sync * PERIOD
        assert axis.step(later, ENABLED, 10**6, fresh=sync % 3 > 0) is Command.DISABLE_VOLTAGE
    axis.step(later + PERIOD, OFF, 10**6, fresh=True)
    assert axis.phase is StopPhase.OFF


def test_an_axis_that_comes_back_from_its_stop_loses_its_voltage() -> None:
    axis = stop(0.0)
    run(axis, lambda *_: STOPPING, lambda _: 0.0, until=lambda a: a.phase is StopPhase.RESTING)
    assert axis.step(1.0, ENABLED, 0, fresh=True) is Command.DISABLE_VOLTAGE
