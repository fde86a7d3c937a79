"""The same commands give the same answers over EtherCAT and over CAN."""

from __future__ import annotations

import struct

from ethercat_master import Master

from sim_plant.ethercat.segment import Segment
from sim_plant.slave_network import SlaveNetwork
from sim_plant.switch_on import load_machine

SEED = 5
CYCLES = 800
AXES = 6
SHOWN = (0x6041, 0x6064, 0x606C, 0x6077)
Row = list[tuple[int, ...]]


def commands(cycle: int) -> tuple[int, int]:
    """Return controlword and target of every axis: switched on, two
    strokes, halted in the second.
    """
    if cycle < 3:
        return (6, 7, 15)[cycle], 0
    if cycle < 300:
        return 0x1F if cycle % 300 == 10 else 0x0F, 15_000
    return (0x11F if cycle > 500 else 0x1F if cycle == 310 else 0x0F), -5_000


def run_can() -> list[Row]:
    """Return answers over CAN: each SYNC lets a cycle pass, latches, and activates set-points."""
    network = SlaveNetwork(load_machine("manutec-r15", SEED))
    network.power_on()
    seen: list[Row] = []
    for cycle in range(CYCLES):
        if cycle == 0:
            network._latch()
        else:
            network.receive(0x80, b"")
        dictionaries = [node.dictionary for node in network.nodes]
        seen.append([tuple(map(d.get, SHOWN)) for d in dictionaries])
        word, target = commands(cycle)
        for dictionary in dictionaries:
            dictionary.write(0x607A, 0, target)
            dictionary.write(0x6040, 0, word)
    return seen


def run_ethercat() -> list[Row]:
    """Return answers over EtherCAT: each frame returns the values latched before."""
    segment = Segment(load_machine("manutec-r15", SEED))
    segment.power_on()
    master = Master(segment.process)
    master.enter_op(*range(AXES))
    seen: list[Row] = []
    for cycle in range(CYCLES + 1):
        word, target = commands(cycle)
        answers = master.exchange([struct.pack("<Hiih", word, target, 0, 0)] * AXES)
        seen.append([struct.unpack_from("<Hiih", answer.data, 12) for answer in answers])
    return seen


def test_every_value_is_the_same_one_frame_later() -> None:
    can, ethercat = run_can(), run_ethercat()
    assert max(row[0][1] for row in can) > 5_000, "it has moved"
    assert ethercat[1:] == can
