"""All drives on one segment: time, arbitration, and robustness against any frame."""

from __future__ import annotations

import random
import struct
from typing import TYPE_CHECKING

import pytest

from sim_plant.slave_network import CYCLE_DEFAULT, SlaveNetwork

if TYPE_CHECKING:
    from desk import Desk
    from ideal_machine import IdealMachine

LIKELY = [
    0x000,
    0x080,
    0x77F,
    *(base + node for base in (0x600, 0x200, 0x300, 0x580, 0x700) for node in range(1, 7)),
]


def random_frame(rng: random.Random) -> tuple[int, bytes]:
    identifier = rng.choice(LIKELY) if rng.random() < 0.9 else rng.randrange(0x800)
    data = rng.randbytes(rng.choice([0, 1, 2, 8, 8, 8, 8, 8, 8, rng.randrange(9)]))
    if 0x600 < identifier < 0x680 and len(data) == 8 and rng.random() < 0.7:
        index = rng.choice([0x1006, 0x1016, 0x1017, 0x1400, 0x1600, 0x1800, 0x1A00, 0x2000, 0x1021])
        command = rng.choice([0x40, 0x23, 0x2B, 0x2F, 0x21, 0x60, 0x70, 0xA0, 0xA3, 0xC2, 0xC6])
        data = struct.pack("<BHB", command, index, rng.randrange(6)) + data[4:]
    return identifier, data


@pytest.mark.parametrize("seed", range(4))
def test_random_frames_neither_upset_the_drives_nor_move_what_is_not_enabled(
    ideal_machine: IdealMachine, seed: int
) -> None:
    rng = random.Random(seed)
    network = SlaveNetwork(ideal_machine)
    network.power_on()
    for _ in range(5_000):
        identifier, data = random_frame(rng)
        if identifier == 0x80 and rng.random() < 0.9:
            continue  # simulated time takes long
        frames = network.receive(identifier, data)
        assert all(0 <= number < 0x800 and len(payload) <= 8 for _, number, payload in frames)
        if identifier == 0x80:
            continue
        network.receive_remote(rng.randrange(0x800))
    for axis in ideal_machine.axes:
        powered = False
        for call, *_ in axis.calls:
            powered = call == "enable" or (powered and call != "disable")
            assert powered or call in ("disable", "torque", "window", "withhold")
    network.receive(0, bytes([129, 0]))
    for node in range(1, 7):
        response = network.receive(0x600 + node, bytes([0x40, 0, 0x10, 0, 0, 0, 0, 0]))
        assert [i for _, i, _ in response] == [0x580 + node]


def test_a_sync_advances_time_by_the_communication_cycle_period(desk: Desk) -> None:
    desk.sync()
    assert desk.network.time == desk.machine.time == CYCLE_DEFAULT
    for node in range(1, 7):
        desk.write(0x1006, 10_000, node=node)
    desk.sync(3)
    assert desk.machine.time == pytest.approx(0.034, abs=1e-12)


def test_the_longest_period_counts_and_none_means_the_default(desk: Desk) -> None:
    desk.write(0x1006, 20_000, node=4)
    desk.sync()
    assert desk.machine.time == pytest.approx(0.02)
    for node in range(1, 7):
        desk.write(0x1006, 0, node=node)
    desk.sync()
    assert desk.machine.time == pytest.approx(0.02 + CYCLE_DEFAULT)


def test_time_stands_still_between_syncs(desk: Desk) -> None:
    desk.enable()
    assert desk.network.time == 0.0


def test_on_the_wall_clock_a_sync_only_latches(ideal_machine: IdealMachine) -> None:
    network = SlaveNetwork(ideal_machine, "wall")
    network.power_on()
    network.receive(0x80, b"")
    assert network.time == 0.0
    network.elapse(0.25)
    assert network.time == ideal_machine.time == 0.25


def test_on_the_wall_clock_timers_and_events_go_on_without_sync(
    ideal_machine: IdealMachine,
) -> None:
    network = SlaveNetwork(ideal_machine, "wall")
    network.power_on()
    network.receive(0x601, struct.pack("<BHBI", 0x2B, 0x1017, 0, 100))
    network.receive(0, bytes([1, 1]))
    frames = network.elapse(0.35)
    beats = [(round(time, 6), data) for time, i, data in frames if i == 0x701]
    assert beats == [(0.1, b"\5"), (0.2, b"\5"), (0.3, b"\5")]


def test_frames_of_one_instant_come_in_the_order_of_arbitration(desk: Desk) -> None:
    for node in range(6, 0, -1):
        desk.write(0x1017, 10, node=node)
    desk.sync(3)
    beats = [i for _, i, _ in desk.log if 0x700 < i < 0x780]
    assert beats == [0x700 + n for n in range(1, 7)]


def test_a_command_to_all_reaches_all_in_the_same_call(desk: Desk) -> None:
    assert [i for i, _ in desk.nmt(129)] == [0x700 + n for n in range(1, 7)]
