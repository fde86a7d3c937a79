"""Life guarding and the SYNC counter, in the plant's nodes and in the driver."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import can
import pytest
from canopen_drive_bus import CanopenDriveBus
from desk import Desk
from ideal_machine import IdealMachine
from local_bench import build, never_energised
from personalities import drives_for, plant_file

from drivers.canopen.process_data import SYNC
from drivers.cia402.states import State, decode_state
from drivers.drive_bus import DriveRefused, Move, NodeSilent
from sim_plant.canopen.abort_codes import AbortCode, SdoAbort
from sim_plant.personality import load_personality
from sim_plant.slave_network import SlaveNetwork

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

Objects = dict[tuple[int, int], Any]

OPERATIONAL, PRE_OPERATIONAL, TOGGLE = 5, 127, 0x80
GUARDED = {
    (0x1016, 1): None,
    (0x100C, 0): ("u16", 0),
    (0x100D, 0): ("u8", 0),
}


def desk_of(name: str) -> Desk:
    """Return drives of a personality with ideal axes."""
    machine = IdealMachine()
    personality = load_personality(name)
    machine.drives = tuple(replace(drive, personality=personality) for drive in machine.drives)
    network = SlaveNetwork(machine)
    network.power_on()
    return Desk(network, machine)


@pytest.fixture
def guarded() -> Desk:
    return desk_of("life-guarding")


@pytest.fixture
def counting() -> Desk:
    return desk_of("sync-counter")


def asked(desk: Desk) -> list[tuple[int, bytes]]:
    return [(number, data) for _, number, data in desk.network.receive_remote(0x701)]


# The plant


def test_a_guarding_request_is_answered_by_state_and_toggle_bit(guarded: Desk) -> None:
    assert [asked(guarded) for _ in range(3)] == [
        [(0x701, bytes([PRE_OPERATIONAL]))],
        [(0x701, bytes([PRE_OPERATIONAL | TOGGLE]))],
        [(0x701, bytes([PRE_OPERATIONAL]))],
    ]
    guarded.nmt(1)
    assert asked(guarded) == [(0x701, bytes([OPERATIONAL | TOGGLE]))]


def test_a_node_that_produces_a_heartbeat_answers_no_guarding_request(guarded: Desk) -> None:
    guarded.write(0x1017, 100)
    assert asked(guarded) == []


def test_a_drive_without_the_objects_answers_no_guarding_request(desk: Desk) -> None:
    assert asked(desk) == []


def test_a_life_time_begins_with_the_first_request_and_its_end_is_an_emergency(
    guarded: Desk,
) -> None:
    assert guarded.request(1, 0x2B, 0x0C, 0x10, 0, 100, 0)[0] == 0x60
    assert guarded.request(1, 0x2F, 0x0D, 0x10, 0, 3)[0] == 0x60
    assert not any(number == 0x81 for number, _ in guarded.sync(200))
    asked(guarded)
    assert not any(number == 0x81 for number, _ in guarded.sync(74))
    assert [data[:2] for number, data in guarded.sync(2) if number == 0x81] == [b"\x30\x81"]
    assert (0x81, bytes(8)) in asked(guarded)


def test_a_node_that_counts_does_not_act_on_a_sync_without_counter(counting: Desk) -> None:
    counting.map_tpdo(1, 0x60410010)
    counting.nmt(1)
    frames = counting.sync()
    assert not any(number == 0x181 for number, _ in frames)
    assert [data[:2] for number, data in frames if number == 0x81] == [b"\x40\x82"]
    frames = counting.send(0x80, b"\x01")
    assert any(number == 0x181 for number, _ in frames)
    assert (0x81, bytes(8)) in frames


def test_the_counter_changes_only_without_a_cycle_period(counting: Desk) -> None:
    with pytest.raises(SdoAbort) as caught:
        counting.write(0x1019, 0)
    assert caught.value.code is AbortCode.DEVICE_STATE
    counting.write(0x1006, 0)
    counting.write(0x1019, 0)
    assert counting.read(0x1019) == 0


# The driver


@pytest.fixture
def bus(tmp_path: Path) -> Iterator[can.BusABC]:
    channel = plant_file(tmp_path, "life-guarding")
    with can.Bus(channel, "sim_plant", ignore_config=True) as can_bus:
        yield can_bus


def frames(bus: can.BusABC) -> list[can.Message]:
    return list(iter(lambda: bus.recv(0), None))


def statusword_request(node: int) -> can.Message:
    data = b"\x40\x41\x60\0\0\0\0\0"
    return can.Message(arbitration_id=0x600 + node, data=data, is_extended_id=False)


def test_guarding_requests_go_out_as_often_as_our_heartbeat(
    bus: can.BusABC, tmp_path: Path
) -> None:
    channel = str(tmp_path / "life-guarding.yaml")
    with can.Bus(channel, "sim_plant", ignore_config=True) as listener:
        with CanopenDriveBus(bus, drives_for("life-guarding")) as drive_bus:
            frames(listener)
            for _ in range(250):
                drive_bus.sample()
            heard = frames(listener)
        asked_for = [f for f in heard if f.is_remote_frame and f.arbitration_id == 0x703]
        beats = [f for f in heard if f.arbitration_id == 0x77F]
        answers = [f for f in heard if f.arbitration_id == 0x703 and not f.is_remote_frame]
    assert len(asked_for) == len(beats) == len(answers) == pytest.approx(10, abs=1)
    assert [f.data[0] >> 7 for f in answers[:4]] in ([0, 1, 0, 1], [1, 0, 1, 0])


def test_the_axes_stop_by_themselves_when_our_guarding_requests_stay_away(
    bus: can.BusABC,
) -> None:
    with CanopenDriveBus(bus, drives_for("life-guarding")) as drive_bus:
        drive_bus.move({axis: Move(0.5, 0.3, 1.0) for axis in range(6)})
        for _ in range(50):
            drive_bus.sample()
        frames(bus)
        for _ in range(300):  # simulate a dead process: only SYNC continues
            bus.send(SYNC)
        heard = frames(bus)
        for node in range(1, 7):
            bus.send(statusword_request(node))
        states = [decode_state(int.from_bytes(f.data[4:6], "little")) for f in frames(bus)]
    lost = {f.arbitration_id for f in heard if f.arbitration_id >> 7 == 1 and f.data[0] == 0x30}
    assert lost == {0x80 + node for node in range(1, 7)}
    assert states == [State.SWITCH_ON_DISABLED] * 6


def test_a_drive_that_answers_no_request_is_missed_like_a_heartbeat(tmp_path: Path) -> None:
    channel = plant_file(tmp_path, "life-guarding")
    fault = tmp_path / "fault.yaml"
    fault.write_text("faults: [{what: heartbeat-lost, axis: 2, at: {time: 1.0}}]\n")
    with can.Bus(channel, "sim_plant", ignore_config=True, faults=str(fault)) as bus:
        drive_bus = CanopenDriveBus(bus, drives_for("life-guarding"))
        with pytest.raises(NodeSilent, match=r"joint 2 .*no heartbeat for 0\.5"), drive_bus:
            _sample_for(drive_bus, 3.0)


def _sample_for(drive_bus: CanopenDriveBus, duration: float) -> None:
    while drive_bus.sample().time < duration:
        pass


def test_the_guarding_ends_with_the_session_and_begins_anew_with_the_next(
    bus: can.BusABC,
) -> None:
    for _ in range(2):
        with CanopenDriveBus(bus, drives_for("life-guarding")) as drive_bus:
            assert drive_bus.sample().reached
        frames(bus)
        for _ in range(300):
            bus.send(SYNC)
        assert not [f for f in frames(bus) if f.arbitration_id >> 7 == 1]


@pytest.mark.parametrize(("place", "kept"), [((0x100C, 0), 0), ((0x100D, 0), 1), ((0x100D, 0), 20)])
def test_a_life_time_that_does_not_protect_is_refused(place: tuple[int, int], kept: int) -> None:
    can_bus, drive_bus = build({2: GUARDED})
    can_bus.drives[2].insists[place] = kept
    with can_bus:
        with pytest.raises(
            DriveRefused, match=r"joint 2 .*keeps a life time .*500 ms were written"
        ):
            drive_bus.__enter__()
        assert never_energised(can_bus)


def test_a_drive_whose_counter_cannot_be_switched_off_is_refused_with_the_reason() -> None:
    can_bus, drive_bus = build({2: {(0x1019, 0): ("u8", 240)}})
    can_bus.drives[2].node.object_dictionary[0x1019].access_type = "ro"
    with can_bus, pytest.raises(DriveRefused, match=r"joint 2 .*a counter in SYNC .* is 240\)"):
        drive_bus.__enter__()


def watching_once(drive: Any) -> None:
    """Let a drive accept each node once for its consumer heartbeats, as in CiA 301."""

    def twice(index: int, sub: int, value: int) -> int | None:
        others = [drive.value(0x1016, n) for n in (1, 2) if index == 0x1016 and n != sub]
        taken = [other >> 16 for other in others if other & 0xFFFF]
        return 0x06040043 if value & 0xFFFF and value >> 16 in taken else None

    drive.forbids = twice


@pytest.mark.parametrize(
    ("first", "second", "held"),
    [
        (0, 127 << 16 | 2000, (0, 127 << 16 | 500)),
        (5 << 16 | 100, 127 << 16 | 2000, (5 << 16 | 100, 127 << 16 | 500)),
        (0, 5 << 16 | 100, (127 << 16 | 500, 5 << 16 | 100)),
        (0, 127 << 16, (127 << 16 | 500, 127 << 16)),
    ],
)
def test_a_drive_that_watches_us_by_another_entry_is_set_there_and_gets_its_time_back(
    first: int, second: int, held: tuple[int, int]
) -> None:
    found: Objects = {(0x1016, 1): ("u32", first), (0x1016, 2): ("u32", second)}
    can_bus, drive_bus = build({2: found})
    drive = can_bus.drives[2]
    watching_once(drive)
    with can_bus:
        with drive_bus:
            assert (drive.value(0x1016, 1), drive.value(0x1016, 2)) == held
            drive_bus.move({1: Move(0.1, 0.5, 5.0)})
        assert (drive.value(0x1016, 1), drive.value(0x1016, 2)) == (first, second)


def test_a_drive_that_takes_no_consumer_heartbeat_is_not_excused_by_a_reason() -> None:
    can_bus, drive_bus = build({2: {}})
    can_bus.drives[2].forbids = lambda index, *_: 0x06040043 if index == 0x1016 else None
    with can_bus:
        with pytest.raises(DriveRefused) as caught:
            drive_bus.__enter__()
        assert never_energised(can_bus)
    assert "free an entry of 1016 with the maker's commissioning tool" in str(caught.value)
    assert "allow_no_heartbeat" not in str(caught.value)


@pytest.mark.parametrize(
    ("found", "written"),
    [
        (0x40000080, [0x80]),
        (0x20000080, [0x80]),
        (0x00000090, [0x80]),
        (0x40000090, [0x90, 0x80]),
        (0xC0000080, [0x80000080]),
        (0x80000080, []),
    ],
)
def test_a_drive_produces_no_sync_of_its_own_from_before_our_period_until_its_own_is_back(
    found: int, written: list[int]
) -> None:
    can_bus, drive_bus = build({2: {(0x1005, 0): ("u32", found), (0x1006, 0): ("u32", 10_000)}})
    drive = can_bus.drives[2]
    asked: list[tuple[int, int]] = []

    def strict(index: int, _: int, value: int) -> int | None:
        if index not in {0x1005, 0x1006}:
            return None
        asked.append((index, value))
        produces = drive.value(0x1005) & 1 << 30
        locked = produces and index == 0x1005 and (drive.value(0x1005) ^ value) & 0x3FFFFFFF
        return 0x06090030 if locked else None

    drive.forbids = strict
    with can_bus:
        with drive_bus:
            assert asked == [*((0x1005, value) for value in written), (0x1006, 4000)]
            asked.clear()
        assert asked == [(0x1006, 10_000), *([(0x1005, found)] if written else [])]
        assert drive.value(0x1005) == found


def test_a_drive_that_insists_on_producing_sync_is_refused() -> None:
    can_bus, drive_bus = build({2: {(0x1005, 0): ("u32", 0x40000080)}})
    can_bus.drives[2].insists[0x1005, 0] = 0x40000080
    with can_bus, pytest.raises(DriveRefused, match=r"joint 2 .*1005:00 .*reads back"):
        drive_bus.__enter__()


def test_the_cycle_period_is_zero_while_the_counter_is_switched_off(tmp_path: Path) -> None:
    channel = plant_file(tmp_path, "sync-counter")
    with (
        can.Bus(channel, "sim_plant", ignore_config=True) as bus,
        can.Bus(channel, "sim_plant", ignore_config=True) as listener,
    ):
        with CanopenDriveBus(bus, drives_for("sync-counter")) as drive_bus:
            assert drive_bus.sample().reached
        heard = [bytes(f.data) for f in frames(listener) if f.arbitration_id == 0x601]
    written = [
        (data[1] | data[2] << 8, int.from_bytes(data[4:8], "little"))
        for data in heard
        if data[0] >> 5 == 1 and data[2] == 0x10
    ]
    wanted = [pair for pair in written if pair[0] in {0x1006, 0x1019}]
    assert wanted == [
        *((0x1006, 0), (0x1019, 0), (0x1006, 4000)),
        *((0x1006, 0), (0x1019, 240), (0x1006, 10000)),  # put back
    ]
