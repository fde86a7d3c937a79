"""Virtual twins of any robot: the plant is physically valid, and
its files agree with the robot's.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from typer.testing import CliRunner

from checked_files.yaml_file import FileError
from drivers.drive_bus import DriveRefused
from drivers.drives_file import load_drives
from drivers.opening import open_drive_bus
from hil.ground_truth.true_parameters import true_parameters
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import inverse_dynamics
from hil.model.robot import Robot
from hil.tasks.measuring import load_robots_drives
from sim_plant import build
from sim_plant.__main__ import app
from sim_plant.physics.reflected_inertia import configurations, gravity_torques, mass_matrix
from sim_plant.plant import load_plant
from sim_plant.twin.draft import GEARED
from sim_plant.twin.robot import value_of
from sim_plant.twin.write import write_twin

if TYPE_CHECKING:
    from sim_plant.plant import Plant

ROBOTS = Path(__file__).parents[2] / "robots"
N_BASE = {
    "pan-tilt": 8, "scara": 8, "cartesian": 3, "ur10e": 36, "panda": 43, "ur10e-on-a-wall": 38,
}  # fmt: skip
MANUTEC = Path(__file__).parents[3] / "hil" / "robots" / "manutec-r15.yaml"


@pytest.fixture(scope="module", params=[*N_BASE, "manutec-r15"])
def robot(request: pytest.FixtureRequest) -> Path:
    """Robot files of all kinds; the manutec-r15's omits parameters and ties two."""
    return MANUTEC if request.param == "manutec-r15" else ROBOTS / f"{request.param}.yaml"


@pytest.fixture(scope="module")
def folder(robot: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("twin")
    write_twin(robot, place / "twin")
    return place / "twin"


@pytest.fixture(scope="module")
def plant(folder: Path) -> Plant:
    return load_plant(str(folder / "plant.yaml"))


def changed(folder: Path, name: str, *changes: tuple[str, str]) -> Path:
    """Return a robot file with changes."""
    text = (ROBOTS / f"{name}.yaml").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = folder / f"{name}.yaml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("key", "place"),
    [("velocity_limit", "joints.0.velocity_limits"), ("name", "names"),
     ("gear_ratio", "joints.0.drive.gear_ratios"), ("torque_limit", "joints.0.torque_limits")],
)  # fmt: skip
def test_a_mistyped_key_is_refused(tmp_path: Path, key: str, place: str) -> None:
    mistyped = changed(tmp_path, "pan-tilt", (f"{key}:", f"{key}s:"))
    done = CliRunner().invoke(app, ["twin", str(mistyped), "-o", str(tmp_path / "twin")])
    assert done.exit_code == 1
    assert f"{place}: unknown key" in done.output
    assert not (tmp_path / "twin").exists()


@pytest.mark.parametrize(("name", "count"), N_BASE.items())
def test_the_robots_have_the_right_number_of_base_parameters(name: str, count: int) -> None:
    assert len(base_parameters(Robot.load(ROBOTS / f"{name}.yaml"))) == count


@pytest.mark.long
def test_the_plant_has_parameters_that_the_robot_can_have(robot: Path, folder: Path) -> None:
    found = true_parameters(Robot.load(robot), folder / "plant.yaml")
    assert np.all(np.isfinite(found))
    assert np.count_nonzero(found) > 0.7 * len(found)


def test_the_plant_weighs_what_the_identification_s_model_says(
    robot: Path, folder: Path, plant: Plant
) -> None:
    """Independent programs agree on frames, kinds of joints, gravity and bodies."""
    described = Robot.load(robot)
    p = true_parameters(described, folder / "plant.yaml")
    for q in configurations(build.reach(plant.file), 5):
        stated = inverse_dynamics(described, p, q, np.zeros_like(q), np.zeros_like(q))
        assert gravity_torques(plant._arm, q) == pytest.approx(stated, abs=1e-9, rel=1e-9)


