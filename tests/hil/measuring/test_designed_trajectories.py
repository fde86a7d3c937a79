"""Designed trajectories on the virtual plant: what passes the dry run is measured without a fault.

All axes accelerate at once and load each other, so drives whose limits of acceleration hold for an
axis by itself run out of torque long before.
"""

from __future__ import annotations

import pytest

from drivers.drives_file import load_drives
from drivers.open_drive_bus import open_drive_bus
from hil.measuring.events import Recorded
from hil.measuring.sequencer import measure
from hil.model.robot import ROBOTS, Robot
from hil.planning.design.trajectories import Search, design_trajectory
from hil.planning.dry_run import dry_run
from hil.planning.plan import Plan, PlannedRobot


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
    identity = PlannedRobot(name=manutec.name, digest=manutec.digest)
    plan = Plan(robot=identity, measurements=(wave,))
    assert not dry_run(plan, manutec).problems
    drives = load_drives(ROBOTS / "manutec-r15.drives.yaml")
    with open_drive_bus(drives, "sim_plant", "manutec-r15") as bus:
        events = list(measure(plan, manutec, bus))
    (recorded,) = (event for event in events if isinstance(event, Recorded))
    assert (recorded.attempts, recorded.findings) == (1, ())
