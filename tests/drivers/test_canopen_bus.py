"""The CANopen driver on drives of canopen's own, and on the plant."""

# ruff: noqa: PT012 - the tests examine both body and end of a with block

from __future__ import annotations

import math
import signal
import threading
from collections import deque
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import can
import drive_bus_conformance as conformance
import local_drives
import numpy as np
import pytest
from canopen_drive_bus import CanopenDriveBus
from local_bench import NODES, all_off, build, drives_file, never_energised, refused

from drivers.canopen.process_data import DOUBT
from drivers.cia402.states import State, decode_state
from drivers.drive_bus import (
    BusUnavailable,
    DriveError,
    DriveFault,
    DriveRefused,
    Move,
    MoveFailed,
    NodeSilent,
    SampleFlag,
)
from drivers.drives_file import load_drives
from drivers.opening import open_drive_bus
from sim_plant.plant import load_plant
from sim_plant.serving.server import serve

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from drivers.drive_bus import DriveBus

MANUTEC = Path(__file__).parents[2] / "hil" / "robots" / "manutec-r15.drives.yaml"


class TestConformanceOnLocalDrives(conformance.DriveBusConformance):
    @pytest.fixture
    def open_bus(self, can_bus: Any) -> Callable[[], DriveBus]:
        return lambda: CanopenDriveBus(can_bus, drives_file())


class TestConformanceOnThePlant(conformance.DriveBusConformance):
    @pytest.fixture
    def open_bus(self) -> Iterator[Callable[[], DriveBus]]:
        with can.Bus("manutec-r15", "sim_plant", ignore_config=True) as bus:
            yield lambda: CanopenDriveBus(bus, load_drives(MANUTEC))


# Entering


