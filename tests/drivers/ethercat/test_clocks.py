"""Drives that act and latch at SYNC0 of synchronised clocks, and a computer synchronised to them.

The plant's clocks, this computer's and its sleep are all of one simulated time, so that nothing
here depends on how busy the machine is.
"""

from __future__ import annotations

import random
import time
from typing import TYPE_CHECKING

import numpy as np
import pytest
from plant_wire import PlantWire

from drivers.drive_bus import Move, NodeSilent, SampleFlag
from drivers.ethercat.bus import EthercatBus
from drivers.ethercat.clocks import OUT_OF_STEP, SHIFT, Passage, ReferenceClock, compute_delays
from drivers.session.servo_axes import ServoAxes
from sim_plant.ethercat import registers as reg
from sim_plant.ethercat.clock import HOP
from sim_plant.ethercat.segment import Segment
from sim_plant.switch_on import load_machine

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.drive_bus import Sample
    from drivers.drives_file import DrivesFile

AXES = 6
PPM = 1e-6
SKEW = 40.0
"""Rate error of this computer's clock against the reference [ppm]."""
LATE = 300e-6
"""Largest oversleep of this computer [s]."""
DRIFTS = (0.0, 30.0, -20.0, 50.0, -50.0, 10.0)
"""Rate errors of the drives' crystals [ppm]."""


class Timed(EthercatBus):
    """Bus on the wall clock of a simulated time."""

    def __init__(self, wire: PlantWire) -> None:
        super().__init__(wire, "wall-clock")
        self.wire = wire

    def _clock(self, period: float) -> ReferenceClock:
        return ReferenceClock(period, host=lambda: self.wire.segment.time * (1 - SKEW * PPM))


class Cable(PlantWire):
    """Wire with a transmission delay.

    Attributes
    ----------
    delay : float
        Transmission delay of frames [s].
    """

    delay = 0.0
    _out = b""

    def send(self, frame: bytes | bytearray) -> bool:
        self._out = bytes(frame)
        return True

    def receive(self, timeout: float) -> bytes | None:
        if self._out:
            self.segment.elapse(self.delay)
            super().send(self._out)
            self._out = b""
        return super().receive(timeout)


@pytest.fixture
def wire(monkeypatch: pytest.MonkeyPatch) -> Cable:
    segment = Segment(load_machine("manutec-r15", 5), "wall")
    segment.power_on()
    for node, drift in zip(segment.nodes, DRIFTS, strict=True):
        node.clock.set_drift(drift * PPM, segment.time)
    chance = random.Random(1)
    monkeypatch.setattr(time, "sleep", lambda t: segment.elapse(t + chance.uniform(0, LATE)))
    return Cable(segment)


@pytest.fixture
def bus(wire: Cable, drives: DrivesFile) -> ServoAxes:
    return ServoAxes(Timed(wire), drives)


def samples(bus: ServoAxes, count: int) -> list[Sample]:
    return [bus.sample() for _ in range(count)]


def sync_types(wire: PlantWire) -> list[tuple[int, int]]:
    held = [node.dictionary for node in wire.segment.nodes]
    return [(each.get(0x1C32, 1), each.get(0x1C33, 1)) for each in held]


def test_the_computer_follows_the_reference_and_states_the_skew(bus: ServoAxes) -> None:
    with bus:
        seen = samples(bus, 1500)
        remark = bus.remarks[0]
    assert not any(any(sample.flags) for sample in seen)
    assert remark.startswith("distributed clock: slave 1 is the reference, ")
    skew = float(remark.split("reference, ")[1].split(" ppm faster than this computer")[0])
    assert skew == pytest.approx(SKEW, abs=3.0)
    assert f"the last at a cable delay of {5 * HOP} ns" in remark
    assert remark in bus.notes


def test_inputs_are_of_sync0_and_stand_under_it_however_late_this_computer_is(
    bus: ServoAxes, wire: Cable
) -> None:
    with bus:
        here = bus.sample().q[0]
        bus.move({0: Move(here + 0.3, 1.0, 5.0)})
        samples(bus, 30)
        node = wire.segment.nodes[0]
        latched: list[tuple[int, int]] = []
        exchange = node.exchange

        def noted(image: Sequence[int]) -> None:
            exchange(image)
            now = node.clock.system(wire.segment.time)
            latched.append((now, node.dictionary.get(0x6064)))

        node.exchange = noted  # type: ignore[method-assign]
        seen = samples(bus, 40)
        node.exchange = exchange  # type: ignore[method-assign]
    instants, positions = np.array(latched[: len(seen)]).T
    times, q = np.array([(sample.time, sample.q[0]) for sample in seen]).T
    assert np.allclose(np.diff(times), bus.period, atol=1e-9)
    assert np.ptp(times - 1e-9 * (instants - instants[0])) < 1e-6
    assert np.allclose((q - q[0]) / (q[-1] - q[0]), (positions - positions[0]) / np.ptp(positions))


