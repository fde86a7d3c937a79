"""End of the stop of one axis: repeated commands and final states."""

from __future__ import annotations

import pytest

from drivers.cia402.set_point import Standstill
from drivers.cia402.states import Command
from drivers.cia402.stop import OFF_TIME, OFF_TIME_MOVING, AxisStop, StopPhase

ENABLED, STOPPING, READY, SWITCHED_ON, OFF = 0x27, 0x07, 0x21, 0x23, 0x40
UNDEFINED = 0x6F


def unsent(settled: int = 1, delay: float = 0.0) -> AxisStop:
    """Return the stop of an axis of 100 increments/s at the instant 0, not yet commanded."""
    return AxisStop(
        0.0,
        0.0,
        0,
        speed=100.0,
        deceleration=1000.0,
        window=20.0,
        rest=Standstill(2.0, settled),
        settling=0.0,
        delay=delay,
    )


def begun(settled: int = 1, delay: float = 0.0) -> AxisStop:
    """Return the stop of `unsent` after the bus has accepted its command."""
    axis = unsent(settled, delay)
    axis.note_sent(0.0)
    return axis


def resting_stop() -> AxisStop:
    """Return the stop of an axis at standstill that confirms the stop at the instant 0."""
    axis = begun()
    axis.step(0.0, STOPPING, 0, fresh=True)
    axis.step(0.0, STOPPING, 0, fresh=True)
    assert axis.phase is StopPhase.RESTING
    return axis


def switched_off() -> AxisStop:
    """Return the stop of an axis that is off at the instant 0."""
    axis = resting_stop()
    axis.step(0.0, OFF, 0, fresh=True)
    assert axis.phase is StopPhase.OFF
    return axis


def test_an_axis_has_rested_for_as_long_as_it_has_stood_still() -> None:
    axis = resting_stop()
    assert axis.resting_time(3.0) == 3.0
    axis.disable(3.0)
    assert axis.resting_time(4.0) == 0.0


def test_a_drive_at_rest_may_take_longer_to_switch_off_than_one_in_motion() -> None:
    axis = resting_stop()
    axis.disable(1.0)
    axis.note_sent(1.0)
    axis.step(1.0 + OFF_TIME - 0.01, STOPPING, 0, fresh=True)
    assert OFF_TIME > OFF_TIME_MOVING
    assert axis.phase is StopPhase.DISABLING


def test_a_drive_that_shows_power_again_is_given_time_anew_twice_and_not_a_third_time() -> None:
    axis, patience = switched_off(), []
    for begun in (10.0, 20.0, 30.0):
        axis.step(begun, ENABLED, 0, fresh=True)
        patience.append(axis.phase is StopPhase.DISABLING)
        axis.note_sent(begun)
        axis.step(begun, OFF, 0, fresh=True)
    assert patience == [True, True, False]


def test_an_axis_that_has_shown_that_it_is_off_stays_off_though_the_stop_is_given_up() -> None:
    axis = switched_off()
    axis.hang()
    assert axis.phase is StopPhase.OFF


def test_an_axis_that_has_not_ended_when_the_stop_is_given_up_is_not_seen_to_be_off() -> None:
    axis = resting_stop()
    axis.hang()
    assert axis.phase is StopPhase.UNSEEN


def test_a_drive_that_stays_ready_to_switch_on_counts_as_off_when_its_time_is_over() -> None:
    axis = resting_stop()
    axis.disable(1.0)
    axis.note_sent(1.0)
    assert axis.step(1.0, READY, 0, fresh=True) is Command.DISABLE_VOLTAGE
    assert axis.phase is StopPhase.DISABLING
    axis.step(1.01 + OFF_TIME, READY, 0, fresh=True)
    assert axis.phase is StopPhase.OFF


def test_where_an_axis_went_off_is_where_it_first_showed_it() -> None:
    axis = switched_off()
    axis.step(1.0, OFF, 7, fresh=True)
    assert axis.left_at == 0


def test_an_axis_that_stands_still_without_showing_that_it_obeys_is_not_at_rest() -> None:
    axis = begun()
    for sync in range(5):
        assert axis.step(0.004 * sync, UNDEFINED, 0, fresh=True) is Command.QUICK_STOP
    assert axis.phase is StopPhase.STOPPING


def test_positions_that_are_not_seen_do_not_show_that_an_axis_rests() -> None:
    axis = begun(settled=3)
    for sync in range(8):
        axis.step(0.004 * sync, STOPPING, 0, fresh=False)
    axis.step(0.032, STOPPING, 0, fresh=True)
    assert axis.phase is StopPhase.SLOWING


@pytest.mark.parametrize("word", [READY, SWITCHED_ON])
def test_a_drive_that_is_not_enabled_when_it_shall_stop_is_switched_off_at_once(word: int) -> None:
    axis = begun()
    assert axis.step(0.004, word, 0, fresh=True) is Command.DISABLE_VOLTAGE
    assert axis.phase is StopPhase.DISABLING


def test_an_axis_may_go_on_for_the_syncs_after_which_its_drive_acts() -> None:
    assert begun(delay=0.008).bound.way == pytest.approx(begun().bound.way + 0.008 * 100.0)


def test_an_axis_that_shows_off_and_moves_is_off_only_once_it_rests() -> None:
    axis = switched_off()
    axis.give_up()
    for sync, position in enumerate((100, 200, 300)):
        axis.step(0.004 * sync, OFF, position, fresh=True)
        assert axis.phase is StopPhase.ADRIFT
    axis.step(0.016, OFF, 300, fresh=True)
    assert axis.phase is StopPhase.OFF


def test_a_drive_has_half_a_second_to_switch_off_and_the_bus_two_to_take_a_command() -> None:
    axis = resting_stop()
    axis.disable(1.0)
    axis.note_sent(1.0)
    axis.step(1.51, STOPPING, 0, fresh=True)
    assert axis.phase is StopPhase.LOST
    axis = unsent()
    axis.step(1.99, STOPPING, 0, fresh=False)
    assert axis.phase is StopPhase.STOPPING
    axis.step(2.01, STOPPING, 0, fresh=False)
    assert axis.phase is StopPhase.DISABLING
