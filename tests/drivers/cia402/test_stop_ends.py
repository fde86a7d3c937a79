"""How the stop of one axis ends: how often it is begun anew, and what cannot be undone."""

from __future__ import annotations

from drivers.cia402.set_point import Standstill
from drivers.cia402.states import Command
from drivers.cia402.stop import OFF_TIME, OFF_TIME_MOVING, AxisStop, StopPhase

ENABLED, STOPPING, READY, OFF = 0x27, 0x07, 0x21, 0x40


def at_rest() -> AxisStop:
    """Return the stop of an axis that stands still at the instant 0 and shows that it obeys."""
    rest = Standstill(2.0, 1)
    axis = AxisStop(
        0.0, 0.0, 0, speed=100.0, deceleration=1000.0, window=20.0, rest=rest, settling=0.0
    )
    axis.sent(0.0)
    axis.step(0.0, STOPPING, 0, fresh=True)
    axis.step(0.0, STOPPING, 0, fresh=True)
    assert axis.phase is StopPhase.RESTING
    return axis


def switched_off() -> AxisStop:
    """Return the stop of an axis that shows at the instant 0 that it is off."""
    axis = at_rest()
    axis.step(0.0, OFF, 0, fresh=True)
    assert axis.phase is StopPhase.OFF
    return axis


def test_an_axis_has_rested_for_as_long_as_it_has_stood_still() -> None:
    axis = at_rest()
    assert axis.rested(3.0) == 3.0
    axis.disable(3.0)
    assert axis.rested(4.0) == 0.0


def test_a_drive_at_rest_may_take_longer_to_switch_off_than_one_in_motion() -> None:
    axis = at_rest()
    axis.disable(1.0)
    axis.sent(1.0)
    axis.step(1.0 + OFF_TIME - 0.01, STOPPING, 0, fresh=True)
    assert OFF_TIME > OFF_TIME_MOVING
    assert axis.phase is StopPhase.DISABLING


def test_a_drive_that_shows_power_again_is_given_time_anew_twice_and_not_a_third_time() -> None:
    axis, patience = switched_off(), []
    for begun in (10.0, 20.0, 30.0):
        axis.step(begun, ENABLED, 0, fresh=True)
        patience.append(axis.phase is StopPhase.DISABLING)
        axis.sent(begun)
        axis.step(begun, OFF, 0, fresh=True)
    assert patience == [True, True, False]


def test_an_axis_that_has_shown_that_it_is_off_stays_off_though_the_stop_is_given_up() -> None:
    axis = switched_off()
    axis.hang()
    assert axis.phase is StopPhase.OFF


def test_an_axis_that_has_not_ended_when_the_stop_is_given_up_is_not_seen_to_be_off() -> None:
    axis = at_rest()
    axis.hang()
    assert axis.phase is StopPhase.UNSEEN


def test_a_drive_that_stays_ready_to_switch_on_counts_as_off_when_its_time_is_over() -> None:
    axis = at_rest()
    axis.disable(1.0)
    axis.sent(1.0)
    assert axis.step(1.0, READY, 0, fresh=True) is Command.DISABLE_VOLTAGE
    axis.step(1.01 + OFF_TIME, READY, 0, fresh=True)
    assert axis.phase is StopPhase.OFF


def test_where_an_axis_went_off_is_where_it_first_showed_it() -> None:
    axis = switched_off()
    axis.step(1.0, OFF, 7, fresh=True)
    assert axis.left_at == 0