def test_the_links_are_bodies(plant: Plant) -> None:
    """M(q) without any motor is positive definite, so that the motors hide nothing."""
    for q in configurations(build.reach(plant.file), 50):
        own = mass_matrix(plant._arm, q)
        moved = np.abs(own).max(axis=0) > 0
        assert np.linalg.eigvalsh(own[np.ix_(moved, moved)])[0] > 0


def test_no_axis_is_overloaded_by_gravity_and_acceleration(plant: Plant) -> None:
    """Loads include motor and friction, at the plans' share of the acceleration limit."""
    drives = [axis.drive for axis in plant.file.axes]
    limit = np.array([drive.peak_torque for drive in drives])
    motor = np.array([0.6 * d.acceleration_max * d.motor_inertia for d in drives])
    friction = np.array([axis.friction.full_speed for axis in plant.file.axes])
    faster = 0.6 * np.array([drive.acceleration_max for drive in drives])
    for q in configurations(build.reach(plant.file), 50):
        gravity = np.abs(gravity_torques(plant._arm, q))
        inertia = (np.abs(mass_matrix(plant._arm, q)) * faster).max(axis=1)
        assert np.all(gravity + inertia + motor + friction < 0.9 * limit)


def test_every_axis_has_something_to_find(plant: Plant) -> None:
    """Links take a part of the torque limit that friction and noise leave visible."""
    limit = np.array([axis.drive.peak_torque for axis in plant.file.axes])
    faster = np.array([axis.drive.acceleration_max for axis in plant.file.axes])
    most = np.zeros(len(limit))
    for q in configurations(build.reach(plant.file), 50):
        inertia = np.diag(mass_matrix(plant._arm, q)) * faster
        most = np.maximum(most, np.abs(gravity_torques(plant._arm, q)) + inertia)
    assert np.all(most > 0.02 * limit)


def test_the_drives_file_agrees_with_robot_and_plant(
    robot: Path, folder: Path, plant: Plant
) -> None:
    drives, _ = load_robots_drives(folder / "drives.yaml", Robot.load(robot))
    for stated, described, reported in zip(drives.axes, plant.file.axes, plant.drives, strict=True):
        assert stated.joint == described.joint
        assert stated.rated_current == reported.rated_current / 1000
        assert stated.increments_per_revolution == reported.increments_per_revolution
        assert stated.limits.torque == described.drive.peak_torque


def test_drives_of_joints_that_slide_do_not_fit_a_robot_whose_joints_turn(tmp_path: Path) -> None:
    robot = ROBOTS / "pan-tilt.yaml"
    write_twin(robot, tmp_path)
    drives = tmp_path / "drives.yaml"
    drives.write_text(drives.read_text().replace("joint: revolute", "joint: prismatic", 1))
    with pytest.raises(FileError, match=r":\d+: axes.0.joint: prismatic of axis joint 1 must be"):
        load_robots_drives(drives, Robot.load(robot))


def test_an_unknown_rotor_is_given_one(tmp_path: Path) -> None:
    robot = changed(tmp_path, "pan-tilt", ("rotor_inertia: 1.2e-05", "rotor_inertia: unknown"))
    write_twin(robot, tmp_path / "twin")
    plant = load_plant(str(tmp_path / "twin" / "plant.yaml"))
    assert plant.file.axes[0].drive.rotor_inertia > 0
    truth = true_parameters(Robot.load(robot), tmp_path / "twin" / "plant.yaml")
    assert np.all(np.isfinite(truth))


