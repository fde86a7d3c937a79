"""Instants of SYNCs: the middle of `send`, flagged if uncertain, kept by the plant."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import can
import numpy as np
import pytest

from drivers.ethercat.clocks import ReferenceClock
from drivers.sync_clock import CERTAIN, LockStep, WallClock
from sim_plant.plant import load_plant
from sim_plant.serving import wall_clock
from sim_plant.serving.server import serve
from sim_plant.slave_network import SlaveNetwork

if TYPE_CHECKING:
    from collections.abc import Callable

PERIOD = 0.004


class Host:
    """Computer whose time is set by tests."""

    def __init__(self) -> None:
        self.time = 100.0

    def __call__(self) -> float:
        return self.time


def note_sent(clock: WallClock, host: Host, took: float) -> float:
    """Send a SYNC in a call of duration `took` [s]; return its instant."""
    host.time += clock.due()
    clock.note_sending()
    host.time += took
    return clock.note_sent()


def test_a_sync_is_timed_in_the_middle_of_what_sending_took() -> None:
    host = Host()
    clock = WallClock(PERIOD, clock=host)
    instants = [note_sent(clock, host, took) for took in (0.0, 0.0002, 0.0)]
    assert np.diff(instants) == pytest.approx([PERIOD + 0.0001, PERIOD - 0.0001])


@pytest.mark.parametrize(("share", "uncertain"), [(1.9, False), (2.1, True), (40.0, True)])
def test_a_sync_whose_sending_was_interrupted_is_uncertain(share: float, uncertain: bool) -> None:
    host = Host()
    clock = WallClock(PERIOD, clock=host)
    note_sent(clock, host, share * CERTAIN * PERIOD)
    assert clock.uncertain is uncertain
    note_sent(clock, host, 0.0)
    assert not clock.uncertain


def test_lock_step_and_clocks_of_drives_are_never_uncertain() -> None:
    host = Host()
    step = LockStep(PERIOD, synchronous=True)
    step.note_sending()
    step.note_sent()
    assert not step.uncertain
    reference = ReferenceClock(PERIOD, host=host)
    reference.begin(0, host())
    note_sent(reference, host, 0.5 * PERIOD)
    assert not reference.uncertain


def test_a_plant_passes_time_to_the_stamp_of_a_frame_and_never_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    host = Host()
    monkeypatch.setattr(wall_clock.time, "monotonic", host)
    monkeypatch.setattr(wall_clock.time, "time", lambda: host.time + 1e3)
    wall = wall_clock.WallClock()
    elapse: Callable[..., float] = wall.elapsed
    host.time += 0.010
    assert elapse(1e3 + 100.004) == pytest.approx(0.004)  # the frame waited for 6 ms
    assert elapse() == pytest.approx(0.006)
    assert elapse(1e3 + 100.003) == 0.0  # the plant has already passed this instant
    host.time += 0.005
    assert elapse(1e9) == pytest.approx(0.005)  # time stamp of another clock


def test_a_plant_that_was_late_never_passes_a_sync_that_is_on_its_way(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    host, seen, over = Host(), [], threading.Event()
    monkeypatch.setattr(wall_clock.time, "monotonic", host)
    monkeypatch.setattr(wall_clock.time, "time", host)
    receive = SlaveNetwork.receive

    def noting(network: SlaveNetwork, identifier: int, data: bytes) -> Any:
        seen.append(network.time)
        return receive(network, identifier, data)

    monkeypatch.setattr(SlaveNetwork, "receive", noting)

    class Late(can.BusABC):
        """Bus without frames for a while; a SYNC sent meanwhile is received long afterwards."""

        def __init__(self) -> None:
            self.calls = 0
            super().__init__("late")

        def recv(self, timeout: float | None = None) -> can.Message | None:
            self.calls += 1
            if self.calls == 1:
                host.time += 0.010  # the process was interrupted
                return None
            over.set()
            return can.Message(arbitration_id=0x80, timestamp=100.003, is_extended_id=False)

        def send(self, msg: can.Message, timeout: float | None = None) -> None:
            pass

    with Late() as bus:
        serve(bus, load_plant("manutec-r15"), "wall", over)
    assert seen == pytest.approx([0.003])
