"""Designed trajectories that pass the dry run are measured on the virtual plant without findings.

All axes accelerate at once and load each other, so drives reach their torque limits long before the
acceleration limits, which are stated for a single moving axis.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from drivers.drives_file import load_drives
from drivers.opening import open_drive_bus
from hil.measuring.sequencer import Recorded, measure
from hil.model.robot import ROBOTS, Robot
from hil.planning.design.trajectories import Search, design_trajectory
from hil.planning.dry_run import dry_run
from hil.planning.plan import Plan, PlannedRobot

if TYPE_CHECKING:
    from hil.planning.trajectory import Trajectory


@pytest.mark.parametrize(
    ("period", "harmonics", "search"),
    [
        pytest.param(4.0, 5, Search(random=40, refined=1, steps=40), id="saturated at 0.9"),
        pytest.param(3.0, 5, Search(random=40, refined=1, steps=30), id="8611 at 0.9"),
        pytest.param(10.0, 15, Search(random=20, refined=1, steps=15), id="15 harmonics"),
    ],
)
def test_a_designed_trajectory_is_measured_at_the_first_attempt(
    manutec: Robot, period: float, harmonics: int, search: Search
) -> None:
    wave = design_trajectory(manutec, period, 1, "det", search=search, harmonics=harmonics)
    plan = plan_of(manutec, wave)
    assert not dry_run(plan, manutec).problems
    drives = load_drives(ROBOTS / "manutec-r15.drives.yaml")
    with open_drive_bus(drives, "sim_plant", "manutec-r15") as bus:
        events = list(measure(plan, manutec, bus))
    (recorded,) = (event for event in events if isinstance(event, Recorded))
    assert (recorded.attempts, recorded.findings) == (1, ())


def test_periods_that_are_no_multiple_of_sync_begin_at_the_sample_nearest_to_them(
    manutec: Robot,
) -> None:
    search = Search(random=4, refined=1, steps=5)
    wave = design_trajectory(manutec, 3.0013, 4, search=search, harmonics=3)
    drives = load_drives(ROBOTS / "manutec-r15.drives.yaml")
    with open_drive_bus(drives, "sim_plant", "manutec-r15") as bus:
        (recorded,) = (
            event
            for event in measure(plan_of(manutec, wave), manutec, bus)
            if isinstance(event, Recorded)
        )
    recording = recorded.recording
    first = np.flatnonzero(recording.group == 0)[0]
    begins = [np.flatnonzero(recording.group == k)[0] - first for k in range(4)]
    assert begins == [round(k * 3.0013 / drives.sync_period) for k in range(4)]
    assert recorded.findings == ()


def plan_of(robot: Robot, wave: Trajectory) -> Plan:
    identity = PlannedRobot(name=robot.name, digest=robot.digest)
    return Plan(robot=identity, measurements=(wave,))
