"""Faults of EtherCAT, and of drives connected by it."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import pytest
from ethercat_master import OP, SAFEOP, Master, SdoRefused, frame_of

from checked_files.yaml_file import FileError
from sim_plant.drive.cia402_states import State
from sim_plant.ethercat.frame import Command
from sim_plant.faults.fault_plan import load_fault_plan
from sim_plant.faults.faulty_segment import FaultySegment
from sim_plant.switch_on import load_machine

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

ERROR = 0x10
OUT = struct.pack("<Hiih", 15, 0, 0, 0)


@pytest.fixture
def faulty(tmp_path: Path) -> Callable[[str], FaultySegment]:
    def make(fault: str) -> FaultySegment:
        path = tmp_path / "faults.yaml"
        path.write_text(f"faults: [{fault}]\n")
        segment = FaultySegment(load_machine("manutec-r15"), "sync", load_fault_plan(path))
        segment.power_on()
        return segment

    return make


def energised(segment: FaultySegment) -> Master:
    """Return a master with all drives in OPERATION ENABLED."""
    master = Master(segment.process)
    master.enter_op(*range(6))
    for word in (6, 7, 15, 15):
        master.exchange([struct.pack("<Hiih", word, 0, 0, 0)] * 6)
    assert {node.state for node in segment._network.nodes} == {State.OPERATION_ENABLED}
    return master


@pytest.mark.parametrize("cut", range(1, 7))
def test_behind_a_cut_cable_the_watchdogs_stop_the_drives(
    faulty: Callable[[str], FaultySegment], cut: int
) -> None:
    segment = faulty(f"{{what: segment-cut, axis: {cut}, at: {{sync: 10}}}}")
    master = energised(segment)
    for _ in range(5):
        assert [answer.counter for answer in master.exchange([OUT] * 6)] == [3] * 6
    for _ in range(40):
        answers = master.exchange([OUT] * 6)
        assert [a.counter for a in answers] == (
            [3] * (cut - 1) + [0] * (7 - cut) if cut > 1 else []
        )
    nodes = segment._network.nodes
    assert [node.states.state for node in nodes] == [OP] * (cut - 1) + [SAFEOP] * (7 - cut)
    off = {State.FAULT, State.FAULT_REACTION_ACTIVE}
    assert all(node.state in off for node in nodes[cut - 1 :])


@pytest.mark.parametrize("what", ["transmit-outage", "receive-outage"])
def test_frames_that_are_lost_let_their_time_pass(
    faulty: Callable[[str], FaultySegment], what: str
) -> None:
    segment = faulty(f"{{what: {what}, at: {{sync: 5}}, lasts: {{syncs: 3}}}}")
    master = energised(segment)
    before = segment.time
    for _ in range(3):
        assert master.exchange([OUT] * 6) == []
    assert [answer.counter for answer in master.exchange([OUT] * 6)] == [3] * 6
    assert segment.time - before == pytest.approx(4 * 0.004)
    assert {node.states.state for node in segment._network.nodes} == {OP}


def test_a_share_of_lost_frames_is_lost_by_chance_and_the_same_in_every_run(
    faulty: Callable[[str], FaultySegment],
) -> None:
    def lost() -> list[int]:
        segment = faulty("{what: frames-lost, size: 20, at: {sync: 5}}")
        master = energised(segment)
        return [n for n in range(200) if not master.exchange([OUT] * 6)]

    first = lost()
    assert 20 <= len(first) <= 60
    assert lost() == first


def test_a_late_frame_comes_with_the_next_one(faulty: Callable[[str], FaultySegment]) -> None:
    segment = faulty("{what: frame-late, at: {frame: 2}}")
    passed = []
    for number in range(4):
        frame = bytearray(frame_of((Command.BRD, 0, 0x130, bytes(2))))
        frame[17] = number
        answer = segment.process(bytes(frame))
        passed.append(None if answer is None else answer[17])
    assert passed == [0, None, 1, 2]


def test_a_slave_that_falls_to_safeop_states_its_code_and_stops_its_drive(
    faulty: Callable[[str], FaultySegment],
) -> None:
    segment = faulty("{what: al-error, axis: 2, code: 0x1A, at: {sync: 6}}")
    master = energised(segment)
    for _ in range(3):
        master.exchange([OUT] * 6)
    assert master.state(1) == (SAFEOP | ERROR, 0x1A)
    assert segment._network.nodes[1].state in (State.FAULT, State.FAULT_REACTION_ACTIVE)


def test_a_slave_without_supply_cuts_the_line_and_begins_anew(
    faulty: Callable[[str], FaultySegment],
) -> None:
    segment = faulty("{what: supply-lost, axis: 3, at: {sync: 6}, lasts: {syncs: 5}}")
    master = energised(segment)
    for _ in range(4):
        answers = master.exchange([OUT] * 6)
    assert [answer.counter for answer in answers] == [3, 3, 0, 0, 0, 0]
    for _ in range(5):
        master.exchange([OUT] * 6)
    assert master.state(2) == (1, 0)
    assert master.state(3)[0] == OP


def test_mailboxes_that_hang_or_refuse(faulty: Callable[[str], FaultySegment]) -> None:
    segment = faulty(
        "{what: sdo-silent, axis: 1, at: {sync: 5}, lasts: {syncs: 1}},"
        "{what: sdo-aborted, axis: 2, code: 0x08000022, at: {sync: 5}}"
    )
    master = energised(segment)
    master.exchange([OUT] * 6)
    with pytest.raises(AssertionError):
        master.upload(0, 0x1000)
    with pytest.raises(SdoRefused, match="0x8000022"):
        master.upload(1, 0x1000)
    master.exchange([OUT] * 6)
    master.exchange([OUT] * 6)
    assert master.fetch(0) is not None


def test_an_alias_and_a_drift_are_the_slaves(faulty: Callable[[str], FaultySegment]) -> None:
    segment = faulty(
        "{what: alias, axis: 1, size: 9, at: {time: 0}},"
        "{what: alias, axis: 2, size: 9, at: {time: 0}},"
        "{what: clock-drift, axis: 2, size: 50, at: {time: 0}}"
    )
    master = Master(segment.process)
    assert [master.word(n, 0x12) for n in range(3)] == [9, 9, 0]
    before = segment._network.nodes[1].clock.local(segment.time)
    segment.elapse(1.0)
    assert segment._network.nodes[1].clock.local(segment.time) - before == 1_000_050_000


def test_a_fault_of_can_is_refused(faulty: Callable[[str], FaultySegment]) -> None:
    with pytest.raises(FileError, match="tpdo-lost does not exist on this bus"):
        faulty("{what: tpdo-lost, axis: 1, at: {sync: 1}}")


def test_a_lost_drive_fault_is_that_of_can(faulty: Callable[[str], FaultySegment]) -> None:
    segment = faulty("{what: fault, axis: 4, code: 0x2310, at: {sync: 6}}")
    master = energised(segment)
    for _ in range(3):
        master.exchange([OUT] * 6)
    emergency = master.fetch(3)
    assert emergency is not None
    assert struct.unpack_from("<HH", emergency, 6) == (1 << 12, 0x2310)
    assert master.upload(3, 0x603F) == b"\x10\x23"
