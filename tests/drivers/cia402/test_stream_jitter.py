"""Set-points that reach the drives with jitter of the host, or with gaps.

Where a kernel sends SYNC it is exactly periodic. The host sends the set-points of each cycle with a
varying delay, which disturbs drives that act on arrival. If the host sends SYNC as well, a stalling
host leaves the drives without SYNC and without set-points.
"""

from __future__ import annotations

import random
import time
from collections import deque
from typing import TYPE_CHECKING, Any

import can
import numpy as np
import pytest
from canopen_drive_bus import CanopenDriveBus
from personalities import drives_for, plant_file

from drivers.drive_bus import MoveFailed, Tripped
from sim_plant.slave_network import SlaveNetwork
from sim_plant.switch_on import load_machine

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from drivers.drives_file import DrivesFile

PERIOD = 0.004
NONE: Callable[[random.Random], float] = lambda _: 0.0  # noqa: E731
SMALL: Callable[[random.Random], float] = lambda r: 3e-4 + r.expovariate(1 / 3e-4)  # noqa: E731
LARGE: Callable[[random.Random], float] = lambda r: r.uniform(2e-4, 3.5e-3)  # noqa: E731


class JitterBus(can.BusABC):
    """Plant on the wall clock with a host whose set-points are late by `jitter` [s]."""

    lock_step = True

    def __init__(self, plant: str, jitter: Callable[[random.Random], float]) -> None:
        self.network = SlaveNetwork(load_machine(plant), "wall")
        self.channel_info = "jitter"
        self._can_protocol, self._filters = can.CanProtocol.CAN_20, None
        self._is_shutdown = False
        self._inbox: deque[can.Message] = deque()
        self._syncs, self._random, self._jitter, self._waits = 0, random.Random(3), jitter, False
        self._take(self.network.power_on())

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame; time passes before each SYNC and before the following set-points."""
        if msg.arbitration_id == 0x80:
            self._syncs += 1
            self._waits = True
            self._elapse(self._syncs * PERIOD - self.network.time)
        elif self._waits and 0x200 < msg.arbitration_id < 0x480:
            self._waits = False
            self._elapse(min(self._jitter(self._random), 0.98 * PERIOD))
        self._take(self.network.receive(msg.arbitration_id, bytes(msg.data)))

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Receive a frame, or None."""
        return self._inbox.popleft() if self._inbox else None

    def _elapse(self, time: float) -> None:
        if time > 0:
            self._take(self.network.elapse(time))

    def _take(self, frames: Any) -> None:
        self._inbox.extend(
            can.Message(arbitration_id=number, data=data, is_extended_id=False)
            for _, number, data in frames
        )

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return self.recv(timeout), True


class StallingBus(JitterBus):
    """Plant on the wall clock with a host that stalls now and then on request.

    Time passes while the host waits for a frame. A share of the waits is longer by up to `longest`
    [s].
    """

    lock_step = False

    def __init__(self, plant: str, seed: int, share: float, longest: float) -> None:
        super().__init__(plant, NONE)
        self.stalling = False
        self._random, self._share, self._longest = random.Random(seed), share, longest

    def clock(self) -> float:
        """Return the plant's time [s]."""
        return float(self.network.time)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame at once."""
        self._take(self.network.receive(msg.arbitration_id, bytes(msg.data)))

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Wait for a frame."""
        if not self._inbox and timeout:
            stalls = self.stalling and self._random.random() < self._share
            stall = self._random.uniform(0.0, self._longest) if stalls else 0.0
            ends = self.clock() + timeout + stall
            while (stall or not self._inbox) and self.clock() < ends - 1e-9:
                self._elapse(min(1e-3, ends - self.clock()))
        return super().recv()


def path(drives: DrivesFile, duration: float = 3.0) -> np.ndarray:
    """Swing all axes between rest and a quarter of their range, at their limits."""
    t = np.arange(0, duration, PERIOD)
    q = np.zeros((len(t), len(drives.axes)))
    for joint, axis in enumerate(drives.axes):
        reach = 0.27 * axis.limits.q_max
        w = min(1.7 * axis.limits.velocity / reach, (axis.limits.acceleration / reach) ** 0.5)
        moving = t < int(duration * w / 2 / np.pi) * 2 * np.pi / w
        q[moving, joint] = reach * (1 - np.cos(w * t[moving])) / 2
    return q


