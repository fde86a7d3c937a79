"""No frame upsets a slave or energises a drive that nobody enabled."""

from __future__ import annotations

import random
import struct

import pytest
from ethercat_master import ETHERNET, Master, frame_of
from hypothesis import given
from hypothesis import strategies as st
from ideal_machine import IdealMachine

from sim_plant.ethercat.cyclic_frame import CyclicFrame
from sim_plant.ethercat.frame import Command
from sim_plant.ethercat.segment import Segment

PLACES = (0x10, 0x100, 0x120, 0x400, 0x420, 0x502, 0x600, 0x610, 0x800, 0x808, 0x810, 0x818)
MORE = (0x900, 0x910, 0x920, 0x981, 0x990, 0x9A0, 0x1000, 0x1400, 0x1800, 0x1C00, 0x2FF8)


def switched_on() -> tuple[IdealMachine, Segment]:
    machine = IdealMachine(2)
    segment = Segment(machine)
    segment.power_on()
    return machine, segment


@given(st.binary(max_size=120))
def test_whatever_stands_in_a_frame_it_comes_back_as_long_as_it_was(rest: bytes) -> None:
    _, segment = switched_on()
    for frame in (rest, ETHERNET + rest, ETHERNET + b"\x40\x10" + rest):
        answer = segment.process(frame)
        assert answer is not None
        assert len(answer) == len(frame)


datagram = st.tuples(
    st.integers(0, 16),
    st.sampled_from((0, 0xFFFF, 0x1001, 0x100)),
    st.one_of(st.sampled_from(PLACES + MORE), st.integers(0, 0xFFFF)),
    st.binary(max_size=40),
)


@given(st.lists(st.lists(datagram, min_size=1, max_size=4), max_size=25))
def test_datagrams_of_any_content_upset_no_slave(
    frames: list[list[tuple[int, int, int, bytes]]],
) -> None:
    _, segment = switched_on()
    for datagrams in frames:
        assert segment.process(frame_of(*datagrams)) is not None
    segment.nodes[0].restart()
    master = Master(segment.process)
    master.enter_preop(0)
    assert master.upload(0, 0x1000) == b"\x92\1\2\0"


def mutated(rng: random.Random, frame: bytes) -> bytes:
    changed = bytearray(frame)
    for _ in range(rng.choice((1, 1, 2, 8))):
        changed[rng.randrange(14, len(changed))] = rng.randrange(256)
    return bytes(changed[: rng.choice((len(changed), rng.randrange(len(changed) + 1)))])


def service(rng: random.Random) -> bytes:
    """Return a malformed CoE service."""
    index = rng.choice((0x1000, 0x1018, 0x1600, 0x1C12, 0x1C32, 0x6060, 0x6081, 0x2000))
    command = rng.choice((0x40, 0x50, 0x21, 0x31, 0x23, 0x2F, 0x60, 0x70, 0x01, 0x80, 0xE0))
    head = struct.pack("<HBHBI", rng.choice((2, 8)) << 12, command, index, rng.randrange(4), 5)
    return head + rng.randbytes(rng.randrange(20))


@pytest.mark.parametrize("seed", range(3))
def test_mutated_frames_of_a_master_energise_nothing(seed: int) -> None:
    rng = random.Random(seed)
    machine, segment = switched_on()
    good = Master(segment.process)
    for number in range(4000):
        if number % 500 == 0:
            for node in segment.nodes:
                node.restart()
            good.enter_op(0, 1)
        if rng.random() < 0.5:
            data = struct.pack("<Hiih", 0, 0, 0, 0) + bytes(12)
            frame = frame_of((Command.LRW, 0, 0, data), (Command.LRW, 0x100, 0, data))
        else:
            content = struct.pack("<HHBB", 30, 0, 0, 3 | rng.randrange(8) << 4) + service(rng)
            frame = frame_of(
                (Command.APWR, 0, 0x1000, content.ljust(512, b"\0")),
                (Command.APRD, 0, 0x1400, bytes(512)),
            )
        segment.process(frame if rng.random() < 0.3 else mutated(rng, frame))
    energised = {call[0] for axis in machine.axes for call in axis.calls}
    assert "move" not in energised


# seed 100 includes a frame that is not EtherCAT among similar ones
@pytest.mark.parametrize("seed", [0, 1, 100])
def test_among_any_frames_those_that_come_again_are_passed_as_any_frame_is(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def answers() -> list[bytes | None]:
        rng = random.Random(seed)
        _, segment = switched_on()
        found: list[bytes | None] = []

        def process(frame: bytes) -> bytes | None:
            found.append(segment.process(frame))
            return found[-1]

        master = Master(process)
        for number in range(1500):
            if number % 100 == 0:
                for node in segment.nodes:
                    node.restart()
                master.enter_op(0, 1)
                word, target = 0, 0
            if rng.random() < 0.1:
                word, target = rng.choice((0, 2, 6, 7, 15, 31)), rng.choice((0, 500, -500))
            data = struct.pack("<Hiih", word, target, 0, 0) + bytes(12)
            cycle = frame_of((Command.LRW, 0, 0, data), (Command.LRW, 0x100, 0, data))
            content = struct.pack("<HHBB", 30, 0, 0, 3 | rng.randrange(8) << 4) + service(rng)
            mail = frame_of((Command.APWR, 0, 0x1000, content.ljust(512, b"\0")))
            kind = rng.random()
            frame = cycle if kind < 0.9 else mail if kind < 0.95 else mutated(rng, cycle)
            process(frame)
        return found

    usual = answers()
    monkeypatch.setattr(CyclicFrame, "fits", lambda *_: False)
    assert answers() == usual
