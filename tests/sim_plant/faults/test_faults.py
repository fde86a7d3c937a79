"""Faults by plan: read, begun and ended in time, with the reactions in docs/reference/faults.md."""

from __future__ import annotations

import logging
import struct
import threading
from typing import TYPE_CHECKING, Any

import can
import pytest
from fault_table.cases import CASES
from fault_table.ethercat_cases import ETHERCAT_CASES
from fault_table.promise import tried
from faulty_bench import SYNC, network, plan, write
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from checked_files.yaml_file import FileError
from sim_plant import __main__ as command
from sim_plant.faults import faulty_network, faulty_segment
from sim_plant.faults.fault_plan import Fault, What, load_fault_plan
from sim_plant.faults.frame_faults import BusOff, NotSent
from sim_plant.faults.moment import Progress, Watch
from sim_plant.plant import load_plant
from sim_plant.serving.server import serve

if TYPE_CHECKING:
    from pathlib import Path

    from fault_table.cases import Case

    from sim_plant.faults.faulty_network import FaultyNetwork

START = (0, b"\1\0")
QUICK = (
    "one frame does not come back",
    "cable cut in front of drive 6",
    "a drive falls to SAFEOP with an error",
    "safe torque off of a drive",
)
"""Rows over EtherCAT in every test run; the others are long."""


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_every_fault_of_the_table_is_survived_as_described(case: Case) -> None:
    logging.disable()
    try:
        assert tried(case).broken == []
    finally:
        logging.disable(logging.NOTSET)


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, id=case.name, marks=() if case.name in QUICK else pytest.mark.long)
        for case in ETHERCAT_CASES
    ],
)
def test_every_fault_of_the_table_is_survived_over_ethercat_too(case: Case) -> None:
    logging.disable()
    try:
        assert tried(case, ethercat=True).broken == []
    finally:
        logging.disable(logging.NOTSET)


def test_every_kind_of_fault_has_a_row() -> None:
    assert {fault.what for case in CASES for fault in case.faults} == set(faulty_network.KINDS)
    over_ethercat = {fault.what for case in ETHERCAT_CASES for fault in case.faults}
    assert set(faulty_segment.KINDS) - over_ethercat == {What.BUS_OFF, What.ALIAS, What.CLOCK_DRIFT}
    assert {*faulty_network.KINDS, *faulty_segment.KINDS} == set(What)


# The plan


def test_a_plan_reads_what_where_when_and_how_long(tmp_path: Path) -> None:
    path = tmp_path / "faults.yaml"
    path.write_text(
        "faults:\n"
        "  - {what: tpdo-lost, axis: 2, at: {set_point: 3, after: 0.2}, lasts: {syncs: 1}}\n"
        "  - {what: fault, axis: 1, code: 0x2310, at: {time: 12.5}}\n"
    )
    lost, failed = load_fault_plan(path).faults
    assert (lost.what, lost.axis, lost.at.set_point, lost.at.after) == ("tpdo-lost", 2, 3, 0.2)
    assert lost.lasts is not None
    assert lost.lasts.syncs == 1
    assert (failed.code, failed.at.time, failed.lasts) == (0x2310, 12.5, None)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("{what: tpdo-lost, at: {sync: 1}}", "f.yaml:2: faults.0: tpdo-lost needs axis"),
        ("{what: cable-cut, axis: 1, at: {sync: 1}}", "cable-cut takes no axis"),
        ("{what: fault, axis: 1, at: {sync: 1}}", "fault needs code"),
        ("{what: encoder-jump, axis: 1, at: {sync: 1}}", "encoder-jump needs size"),
        ("{what: fault, axis: 1, code: 0x12345, at: {sync: 1}}", "must be at most FFFFh"),
        ("{what: cable-cut, at: {}}", "must have one of time, sync, frame, set_point, not none"),
        ("{what: cable-cut, at: {time: 1, sync: 2}}", "not time and sync"),
        ("{what: cable-cut, at: {sync: 1}, lasts: {}}", "must have either time or syncs"),
        ("{what: earthquake, at: {sync: 1}}", "'earthquake'"),
    ],
)
def test_a_plan_that_makes_no_sense_is_refused_with_its_place(line: str, words: str) -> None:
    with pytest.raises(FileError, match=r"f\.yaml:2") as caught:
        plan(line)
    assert words in str(caught.value)


