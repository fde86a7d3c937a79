"""Shutdown: reasons to stop all axes, and the release of watchdogs."""

# ruff: noqa: PT012 - the tests examine both body and end of a with block

from __future__ import annotations

import struct
import time
from contextlib import contextmanager
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import can
import local_drives
import pytest
from canopen_drive_bus import CanopenDriveBus
from local_bench import NODES, all_off, drives_file, never_energised

from drivers.drive_bus import (
    BusUnavailable,
    DriveError,
    DriveFault,
    LimitExceeded,
    Move,
    Tripped,
)
from drivers.session import servo_axes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

MOVES = {axis: Move(1.0, 1.0, 10.0) for axis in range(NODES)}
STOP, OFF = 0x02, 0x00


def samples(drive_bus: CanopenDriveBus, count: int) -> None:
    for _ in range(count):
        drive_bus.sample()


def controlwords(can_bus: Any, node: int) -> list[int]:
    return [
        struct.unpack("<iH", frame.data)[1]
        for frame in can_bus.sent
        if frame.arbitration_id == 0x200 + node
    ]


def watched(can_bus: Any) -> list[bool]:
    return [drive.value(0x1016, 1) != 0 for drive in can_bus.drives.values()]


def run_away(can_bus: Any) -> None:
    can_bus.drives[1].position += 100_000


def failing(nodes: set[int], times: int, error: Exception) -> Callable[[can.Message], None]:
    """Let this number of set-points and commands to these nodes fail."""
    left = dict.fromkeys(nodes, times)

    def fail(frame: can.Message) -> None:
        service, node = frame.arbitration_id & 0x780, frame.arbitration_id & 0x7F
        if service in {0x200, 0x600} and left.get(node):
            left[node] -= 1
            raise error

    return fail


# Stop commands


def test_a_stop_command_that_fails_keeps_no_other_axis_from_being_stopped(can_bus: Any) -> None:
    drive_bus = CanopenDriveBus(can_bus, drives_file())
    with pytest.raises(KeyboardInterrupt), drive_bus:
        drive_bus.move(MOVES)
        samples(drive_bus, 20)
        can_bus.sent.clear()
        can_bus.on_send = failing({1}, 6, can.CanOperationError("transmit buffer full"))
        raise KeyboardInterrupt
    before_sync = [f.arbitration_id for f in can_bus.sent]
    assert {0x202, 0x203} <= set(before_sync[: before_sync.index(0x80)])
    assert all_off(can_bus)
    assert not any(watched(can_bus))


def test_a_stop_command_is_repeated_at_every_sync_until_it_is_obeyed(can_bus: Any) -> None:
    drive_bus = CanopenDriveBus(can_bus, drives_file())
    with pytest.raises(KeyboardInterrupt), drive_bus:
        drive_bus.move(MOVES)
        samples(drive_bus, 20)
        can_bus.sent.clear()
        can_bus.on_send = failing({1, 2, 3}, 24, OSError("no buffer space available"))
        raise KeyboardInterrupt
    syncs = [n for n, frame in enumerate(can_bus.sent) if frame.arbitration_id == 0x80]
    for first, second in pairwise(syncs[:6]):
        between = {frame.arbitration_id for frame in can_bus.sent[first:second]}
        assert {0x201, 0x202, 0x203} <= between
    assert all_off(can_bus)


