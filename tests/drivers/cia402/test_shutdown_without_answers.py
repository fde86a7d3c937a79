"""Shutdown with missing telegrams or few SYNCs is bounded and states the present reason."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pytest
from fake_fieldbus import PERIOD, FakeDrive, FakeFieldbus
from local_bench import drives_file

from drivers.axis import Axis
from drivers.cia402 import power
from drivers.cia402.power import Power
from drivers.cia402.shutdown import LONGEST, Shutdown
from drivers.cia402.states import State
from drivers.cia402.stop import OFF_TIME_MOVING, UNSENT_TIME
from drivers.cia402.supervision import Supervision
from drivers.drive_bus import BusUnavailable, NodeSilent, SampleFlag

if TYPE_CHECKING:
    from drivers.drives_file import AxisDrive
    from drivers.fieldbus import Entry


class Clock:
    """Real time that passes only with SYNCs [s]."""

    def __init__(self, per_sync: float) -> None:
        self.now, self._per_sync = 0.0, per_sync

    def __call__(self) -> float:
        return self.now

    def tick(self) -> None:
        self.now += self._per_sync


class Bus(FakeFieldbus):
    """Three energised axes whose commands may be refused for a while."""

    def __init__(self, clock: Clock | None = None) -> None:
        super().__init__(3)
        self.refusals, self.ceased = 0, math.inf
        self._clock = clock
        for drive in self.drives:
            drive.state, drive.takes_no_orders = State.OPERATION_ENABLED, True

    def command(self, axis: int, target: int, controlword: int) -> None:
        if axis == 1 and self.refusals:
            self.refusals -= 1
            raise BusUnavailable("no such mailbox")
        super().command(axis, target, controlword)

    def miss(self) -> None:
        super().miss()
        if self._clock is not None:
            self._clock.tick()

    def cease(self) -> None:
        self.alive, self.ceased = False, min(self.ceased, self.time)


def shut_down(bus: Bus, axes: tuple[AxisDrive, ...]) -> Shutdown:
    off = Power(bus, bus.drives, Supervision(bus.drives)).switch_off
    shutdown = Shutdown(bus, bus, Axis.all(axes, bus.drives), PERIOD, off)
    shutdown.begin([1.0] * 3, [10.0] * 3)
    shutdown.switch_off()
    return shutdown


@pytest.mark.parametrize("brake_delay", [0.0, 2.0])
def test_a_stop_whose_syncs_hardly_pass_is_given_up_later_where_brakes_close_slowly(
    monkeypatch: pytest.MonkeyPatch, brake_delay: float
) -> None:
    clock = Clock(per_sync=0.5)
    monkeypatch.setattr(power, "monotonic", clock)
    bus = Bus(clock)
    bus.silent = {0, 1, 2}
    shut_down(bus, tuple(drives_file(brake_delay=brake_delay).axes))
    assert clock.now == pytest.approx(LONGEST + brake_delay, abs=1.0)


def test_a_refusal_that_is_over_is_not_the_reason_why_a_drive_stays_on() -> None:
    axes = tuple(drives_file().axes)
    bus = Bus()
    bus.drives[1].deaf, bus.refusals = True, 3
    shutdown = shut_down(bus, axes)
    shutdown.conclude()
    assert shutdown.problems[0] == (
        "axis 2: does not switch off, it shows OPERATION ENABLED; its watchdog stays armed and our "
        "heartbeat has stopped"
    )


def test_a_refusal_that_lasts_is_the_reason_why_a_drive_stays_on() -> None:
    axes = tuple(drives_file().axes)
    bus = Bus()
    bus.refusals = 100_000
    shutdown = shut_down(bus, axes)
    shutdown.conclude()
    assert "axis 2: does not switch off" in shutdown.problems[0]
    assert "(no such mailbox)" in shutdown.problems[0]


def test_a_command_that_the_bus_refuses_goes_out_as_an_object_at_once() -> None:
    bus = Bus()
    bus.refusals, bus.drives[1].takes_no_orders = 100_000, False
    shutdown = shut_down(bus, tuple(drives_file(brake_delay=0.0).axes))
    assert bus.drives[1].history[0] is State.QUICK_STOP_ACTIVE
    assert shutdown.off == (True, True, True)
    assert bus.alive


def test_a_lost_drive_is_commanded_by_objects_too() -> None:
    bus = Bus()
    bus.drives[1].deaf, bus.drives[1].takes_no_orders = True, False
    shutdown = shut_down(bus, tuple(drives_file(brake_delay=0.0).axes))
    shutdown.conclude()
    assert shutdown.off == (True, True, True)


def test_an_axis_rests_once_it_has_stood_still_for_forty_milliseconds() -> None:
    bus = Bus()
    shut_down(bus, tuple(drives_file(brake_delay=0.0).axes))
    for drive in bus.drives:
        assert drive.history.count(State.QUICK_STOP_ACTIVE) * PERIOD >= 0.04


def test_axes_that_are_off_are_watched_for_three_tenths_of_a_second() -> None:
    bus = Bus()
    shutdown = shut_down(bus, tuple(drives_file(brake_delay=0.0).axes))
    off = bus.time
    shutdown.conclude()
    assert bus.time - off >= 0.3


class Echo(Bus):
    """Bus with a second drive without communication, whose old telegram
    repeats with every new one.
    """

    def __init__(self) -> None:
        super().__init__()
        self.drives = (self.drives[0], Mute(2), self.drives[2])
        self.drives[1].state, self.drives[1].deaf = State.OPERATION_ENABLED, True

    def sync(self) -> float:
        time = super().sync()
        self.words = (self.words[0], 0x40, self.words[2])
        self.flags = (0, SampleFlag.DOUBLED.value, 0)
        return time


class Mute(FakeDrive):
    """Drive without answers to commands."""

    def put(self, entry: Entry, value: int) -> None:
        raise NodeSilent(self.label)


def test_an_axis_is_not_taken_for_off_by_one_of_two_telegrams_that_may_be_an_old_one() -> None:
    bus = Echo()
    shutdown = shut_down(bus, tuple(drives_file(brake_delay=0.0).axes))
    assert shutdown.off == (True, False, True)
    assert not bus.alive  # off before any further attempt


def test_our_heartbeat_ceases_for_a_drive_that_does_not_obey_while_others_await_their_brakes() -> (
    None
):
    bus = Bus()
    bus.drives[1].deaf = True
    shut_down(bus, tuple(drives_file(brake_delay=2.0).axes))
    assert bus.time > 2.0
    assert bus.ceased < 1.0


def test_a_drive_whose_telegrams_stay_away_is_switched_off_by_objects() -> None:
    bus = Bus()
    bus.silent, bus.drives[1].deaf = {1}, True
    shutdown = shut_down(bus, tuple(drives_file(brake_delay=0.0).axes))
    assert bus.drives[1].state is State.SWITCH_ON_DISABLED
    assert shutdown.off == (True, True, True)


class Unplugged(Bus):
    """Bus that neither sends nor receives."""

    def sync(self) -> float:
        raise BusUnavailable("cable unplugged")

    def command(self, axis: int, target: int, controlword: int) -> None:
        self.sync()


def test_time_passes_though_no_sync_can_be_sent() -> None:
    bus = Unplugged()
    shut_down(bus, tuple(drives_file(brake_delay=0.0).axes))
    assert bus.time == pytest.approx(UNSENT_TIME + OFF_TIME_MOVING, abs=0.1)


class Watched(Bus):
    """Bus whose second drive only obeys its watchdog, two seconds
    after our heartbeat has ceased.
    """

    def __init__(self) -> None:
        super().__init__()
        self.drives[1].deaf = True

    def miss(self) -> None:
        super().miss()
        if self.time > self.ceased + 2.0:
            self.drives[1].state = State.SWITCH_ON_DISABLED


def test_the_reaction_of_a_drive_s_watchdog_is_awaited() -> None:
    bus = Watched()
    shutdown = shut_down(bus, tuple(drives_file(brake_delay=0.0).axes))
    assert shutdown.off == (True, False, True)
    shutdown.conclude()
    assert shutdown.off == (True, True, True)
    assert any("its own reaction to the loss of our heartbeat" in p for p in shutdown.problems)


def test_after_a_stop_telegrams_are_awaited_again_as_before(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bus, hurried = Bus(), []
    monkeypatch.setattr(bus, "hurry", hurried.append)
    shut_down(bus, tuple(drives_file(brake_delay=0.0).axes)).forget()
    assert hurried == [True, False]


def test_what_is_fed_forward_is_taken_back_from_every_axis_that_shall_stop() -> None:
    bus = Bus()
    shut_down(bus, tuple(drives_file(brake_delay=0.0).axes))
    assert set(bus.fed) == {(axis, 0, 0) for axis in range(3)}
