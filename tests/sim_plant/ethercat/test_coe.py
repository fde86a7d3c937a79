"""CoE: transfers of every kind, complete access, SDO information, process data by assignment."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import pytest
from ethercat_master import OP, SAFEOP, Master, SdoRefused

from sim_plant.drive.cia402_states import State
from sim_plant.ethercat.objects import coe_entries

if TYPE_CHECKING:
    from sim_plant.ethercat.segment import Segment


@pytest.fixture
def master(segment: Segment) -> Master:
    opened = Master(segment.process)
    opened.enter_preop(0)
    return opened


def test_all_objects_are_read_and_what_is_written_is_held(master: Master) -> None:
    for entry in coe_entries().values():
        if entry.readable:
            found = master.upload(0, entry.index, entry.subindex)
            assert not entry.code or len(found) == entry.size
    master.download(0, 0x6081, 0, struct.pack("<I", 4321))
    assert master.upload(0, 0x6081) == struct.pack("<I", 4321)
    assert master.upload(0, 0x2000) == b"axis 1"


@pytest.mark.parametrize(
    ("index", "subindex", "data", "code"),
    [
        (0x2FFF, 0, b"\0", "0x6020000"),
        (0x1018, 9, b"\0", "0x6090011"),
        (0x6502, 0, bytes(4), "0x6010002"),
        (0x6081, 0, b"\0", "0x6070013"),
        (0x6081, 0, bytes(8), "0x6070012"),
        (0x6060, 0, b"\7", "0x6090030"),
    ],
)
def test_what_does_not_fit_is_aborted_with_its_code(
    master: Master, index: int, subindex: int, data: bytes, code: str
) -> None:
    with pytest.raises(SdoRefused, match=code):
        master.download(0, index, subindex, data)


def test_a_value_longer_than_the_mailbox_travels_in_segments(
    segment: Segment, master: Master
) -> None:
    segment.nodes[0].dictionary.preset(0x1008, 0, bytes(range(97, 117)) * 60)
    assert master.upload(0, 0x1008) == bytes(range(97, 117)) * 60
    master.request(0, 1)
    small = Master(segment.process, 22)
    small.enter_preop(0)
    assert small.upload(0, 0x1008) == bytes(range(97, 117)) * 60


def test_a_download_in_segments_is_written_with_the_last_one(master: Master) -> None:
    master.coe(0, 2, struct.pack("<BHBI", 0x21, 0x6081, 0, 4) + b"\x10\x27")
    assert master.coe(0, 2, bytes([0x01 | 5 << 1]) + b"\0\0" + bytes(5) + b"")[0] == 0x20
    assert master.upload(0, 0x6081) == struct.pack("<I", 10_000)
    master.coe(0, 2, struct.pack("<BHBI", 0x21, 0x6081, 0, 4) + b"\x10\x27")
    toggled = master.coe(0, 2, bytes([0x11 | 5 << 1]) + bytes(7))
    assert struct.unpack_from("<I", toggled, 4)[0] == 0x0503_0000


def test_complete_access_reads_and_writes_an_object_at_once(master: Master) -> None:
    identity = master.upload(0, 0x1018, complete=True)
    assert identity == struct.pack("<BxIIII", 4, 0x1234, 0x402, 7, 100)
    assert master.upload(0, 0x1018, 1, complete=True) == identity[2:]
    master.download(0, 0x1C12, 0, struct.pack("<BxHH", 2, 0x1601, 0x1600), complete=True)
    assert master.upload(0, 0x1C12, complete=True) == struct.pack("<BxHH", 2, 0x1601, 0x1600)
    for index, data in ((0x6081, bytes(4)), (0x1018, bytes(2) + bytes(16)), (0x2FFF, bytes(4))):
        with pytest.raises(SdoRefused):
            master.download(0, index, 0, data, complete=True)


def information(master: Master, code: int, data: bytes) -> bytes:
    answer = master.coe(0, 8, struct.pack("<BBH", code, 0, 0) + data)
    whole = answer[4:]
    while answer[0] & 0x80:
        fragment = master.fetch(0)
        assert fragment is not None
        answer = fragment[8:]
        whole += answer[4:]
    return answer[:1] + whole


def test_sdo_information_lists_and_describes_every_object(segment: Segment, master: Master) -> None:
    listed = information(master, 1, struct.pack("<H", 1))
    indices = struct.unpack(f"<{len(listed) // 2 - 1}H", listed[3:])
    assert set(indices) == {entry.index for entry in coe_entries().values()}
    counts = struct.unpack("<HHHHHH", information(master, 1, bytes(2))[1:])
    assert counts[1] == len(indices)
    for index in indices:
        found = information(master, 3, struct.pack("<H", index))
        assert struct.unpack_from("<H", found, 1)[0] == index
        name, last, kind = found[7:].decode(), found[5], found[6]
        assert name
        assert kind in (7, 8, 9)
        for subindex in range(last + 1):
            entry = information(master, 5, struct.pack("<HBB", index, subindex, 0))
            assert struct.unpack_from("<HB", entry, 1) == (index, subindex)
    assert segment.nodes[0].mailbox.is_crowded is False
    assert information(master, 3, b"\xff\x2f")[0] == 7


def assign(master: Master, slave: int, index: int, *mappings: int) -> None:
    for subindex, number in ((0, 0), *enumerate(mappings, start=1), (0, len(mappings))):
        data = bytes([number]) if subindex == 0 else struct.pack("<H", number)
        master.download(slave, index, subindex, data)


def test_process_data_are_what_assignment_and_mappings_say(
    segment: Segment, master: Master
) -> None:
    for subindex, number in ((0, 0), (1, 0x6061_0008), (2, 0x6064_0020), (0, 2)):
        data = bytes([number]) if subindex == 0 else struct.pack("<I", number)
        master.download(0, 0x1A00, subindex, data)
    assign(master, 0, 0x1C13, 0x1A00, 0x1A02)
    assign(master, 0, 0x1C12, 0x1601)
    master.enter_safeop(0, (3, segment.nodes[0].process_data.sizes[1]))
    assert segment.nodes[0].process_data.sizes[0] == 3
    for wrong in ((0x1C12, 0, b"\0"), (0x1A00, 0, b"\0")):
        with pytest.raises(SdoRefused, match="0x8000022"):
            master.download(0, *wrong)


@pytest.mark.parametrize(
    ("index", "subindex", "number", "code"),
    [
        (0x1C12, 1, 0x1601, "0x6010000"),
        (0x1A00, 1, 0x6064_0020, "0x6010000"),
    ],
)
def test_a_mapping_in_use_is_not_changed(
    master: Master, index: int, subindex: int, number: int, code: str
) -> None:
    data = struct.pack("<I" if index == 0x1A00 else "<H", number)
    with pytest.raises(SdoRefused, match=code):
        master.download(0, index, subindex, data)


def test_objects_that_cannot_be_mapped_or_assigned_are_refused(master: Master) -> None:
    for index in (0x1600, 0x1C12):
        master.download(0, index, 0, b"\0")
    for index, data, code in (
        (0x1600, struct.pack("<I", 0x6064_0020), "0x6040041"),
        (0x1600, struct.pack("<I", 0x6040_0008), "0x6040041"),
        (0x1C12, struct.pack("<H", 0x1A00), "0x6090030"),
    ):
        with pytest.raises(SdoRefused, match=code):
            master.download(0, index, 1, data)
    master.download(0, 0x1C12, 1, struct.pack("<H", 0x1601))
    master.download(0, 0x1C12, 2, struct.pack("<H", 0x1601))
    with pytest.raises(SdoRefused, match="0x6040043"):
        master.download(0, 0x1C12, 0, b"\2")


def test_outputs_act_when_the_frame_has_passed_and_show_a_cycle_later(
    segment: Segment, master: Master
) -> None:
    master.enter_op(0)

    def statusword(word: int) -> int:
        answer = master.exchange([struct.pack("<Hiih", word, 0, 0, 0)])[0]
        return int(struct.unpack_from("<H", answer.data, 12)[0]) & 0x6F

    assert [statusword(word) for word in (0, 6, 7, 15, 15, 15)] == [
        0x00,
        State.SWITCH_ON_DISABLED,
        State.SWITCH_ON_DISABLED,
        State.READY,
        State.SWITCHED_ON,
        State.OPERATION_ENABLED,
    ]


def test_a_set_point_comes_together_with_its_controlword_whatever_the_order(
    segment: Segment, master: Master
) -> None:
    machine = segment._machine
    master.enter_op(0)
    for word in (6, 7, 15):
        master.exchange([struct.pack("<Hiih", word, 0, 0, 0)])
    master.exchange([struct.pack("<Hiih", 0x1F, 5000, 0, 0)])
    assert ("move", 5000) in {call[:2] for call in machine.axes[0].calls}  # type: ignore[attr-defined]


def test_process_data_act_in_op_only(segment: Segment, master: Master) -> None:
    master.enter_safeop(0)
    for word in (6, 7, 15):
        answer = master.exchange([struct.pack("<Hiih", word, 0, 0, 0)])[0]
        assert answer.counter == 3
    assert segment.nodes[0].state is State.SWITCH_ON_DISABLED
    assert master.state(0) == (SAFEOP, 0)


def test_a_value_that_an_object_does_not_take_is_an_emergency(
    segment: Segment, master: Master
) -> None:
    assign(master, 0, 0x1C12, 0x1601)
    master.enter_safeop(0, (3, 12))
    assert master.request(0, OP) == (OP, 0)
    master.exchange([struct.pack("<Hb", 6, 77)])
    emergency = master.fetch(0)
    assert emergency is not None
    assert struct.unpack_from("<HH", emergency, 6) == (1 << 12, 0x8200)
