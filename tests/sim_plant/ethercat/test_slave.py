"""Slave as seen by a master: registers, states, sync managers, FMMUs, EEPROM, watchdog."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import pytest
from ethercat_master import INIT, INPUTS, MAILBOX_OUT, OP, OUTPUTS, PREOP, SAFEOP, Master

from sim_plant.drive.cia402_states import State
from sim_plant.ethercat.frame import Command

if TYPE_CHECKING:
    from sim_plant.ethercat.segment import Segment

ERROR = 0x10


@pytest.fixture
def master(segment: Segment) -> Master:
    return Master(segment.process)


def test_every_command_reads_and_writes_whom_it_names_and_counts_so(master: Master) -> None:
    counters = {
        (Command.APRD, -1 & 0xFFFF): 1,
        (Command.APWR, -1 & 0xFFFF): 1,
        (Command.APRW, -1 & 0xFFFF): 3,
        (Command.BRD, 0): 3,
        (Command.BWR, 0): 3,
        (Command.BRW, 0): 9,
        (Command.NOP, 0): 0,
        (Command.ARMW, -1 & 0xFFFF): 3,
        (Command.APRD, -3 & 0xFFFF): 0,
    }
    for (command, position), counter in counters.items():
        answer = master.send((command, position, 0x2000, b"\1\2"))[0]
        assert answer.counter == counter, command
    for slave in range(3):
        master.write(slave, 0x10, struct.pack("<H", 0x1000 + slave))
    for command, counter in ((Command.FPRD, 1), (Command.FPWR, 1), (Command.FPRW, 3)):
        assert master.send((command, 0x1002, 0x2000, b"\0"))[0].counter == counter
    assert master.send((Command.FRMW, 0x1000, 0x2000, b"\0"))[0].counter == 3
    assert master.send((Command.FPRD, 0x2000, 0x2000, b"\0"))[0].counter == 0


def test_a_broadcast_read_is_the_union_and_a_positioned_one_the_slaves_own(master: Master) -> None:
    for slave in range(3):
        master.write(slave, 0x2000, bytes([1 << slave]))
    assert master.send((Command.BRD, 0, 0x2000, b"\0"))[0] == (b"\7", 3)
    assert master.read(1, 0x2000, 1) == (b"\2", 1)
    assert master.send((Command.ARMW, -1 & 0xFFFF, 0x2000, b"\0"))[0] == (b"\2", 3)
    assert master.read(2, 0x2000, 1) == (b"\2", 1)


def test_registers_that_are_not_for_masters_stay(master: Master) -> None:
    before = master.read(0, 0x110, 2).data
    assert master.write(0, 0x110, b"\xff\xff") == 0
    assert master.read(0, 0x110, 2).data == before
    assert master.write(0, 0x2FFF, b"\0\0") == 0
    assert master.read(0, 0x2FFF, 2).counter == 0


def test_states_go_up_step_by_step_and_down_at_once(master: Master) -> None:
    assert master.state(0) == (INIT, 0)
    assert master.request(0, SAFEOP) == (INIT | ERROR, 0x11)
    master.set_manager(0, 0, MAILBOX_OUT, 128, 0x26)
    assert master.request(0, PREOP) == (INIT | ERROR, 0x11), "not acknowledged"
    assert master.request(0, PREOP | ERROR) == (INIT | ERROR, 0x16), "one mailbox is missing"
    assert master.request(0, INIT | ERROR) == (INIT, 0)
    master.enter_preop(0)
    assert master.request(0, 3) == (PREOP | ERROR, 0x13), "no bootstrap"
    assert master.request(0, 7 | ERROR) == (PREOP | ERROR, 0x12), "no such state"
    assert master.request(0, PREOP | ERROR) == (PREOP, 0)
    master.enter_safeop(0)
    assert master.request(0, OP) == (OP, 0)
    assert master.request(0, PREOP) == (PREOP, 0)
    assert master.request(0, INIT) == (INIT, 0)


@pytest.mark.parametrize(
    ("manager", "start", "size", "control", "code"),
    [
        (2, OUTPUTS, 11, 0x64, 0x1D),
        (2, OUTPUTS, 0, 0x64, 0x1D),
        (2, OUTPUTS, 12, 0x60, 0x1D),
        (2, 0x2FFC, 12, 0x64, 0x1D),
        (3, INPUTS, 13, 0x20, 0x1E),
        (3, INPUTS, 12, 0x24, 0x1E),
        (3, 0x0800, 12, 0x20, 0x1E),
    ],
)
def test_process_data_of_another_size_or_place_are_refused_on_the_way_to_safeop(
    master: Master, manager: int, start: int, size: int, control: int, code: int
) -> None:
    master.enter_preop(0)
    master.enter_safeop(0)
    master.request(0, PREOP)
    master.set_manager(0, manager, start, size, control)
    assert master.request(0, SAFEOP) == (PREOP | ERROR, code)


def test_what_a_frame_asks_for_is_not_there_in_the_same_frame(master: Master) -> None:
    asked, shown = master.send(
        (Command.APWR, 0, 0x120, struct.pack("<H", SAFEOP)), (Command.APRD, 0, 0x130, bytes(2))
    )
    assert (asked.counter, shown.data) == (1, struct.pack("<H", INIT))
    assert master.state(0)[0] == INIT | ERROR


def test_fmmus_lay_single_bits_and_status_of_mailboxes_into_logical_memory(master: Master) -> None:
    master.enter_preop(0)
    bit = struct.pack("<IHBBHBBB3x", 0x5000, 1, 6, 6, 0x80D, 3, 1, 1)
    master.write(0, 0x620, bit)
    waiting = master.send((Command.LRD, 0x5000, 0, b"\x81"))[0]
    assert waiting == (b"\x81", 1)
    master.post(0, struct.pack("<HBHBI", 2 << 12, 0x40, 0x1000, 0, 0))
    assert master.send((Command.LRD, 0x5000, 0, b"\x81"))[0].data == b"\xc1"
    nibbles = struct.pack("<IHBBHBBB3x", 0x6000, 2, 4, 3, 0x2000, 1, 3, 1)
    master.write(0, 0x630, nibbles)
    master.write(0, 0x2000, b"\xff\xff")
    assert master.send((Command.LWR, 0x6000, 0, b"\xaf\xf5"))[0].counter == 1
    assert master.read(0, 0x2000, 2).data == b"\xb5\xfe"
    assert master.send((Command.LRW, 0x6000, 0, b"\x0f\xf0"))[0].counter == 3


def test_a_datagram_may_cover_a_part_of_what_an_fmmu_maps(master: Master) -> None:
    master.write(0, 0x600, struct.pack("<IHBBHBBB3x", 0x100, 8, 0, 7, 0x2000, 0, 3, 1))
    master.write(0, 0x2000, bytes(range(8)))
    assert master.send((Command.LRD, 0x104, 0, bytes(8)))[0] == (b"\4\5\6\7\0\0\0\0", 1)
    assert master.send((Command.LWR, 0xFC, 0, b"abcdefgh"))[0].counter == 1
    assert master.read(0, 0x2000, 8).data == b"efgh\4\5\6\7"


def test_a_full_mailbox_takes_nothing_and_an_empty_one_gives_nothing(
    segment: Segment, master: Master
) -> None:
    master.enter_preop(0)
    segment.nodes[0].mailbox.is_stuck = True
    request = struct.pack("<HBHBI", 2 << 12, 0x40, 0x1000, 0, 0)
    assert master.post(0, request) == 1
    assert master.post(0, request) == 0
    assert master.fetch(0) is None
    segment.nodes[0].mailbox.is_stuck = False
    assert master.fetch(0) is None, "its firmware works after a frame"
    assert master.fetch(0) is not None


def test_a_repeated_request_is_answered_once_and_an_answer_repeated_on_request(
    master: Master,
) -> None:
    master.enter_preop(0)
    request = struct.pack("<HBHBI", 2 << 12, 0x40, 0x1000, 0, 0)
    master.post(0, request, counter=3)
    first = master.fetch(0)
    master.post(0, request, counter=3)
    assert master.fetch(0) is None
    master.write(0, 0x80E, b"\3")
    assert master.read(0, 0x80F, 1).data == b"\2"
    assert master.fetch(0) == first
    master.post(0, request, counter=4)
    again = master.fetch(0)
    assert first is not None
    assert again is not None
    assert (again[5] >> 4, again[6:]) == (first[5] % 0x70 // 16 + 1, first[6:])


@pytest.mark.parametrize(
    ("service", "kind", "size", "code"),
    [(bytes(8), 5, 8, 2), (b"\0", 3, 1, 6), (bytes(8), 3, 900, 8)],
)
def test_a_mailbox_that_is_not_understood_is_answered_with_an_error(
    master: Master, service: bytes, kind: int, size: int, code: int
) -> None:
    master.enter_preop(0)
    content = struct.pack("<HHBB", size, 0, 0, kind | 0x10) + service
    master.write(0, MAILBOX_OUT, content.ljust(512, b"\0"))
    answer = master.fetch(0)
    assert answer is not None
    assert (answer[5] & 0x0F, answer[6:]) == (0, struct.pack("<HH", 1, code))


def eeprom(master: Master, word: int, command: int = 0x100, data: bytes = b"") -> tuple[int, bytes]:
    master.write(0, 0x508, data) if data else None
    master.write(0, 0x502, struct.pack("<HI", command, word))
    return master.word(0, 0x502), master.read(0, 0x508, 8).data


def test_the_eeprom_holds_identity_and_is_written_with_leave_only(
    segment: Segment, master: Master
) -> None:
    identity = eeprom(master, 8)[1] + eeprom(master, 12)[1]
    assert struct.unpack("<4I", identity) == (0x1234, 0x402, 7, 100)
    assert eeprom(master, 4, 0x200, struct.pack("<H", 77))[0] & 0x4000
    assert eeprom(master, 4, 0x201, struct.pack("<H", 77))[0] & 0x7800 == 0
    assert master.word(0, 0x12) == 0, "an alias counts from the next power-on"
    segment.nodes[0].restart()
    assert master.word(0, 0x12) == 77
    assert master.send((Command.FPRD, 77, 0x130, bytes(2)))[0].counter == 0
    master.write(0, 0x103, b"\1")
    assert master.send((Command.FPRD, 77, 0x130, bytes(2)))[0].counter == 1
    master.write(0, 0x500, b"\1")
    assert eeprom(master, 8)[0] & 0x2000, "the slave's own side has it"


def test_the_watchdog_takes_a_slave_out_of_op_and_its_drive_into_a_fault(
    segment: Segment, master: Master
) -> None:
    master.enter_op(0)
    for word in (6, 7, 15):
        master.exchange([struct.pack("<Hiih", word, 0, 0, 0)])
    drive = segment.nodes[0]
    assert drive.state is State.OPERATION_ENABLED
    segment.elapse(0.09)
    master.exchange([struct.pack("<Hiih", 15, 0, 0, 0)])
    segment.elapse(0.09)
    assert (master.state(0), master.word(0, 0x440)) == ((OP, 0), 1)
    segment.elapse(0.02)
    assert (master.state(0), master.word(0, 0x440)) == ((SAFEOP | ERROR, 0x1B), 0)
    assert drive.state in (State.FAULT, State.FAULT_REACTION_ACTIVE)
    assert master.read(0, 0x442, 1).data == b"\1"
    assert master.request(0, OP) == (SAFEOP | ERROR, 0x1B)
    assert master.request(0, SAFEOP | ERROR) == (SAFEOP, 0)
    assert master.request(0, OP) == (OP, 0)


def test_the_watchdog_takes_the_time_that_is_written_and_none_where_it_is_zero(
    segment: Segment, master: Master
) -> None:
    master.write(0, 0x420, struct.pack("<H", 200))
    master.write(1, 0x420, bytes(2))
    master.enter_op(0, 1)
    segment.elapse(0.019)
    assert master.state(0) == (OP, 0)
    segment.elapse(0.002)
    assert master.state(0) == (SAFEOP | ERROR, 0x1B)
    segment.elapse(10.0)
    assert master.state(1) == (OP, 0)


def test_leaving_op_is_for_an_energised_drive_the_loss_of_its_master(
    segment: Segment, master: Master
) -> None:
    master.enter_op(0, 1)
    for word in (6, 7, 15):
        master.exchange([struct.pack("<Hiih", word, 0, 0, 0)] * 2)
    master.request(0, SAFEOP)
    assert segment.nodes[0].state in (State.FAULT, State.FAULT_REACTION_ACTIVE)
    assert segment.nodes[1].state is State.OPERATION_ENABLED
    assert master.fetch(0) is not None, "an emergency waits"


def test_behind_a_cut_nothing_is_reached_and_the_last_slave_closes_its_port(
    segment: Segment, master: Master
) -> None:
    assert master.word(1, 0x110) & 0x0820 == 0x0820
    segment.cuts.add(2)
    assert master.send((Command.BRD, 0, 0x130, bytes(2)))[0].counter == 2
    assert master.word(1, 0x110) & 0x0C20 == 0x0400
    segment.nodes[1].connect(False)
    assert master.send((Command.BRD, 0, 0x130, bytes(2)))[0].counter == 1
    segment.cuts.add(0)
    assert master.send((Command.BRD, 0, 0x130, bytes(2))) == []