def test_sync0_comes_while_inside_and_ends_where_drives_are_put_back(
    bus: ServoAxes, wire: Cable
) -> None:
    nodes = wire.segment.nodes
    with bus:
        bus.sample()
        assert [node.clock.cycle for node in nodes] == [round(1e9 * bus.period)] * AXES
        assert sync_types(wire) == [(2, 2)] * AXES
    assert [node.clock.cycle for node in nodes] == [0] * AXES
    assert sync_types(wire) == [(1, 1)] * AXES


def test_a_frame_that_comes_after_sync0_stands_under_it_and_the_next_is_doubled(
    bus: ServoAxes, wire: Cable
) -> None:
    with bus:
        before = samples(bus, 50)[-1]
        wire.delay = (SHIFT + 0.1) * bus.period
        late = bus.sample()
        wire.delay = 0.0
        doubled, after = samples(bus, 2)
    assert late.time - before.time == pytest.approx(2 * bus.period)
    assert late.flags == (0,) * AXES
    assert (doubled.time, doubled.q) == (late.time, late.q)
    assert doubled.flags == (SampleFlag.DOUBLED,) * AXES
    assert after.flags == (0,) * AXES
    assert after.time - late.time == pytest.approx(bus.period)


@pytest.mark.parametrize("jump", [-0.3, -0.0013, 0.0015, 0.2])
def test_a_reference_that_jumps_is_followed_again(bus: ServoAxes, wire: Cable, jump: float) -> None:
    with bus:
        samples(bus, 50)
        for node in wire.segment.nodes:
            node.clock._at += 1e9 * jump
            node._start_sync0()
        samples(bus, 30)
        after = samples(bus, 50)
    assert not any(any(sample.flags) for sample in after)
    assert np.allclose(np.diff([sample.time for sample in after]), bus.period)


def test_an_axis_whose_clock_is_off_is_flagged_alone_until_it_is_drawn_back(
    bus: ServoAxes, wire: Cable
) -> None:
    with bus:
        samples(bus, 50)
        wire.segment.nodes[3].clock._at += 5e9 * OUT_OF_STEP
        off = bus.sample()
        after = samples(bus, 50)
    assert off.flags == (0, 0, 0, SampleFlag.LATE, 0, 0)
    assert after[-1].flags == (0,) * AXES


def test_after_a_lost_frame_the_next_sample_is_good_for_it_is_of_the_last_sync0(
    bus: ServoAxes, wire: Cable
) -> None:
    with bus:
        before = samples(bus, 20)[-1]
        wire.on_the_way = lambda _: None
        lost = samples(bus, 3)
        wire.on_the_way = bytes
        after = bus.sample()
    assert {sample.flags for sample in lost} == {(SampleFlag.MISSING,) * AXES}
    assert after.flags == (0,) * AXES
    assert after.time - before.time == pytest.approx(4 * bus.period)


@pytest.mark.parametrize("lacking", ["clock", "SYNC0", "leave"])
def test_drives_without_clocks_are_served_as_frames_come(
    wire: Cable, drives: DrivesFile, lacking: str
) -> None:
    node = wire.segment.nodes[2]
    if lacking == "clock":
        node.controller.memory[8] &= ~0x0C
    elif lacking == "SYNC0":
        node.dictionary.set(0x1C32, 4, 2)
    else:
        drives = drives.model_copy(update={"distributed_clock": False})
    with ServoAxes(Timed(wire), drives) as bus:
        seen = samples(bus, 20)
        assert bus.remarks == ()
        assert not any(node.clock.is_cyclic for node in wire.segment.nodes)
    assert not any(any(sample.flags) for sample in seen)


def test_a_clock_that_does_not_follow_is_stated_before_power_on(
    bus: ServoAxes, wire: Cable
) -> None:
    node = wire.segment.nodes[4]
    node.clock.compare = lambda *_: node.controller.put(reg.TIME_DIFFERENCE, 4, 50_000)  # type: ignore[method-assign]
    with pytest.raises(NodeSilent, match=r"clocks differ.*distributed_clock: false"):
        bus.__enter__()
    assert not any(node.dictionary.get(0x6041) & 4 for node in wire.segment.nodes)


def test_a_reference_that_is_lost_is_not_followed(bus: ServoAxes, wire: Cable) -> None:
    with bus:
        before = samples(bus, 50)[-1]
        wire.segment.nodes[0].controller.put(reg.STATION, 2, 0)
        after = bus.sample()
    assert after.time - before.time == pytest.approx(bus.period)


def test_delays_of_a_line_and_of_a_tree() -> None:
    line = [Passage((0, 1500), 1), Passage((7000, 7900), 1), Passage((50,), 0)]
    assert compute_delays(line) == [0, 300, 750]
    # A junction with two branches: a slave after 100 ns of cable, and a slave after 300 ns.
    tree = [Passage((0, 200, 800), 2), Passage((5,), 0), Passage((6,), 0)]
    assert compute_delays(tree) == [0, 100, 500]
    without = [Passage((0, 1000), 1), Passage((), 1), Passage((9,), 0)]
    assert compute_delays(without) == [0, 0, 500], "a slave without a clock is a piece of cable"
    dark = [Passage((0, 1000), 1), Passage((), 2), Passage((9,), 0), Passage((9,), 0)]
    assert compute_delays(dark) == [0, 0, 0, 0], "behind it nobody can share the time out"
