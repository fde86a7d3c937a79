"""Plans and shapes of trees: one branch moves at a time, others wait at mid-range."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from checked_files.yaml_file import FileError
from hil.errors import NoLoad
from hil.ground_truth.true_parameters import true_parameters
from hil.model.capsules import capsules, link_reaches, segments
from hil.model.load import load_columns
from hil.model.robot import Robot
from hil.planning.design.by_counts import design
from hil.planning.design.trajectories import design_trajectory
from hil.planning.dry_run import dry_run
from hil.planning.measurement import Coupling, Gravity, Inertia
from hil.planning.prediction.noise import stated_noise
from hil.planning.prediction.precision import predict
from sim_plant.twin.write import write_twin

FILE = Path(__file__).parents[2] / "robots" / "two-arms.yaml"
LEFT, RIGHT = [1, 2], [3, 4, 5]


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load(FILE)


def test_a_plan_of_strokes_moves_one_branch_at_a_time_and_shows_all_parameters(
    robot: Robot,
) -> None:
    drive = robot.file.joints[3].drive  # strokes tell no unknown rotor from its link
    robot = robot.replace_joints({4: {"drive": drive}})
    plan, middle = design(robot), (robot.q_min + robot.q_max) / 2
    assert not dry_run(plan, robot).problems
    for each in plan.measurements:
        assert isinstance(each, Gravity | Inertia | Coupling)
        # motor angles of moving axes are shifted by up to a fifth of the range
        away = np.abs(np.array(each.q) - middle) > 0.11 * (robot.q_max - robot.q_min)
        assert not (away[LEFT].any() and away[RIGHT].any()), each.id
    found = predict(robot, plan.measurements, 0.004, stated_noise(robot))
    assert (found.effect < 0.001).all()


def test_motions_of_all_branches_at_once_and_loads_are_refused_with_what_to_do(
    robot: Robot, tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match=r"moves all axes at once, .* plan strokes"):
        design_trajectory(robot)
    with pytest.raises(NoLoad, match=r"2 last links, .* the branch of the load alone: .* --to"):
        load_columns(robot)


def test_virtual_plants_are_chains(robot: Robot, tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"moves a chain, and the robot is a tree; .* one branch"):
        write_twin(FILE, tmp_path / "twin")
    with pytest.raises(FileError, match="axes: are a chain, and the robot is a tree"):
        true_parameters(robot.changed(joints=robot.file.joints), "manutec-r15")


def test_capsules_lie_on_their_branch_within_reach(robot: Robot) -> None:
    model, tree = pin.Model(), robot.parents
    for k, parent in enumerate(tree):
        joint = pin.JointModelRZ() if robot.revolute[k] else pin.JointModelPZ()
        model.addJoint(parent + 1, joint, pin.SE3(robot.zero_pose(k)), f"{k}")
    data, shapes, reach = model.createData(), capsules(robot), link_reaches(robot)
    low, high = robot.q_min, robot.q_max
    for q in np.random.default_rng(1).uniform(low, high, (20, robot.n_joints)):
        placed = segments(robot, q[None])[0]
        pin.forwardKinematics(model, data, q)
        for link, ends in enumerate(shapes.ends):
            expected = [data.oMi[link + 1].act(end) for end in ends]
            np.testing.assert_allclose(placed[link], expected, atol=1e-12)
        assert (np.linalg.norm(placed, axis=-1).max(axis=-1) <= reach - shapes.radii + 1e-12).all()
        for joint in range(robot.n_joints):
            other = q + 0.01 * np.eye(robot.n_joints)[joint]
            way = np.linalg.norm(segments(robot, other[None])[0] - placed, axis=-1).max(axis=-1)
            assert (way <= 0.01 * shapes.reach[:, joint] + 1e-12).all()
    moves = shapes.reach > 0
    assert not moves[np.ix_(LEFT, RIGHT)].any()
    assert not moves[np.ix_(RIGHT, LEFT)].any()
