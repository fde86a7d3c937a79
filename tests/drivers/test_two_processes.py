"""Driver and plant in two processes."""

from __future__ import annotations

import math
import signal
from typing import TYPE_CHECKING

import numpy as np
import pytest
from canopen_drive_bus import CanopenDriveBus
from two_processes import BUSES, DRIVES, open_bus, plant_process, slow_drives, wake

from drivers import sync_clock
from drivers.drive_bus import Move, NodeSilent, SampleFlag
from drivers.drives_file import load_drives
from drivers.opening import open_drive_bus
from drivers.sync_clock import PAUSE, TOO_LATE

if TYPE_CHECKING:
    from two_processes import Place

    from drivers.drive_bus import Sample

pytestmark = pytest.mark.parametrize("place", BUSES)
SEED = "5"
PERIOD = 0.04


def moved(axes: CanopenDriveBus, number: int) -> list[Sample]:
    with axes:
        axes.move({0: Move(0.3, 0.8, 5.0), 4: Move(-0.2, 0.5, 5.0)})
        return [axes.sample() for _ in range(number)]


def test_in_lock_step_it_is_the_same_to_the_last_bit_as_in_one_process(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sync_clock, "PATIENCE", 60.0)  # answers come, even on a busy machine
    drives = load_drives(DRIVES)
    with plant_process(place, "--seed", SEED):
        apart = moved(open_drive_bus(drives, *place, pacing="lock-step"), 200)
    options = {"seed": int(SEED)}
    together = moved(open_drive_bus(drives, "sim_plant", "manutec-r15", options), 200)
    assert apart == together
    assert apart[-1].reached


def test_on_the_wall_clock_samples_are_a_period_apart_or_a_gap_tells_of_it(place: Place) -> None:
    with (
        plant_process(place),
        open_bus(place) as bus,
        CanopenDriveBus(bus, slow_drives(PERIOD)) as axes,
    ):
        axes.move({0: Move(0.3, 0.8, 5.0)})
        while True:
            samples, before = [axes.sample()], axes.skipped_syncs
            samples += [axes.sample() for _ in range(30)]
            skipped = axes.skipped_syncs - before
            gaps = np.diff([sample.time for sample in samples])
            # a stall at either end is counted with another sample; a long one begins a new grid
            if gaps.max() < PAUSE and np.abs(gaps[[0, -1]] - PERIOD).max() < TOO_LATE * PERIOD:
                break
    assert sum(gaps) == pytest.approx((len(gaps) + skipped) * PERIOD, abs=0.6 * PERIOD)
    for sample in samples:
        for position, flags in zip(sample.q, sample.flags, strict=True):
            assert math.isnan(position) == bool(flags & SampleFlag.MISSING)


def test_a_plant_that_hangs_ends_the_session_and_nobody_waits_for_ever(place: Place) -> None:
    def wait_for_trouble(axes: CanopenDriveBus) -> None:
        while True:
            axes.sample()

    with plant_process(place, "--clock", "wall") as plant, open_bus(place) as bus:
        axes = CanopenDriveBus(bus, slow_drives(PERIOD))
        with axes:
            plant.send_signal(signal.SIGSTOP)
            with pytest.raises(NodeSilent, match="joint 1"):
                wait_for_trouble(axes)
            plant.send_signal(signal.SIGCONT)
            wake(place)  # wait for the first answer of the bus
