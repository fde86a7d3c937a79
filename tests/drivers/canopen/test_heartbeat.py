"""Heartbeats without drives, on a network that records sent frames and a clock set by tests."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest

from drivers.canopen.heartbeat import OPERATIONAL, PRE_OPERATIONAL, START_TIME, Heartbeats

if TYPE_CHECKING:
    from collections.abc import Callable

MASTER, NODE = 127, 3
PERIOD, TIMEOUT = 0.1, 0.5


class Bench:
    """Network without nodes, and its time."""

    def __init__(self) -> None:
        self.time = 10.0
        self.sent: list[int] = []
        self.heard: dict[int, Callable[..., None]] = {}
        network: Any = SimpleNamespace(
            subscribe=self.heard.__setitem__,
            send_frame=lambda frame: self.sent.append(frame.arbitration_id),
        )
        now = lambda: self.time  # noqa: E731
        self.beats = Heartbeats(network, MASTER, {NODE: "axis 3"}, PERIOD, TIMEOUT, now)

    def hear(self, state: int, node: int = NODE) -> None:
        self.heard[0x700 + node](0x700 + node, bytearray([state]), 0.0)

    def trouble_at(self, time: float) -> str:
        self.time = time
        self.beats.service()
        return str(self.beats.trouble or "")


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_a_drive_is_missed_once_its_timeout_is_over_and_not_before(bench: Bench) -> None:
    bench.beats.watch()
    assert bench.trouble_at(10.0 + TIMEOUT - 0.001) == ""
    assert bench.trouble_at(10.0 + TIMEOUT).startswith("axis 3: no heartbeat for 0.5 s")


def test_each_heartbeat_begins_the_time_anew(bench: Bench) -> None:
    bench.beats.watch()
    bench.time = 10.4
    bench.hear(OPERATIONAL)
    assert bench.trouble_at(10.8) == ""
    assert bench.trouble_at(10.95) != ""


def test_ours_goes_out_when_it_is_due_with_the_requests_and_never_after_it_has_ceased(
    bench: Bench,
) -> None:
    bench.beats.requests.append(SimpleNamespace(arbitration_id=0x705))  # type: ignore[arg-type]
    for bench.time in (10.0, 10.05, 10.1):
        bench.beats.beat()
    assert bench.sent == [0x77F, 0x705, 0x77F, 0x705]
    bench.beats.cease()
    bench.beats.hurry()
    bench.time = 20.0
    bench.beats.beat()
    assert len(bench.sent) == 4
    bench.beats.watch()
    bench.beats.hurry()
    assert bench.sent[4:] == [0x77F, 0x705]


def test_a_drive_may_be_pre_operational_for_a_while_after_its_start_alone(bench: Bench) -> None:
    bench.beats.watch(starting=True)
    bench.time += START_TIME
    bench.hear(PRE_OPERATIONAL)
    assert bench.beats.trouble is None
    bench.time += 0.01
    bench.hear(PRE_OPERATIONAL)
    assert "axis 3: is pre-operational during operation" in str(bench.beats.trouble)


def test_a_drive_that_was_operational_may_not_leave_that(bench: Bench) -> None:
    bench.beats.watch(starting=True)
    bench.hear(OPERATIONAL)
    bench.hear(PRE_OPERATIONAL)
    assert "is pre-operational" in str(bench.beats.trouble)


def test_another_master_that_sends_ours_is_trouble(bench: Bench) -> None:
    bench.hear(OPERATIONAL, MASTER)
    assert bench.beats.trouble is None  # no node is supervised yet
    bench.beats.watch()
    bench.hear(OPERATIONAL, MASTER)
    assert "another master on the bus sends our heartbeat" in str(bench.beats.trouble)