def test_a_fault_of_an_axis_that_is_not_there_is_refused() -> None:
    with pytest.raises(FileError, match="axis: 7 must be at most 6"):
        network("{what: node-reset, axis: 7, at: {sync: 1}}")


# The moment


@given(begin=st.integers(1, 40), syncs=st.integers(1, 40))
def test_a_fault_of_so_many_syncs_is_present_at_exactly_these(begin: int, syncs: int) -> None:
    fault = plan(f"{{what: cable-cut, at: {{sync: {begin}}}, lasts: {{syncs: {syncs}}}}}").faults[0]
    watch = Watch(fault)
    present = [n for n in range(1, 100) if watch.present(Progress(n * 0.004, n, n))]
    assert present == list(range(begin, begin + syncs))


def test_a_fault_that_begins_between_two_syncs_is_present_at_as_many_as_it_should() -> None:
    faulty = reporting("{what: tpdo-lost, axis: 2, at: {frame: 20}, lasts: {syncs: 1}}")
    while faulty.progress.frames < 20:
        faulty.receive(0x77F, b"\5")
    assert faulty.present
    answers = [identifiers(faulty.receive(*SYNC)) for _ in range(3)]
    assert answers == [[0x181], [0x181, 0x182], [0x181, 0x182]]


@given(begin=st.floats(0, 0.2), after=st.floats(0, 0.1), lasts=st.floats(0.01, 0.1))
def test_a_fault_in_time_begins_and_ends_in_time(begin: float, after: float, lasts: float) -> None:
    fault = Fault.model_validate(
        {"what": "cable-cut", "at": {"time": begin, "after": after}, "lasts": {"time": lasts}}
    )
    watch = Watch(fault)
    present = [t for t in (n * 0.004 for n in range(200)) if watch.present(Progress(t, 1, 1))]
    assert begin + after <= present[0] < begin + after + 0.0041
    assert lasts - 0.0041 < present[-1] - present[0] <= lasts
    assert watch.over


# Effect of injections on frames; other effects are shown by the fault table


def identifiers(frames: list[tuple[float, int, bytes]]) -> list[int]:
    return [identifier for _, identifier, _ in frames]


def report_status(faulty: FaultyNetwork, node: int) -> None:
    """Map the statusword into TPDO 1 of a node, on every SYNC."""
    for index, sub, size, value in (
        (0x1800, 1, 4, 1 << 31 | 0x180 + node),
        (0x1800, 2, 1, 1),
        (0x1A00, 0, 1, 0),
        (0x1A00, 1, 4, 0x6041_0010),
        (0x1A00, 0, 1, 1),
        (0x1800, 1, 4, 0x180 + node),
    ):
        write(faulty, node, index, sub, size, value)


def reporting(*lines: str) -> FaultyNetwork:
    faulty = network(*lines)
    for node in (1, 2):
        report_status(faulty, node)
    faulty.receive(*START)
    return faulty


@pytest.mark.parametrize(
    ("what", "seen"),
    [
        ("tpdo-lost", [[0x181, 0x182], [0x181], [0x181], [0x181, 0x182]]),
        ("tpdo-doubled", [[0x181, 0x182], [0x181, 0x182, 0x182], [0x181, 0x182, 0x182],
                          [0x181, 0x182]]),
        ("tpdo-late", [[0x181, 0x182], [0x181], [0x182, 0x181], [0x182, 0x181, 0x182]]),
    ],
)  # fmt: skip
def test_tpdos_are_lost_doubled_or_late_for_as_long_as_planned(
    what: str, seen: list[list[int]]
) -> None:
    faulty = reporting(f"{{what: {what}, axis: 2, at: {{sync: 2}}, lasts: {{syncs: 2}}}}")
    assert [identifiers(faulty.receive(*SYNC)) for _ in range(4)] == seen


def test_set_points_are_counted_by_axis() -> None:
    faulty = network("{what: heartbeat-lost, axis: 2, at: {set_point: 2}}")
    for node in (1, 2, 2):
        for word in (0x1F, 0x0F):
            write(faulty, node, 0x6040, 0, 2, word)
    assert faulty.progress.set_points == {1: 1, 2: 2}
    faulty.receive(*SYNC)
    assert [fault.axis for fault in faulty.present] == [2]


