"""Frames by the block: the same frames as one by one, and nothing passes for what it is not."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.can_bus.frame_block import FrameBlock, messages
from drivers.canopen.process_data import SYNC
from sim_plant.serving.bus import PlantBus

if TYPE_CHECKING:
    from collections.abc import Iterator

IDENTIFIERS = (0x183, 0x181, 0x182)
LAYOUTS = ("Hih", "Hi", "h")


def frame(identifier: int, data: bytes) -> bytes:
    return struct.pack("=IB3x8s", identifier, len(data), data)


def block(*frames: tuple[int, bytes]) -> bytes:
    return b"".join(frame(*each) for each in frames)


@given(
    st.tuples(
        st.tuples(st.integers(0, 0xFFFF), st.integers(-(2**31), 2**31 - 1), st.integers(-9, 9)),
        st.tuples(st.integers(0, 0xFFFF), st.integers(-(2**31), 2**31 - 1)),
        st.tuples(st.integers(-32768, 32767)),
    )
)
def test_values_come_in_the_order_that_was_asked_for(
    values: tuple[tuple[int, ...], tuple[int, ...], tuple[int, ...]],
) -> None:
    data = [struct.pack("<" + code, *row) for code, row in zip(LAYOUTS, values, strict=True)]
    raw = block((0x181, data[1]), (0x182, data[2]), (0x183, data[0]))
    expected = FrameBlock(IDENTIFIERS, LAYOUTS)
    assert expected.unpack(raw) == sum(values, ())
    assert expected.data(raw) == data


def test_values_can_be_picked_and_put_into_another_order() -> None:
    raw = block((0x181, struct.pack("<HHi", 9, 8, -5)), (0x182, struct.pack("<ihxx", 1 << 20, 7)))
    layouts = ("ihxx", "xxHi")
    expected = FrameBlock((0x182, 0x181), layouts, order=(2, 3, 0))
    assert expected.unpack(raw) == (8, -5, 1 << 20)
    assert FrameBlock((0x182, 0x181), layouts).unpack(raw) == (1 << 20, 7, 8, -5)


@pytest.mark.parametrize(
    "raw",
    [
        b"",
        block((0x181, bytes(6)), (0x182, bytes(2))),
        block((0x181, bytes(6)), (0x182, bytes(2)), (0x184, bytes(8))),
        block((0x181, bytes(6)), (0x182, bytes(3)), (0x183, bytes(8))),
        block((0x181, bytes(6)), (0x183, bytes(8)), (0x182, bytes(2))),
        block((0x181, bytes(6)), (0x182, bytes(2)), (0x183, bytes(8)), (0x181, bytes(6))),
        block((0x181 | 1 << 31, bytes(6)), (0x182, bytes(2)), (0x183, bytes(8))),
    ],
    ids=["empty", "one missing", "foreign", "length", "order", "doubled", "extended"],
)
def test_no_other_block_passes(raw: bytes) -> None:
    assert FrameBlock(IDENTIFIERS, LAYOUTS).unpack(raw) is None


def test_a_block_taken_apart_gives_its_frames() -> None:
    raw = block((0x181, b"abc"), (0x702, b""))
    assert [(m.arbitration_id, bytes(m.data)) for m in messages(raw)] == [
        (0x181, b"abc"),
        (0x702, b""),
    ]


# --- the plant's bus as a source ------------------------------------------------------------------


def send(bus: PlantBus, identifier: int, data: bytes) -> None:
    bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))


@pytest.fixture
def bus(ideal_channel: str) -> Iterator[PlantBus]:
    """Six drives, OPERATIONAL, which answer each SYNC with the TPDO1 that they start with."""
    with PlantBus(ideal_channel) as plant:
        for node in range(1, 7):
            for data in (
                struct.pack("<BHBI", 0x23, 0x1800, 1, 1 << 31 | 0x180 + node),
                struct.pack("<BHBI", 0x2F, 0x1800, 2, 1),
                struct.pack("<BHBI", 0x23, 0x1800, 1, 0x180 + node),
            ):
                send(plant, 0x600 + node, data)
        send(plant, 0, b"\1\0")
        while plant.recv(0) is not None:
            pass
        yield plant


def test_the_answer_to_a_sync_is_the_same_by_the_block_and_frame_by_frame(bus: PlantBus) -> None:
    bus.send(SYNC)
    raw = bus.recv_block()
    assert raw is not None
    assert bus.idle()
    with PlantBus(str(bus.channel_info).removeprefix("simulated plant ")) as listener:
        bus.send(SYNC)
        heard = [m for m in iter(lambda: listener.recv(0), None) if m.arbitration_id != 0x80]
    assert [(m.arbitration_id, bytes(m.data)) for m in messages(raw)] == [
        (m.arbitration_id, bytes(m.data)) for m in heard
    ]
    assert [m.arbitration_id for m in heard] == [0x180 + n for n in range(1, 7)]
    times = [m.timestamp for m in heard]
    assert times == sorted(set(times))


def test_frames_before_a_block_are_read_first(bus: PlantBus) -> None:
    send(bus, 0x601, bytes([0x40, 0, 0x10, 0, 0, 0, 0, 0]))
    bus.send(SYNC)
    assert bus.recv_block() is None
    first = bus.recv(0)
    assert first is not None
    assert first.arbitration_id == 0x581
    assert bus.recv_block() is not None


def test_a_filtered_bus_hands_out_no_blocks(bus: PlantBus) -> None:
    bus.set_filters([{"can_id": 0x183, "can_mask": 0x7FF, "extended": False}])
    bus.send(SYNC)
    assert bus.recv_block() is None
    heard = [m.arbitration_id for m in iter(lambda: bus.recv(0), None)]
    assert heard == [0x183]