def test_a_direct_drive_has_no_ripple_that_looks_like_gravity(tmp_path: Path) -> None:
    direct = ("gear_ratio: 50, rotor_inertia: 1.2e-05", "gear_ratio: 1, rotor_inertia: 0")
    robot = changed(tmp_path, "pan-tilt", direct, direct)
    write_twin(robot, tmp_path / "twin")
    plant = load_plant(str(tmp_path / "twin" / "plant.yaml"))
    assert plant.file.axes[0].drive.gear_ratio < GEARED
    assert plant.file.noise.ripple == 0
    step = plant.file.axes[0].drive.velocity_max * 0.004
    assert step * abs(plant.axes[0]._scale) >= 400  # increments in a SYNC period


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("velocity_limit: 3\n", "velocity_limit: unknown\n", "yaml:10: joints.0.velocity_limit"),
        ("q_max: 2.8\n", "q_max: -3\n", "-3 must be greater than q_min = -2.8"),
        ("alpha: 0}", "alpha: one}", "'one' is not a sum, product or quotient of numbers, pi and"),
        ("joints:", "couplings: [{motor: 1, joint: 2}]\njoints:", "no coupled motors"),
        ("joints:", "ties: [Iyy9 = Ixx1]\njoints:", "must tie two parameters of links"),
        ("q_min: -2.8\n", "q_min: !state least position\n", "must be stated: least position"),
    ],
)
def test_a_robot_that_nothing_can_move_is_refused_with_its_line(
    tmp_path: Path, old: str, new: str, words: str
) -> None:
    with pytest.raises(FileError) as caught:
        write_twin(changed(tmp_path, "pan-tilt", (old, new)), tmp_path / "twin")
    assert words in str(caught.value)
    assert not (tmp_path / "twin").exists()


def test_links_of_which_too_little_is_present_are_refused(tmp_path: Path) -> None:
    alone = ("    q_min: -2.8\n", "    parameters: [sx]\n    q_min: -2.8\n")
    still = ("rotor_inertia: 1.2e-05", "rotor_inertia: 0")
    robot = changed(tmp_path, "pan-tilt", alone, still)
    other = ("    q_min: -0.9\n", "    parameters: [sx]\n    q_min: -0.9\n")
    path = tmp_path / "pan-tilt.yaml"
    path.write_text(robot.read_text().replace(*other).replace(*still))
    with pytest.raises(FileError, match="no masses make M"):
        write_twin(path, tmp_path / "twin")


def test_a_urdf_is_refused_with_the_command_that_makes_a_robot_file(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="hil robot new --urdf"):
        write_twin(tmp_path / "arm.urdf", tmp_path / "twin")


def test_nothing_is_written_over(tmp_path: Path) -> None:
    runner = CliRunner()
    arguments = ["twin", str(ROBOTS / "pan-tilt.yaml"), "-o", str(tmp_path / "twin")]
    assert runner.invoke(app, arguments).exit_code == 0
    again = runner.invoke(app, arguments)
    assert again.exit_code == 1
    assert "exists; name another folder" in again.output


def test_serving_needs_no_command() -> None:
    """Serve by python -m sim_plant --interface ... --channel ..."""
    result = CliRunner().invoke(app, ["--interface", "nowhere", "--channel", "c"])
    assert result.exit_code == 1
    assert "nowhere" in result.output


@pytest.mark.parametrize(
    ("text", "value"),
    [("l1", 0.5), ("-l1 + 2*0.1", -0.3), ("pi/2", np.pi / 2), ("(l1 - 1)/4", -0.125)],
)
def test_frames_are_read_as_robot_files_may_write_them(text: str, value: float) -> None:
    assert value_of(text, {"l1": 0.5}) == pytest.approx(value)


@pytest.mark.parametrize("text", ["l2", "l1**2", "__import__('os')", "1/0", "", "l1 and 2"])
def test_nothing_else_is_evaluated(text: str) -> None:
    with pytest.raises(ValueError, match="is not a sum, product or quotient"):
        value_of(text, {"l1": 0.5})


def test_a_plant_with_another_gear_than_its_drives_file_is_refused_before_anything_moves(
    folder: Path, tmp_path: Path
) -> None:
    """Gear 101 instead of 100: the drives state their own gear, so nobody would notice it later."""
    text = (folder / "plant.yaml").read_text()
    stated = re.search(r"gear_ratio: ([\d.]+)", text)
    assert stated
    other = f"gear_ratio: {1.01 * float(stated[1]):.6g}"
    plant, drives = tmp_path / "plant.yaml", load_drives(folder / "drives.yaml")
    plant.write_text(text.replace(stated[0], other, 1))
    with pytest.raises(DriveRefused, match=r"joint 1 .*gear \(6091\) is"):
        open_drive_bus(drives, "sim_plant", str(plant)).__enter__()
