"""Repeated frames have the same effect as single frames."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import pytest
from ethercat_master import Master
from ideal_machine import IdealMachine

from sim_plant.ethercat import registers as reg
from sim_plant.ethercat.cyclic_frame import CyclicFrame
from sim_plant.ethercat.frame import Command
from sim_plant.ethercat.segment import Segment

if TYPE_CHECKING:
    from collections.abc import Callable

AXES, ADDRESS = 3, 0x1001


def session(segment: Segment) -> tuple[list[bytes | None], int]:
    """Return answers to frames, many of them equal, and the number handled as repeated.

    Outputs are constant for some frames; meanwhile SDOs write the same objects and change the mode.
    """
    answers: list[bytes | None] = []
    alike = 0

    def process(frame: bytes) -> bytes | None:
        nonlocal alike
        usual = segment._usual
        alike += usual is not None and usual.fits(frame)
        answers.append(segment.process(frame))
        return answers[-1]

    master = Master(process)
    master.enter_op(*range(AXES))
    master.write(0, reg.STATION, struct.pack("<H", ADDRESS))
    segment.nodes[2].clock.set_drift(1e-4, segment.time)

    def cycle(word: int, target: int) -> None:
        outputs = struct.pack("<Hiih", word, target, 0, 0)
        logical = [(Command.LRW, 0x100 * n, 0, outputs + bytes(12)) for n in range(AXES)]
        clock = (Command.FRMW, ADDRESS, reg.SYSTEM_TIME, bytes(8))
        apart = (Command.BRD, 0, reg.TIME_DIFFERENCE, bytes(4))
        master.send(*logical, (Command.BRD, 0, reg.AL_STATUS, bytes(2)), clock, apart)

    happens: dict[int, Callable[[], object]] = {
        15: lambda: master.download(0, 0x607A, 0, struct.pack("<i", 77)),
        16: lambda: master.download(1, 0x6040, 0, struct.pack("<H", 2)),
        18: lambda: (master.upload(0, 0x607A), master.upload(1, 0x6040)),
        20: lambda: master.upload(1, 0x6064),
        25: lambda: master.download(2, 0x6060, 0, b"\x08"),
        30: lambda: master.request(2, 4),
        40: lambda: master.request(2, 8),
        50: lambda: segment.cuts.add(2),
        53: segment.cuts.clear,
    }
    for step in range(60):
        cycle((6, 7, 15)[min(step // 3, 2)], 100 * (step // 7))
        happens.get(step, lambda: None)()
    segment.elapse(0.2)
    cycle(15, 0)
    return answers, alike


@pytest.fixture
def switched_on() -> Callable[[], Segment]:
    def made() -> Segment:
        segment = Segment(IdealMachine(AXES))
        segment.power_on()
        return segment

    return made


def test_every_byte_is_the_same(
    switched_on: Callable[[], Segment], monkeypatch: pytest.MonkeyPatch
) -> None:
    usual, alike = session(switched_on())
    monkeypatch.setattr(CyclicFrame, "fits", lambda *_: False)
    assert session(switched_on()) == (usual, 0)
    assert alike > 40