def torque_steps(
    jitter: Callable[[random.Random], float], plant: str = "manutec-r15", name: str = "plain"
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return the rms of each axis's torque steps [% of its limit], and the driver's note."""
    drives, tau = drives_for(name, following_error_window=0.3), []
    with CanopenDriveBus(JitterBus(plant, jitter), drives) as bus:
        bus.stream(path(drives).tolist())
        reached = False
        while not reached:
            sample = bus.sample()
            tau.append(sample.tau)
            reached = sample.reached
        limit = np.array([axis.limits.torque for axis in drives.axes])
        return 100 * np.sqrt((np.diff(np.array(tau), axis=0) ** 2).mean(0)) / limit, bus.notes


@pytest.mark.parametrize("jitter", [SMALL, LARGE])
def test_the_host_s_jitter_does_not_reach_the_motors(
    jitter: Callable[[random.Random], float],
) -> None:
    quiet, _ = torque_steps(NONE)
    assert torque_steps(jitter)[0] == pytest.approx(quiet, rel=0.1)


def test_a_drive_that_takes_set_points_on_arrival_only_is_served_and_the_jitter_stated(
    tmp_path: Path,
) -> None:
    steps, notes = torque_steps(SMALL, plant_file(tmp_path, "event-rpdo"), "event-rpdo")
    assert steps.max() > 20
    assert (
        len([note for note in notes if "RPDO 1 carries its set-points, of type 255" in note]) == 6
    )
    assert notes[-1].startswith("joint 1 (node 1), joint 2 ")
    assert "set-points acted on arrival, up to 0 ms after SYNC" in notes[-1]


def stalled(seed: int, share: float, longest: float) -> tuple[np.ndarray, str]:
    """Return sample times of a path of 2.4 s with a stalling host, and the last note."""
    bus, drives = StallingBus("manutec-r15", seed, share, longest), drives_for("plain")
    with CanopenDriveBus(bus, drives) as axes:
        bus.stalling = True
        axes.stream(path(drives, 2.4).tolist())
        times = [axes.sample().time]
        while not (sample := axes.sample()).reached:
            times.append(sample.time)
        return np.array(times), axes.notes[-1]


@pytest.mark.parametrize(("seed", "share", "within"), [(0, 0.01, 25), (1, 0.01, 25), (0, 0.05, 35)])
def test_a_host_that_stalls_slows_a_path_down_and_never_ends_it(
    seed: int, share: float, within: float
) -> None:
    times, note = stalled(seed, share, 0.08)
    assert np.diff(times).max() > 0.05
    assert np.diff(times).min() > 0.49 * PERIOD, "a SYNC that came too late is made up for"
    assert times[-1] - times[0] < within
    assert "path slowed down for " in note


def test_a_host_that_is_always_a_little_late_slows_a_path_down() -> None:
    """The delay is too small for a skipped SYNC; but the drives
    brake meanwhile and must catch up.
    """
    times, note = stalled(0, 0.6, 0.0019)
    assert np.diff(times).max() < 1.5 * PERIOD
    assert 3.5 < times[-1] - times[0] < 6.0
    assert "path slowed down for " in note


def test_a_path_that_hardly_goes_on_any_more_is_ended_with_the_reason(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("drivers.cia402.cyclic_position.LOOKED_AT", 2.0)
    with pytest.raises(
        MoveFailed, match=r"path passed at [01]\.\d\d% of its nominal speed for 2 s"
    ):
        stalled(0, 1.0, 0.08)


def test_a_trip_soon_after_a_late_sync_says_that_first() -> None:
    bus = JitterBus("manutec-r15", NONE)
    with CanopenDriveBus(bus, drives_for("plain"), pacing="wall-clock") as drives:
        drives.sample()
        time.sleep(0.05)
        drives.sample()
        assert drives._session is not None
        drives._session._trips._lows = [10**7] * 6
        with pytest.raises(
            Tripped,
            match=r"^[0-9.e-]+ ms earlier a SYNC was [0-9.]+ ms after .* 4 ms: this computer",
        ):
            list(iter(drives.sample, None))