def test_what_a_back_end_raises_is_a_drive_error_and_stops_the_axes(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    class Broken(Exception):
        pass

    for error in (OSError(100, "network is down"), Broken("no such handle"), ValueError("closed")):
        with pytest.raises(BusUnavailable, match="cannot be sent") as caught, drive_bus:
            drive_bus.move(MOVES)
            samples(drive_bus, 5)

            def fail(frame: can.Message, error: Exception = error) -> None:
                if frame.arbitration_id == 0x80 and fail.left:  # type: ignore[attr-defined]
                    fail.left -= 1  # type: ignore[attr-defined]
                    raise error

            fail.left = 10  # type: ignore[attr-defined]
            can_bus.on_send = fail
            samples(drive_bus, 1)
        assert caught.value.__cause__ is error
        assert all_off(can_bus)
        can_bus.on_send = lambda _: None


def test_what_a_back_end_raises_when_receiving_is_a_drive_error(
    can_bus: Any, drive_bus: CanopenDriveBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(BusUnavailable, match=r"cannot receive: .*adapter"), drive_bus:
        samples(drive_bus, 5)

        def broken(timeout: float | None = None) -> None:
            monkeypatch.undo()
            raise OSError("adapter unplugged")

        monkeypatch.setattr(drive_bus._connection.process_data, "_receive", broken)
        samples(drive_bus, 1)
    assert all_off(can_bus)


# The latch


def trip(can_bus: Any, drive_bus: CanopenDriveBus) -> None:
    drive_bus.move(MOVES)
    samples(drive_bus, 10)
    run_away(can_bus)
    with pytest.raises(Tripped, match="joint 1"):
        samples(drive_bus, 10)


def test_after_a_trip_nothing_moves_until_a_deliberate_reset(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    with drive_bus:
        trip(can_bus, drive_bus)
        for attempt in (
            lambda: drive_bus.move(MOVES),
            lambda: drive_bus.stream([[0.0] * NODES] * 3),
            drive_bus.halt,
            drive_bus.sample,
        ):
            can_bus.sent.clear()
            with pytest.raises(Tripped, match=r"until a deliberate reset\(\): joint 1"):
                attempt()
            assert not any(
                word & 0x0F == 0x0F for n in (1, 2, 3) for word in controlwords(can_bus, n)
            )
        assert not any(drive.state == "enabled" for drive in can_bus.drives.values())
        drive_bus.reset()
        samples(drive_bus, 5)
        assert all(drive.state == "enabled" for drive in can_bus.drives.values())
        drive_bus.move({1: Move(0.5, 1.0, 10.0)})
        while not drive_bus.sample().reached:
            pass
    assert all_off(can_bus)
    assert not any(watched(can_bus))


def test_axes_have_come_to_rest_when_the_trip_is_raised(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    with drive_bus:
        trip(can_bus, drive_bus)
        before = [drive.position for drive in can_bus.drives.values()]
        for drive in can_bus.drives.values():
            drive.step()
        assert [drive.position for drive in can_bus.drives.values()] == before


def test_a_reset_without_a_trip_changes_nothing(can_bus: Any, drive_bus: CanopenDriveBus) -> None:
    with drive_bus:
        can_bus.sent.clear()
        drive_bus.reset()
        assert not can_bus.sent


def test_a_drive_that_does_not_show_that_it_is_off_is_not_powered_on_again(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    with pytest.raises(DriveFault, match=r"joint 2 .*not confirmed off"), drive_bus:
        can_bus.drives[2].stuck |= {"enabled", "stopping"}
        trip(can_bus, drive_bus)
        drive_bus.reset()


# Watchdogs


def test_a_drive_that_stays_energised_keeps_its_watchdog_and_hears_no_heartbeat_any_more(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    with pytest.raises(DriveFault, match=r"incomplete.*joint 2 .*watchdog stays armed"), drive_bus:
        samples(drive_bus, 5)
        can_bus.drives[2].stuck |= {"enabled", "stopping"}
    assert watched(can_bus) == [False, True, False]
    beats = [n for n, frame in enumerate(can_bus.sent) if frame.arbitration_id == 0x77F]
    syncs_after = [f for f in can_bus.sent[beats[-1] :] if f.arbitration_id == 0x80]
    assert len(syncs_after) * local_drives.PERIOD > 0.5


def test_a_start_that_is_refused_releases_the_watchdogs_of_drives_that_are_off(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    can_bus.drives[3].stuck.add("ready")
    with pytest.raises(DriveError):
        drive_bus.__enter__()
    assert never_energised(can_bus)
    assert not any(watched(can_bus))


# Brakes, and positions of the axes


def test_voltage_stays_on_for_the_brake_s_delay_after_standstill(can_bus: Any) -> None:
    delays = []
    for delay in (0.0, 0.3):
        for drive in can_bus.drives.values():
            drive.history.clear()
            drive.stays_stopped = True
        drive_bus = CanopenDriveBus(can_bus, drives_file(brake_delay=delay))
        with drive_bus:
            samples(drive_bus, 5)
            can_bus.sent.clear()
        syncs, first_off = 0, 0
        for frame in can_bus.sent:
            syncs += frame.arbitration_id == 0x80
            if frame.arbitration_id == 0x201 and struct.unpack("<iH", frame.data)[1] == OFF:
                first_off = first_off or syncs
        delays.append(first_off * local_drives.PERIOD)
        assert all_off(can_bus)
    assert delays[1] - delays[0] == pytest.approx(0.3, abs=0.01)


def test_an_axis_that_sags_after_switching_off_is_noted(can_bus: Any) -> None:
    drive_bus = CanopenDriveBus(can_bus, drives_file())
    with drive_bus:
        samples(drive_bus, 5)
        can_bus.drives[2].sags = 500.0
    (note,) = [note for note in drive_bus.notes if "sagged" in note]
    assert note.startswith("joint 2 (node 2): sagged by 0.0077 rad")
    assert "brake_delay" in note


def test_an_axis_that_shows_off_and_goes_on_is_not_released(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    with pytest.raises(DriveFault, match=r"joint 2 .*it still moves"), drive_bus:
        samples(drive_bus, 5)
        can_bus.drives[2].sags = 1e9
    assert watched(can_bus) == [False, True, False]


@pytest.mark.parametrize("radians", [2.1, -2.1])
def test_an_axis_that_stands_outside_its_limits_keeps_all_from_being_powered(
    can_bus: Any, drive_bus: CanopenDriveBus, radians: float
) -> None:
    can_bus.drives[1].position = can_bus.drives[1].target = radians * 4096 * 100 / 6.283185
    with pytest.raises(LimitExceeded, match=r"joint 1 .*is at -?2.1 rad, must be in \[-2, 2\]"):
        drive_bus.__enter__()
    assert never_energised(can_bus)


def test_before_homing_an_axis_may_stand_anywhere(can_bus: Any) -> None:
    can_bus.drives[1].position = can_bus.drives[1].target = 1e6
    with CanopenDriveBus(can_bus, drives_file(), anywhere=True) as drive_bus:
        drive_bus.follow()
    assert all_off(can_bus)


def test_a_bus_that_was_opened_for_us_is_shut_down_when_connecting_fails() -> None:
    class Half(local_drives.LocalBus):
        closed = 0

        def shutdown(self) -> None:
            type(self).closed += 1
            super().shutdown()

    bus = Half(NODES, {})
    drive_bus = CanopenDriveBus(bus, drives_file(), pacing="nonsense", owns_bus=True)  # type: ignore[arg-type]
    drive_bus._drives = None  # type: ignore[assignment]
    with pytest.raises(AttributeError):
        drive_bus.__enter__()
    assert Half.closed == 1


# Supervision


def test_axes_in_motion_that_nobody_looks_at_are_stopped(can_bus: Any) -> None:
    drives = drives_file().model_copy(update={"heartbeat_timeout": 2.0})  # busy machines stall
    drive_bus = CanopenDriveBus(can_bus, drives, pacing="wall-clock")
    with drive_bus:
        samples(drive_bus, 3)
        time.sleep(1.1)
        samples(drive_bus, 3)  # a caller may pause at rest
        drive_bus.move({0: Move(1.5, 0.5, 10.0)})
        samples(drive_bus, 3)
        time.sleep(1.1)
        with pytest.raises(Tripped, match=r"were not supervised .* at most 1 s allowed"):
            drive_bus.sample()
    assert all_off(can_bus)


def test_after_a_long_pause_quick_stop_comes_before_the_voltage_is_disabled(can_bus: Any) -> None:
    drives = drives_file().model_copy(update={"heartbeat_timeout": 10.0})
    drive_bus = CanopenDriveBus(can_bus, drives, pacing="wall-clock")
    with pytest.raises(KeyboardInterrupt), drive_bus:
        drive_bus.move({0: Move(1.5, 0.1, 10.0)})
        samples(drive_bus, 3)
        time.sleep(2.1)
        can_bus.sent.clear()
        raise KeyboardInterrupt
    assert [controlwords(can_bus, node)[0] for node in (1, 2, 3)] == [STOP] * 3
    assert all_off(can_bus)


def test_axes_rest_before_a_drive_is_asked_for_the_reason_of_its_fault(can_bus: Any) -> None:
    asked: list[bool] = []

    def ask(frame: can.Message) -> None:
        data = bytes(frame.data)
        if frame.arbitration_id == 0x601 and data[1:3] == b"\x3f\x60":
            asked.append(all(d.state != "enabled" for d in can_bus.drives.values()))

    drive_bus = CanopenDriveBus(can_bus, drives_file())
    with pytest.raises(DriveFault, match="joint 1"), drive_bus:
        drive_bus.move(MOVES)
        samples(drive_bus, 10)
        can_bus.on_send = ask
        can_bus.drives[1].go("fault")
        samples(drive_bus, 5)
    assert asked
    assert asked[0]


def test_a_drive_that_shows_off_and_moves_is_not_powered_on_again(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    with pytest.raises(DriveFault, match=r"joint 2 .*not confirmed off"), drive_bus:
        trip(can_bus, drive_bus)
        can_bus.drives[2].sags = 1e9
        drive_bus.reset()
    assert can_bus.drives[2].state == "off"


def test_samples_after_a_trip_keep_the_axes_stopped(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    for drive in can_bus.drives.values():
        drive.stays_stopped = True
    with pytest.raises(DriveFault, match=r"joint 3 .*OPERATION ENABLED"), drive_bus:
        trip(can_bus, drive_bus)
        assert can_bus.drives[3].state == "stopping"
        can_bus.drives[3].go("enabled")  # commanded by another master
        for _ in range(10):
            with pytest.raises(Tripped):
                drive_bus.sample()
        assert can_bus.drives[3].state == "off"
    assert all_off(can_bus)


def test_a_command_whose_identifier_the_bus_refuses_is_given_by_sdo_at_once(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    def refuse(frame: can.Message) -> None:
        if frame.arbitration_id == 0x202:
            raise can.CanOperationError("no such mailbox")

    with pytest.raises(KeyboardInterrupt), drive_bus:
        drive_bus.move(MOVES)
        samples(drive_bus, 20)
        can_bus.sent.clear()
        can_bus.on_send = refuse
        raise KeyboardInterrupt
    ordered = [frame.arbitration_id for frame in can_bus.sent].index(0x602)
    assert bytes(can_bus.sent[ordered].data) == b"\x2b\x40\x60\x00\x02\x00\x00\x00"
    assert 0x80 not in [frame.arbitration_id for frame in can_bus.sent[:ordered]]
    assert watched(can_bus) == [False, False, False]
    assert all_off(can_bus)


def test_a_command_that_the_bus_refuses_for_one_axis_alone_ends_our_heartbeat(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    def refuse(frame: can.Message) -> None:
        if frame.arbitration_id in {0x202, 0x602}:
            raise can.CanOperationError("no such mailbox")

    with pytest.raises(KeyboardInterrupt), drive_bus:
        drive_bus.move(MOVES)
        samples(drive_bus, 20)
        can_bus.sent.clear()
        can_bus.on_send = refuse
        raise KeyboardInterrupt
    beats = [n for n, frame in enumerate(can_bus.sent) if frame.arbitration_id == 0x77F]
    syncs = [frame.arbitration_id for frame in can_bus.sent[: beats[-1]]].count(0x80)
    assert syncs * local_drives.PERIOD < 0.6


def test_outside_a_session_nothing_can_be_commanded(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    def refused_outside() -> None:
        for attempt in (
            lambda: drive_bus.move(MOVES),
            lambda: drive_bus.stream([[0.0] * NODES] * 3),
            drive_bus.halt,
            drive_bus.sample,
            drive_bus.follow,
            drive_bus.reset,
        ):
            with pytest.raises(DriveError, match="enter the bus first"):
                attempt()

    refused_outside()
    with drive_bus:
        trip(can_bus, drive_bus)
        with pytest.raises(DriveError, match="entered already"):
            drive_bus.__enter__()
    sent = len(can_bus.sent)
    refused_outside()
    drive_bus.__exit__(None, None, None)
    assert len(can_bus.sent) == sent


def test_two_signals_at_once_keep_nothing_powered(
    can_bus: Any, drive_bus: CanopenDriveBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    held = servo_axes.hold_interrupts
    pressed: list[int] = []

    @contextmanager
    def late() -> Iterator[None]:
        if len(pressed) < 2:
            pressed.append(1)
            raise KeyboardInterrupt  # must precede the deferral of signals
        with held():
            yield

    monkeypatch.setattr(servo_axes, "hold_interrupts", late)
    with pytest.raises(KeyboardInterrupt), drive_bus:
        drive_bus.move(MOVES)
        samples(drive_bus, 5)
        raise KeyboardInterrupt
    assert len(pressed) == 2
    assert all_off(can_bus)
    assert not any(watched(can_bus))


def test_a_watch_that_somebody_changed_before_power_on_is_refused(can_bus: Any) -> None:
    def meddle(frame: can.Message) -> None:
        if frame.arbitration_id == 0 and frame.data[0] == 1:  # NMT start
            can_bus.drives[2].node.set_data(0x1016, 1, bytes(4))

    can_bus.on_send = meddle
    with pytest.raises(DriveError, match=r"joint 2 .*1016:01 .* is 0, .* was written: another"):
        CanopenDriveBus(can_bus, drives_file()).__enter__()
    assert never_energised(can_bus)


def test_another_master_with_our_number_is_refused(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    with pytest.raises(DriveError, match=r"another master .*node 127"), drive_bus:
        samples(drive_bus, 5)
        can_bus.inbox.append(can.Message(arbitration_id=0x77F, data=[5], is_extended_id=False))
        samples(drive_bus, 50)
    assert all_off(can_bus)


@pytest.mark.parametrize(("option", "reaction"), [(2, 3), (6, 1)])
def test_when_this_process_dies_no_drive_stays_in_a_quick_stop_that_is_energised(
    can_bus: Any, option: int, reaction: int
) -> None:
    drives = drives_file().model_copy(update={"quick_stop_option": option})
    with CanopenDriveBus(can_bus, drives):
        assert [d.value(0x6007) for d in can_bus.drives.values()] == [reaction] * NODES


def test_a_limit_below_one_count_is_refused_and_never_written_as_none(can_bus: Any) -> None:
    limits = {"q_min": -2, "q_max": 2, "velocity": 1e-7, "acceleration": 20, "torque": 300}
    with pytest.raises(DriveError, match=r"limits.velocity 1e-07 .* less than one count of"):
        CanopenDriveBus(can_bus, drives_file(limits=limits)).__enter__()
    assert all(drive.value(0x607F) == 0 for drive in can_bus.drives.values())
    assert never_energised(can_bus)
