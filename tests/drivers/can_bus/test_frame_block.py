"""Blocks of frames hold the same content as their single messages."""

from __future__ import annotations

import struct

import can
import pytest

from drivers.can_bus.capabilities import FrameBlock, find_capabilities

FRAME = struct.Struct("=IB3x8s")
LAYOUTS = "Hih", "xxb"
BLOCK = FRAME.pack(0x181, 3, b"\0\0\7") + FRAME.pack(0x185, 8, struct.pack("<Hih", 1, -2, 3))


def test_values_come_in_the_order_that_was_asked_for() -> None:
    expected = FrameBlock([0x185, 0x181], LAYOUTS, [3, 1, 0, 2])
    assert expected.unpack(BLOCK) == (7, -2, 1, 3)
    assert expected.data(BLOCK) == [struct.pack("<Hih", 1, -2, 3), b"\0\0\7"]


@pytest.mark.parametrize(
    "other",
    [
        BLOCK[:16],
        BLOCK + BLOCK[:16],
        BLOCK[16:] + BLOCK[:16],
        FRAME.pack(0x182, 3, b"\0\0\7") + BLOCK[16:],
        FRAME.pack(0x181, 4, b"\0\0\7\0") + BLOCK[16:],
        FRAME.pack(0x80000181, 3, b"\0\0\7") + BLOCK[16:],
    ],
    ids=["missing", "repeated", "out of order", "foreign", "longer", "extended"],
)
def test_any_other_block_is_none(other: bytes) -> None:
    assert FrameBlock([0x185, 0x181], LAYOUTS, [0, 1, 2, 3]).unpack(other) is None


def write(bus: can.BusABC, index: int, subindex: int, value: int, size: int) -> None:
    """Write an object of node 1 by an expedited SDO."""
    head = struct.pack("<BHB", 0x23 | (4 - size) << 2, index, subindex)
    data = head + value.to_bytes(4, "little")
    bus.send(can.Message(arbitration_id=0x601, data=data, is_extended_id=False))
    while (answer := bus.recv(0.0)) and answer.arbitration_id != 0x581:
        pass
    assert answer is not None
    assert answer.data[0] == 0x60


def test_a_block_of_the_plant_is_its_messages() -> None:
    """A second bus on the same channel receives the frames one by one."""
    with (
        can.Bus("manutec-r15", "sim_plant", ignore_config=True) as bus,
        can.Bus("manutec-r15", "sim_plant", ignore_config=True) as beside,
    ):
        for number, cob_id in enumerate((0x181, 0x281, 0x381, 0x481)):
            write(bus, 0x1800 + number, 1, cob_id | 1 << 31, 4)
        write(bus, 0x1800, 2, 1, 1)  # on every SYNC
        write(bus, 0x1800, 1, 0x181, 4)
        bus.send(can.Message(arbitration_id=0, data=[1, 1], is_extended_id=False))
        source = find_capabilities(bus).blocks
        assert source is not None
        while bus.recv(0.0) or beside.recv(0.0):
            pass
        bus.send(can.Message(arbitration_id=0x80, is_extended_id=False))
        block = source.recv_block()
        assert block is not None
        beside.recv(0.0)  # SYNC
        singly = [beside.recv(0.0) for _ in range(len(block) // FRAME.size)]
        assert [(each.arbitration_id, each.dlc, bytes(each.data)) for each in singly if each] == [
            (number, size, data[:size]) for number, size, data in FRAME.iter_unpack(block)
        ]
        source.put_back(block)
        again = [bus.recv(0.0) for _ in singly]
        assert [each.timestamp for each in again if each] == [
            each.timestamp for each in singly if each
        ]
        assert bus.recv(0.0) is None
