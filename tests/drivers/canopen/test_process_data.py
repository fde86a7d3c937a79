"""Valid and invalid answers to SYNC, on a bus with frames set by the test."""

from __future__ import annotations

import math
import struct
from types import SimpleNamespace
from typing import Any

import can
import pytest

from drivers.canopen.pdo_mapping import Inputs, fed_forward, received, transmitted
from drivers.canopen.process_data import SyncProcessData
from drivers.drive_bus import SampleFlag
from drivers.drives_file import load_drives
from hil.model.robot import ROBOTS

AXES = load_drives(ROBOTS / "manutec-r15.drives.yaml").axes[:2]
TPDO = struct.Struct("<Hih")


class Bench:
    """Bus in lock-step with two drives whose answers are set by the test alone."""

    def __init__(self) -> None:
        self.queue: list[can.Message] = []
        self.sent: list[tuple[int, bytes]] = []
        self.passed_on: list[can.Message] = []
        self.time = 0.0
        network: Any = SimpleNamespace(
            channel=SimpleNamespace(
                recv=lambda _timeout: self.queue.pop(0) if self.queue else None,
                send=lambda _frame: None,
            ),
            subscribe=lambda *_: None,
            dispatch=self.passed_on.append,
            send_message=lambda cob_id, data: self.sent.append((cob_id, data)),
        )
        clock: Any = SimpleNamespace(
            synchronous=True,
            note_sending=lambda: None,
            note_sent=self.tick,
            passed_over=0,
            uncertain=False,
        )
        drives: Any = [
            SimpleNamespace(
                inputs=Inputs(received(axis), received(axis), fed_forward(axis)),
                transmitted=transmitted(axis),
            )
            for axis in AXES
        ]
        self.data = SyncProcessData(network, AXES, clock, drives)

    def tick(self) -> float:
        self.time += 0.004
        return self.time

    def answer(self, axis: int, position: int, **kind: Any) -> can.Message:
        data = TPDO.pack(0x1237, position, 5) + kind.pop("more", b"")
        number = kind.pop("number", 0x180 + AXES[axis].node)
        return can.Message(
            arbitration_id=number, data=data, is_extended_id=False, **kind
        )  # fmt: skip

    def sync(self, *frames: can.Message) -> None:
        self.queue = list(frames)
        self.data.sync()


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_an_answer_is_unpacked_in_joint_order_whoever_comes_first(bench: Bench) -> None:
    bench.sync(bench.answer(1, -7), bench.answer(0, 3))
    assert bench.data.positions == (3, -7)
    assert (bench.data.words, bench.data.currents) == ((0x1237, 0x1237), (5, 5))
    assert bench.data.flags == (0, 0)


@pytest.mark.parametrize("kind", ["longer", "extended"])
def test_what_only_resembles_an_answer_is_none(bench: Bench, kind: str) -> None:
    bench.sync(bench.answer(0, 3), bench.answer(1, 4))
    strange = bench.answer(0, 99, more=b"\0" if kind == "longer" else b"")
    strange.is_extended_id = kind == "extended"
    bench.sync(strange, bench.answer(1, 5))
    assert bench.data.positions == (3, 5)
    assert bench.data.flags == (SampleFlag.MISSING, 0)
    assert bench.passed_on == [strange]


def test_an_axis_that_is_not_seen_may_be_of_any_speed(bench: Bench) -> None:
    for k in range(6):
        bench.sync(bench.answer(0, 10 * k), bench.answer(1, 0))
    assert bench.data.speeds() == [pytest.approx(10 / 0.004), 0.0]
    bench.sync(bench.answer(0, 60))
    assert bench.data.speeds()[1] == math.inf


def test_what_is_fed_forward_is_taken_back_by_zeros(bench: Bench) -> None:
    bench.data.feed_forward(1, 300, -20)
    bench.data.withdraw(1)
    (_, fed), (number, taken_back) = bench.sent
    assert (struct.unpack("<ih", fed), struct.unpack("<ih", taken_back)) == ((300, -20), (0, 0))
    assert number == 0x400 + AXES[1].node
