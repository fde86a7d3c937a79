"""Distributed clock: delays, offsets, drift, SYNC0."""

from __future__ import annotations

import struct
from itertools import pairwise

import pytest
from ethercat_master import Master
from ideal_machine import IdealMachine

from sim_plant.drive.cia402_states import State
from sim_plant.ethercat.frame import Command
from sim_plant.ethercat.segment import Segment

HOP = 300


@pytest.fixture
def segment() -> Segment:
    network = Segment(IdealMachine(3), "wall")
    network.power_on()
    return network


@pytest.fixture
def master(segment: Segment) -> Master:
    return Master(segment.process)


def times(master: Master, slave: int) -> tuple[int, int]:
    """Return system time and its signed difference to the reference [ns]."""
    raw = master.read(slave, 0x910, 32).data
    difference = struct.unpack_from("<I", raw, 28)[0]
    size = difference & 0x7FFF_FFFF
    return struct.unpack_from("<Q", raw)[0], -size if difference >> 31 else size


def align(master: Master) -> None:
    """Set offsets and delays as masters do (ETG.1000.4): by the times at which a frame passed."""
    master.send((Command.BWR, 0, 0x900, bytes(4)))
    received = [struct.unpack("<II", master.read(n, 0x900, 8).data) for n in range(3)]
    local = [struct.unpack("<Q", master.read(n, 0x918, 8).data)[0] for n in range(3)]
    whole = received[0][1] - received[0][0]
    for n in range(3):
        own = received[n][1] - received[n][0] if n < 2 else 0
        delay = (whole - own) // 2
        offset = (local[0] - local[n] + delay) % (1 << 64)
        master.write(n, 0x920, struct.pack("<QI", offset, delay))


def test_delays_and_offsets_are_found_from_when_a_frame_passed(
    segment: Segment, master: Master
) -> None:
    segment.elapse(1.0)
    segment.nodes[1].restart()
    segment.elapse(0.5)
    align(master)
    assert [struct.unpack("<I", master.read(n, 0x928, 4).data)[0] for n in range(3)] == [
        0,
        HOP,
        2 * HOP,
    ]
    assert [times(master, n)[0] - n * HOP for n in range(3)] == [1_500_000_000] * 3
    assert master.read(2, 0x904, 4).data == bytes(4), "its second port is not connected"


def test_clocks_that_drift_are_drawn_to_the_reference(segment: Segment, master: Master) -> None:
    for drift, node in zip((0.0, 80e-6, -60e-6), segment.nodes, strict=True):
        node.clock.set_drift(drift, segment.time)
    align(master)
    segment.elapse(0.1)
    assert [times(master, n)[0] - times(master, 0)[0] - n * HOP for n in range(3)] == [
        0,
        8000,
        -6000,
    ]
    for _ in range(500):
        segment.elapse(0.001)
        assert master.send((Command.ARMW, 0, 0x910, bytes(8)))[0].counter == 3
    apart = [abs(times(master, n)[1]) for n in (1, 2)]
    assert max(apart) <= 3


def test_with_sync0_outputs_act_and_inputs_are_latched_at_it(
    segment: Segment, master: Master
) -> None:
    drive = segment.nodes[0]
    master.enter_preop(0)
    master.enter_safeop(0)
    align(master)
    start = times(master, 0)[0] + 5_000_000
    master.write(0, 0x990, struct.pack("<Q", start))
    master.write(0, 0x9A0, struct.pack("<I", 2_000_000))
    master.write(0, 0x981, b"\3")
    assert master.request(0, 8) == (8, 0)
    master.exchange([struct.pack("<Hiih", 6, 0, 0, 0)])
    segment.elapse(0.0049)
    assert drive.state is State.SWITCH_ON_DISABLED
    segment.elapse(0.0002)
    assert drive.state is State.READY
    shown = master.exchange([struct.pack("<Hiih", 6, 0, 0, 0)])[0].data
    assert shown[12] & 0x6F == State.SWITCH_ON_DISABLED, "latched at SYNC0, as outputs acted"
    segment.elapse(0.002)
    shown = master.exchange([struct.pack("<Hiih", 6, 0, 0, 0)])[0].data
    assert shown[12] & 0x6F == State.READY


@pytest.mark.parametrize("cycle", [0, 50_000, 2_000_000_000])
def test_a_sync0_cycle_that_the_drive_does_not_follow_is_refused(
    master: Master, cycle: int
) -> None:
    master.enter_preop(0)
    master.enter_safeop(0)
    master.write(0, 0x9A0, struct.pack("<I", cycle))
    master.write(0, 0x981, b"\3")
    assert master.request(0, 8) == (0x14, 0x36)


def test_sync0_comes_once_a_cycle_while_the_clock_is_drawn(
    segment: Segment, master: Master
) -> None:
    counted: list[float] = []
    node = segment.nodes[1]
    node.clock.set_drift(50e-6, 0.0)
    align(master)
    master.enter_preop(1)
    master.enter_safeop(1)
    node.exchange = lambda _image: counted.append(segment.time)  # type: ignore[method-assign]
    master.write(1, 0x990, struct.pack("<Q", times(master, 1)[0] + 1_000_000))
    master.write(1, 0x9A0, struct.pack("<I", 1_000_000))
    master.write(1, 0x981, b"\3")
    for _ in range(1000):
        segment.elapse(0.0007)
        master.send((Command.ARMW, 0, 0x910, bytes(8)))
    spans = [b - a for a, b in pairwise(counted)]
    assert 695 <= len(counted) <= 701
    assert max(abs(span - 0.001) for span in spans) < 1e-6
