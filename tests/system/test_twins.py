"""Robots of all kinds on their virtual twins: planned, measured, identified, compared.

Robots with two to four axes, also prismatic ones, run a complete small campaign. Plans that
determine all parameters of six and seven axes take half an hour of robot time; there a few
measurements are compared with the torques of the plant's links, motors and friction.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import hil
from hil.cli import main
from hil.estimation.identify import estimate
from hil.ground_truth.comparison import Comparison
from hil.ground_truth.true_parameters import true_parameters
from hil.model.dynamics import inverse_dynamics
from hil.model.robot import Robot
from hil.planning.measurement import Gravity
from hil.planning.plan import Plan, PlannedRobot
from hil.runs.pooling import recorded
from sim_plant.plant_file import load_plant_file
from sim_plant.twin.write import write_twin

ROBOTS = Path(__file__).parents[1] / "robots"
COUNTS = {
    "pan-tilt": ("--gravity", "8", "--inertia", "12", "--coupling", "3"),
    "scara": ("--gravity", "6", "--inertia", "20"),
    "cartesian": ("--gravity", "4", "--inertia", "9"),
}
LARGE = ["ur10e", "panda", "ur10e-on-a-wall"]
SEEN = 0.03
"""Permitted gravity error without a friction fit, as a share of an axis's torque limit."""


def cli(*arguments: object) -> None:
    """Run `hil` with these arguments, and check that it exits with status 0."""
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    assert not ended.value.code


def twin_of(name: str, folder: Path) -> Path:
    write_twin(ROBOTS / f"{name}.yaml", folder / "twin")
    return folder / "twin"


def measured(plan: Path, twin: Path, folder: Path) -> Path:
    run = folder / "run"
    drives = "--drives", twin / "drives.yaml"
    cli("run", plan, "-o", run, "--channel", twin / "plant.yaml", *drives)
    return run


@pytest.fixture(scope="module", params=COUNTS)
def campaign(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with twin, plan and run of a small robot."""
    folder = tmp_path_factory.mktemp(request.param)
    twin, plan = twin_of(request.param, folder), folder / "plan.yaml"
    cli("plan", ROBOTS / f"{request.param}.yaml", "-o", plan, *COUNTS[request.param])
    cli("dry-run", plan, "--drives", twin / "drives.yaml")
    measured(plan, twin, folder)
    return folder


def test_the_parameters_of_the_twin_are_found(campaign: Path) -> None:
    run = hil.Run.open(campaign / "run")
    truth = true_parameters(run.robot, campaign / "twin" / "plant.yaml")
    found = Comparison(estimate(run.robot, recorded(run)), truth)
    assert found.mean_torque_error < 0.5e-2
    assert found.inside.sum() >= len(truth) - 1


def test_no_measurement_has_findings(campaign: Path) -> None:
    run = hil.Run.open(campaign / "run")
    assert [measured.measurement.id for measured in run if measured.findings] == []


def test_the_commands_go_through_to_the_report(
    campaign: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cli("identify", campaign / "run")
    cli("report", campaign / "run")
    cli("validate", campaign / "run", "--truth", campaign / "twin" / "plant.yaml")
    shown = capsys.readouterr().out
    assert "estimate against truth" in shown
    if "scara" in shown:
        assert "rms, N m or N" in shown
    if "cartesian" in shown:
        assert "rms, N " in shown
        assert not re.search(r"\brad\b|N m\b", shown)


def gravity_plan(robot: Robot) -> Plan:
    """Return a plan of an outer and an inner joint, slowly back and forth under gravity."""
    rng = np.random.default_rng(3)
    q = robot.q_min + rng.uniform(0.3, 0.6, robot.n_joints) * (robot.q_max - robot.q_min)
    measurements = [
        Gravity(
            id=f"g{axis + 1}",
            axis=axis + 1,
            q=tuple(np.round(q, 3).tolist()),
            stroke=0.3,
            velocity=round(0.15 * float(robot.velocity_limit[axis]), 3),
            acceleration=round(0.3 * float(robot.acceleration_limit[axis]), 3),
            cycles=2,
        )
        for axis in (1, 3, robot.n_joints - 2)
    ]
    return Plan(
        robot=PlannedRobot(name=robot.name, digest=robot.digest), measurements=tuple(measurements)
    )


@pytest.mark.parametrize("name", LARGE)
def test_a_large_robot_s_drives_measure_what_its_links_weigh(name: str, tmp_path: Path) -> None:
    from hil.cli.plan_view import write_plan

    robot = Robot.load(ROBOTS / f"{name}.yaml")
    twin, plan = twin_of(name, tmp_path), tmp_path / "plan.yaml"
    write_plan(plan, gravity_plan(robot), robot)
    run = hil.Run.open(measured(plan, twin, tmp_path))
    truth = true_parameters(robot, twin / "plant.yaml")
    assert load_plant_file(str(twin / "plant.yaml")).gravity == tuple(robot.gravity)
    for measurement, recording in recorded(run):
        axis = measurement.index
        still = np.zeros_like(recording.q)
        weight = inverse_dynamics(robot, truth, recording.q, still, still)[:, axis]
        forth, back = (recording.stroke % 2 == way for way in (0, 1))
        moving = recording.stroke >= 0
        halves = [(recording.tau[:, axis] - weight)[moving & way].mean() for way in (forth, back)]
        missed = abs(sum(halves)) / 2
        assert missed < SEEN * robot.torque_limit[axis]
        assert np.ptp(halves) > 0  # friction, against the motion