def test_no_drive_is_enabled_before_all_are_switched_on(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    order: list[tuple[int, str]] = []
    for node, drive in can_bus.drives.items():
        drive.go = lambda state, node=node, go=drive.go: (order.append((node, state)), go(state))
    with drive_bus:
        states = [state for _, state in order]
        assert states.count("on") == states.count("enabled") == NODES
        assert states.index("enabled") > max(i for i, state in enumerate(states) if state == "on")


def test_entering_does_not_move_and_holds_the_present_position(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    can_bus.drives[2].position = 1234.0
    with drive_bus:
        drive_bus.sample()
        assert can_bus.drives[2].position == 1234.0
        assert can_bus.drives[2].value(0x607A) == 1234


def test_limits_and_reactions_are_written_to_the_drives(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    per_radian = 4096 * 100 / (2 * math.pi)
    with drive_bus:
        first, second = can_bus.drives[1], can_bus.drives[2]
        assert first.value(0x607D, 2) == round(2 * per_radian)
        ends = [
            int.from_bytes(second.node.get_data(0x607D, sub), "little", signed=True)
            for sub in (1, 2)
        ]
        assert ends == [500 - round(2 * per_radian), 500 + round(2 * per_radian)]
        assert first.value(0x607F) == int(2 * per_radian)
        assert first.value(0x6072) == 3000
        assert first.value(0x6065) == round(0.05 * per_radian)
        assert first.value(0x6066) == 50
        assert first.value(0x6007) == 3
        assert first.value(0x1006) == 4000


def test_heartbeats_are_watched_both_ways_and_the_watch_ends_with_power(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    with drive_bus:
        assert can_bus.drives[1].value(0x1016, 1) == 127 << 16 | 500
        assert can_bus.drives[1].value(0x1017) == 100
        can_bus.sent.clear()
        for _ in range(100):
            drive_bus.sample()
        beats = [frame for frame in can_bus.sent if frame.arbitration_id == 0x77F]
        assert len(beats) == 4
    assert can_bus.drives[1].value(0x1016, 1) == 0
    assert can_bus.drives[1].node.nmt.state != "OPERATIONAL"


def test_the_pdos_are_mapped_as_needed(can_bus: Any, drive_bus: CanopenDriveBus) -> None:
    with drive_bus:
        drive = can_bus.drives[3]
        assert [drive.value(0x1A00, sub) for sub in range(4)] == [
            3,
            0x60410010,
            0x60640020,
            0x60780010,
        ]
        assert [drive.value(0x1600, sub) for sub in range(3)] == [2, 0x607A0020, 0x60400010]
        assert drive.value(0x1800, 1) == 0x183
        assert drive.value(0x1800, 2) == 1


def test_a_tpdo_that_is_not_needed_is_switched_off() -> None:
    can_bus, drive_bus = build({2: {(0x1801, 1): ("u32", 0x282)}})
    seen: list[int] = []

    def outgoing(frame: can.Message) -> list[can.Message]:
        seen.append(frame.arbitration_id)
        return [frame]

    with can_bus, drive_bus:
        assert can_bus.drives[2].value(0x1801, 1) == 1 << 31 | 0x282
        can_bus.outgoing = outgoing
        drive_bus.sample()
        assert 0x182 in seen
        assert 0x282 not in seen


def test_a_current_of_32_bits_goes_into_a_second_pdo_of_the_same_sync() -> None:
    changes = {node: {(0x30D1, 2): ("i32", 100_000)} for node in (1, 2, 3)}
    can_bus = local_drives.LocalBus(NODES, changes)
    current = {
        "index": 0x30D1,
        "subindex": 2,
        "type": "i32",
        "basis": "mA",
        "amplitude": "peak",
    }
    with can_bus, CanopenDriveBus(can_bus, drives_file(current=current)) as drive_bus:
        sample = drive_bus.sample()
        assert sample.tau == pytest.approx((5000.0, -5000.0, 5000.0))
        assert sample.flags == (0, 0, 0)


def test_what_a_drive_lacks_but_can_do_without_is_noted() -> None:
    can_bus, drive_bus = build({2: {(0x6007, 0): None}})
    with can_bus, drive_bus:
        assert any("joint 2 (node 2): no object 6007" in note for note in drive_bus.notes)


def test_a_missing_node_is_named_with_the_remedy(can_bus: Any, drive_bus: CanopenDriveBus) -> None:
    can_bus.drives[2].powered = False
    with pytest.raises(NodeSilent, match=r"joint 2 \(node 2\): no answer .* check .* power"):
        drive_bus.__enter__()
    assert never_energised(can_bus)


def test_every_drive_that_cannot_serve_is_named_at_once() -> None:
    message = refused({1: {(0x1018, 1): ("u32", 9)}, 3: {(0x6502, 0): ("u32", 4)}}, DriveRefused)
    assert "joint 1" in message
    assert "joint 3" in message


@pytest.mark.parametrize(
    ("objects", "words"),
    [
        ({(0x1018, 2): ("u32", 0x77)}, "product code 00000077h, the drives file expects 00000402h"),
        ({(0x1000, 0): ("u32", 401)}, "device profile 401 is not a CiA 402 drive"),
        (
            {(0x6502, 0): ("u32", 0x304)},
            "neither profile position nor cyclic synchronous position mode (6502 = 00000304h",
        ),
        ({(0x6075, 0): ("u32", 2100)}, "is 2.1 A, the drives file states rated_current: 2 A;"),
        ({(0x6076, 0): ("u32", 1500)}, "is 1.5 N m, the drives file states rated_torque: 1 N m;"),
        (
            {(0x608F, 1): ("u32", 8192), (0x608F, 2): ("u32", 1)},
            "is 8192 counts per motor revolution (608F = 8192, in increments), the drives",
        ),
        ({(0x6078, 0): None}, "6078:00 (current readback): abort 06020000"),
        ({(0x6078, 0): ("i32", 0)}, "has 4 bytes, expected 2"),
        ({(0x1016, 1): None}, "1016:01 (consumer heartbeat time): abort 06020000"),
        ({(0x1A00, 2): None}, "1A00:02 (object 2 of TPDO 1): abort 06090011"),
        ({(0x607D, 1): None, (0x607D, 2): None}, "607D:01"),
    ],
)
def test_a_drive_that_cannot_serve_is_refused_with_the_reason(
    objects: dict[tuple[int, int], Any], words: str
) -> None:
    assert words in refused({2: objects}, DriveRefused)


def test_a_mapping_that_reads_back_differently_is_refused() -> None:
    can_bus, drive_bus = build()
    can_bus.drives[2].insists[0x1A00, 3] = 0x60770010
    with can_bus:
        with pytest.raises(
            DriveRefused, match=r"1A00:03 .* reads back 1618411536 after 1618477072"
        ):
            drive_bus.__enter__()
        assert never_energised(can_bus)


def test_a_limit_that_the_drive_does_not_take_is_refused() -> None:
    can_bus, drive_bus = build()
    can_bus.drives[1].insists[0x6072, 0] = 0  # neither the drive's own limit nor ours
    with can_bus, pytest.raises(DriveRefused, match=r"6072.* reads back 0 after 3000 was"):
        drive_bus.__enter__()


def _fix(can_bus: Any, node: int, *objects: tuple[int, int]) -> None:
    for index, sub in objects:
        can_bus.drives[node].node.object_dictionary[index][sub].access_type = "ro"


FIXED = {
    (0x1800, 1): ("u32", 0x182),
    (0x1800, 2): ("u8", 1),
    (0x1A00, 0): ("u8", 3),
    (0x1A00, 1): ("u32", 0x60410010),
    (0x1A00, 2): ("u32", 0x60640020),
    (0x1A00, 3): ("u32", 0x60780010),
}


def test_a_fixed_mapping_that_says_what_is_needed_is_taken_as_it_is() -> None:
    can_bus, drive_bus = build({2: FIXED})
    _fix(can_bus, 2, *FIXED)
    with can_bus, drive_bus:
        assert drive_bus.sample().flags == (0, 0, 0)


def test_a_fixed_mapping_that_says_something_else_is_refused() -> None:
    can_bus, drive_bus = build({2: {**FIXED, (0x1A00, 3): ("u32", 0x60770010)}})
    _fix(can_bus, 2, *FIXED)
    with can_bus, pytest.raises(DriveRefused, match=r"1A00:03 .* is fixed at 60770010h, 60780010h"):
        drive_bus.__enter__()


def test_a_drive_that_does_not_show_the_mode_is_refused() -> None:
    can_bus, drive_bus = build()
    can_bus.drives[3].ignores_mode = True
    with can_bus:
        with pytest.raises(DriveRefused, match=r"joint 3 .* 6061 shows 0, 3 s after"):
            drive_bus.__enter__()
        assert never_energised(can_bus)


def test_a_drive_found_in_a_fault_is_refused_unless_its_reset_is_asked_for() -> None:
    can_bus, drive_bus = build()
    with can_bus:
        can_bus.drives[2].state = "fault"
        can_bus.drives[2].node.set_data(0x603F, 0, b"\x10\x23")
        with pytest.raises(DriveFault, match=r"joint 2 .*: FAULT: 2310 \(continuous over-current"):
            drive_bus.__enter__()
        assert never_energised(can_bus)
        assert not any(word & 0x80 for word in can_bus.drives[2].words)
        with CanopenDriveBus(can_bus, drives_file(), reset_faults=True) as again:
            assert again.sample().reached


def test_a_drive_found_energised_is_switched_off_before_anything_is_written() -> None:
    can_bus, drive_bus = build()
    with can_bus:
        can_bus.drives[1].state = "enabled"
        with drive_bus:
            assert can_bus.drives[1].history[1] == "off"


def test_a_drive_that_stays_switched_off_keeps_all_others_unenergised() -> None:
    can_bus, drive_bus = build()
    with can_bus:
        can_bus.drives[3].stuck.add("ready")
        with pytest.raises(DriveRefused, match=r"joint 3 .* stays in READY TO SWITCH ON"):
            drive_bus.__enter__()
        can_bus.drives[3].stuck.clear()
        assert never_energised(can_bus)
        assert all(drive.value(0x1016, 1) == 0 for drive in can_bus.drives.values())


def test_a_drive_that_answers_no_sync_keeps_all_others_unenergised(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    can_bus.outgoing = lambda frame: [] if frame.arbitration_id == 0x182 else [frame]
    with pytest.raises(NodeSilent, match=r"^joint 2 .*: does not answer each SYNC"):
        drive_bus.__enter__()
    assert never_energised(can_bus)
    assert all_off(can_bus)


@pytest.mark.parametrize("word", [0x06, 0x07, 0x0F])
def test_an_interrupt_while_powering_on_switches_all_off_again(
    can_bus: Any, drive_bus: CanopenDriveBus, word: int
) -> None:
    def interrupt(frame: can.Message) -> None:
        if frame.arbitration_id == 0x202 and frame.data[4] == word:
            can_bus.on_send = lambda _: None
            raise KeyboardInterrupt

    can_bus.on_send = interrupt
    with pytest.raises(KeyboardInterrupt):
        drive_bus.__enter__()
    assert all_off(can_bus)
    assert all(drive.value(0x1016, 1) == 0 for drive in can_bus.drives.values())


# Samples


def spoil(can_bus: Any, cob_id: int, *copies: int) -> None:
    """Send the n-th next frame of `cob_id` `copies[n]` times, and all other frames once."""
    left = list(copies)

    def outgoing(frame: can.Message) -> list[can.Message]:
        if frame.arbitration_id == cob_id and left:
            return [frame] * left.pop(0)
        return [frame]

    can_bus.outgoing = outgoing


def test_a_lost_tpdo_is_flagged_and_never_guessed(can_bus: Any, drive_bus: CanopenDriveBus) -> None:
    with drive_bus:
        spoil(can_bus, 0x182, 0)
        sample = drive_bus.sample()
        assert sample.flags == (0, SampleFlag.MISSING, 0)
        assert math.isnan(sample.q[1])
        assert math.isnan(sample.tau[1])
        assert math.isfinite(sample.q[0] + sample.tau[2])
        assert drive_bus.sample().flags == (0, 0, 0)


def test_a_doubled_tpdo_is_flagged_and_the_first_counts(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    with drive_bus:
        spoil(can_bus, 0x183, 2)
        sample = drive_bus.sample()
        assert sample.flags == (0, 0, SampleFlag.DOUBLED)
        assert math.isfinite(sample.q[2])
        assert drive_bus.sample().flags == (0, 0, 0)


def test_a_late_tpdo_is_flagged_and_dropped(can_bus: Any, drive_bus: CanopenDriveBus) -> None:
    held: list[can.Message] = []

    def outgoing(frame: can.Message) -> list[can.Message]:
        if frame.arbitration_id != 0x181:
            return [frame]
        if not held:
            held.append(frame)
            return []
        return [held[0], frame]

    with drive_bus:
        can_bus.outgoing = outgoing
        first = drive_bus.sample()
        can_bus.drives[1].position = can_bus.drives[1].target = 512.0
        second = drive_bus.sample()
        assert first.flags[0] == SampleFlag.MISSING
        assert second.flags[0] == SampleFlag.LATE
        assert second.q[0] == pytest.approx(2 * math.pi / 800)


def test_a_foreign_frame_under_a_tpdos_identifier_is_not_taken_for_one(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    with drive_bus:
        spoil(can_bus, 0x181, 0)
        can_bus.inbox.append(can.Message(arbitration_id=0x181, data=b"\1", is_extended_id=False))
        assert drive_bus.sample().flags[0] & SampleFlag.MISSING


def test_saturation_is_flagged(can_bus: Any, drive_bus: CanopenDriveBus) -> None:
    with drive_bus:
        can_bus.drives[1].extra_status = 0x0800
        assert drive_bus.sample().flags == (SampleFlag.LIMIT, 0, 0)
        can_bus.drives[1].extra_status = 0
        assert drive_bus.sample().flags == (0, 0, 0)


# Other clocks


@pytest.fixture
def timed_bus() -> Iterator[Any]:
    bus = local_drives.TimedBus(NODES, {})
    yield bus
    bus.shutdown()


@pytest.fixture
def wall_bus(timed_bus: Any) -> CanopenDriveBus:
    """The driver with deadlines, on a busy machine too."""
    return CanopenDriveBus(timed_bus, drives_file(), period=0.02, pacing="wall-clock")


def test_on_the_wall_clock_samples_come_at_their_deadlines(wall_bus: CanopenDriveBus) -> None:
    with wall_bus:
        times = [wall_bus.sample().time for _ in range(10)]
        assert np.diff(times) == pytest.approx(0.02)
        assert wall_bus.skipped_syncs == 0


def test_on_the_wall_clock_a_deadline_that_was_missed_is_skipped_and_counted(
    timed_bus: Any, wall_bus: CanopenDriveBus
) -> None:
    with wall_bus:
        first = wall_bus.sample()
        timed_bus.time += 0.05
        assert wall_bus.sample().time - first.time == pytest.approx(0.06)
        assert wall_bus.skipped_syncs == 2


def test_on_the_wall_clock_a_tpdo_that_comes_after_its_sample_is_late(
    timed_bus: Any, wall_bus: CanopenDriveBus
) -> None:
    held: list[can.Message] = []

    def outgoing(frame: can.Message) -> list[can.Message]:
        if frame.arbitration_id == 0x182 and not held:
            held.append(frame)
            return []
        return [frame]

    with wall_bus:
        timed_bus.outgoing = outgoing
        assert wall_bus.sample().flags[1] == SampleFlag.MISSING
        timed_bus.inbox.extend(held)
        timed_bus.drives[2].position = timed_bus.drives[2].target = 500.0 - 512
        sample = wall_bus.sample()
        assert sample.flags == (0, SampleFlag.LATE, 0)
        assert sample.q[1] == pytest.approx(2 * math.pi / 800)
        assert wall_bus.sample().flags == (0, 0, 0)


def test_on_the_wall_clock_answers_that_lag_by_a_sync_are_flagged_as_long_as_nobody_knows(
    timed_bus: Any, wall_bus: CanopenDriveBus
) -> None:
    held: list[can.Message] = []

    def outgoing(frame: can.Message) -> list[can.Message]:
        if frame.arbitration_id != 0x182:
            return [frame]
        held.append(frame)
        return [held.pop(0)] if len(held) > 1 else []

    with wall_bus:
        wall_bus.sample()
        timed_bus.outgoing = outgoing
        assert wall_bus.sample().flags[1] == SampleFlag.MISSING
        assert [wall_bus.sample().flags[1] for _ in range(DOUBT)] == [SampleFlag.LATE] * DOUBT
        assert wall_bus.sample().flags[1] == 0
        timed_bus.outgoing = lambda frame: [frame]


def test_on_the_wall_clock_a_node_that_never_falls_silent_keeps_no_sample_waiting(
    timed_bus: Any,
) -> None:
    patient = drives_file().model_copy(update={"heartbeat_timeout": 60.0})
    wall_bus = CanopenDriveBus(timed_bus, patient, period=0.02, pacing="wall-clock")

    class Endless(deque[can.Message]):
        def popleft(self) -> can.Message:
            self.append(can.Message(arbitration_id=0x733, data=b"\5", is_extended_id=False))
            return super().popleft()

    with wall_bus:
        wall_bus.sample()
        quiet, timed_bus.inbox = timed_bus.inbox, Endless(timed_bus.inbox)
        timed_bus.inbox.append(can.Message(arbitration_id=0x733, data=b"\5", is_extended_id=False))
        timed_bus.outgoing = lambda frame: [] if frame.arbitration_id == 0x182 else [frame]
        assert wall_bus.sample().flags[1] == SampleFlag.MISSING
        timed_bus.inbox, timed_bus.outgoing = quiet, lambda frame: [frame]


def test_a_late_frame_of_another_length_is_no_tpdo(
    timed_bus: Any, wall_bus: CanopenDriveBus
) -> None:
    with wall_bus:
        wall_bus.sample()
        timed_bus.inbox.append(can.Message(arbitration_id=0x181, data=b"\1", is_extended_id=False))
        assert wall_bus.sample().flags == (0, 0, 0)


def test_on_the_wall_clock_our_heartbeat_goes_on_during_a_long_set_up(
    timed_bus: Any, wall_bus: CanopenDriveBus
) -> None:
    beats: list[float] = []

    def dawdle(frame: can.Message) -> None:
        timed_bus.time += 0.003
        if frame.arbitration_id == 0x77F:
            beats.append(timed_bus.time)

    timed_bus.on_send = dawdle
    begin = timed_bus.time
    with wall_bus:
        ends = [begin, *beats, timed_bus.time]
    assert ends[-1] - begin > 0.5
    assert max(after - before for before, after in pairwise(ends)) < 0.4


def test_the_plant_in_another_thread_is_driven_in_lock_step_over_a_stock_bus() -> None:
    stop = threading.Event()
    with (
        can.Bus("served", "virtual", ignore_config=True) as theirs,
        can.Bus("served", "virtual", ignore_config=True) as ours,
    ):
        plant = load_plant("manutec-r15")
        thread = threading.Thread(target=serve, args=(theirs, plant, "sync", stop))
        thread.start()
        try:
            with CanopenDriveBus(ours, load_drives(MANUTEC), pacing="lock-step") as drive_bus:
                start = drive_bus.sample().q[5]
                drive_bus.move({5: Move(start + 0.1, 1.0, 10.0)})
                samples = conformance.travel(drive_bus)
                assert samples[-1].q[5] == pytest.approx(start + 0.1, abs=3e-3)
                assert not any(flag for sample in samples for flag in sample.flags)
        finally:
            stop.set()
            thread.join()


# Trouble


def trouble(can_bus: Any, drive_bus: CanopenDriveBus, cause: Callable[[], None]) -> DriveError:
    """Cause a fault during motion; return the error after checking the stop."""
    with pytest.raises(DriveError) as caught, drive_bus:
        drive_bus.move({0: Move(1.0, 0.5, 5.0), 1: Move(1.0, 0.5, 5.0)})
        for _ in range(20):
            drive_bus.sample()
        cause()
        try:
            for _ in range(1000):
                drive_bus.sample()
        except DriveError:
            enabled = [n for n, d in can_bus.drives.items() if d.powered and d.state == "enabled"]
            assert not enabled
            raise
    assert all_off(can_bus) or any(not drive.powered for drive in can_bus.drives.values())
    for drive in can_bus.drives.values():
        assert abs(drive.position) < 0.3 * 4096 * 100 / (2 * math.pi)
    return caught.value


def test_a_fault_in_mid_motion_stops_all_axes_and_is_told_in_words(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    error = trouble(can_bus, drive_bus, lambda: can_bus.drives[2].fail(0x8611))
    assert isinstance(error, DriveFault)
    assert "joint 2 (node 2): FAULT: 8611 (following error too large)" in str(error)


def test_a_fault_without_emergency_is_told_from_the_drives_error_code(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    def fail_silently() -> None:
        can_bus.outgoing = lambda frame: [] if frame.arbitration_id == 0x82 else [frame]
        can_bus.drives[2].fail(0x3210)

    error = trouble(can_bus, drive_bus, fail_silently)
    assert "3210 (DC link over-voltage)" in str(error)


def test_an_emergency_of_a_drive_that_works_on_is_noted_once_and_stops_nothing(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    with drive_bus:
        for _ in range(3):
            can_bus.network.emit(0x83, b"\x10\x42" + bytes(6))
            drive_bus.sample()
        for _ in range(3):
            drive_bus.sample()
        warnings = [note for note in drive_bus.notes if "warning" in note]
        (warning,) = warnings
        assert "joint 3 (node 3): warning 4210 (device temperature too high)" in warning
        assert all(drive.state == "enabled" for drive in can_bus.drives.values())


def test_a_drive_that_switches_off_by_itself_stops_all_axes(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    error = trouble(can_bus, drive_bus, lambda: can_bus.drives[1].go("off"))
    assert "left OPERATION ENABLED for SWITCH ON DISABLED" in str(error)
    assert "safe torque off" in str(error)


def test_a_lost_heartbeat_stops_all_axes(can_bus: Any, drive_bus: CanopenDriveBus) -> None:
    def silence() -> None:
        can_bus.drives[3].heart_beats = False

    error = trouble(can_bus, drive_bus, silence)
    assert isinstance(error, NodeSilent)
    assert "joint 3 (node 3): no heartbeat for" in str(error)


def test_a_node_that_loses_power_is_noticed_by_its_heartbeat(
    can_bus: Any, drive_bus: CanopenDriveBus, caplog: pytest.LogCaptureFixture
) -> None:
    def cut() -> None:
        can_bus.drives[3].powered = False

    error = trouble(can_bus, drive_bus, cut)
    assert isinstance(error, NodeSilent)
    assert any("powering off is incomplete" in note for note in error.__notes__)
    assert "powering off is incomplete" in caplog.text  # callers may not show notes


def test_a_node_that_restarts_is_noticed_at_once(can_bus: Any, drive_bus: CanopenDriveBus) -> None:
    error = trouble(can_bus, drive_bus, lambda: can_bus.network.emit(0x701, b"\0"))
    assert "has restarted (boot-up)" in str(error)


def test_a_set_point_that_is_not_acknowledged_fails(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    can_bus.drives[2].deaf_to_set_points = True
    error = trouble(can_bus, drive_bus, lambda: None)
    assert isinstance(error, MoveFailed)
    assert "waiting for the drive to acknowledge" in str(error)


def test_a_set_point_that_is_not_reached_fails(can_bus: Any, drive_bus: CanopenDriveBus) -> None:
    can_bus.drives[2].immobile = True
    can_bus.drives[1].immobile = True
    with (
        pytest.raises(
            MoveFailed,
            match=r"joint 1 .*: position and current have .*; set-point 0.1 at q = 0: on the way",
        ),
        drive_bus,
    ):
        drive_bus.move({0: Move(0.1, 0.5, 5.0)})
        for _ in range(2000):
            drive_bus.sample()
    assert all_off(can_bus)


# Leaving


def test_leaving_stops_first_and_then_switches_off(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    with drive_bus:
        drive_bus.sample()
    history = can_bus.drives[1].history
    assert history[history.index("enabled") + 1 :][:2] == ["stopping", "off"]
    assert all_off(can_bus)


def test_an_interrupt_in_a_sample_switches_off(can_bus: Any, drive_bus: CanopenDriveBus) -> None:
    def interrupt(frame: can.Message) -> None:
        can_bus.on_send = lambda _: None
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), drive_bus:
        drive_bus.move({0: Move(1.0, 0.5, 5.0)})
        drive_bus.sample()
        can_bus.on_send = interrupt
        drive_bus.sample()
    assert all_off(can_bus)


@pytest.mark.parametrize("nth", range(1, 20))
def test_a_second_interrupt_while_leaving_leaves_no_drive_energised(
    can_bus: Any, drive_bus: CanopenDriveBus, nth: int
) -> None:
    sent = 0

    def press(_: can.Message) -> None:
        nonlocal sent
        sent += 1
        if sent == nth:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt), drive_bus:
        drive_bus.sample()
        can_bus.on_send = press
        raise KeyboardInterrupt
    assert sent >= nth
    assert all_off(can_bus)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("nth", range(1, 20))
def test_a_bus_error_while_leaving_keeps_no_other_drive_from_being_switched_off(
    can_bus: Any, drive_bus: CanopenDriveBus, nth: int
) -> None:
    sent = 0

    def fail(_: can.Message) -> None:
        nonlocal sent
        sent += 1
        if nth <= sent < nth + 5:
            raise can.CanOperationError("Transmit buffer full")

    with drive_bus:
        drive_bus.sample()
        can_bus.on_send = fail
    assert all_off(can_bus)


def test_a_drive_that_does_not_switch_off_is_reported_never_swallowed(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    with (
        pytest.raises(DriveFault, match=r"emergency stop.*joint 2 .*does not switch off"),
        drive_bus,
    ):
        can_bus.drives[2].stuck |= {"enabled", "stopping"}
    assert can_bus.drives[1].state == can_bus.drives[3].state == "off"


@pytest.mark.long  # power-down waits for drives without communication, 5 s by the clock
def test_a_dead_bus_is_reported_as_such(can_bus: Any, drive_bus: CanopenDriveBus) -> None:
    def die(_: can.Message) -> None:
        raise can.CanOperationError("Network is down")

    with pytest.raises(BusUnavailable, match=r"Network is down.*check cable") as caught, drive_bus:
        can_bus.on_send = die
        drive_bus.sample()
    assert any("press the emergency stop" in note for note in caught.value.__notes__)


def test_a_refused_set_never_shows_an_energised_statusword_on_the_bus() -> None:
    can_bus, drive_bus = build({3: {(0x1018, 1): ("u32", 1)}})
    shown: list[State | None] = []

    def note(frame: can.Message) -> list[can.Message]:
        if 0x180 < frame.arbitration_id < 0x200:
            shown.append(decode_state(int.from_bytes(frame.data[:2], "little")))
        return [frame]

    can_bus.outgoing = note
    with can_bus, pytest.raises(DriveRefused):
        drive_bus.__enter__()
    assert State.OPERATION_ENABLED not in shown
    assert not any(frame.arbitration_id & 0x780 == 0x200 for frame in can_bus.sent)


# Opening


@pytest.mark.parametrize(
    ("interface", "channel", "words"),
    [
        ("carrier-pigeon", "x", "'carrier-pigeon' is unknown to python-can; choose one of"),
        ("socketcan", "can77", "ip link set can77 up type can bitrate 1000000"),
        ("serial", "/dev/no-such-port", "check channel and options"),
    ],
)
def test_a_bus_that_cannot_be_opened_is_told_with_the_remedy(
    interface: str, channel: str, words: str
) -> None:
    with pytest.raises(BusUnavailable) as caught:
        open_drive_bus(drives_file(), interface, channel)
    assert words in str(caught.value)


def test_a_bus_that_was_opened_for_us_is_shut_down() -> None:
    drive_bus = open_drive_bus(drives_file(), "virtual", "nobody there", pacing="lock-step")
    with pytest.raises(NodeSilent):
        drive_bus.__enter__()
    other = can.Bus("nobody there", "virtual", ignore_config=True)
    with other:
        assert len(other.channel) == 1