def test_a_cut_cable_passes_nothing_but_time() -> None:
    faulty = reporting("{what: cable-cut, at: {sync: 2}, lasts: {syncs: 3}}")
    answers = [identifiers(faulty.receive(*SYNC)) for _ in range(5)]
    assert [bool(answer) for answer in answers] == [True, False, False, False, True]
    assert faulty.time == pytest.approx(5 * 0.004)


def test_an_adapter_in_bus_off_takes_no_frame() -> None:
    faulty = network("{what: adapter-bus-off, at: {frame: 2}}")
    faulty.receive(*SYNC)
    with pytest.raises(BusOff, match="frame 080"):
        faulty.receive(*SYNC)


@pytest.mark.parametrize("what", ["adapter-bus-off", "transmit-outage"])
def test_an_adapter_that_takes_no_frame_takes_no_guarding_request(what: str) -> None:
    faulty = network(f"{{what: {what}, at: {{frame: 1}}}}")
    with pytest.raises(NotSent, match="frame 701"):
        faulty.receive_remote(0x701)


@pytest.mark.parametrize("what", ["cable-cut", "master-heartbeat-lost"])
def test_a_guarding_request_is_lost_as_a_heartbeat_is(what: str) -> None:
    faulty = network(f"{{what: {what}, at: {{frame: 1}}}}")
    heard: list[int] = []
    faulty._network.receive_remote = heard.append  # type: ignore[assignment, method-assign]
    assert faulty.receive_remote(0x701) == []
    assert not heard


@pytest.mark.parametrize("what", ["adapter-bus-off", "transmit-outage"])
def test_time_passes_with_a_sync_that_our_adapter_refuses(what: str) -> None:
    faulty = reporting(f"{{what: {what}, at: {{sync: 2}}, lasts: {{time: 0.05}}}}")
    faulty.receive(*SYNC)
    for _ in range(13):  # 0.052 s
        with pytest.raises(NotSent):
            faulty.receive(*SYNC)
    assert identifiers(faulty.receive(*SYNC)) == [0x181, 0x182]
    assert faulty.time == pytest.approx(15 * 0.004)


def test_no_time_passes_with_another_frame_that_our_adapter_refuses() -> None:
    faulty = network("{what: transmit-outage, at: {frame: 1}}")
    with pytest.raises(NotSent, match="transmit outage: frame 000 was not sent"):
        faulty.receive(*START)
    assert faulty.time == 0.0


@pytest.mark.parametrize(("what", "heard"), [("transmit-outage", [0x702]), ("adapter-bus-off", [])])
def test_a_transmit_outage_leaves_us_hearing_the_drives(what: str, heard: list[int]) -> None:
    faulty = network(f"{{what: {what}, at: {{sync: 1}}}}")
    write(faulty, 2, 0x1017, 0, 2, 3)
    with pytest.raises(NotSent) as refused:
        faulty.receive(*SYNC)
    assert identifiers(refused.value.frames) == heard


def test_a_receive_outage_lets_our_frames_through() -> None:
    faulty = reporting("{what: receive-outage, at: {sync: 2}, lasts: {time: 0.008}}")
    faulty.receive(*SYNC)
    assert faulty.receive(*SYNC) == []
    faulty.receive(0, b"\x80\2")  # pre-operational
    answers = [identifiers(faulty.receive(*SYNC)) for _ in range(2)]
    assert answers == [[], [0x181]]


def test_what_drives_send_in_a_transmit_outage_is_in_the_bus_s_queue(tmp_path: Path) -> None:
    path = tmp_path / "faults.yaml"
    path.write_text("faults:\n  - {what: transmit-outage, at: {sync: 1}}\n")
    with can.Bus(interface="sim_plant", channel="manutec-r15", faults=str(path)) as bus:
        produce = struct.pack("<BHBI", 0x2B, 0x1017, 0, 3)
        bus.send(can.Message(arbitration_id=0x602, data=produce, is_extended_id=False))
        while bus.recv(0):
            pass
        with pytest.raises(can.CanOperationError):
            bus.send(can.Message(arbitration_id=0x80, is_extended_id=False))
        beat = bus.recv(0)
    assert beat is not None
    assert beat.arbitration_id == 0x702


