"""Capabilities of buses beyond python-can's interface, and their forwarding by wrapping buses."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import can
from kernel_bus import SocketcanLike
from probing_bench import drives_of

from drivers.can_bus.capabilities import Capabilities, find_capabilities
from drivers.can_bus.frame_log import FrameLog
from drivers.can_bus.kernel_sync import KernelSync
from drivers.can_bus.replay_bus import ReplayBus
from drivers.canopen.stopwatch import StopwatchBus

if TYPE_CHECKING:
    from pathlib import Path

LOG = """date Sun Nov 22 08:00:00.000 2026
base hex  timestamps absolute
no internal events logged
0.001000 1 80 Tx d 0
"""


def test_a_stock_bus_has_none() -> None:
    with can.Bus(interface="virtual", channel="stock") as bus:
        assert find_capabilities(bus) == Capabilities(clock=time.perf_counter)


def test_the_plant_keeps_step() -> None:
    with can.Bus("manutec-r15", "sim_plant", ignore_config=True) as bus:
        able = find_capabilities(bus)
    assert able.lock_step
    assert not able.recorded


def test_a_plant_on_the_wall_clock_does_not_keep_step() -> None:
    with can.Bus("manutec-r15", "sim_plant", ignore_config=True, clock="wall") as bus:
        assert not find_capabilities(bus).lock_step


def test_a_replay_has_its_own_time_and_no_drives(tmp_path: Path) -> None:
    log = tmp_path / "frames.asc"
    log.write_text(LOG)
    with ReplayBus(str(log)) as bus:
        able = find_capabilities(bus)
        assert able.recorded
        assert able.clock() == bus.clock()


def virtual() -> SocketcanLike:
    return SocketcanLike(can.Bus(interface="virtual", channel="inner"))


def test_the_stopwatch_passes_all_on() -> None:
    with virtual() as inner, StopwatchBus(inner, drives_of(1)) as bus:
        assert find_capabilities(bus).kernel_sync
    with (
        can.Bus("manutec-r15", "sim_plant", ignore_config=True) as plant,
        StopwatchBus(plant, drives_of(1)) as bus,
    ):
        assert find_capabilities(bus).lock_step


def test_a_log_leaves_sync_to_the_driver_whose_frames_can_be_done_again(tmp_path: Path) -> None:
    with FrameLog(virtual(), tmp_path / "frames.log") as bus:
        assert find_capabilities(bus) == Capabilities(clock=bus.clock)


def test_where_frames_wait_for_the_kernel_s_sync_nothing_is_passed_on() -> None:
    with virtual() as inner, KernelSync(inner, 0.004, (), pause=0.25) as bus:
        assert find_capabilities(bus) == Capabilities()