def test_a_drive_whose_supply_returns_boots() -> None:
    faulty = reporting("{what: supply-lost, axis: 2, at: {sync: 2}, lasts: {syncs: 2}}")
    answers = [identifiers(faulty.receive(*SYNC)) for _ in range(4)]
    assert answers == [[0x181, 0x182], [0x181], [0x181], [0x181, 0x702]]


def test_a_drive_back_from_bus_off_goes_on_where_it_was() -> None:
    faulty = reporting("{what: bus-off, axis: 2, at: {sync: 2}, lasts: {syncs: 1}}")
    answers = [identifiers(faulty.receive(*SYNC)) for _ in range(3)]
    assert answers == [[0x181, 0x182], [0x181], [0x181, 0x182]]


# Sensors


def readings(faulty: FaultyNetwork, field: int) -> list[int]:
    return [int(value) for value in faulty.machine.read()[field::7]]


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("{what: current-offset, axis: 3, size: 200, at: {sync: 1}}", range(150, 250)),
        ("{what: current-clipped, axis: 3, size: 0, at: {sync: 1}}", range(1)),
    ],
)
def test_a_current_sensor_shows_what_is_planned(line: str, expected: range) -> None:
    faulty = network(line)
    faulty.receive(*SYNC)
    currents = readings(faulty, 3)
    assert currents[2] in expected
    assert all(abs(current) < 50 for n, current in enumerate(currents) if n != 2)


def test_a_current_that_is_stuck_shows_one_value_until_it_is_over() -> None:
    faulty = network("{what: current-stuck, axis: 1, at: {sync: 2}, lasts: {syncs: 20}}")
    shown = []
    for _ in range(60):
        faulty.receive(*SYNC)
        shown.append(readings(faulty, 3)[0])
    assert len(set(shown[2:21])) == 1
    assert len(set(shown[25:])) > 3


def test_an_encoder_that_jumps_back_shows_the_old_angle() -> None:
    faulty = network("{what: encoder-jump, axis: 1, size: 500, at: {sync: 2}, lasts: {syncs: 2}}")
    shown: list[Any] = []
    for _ in range(4):
        faulty.receive(*SYNC)
        shown.append(readings(faulty, 0)[0])
    assert [round(value - shown[0], -2) for value in shown] == [0, 500, 500, 0]


def test_a_push_from_outside_is_met_by_motor_and_friction_until_it_is_over() -> None:
    faulty = network(
        "{what: push, axis: 1, size: 189, at: {sync: 20}, lasts: {syncs: 60}}"  # 600 per mille
    )
    faulty.machine.axes[0].enable()
    shown = []
    for _ in range(200):
        faulty.receive(*SYNC)
        shown.append(readings(faulty, 3)[0])
    before, during, after = (sum(shown[a:b]) / (b - a) for a, b in ((5, 19), (60, 79), (180, 200)))
    assert abs(during - before + 600) < 150  # the friction of the axis
    assert abs(after - before) < 150


# Plant served with a fault plan


def test_a_served_plant_takes_a_plan() -> None:
    stop, faults = threading.Event(), plan("{what: node-reset, axis: 2, at: {sync: 3}}")
    with (
        can.Bus("faults", "virtual", ignore_config=True) as theirs,
        can.Bus("faults", "virtual", ignore_config=True) as ours,
    ):
        arguments = (theirs, load_plant("manutec-r15"), "sync", stop, faults)
        server = threading.Thread(target=serve, args=arguments)
        server.start()
        try:
            boots = [ours.recv(20.0) for _ in range(6)]
            for _ in range(3):
                ours.send(can.Message(arbitration_id=0x80, is_extended_id=False))
            again = ours.recv(20.0)
        finally:
            stop.set()
            server.join()
    assert [boot.arbitration_id for boot in boots if boot] == [0x701 + n for n in range(6)]
    assert again is not None
    assert (again.arbitration_id, again.data) == (0x702, b"\0")


def test_the_command_refuses_a_plan_that_does_not_fit(tmp_path: Path) -> None:
    path = tmp_path / "faults.yaml"
    path.write_text("faults:\n  - {what: fault, axis: 1, at: {sync: 1}}\n")
    options = ["--interface", "virtual", "--channel", "x", "--faults", str(path)]
    result = CliRunner().invoke(command.app, options)
    assert result.exit_code == 1
    assert "faults.yaml:2: faults.0: fault needs code" in result.output
