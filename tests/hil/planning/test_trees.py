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
from hil.planning.design import candidates
from hil.planning.design.by_counts import design
from hil.planning.design.trajectories import Basis, Search, condition, design_trajectory
from hil.planning.dry_run import dry_run
from hil.planning.measurement import Coupling, Gravity, Inertia
from hil.planning.plan import make_plan
from hil.planning.prediction.information import predict
from hil.planning.prediction.noise import stated_noise
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


def test_a_trajectory_moves_one_branch_and_those_of_all_branches_show_all_parameters(
    robot: Robot,
) -> None:
    middle, search = (robot.q_min + robot.q_max) / 2, Search(random=20, refined=1, steps=8)
    waves = [design_trajectory(robot, search=search, branch=branch) for branch in (0, 1)]
    assert [each.id for each in waves] == ["trajectory1", "trajectory2"]
    assert [each.moved for each in waves] == [(0, *LEFT), (0, *RIGHT)]
    for each, resting in zip(waves, (RIGHT, LEFT), strict=True):
        path = each.path(0.004)
        assert (path[:, resting] == middle[resting]).all()
        assert condition(robot, each) < 100.0
    assert not dry_run(make_plan(robot, waves), robot).problems
    found = predict(robot, waves, 0.004, stated_noise(robot))
    assert (found.effect < 0.01).all()
    (one,) = predict(robot, waves[:1], 0.004, stated_noise(robot)).effect[-1:]
    assert one > 0.1


def test_the_gradient_of_a_branch_is_that_of_the_cost(robot: Robot) -> None:
    basis = Basis(robot, 10.0, branch=1)
    x = 1.2 * basis.random(np.random.default_rng(1))
    _, gradient = basis.cost(x, "det", 3.0)
    some = np.random.default_rng(2).normal(size=x.shape)
    ends = [basis.cost(x + side * 1e-6 * some, "det", 3.0)[0] for side in (-1, 1)]
    assert np.sum(gradient * some) == pytest.approx((ends[1] - ends[0]) / 2e-6, rel=1e-3)


def test_a_plan_by_minutes_may_have_trajectories_of_all_branches(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(candidates, "SEARCH", Search(random=2, refined=1, steps=1))
    options = candidates.trajectories(robot, None, 0.008, stated_noise(robot), 0.5)
    assert {each.measurement.moved for each in options} == {(0, *LEFT), (0, *RIGHT)}


def test_loads_are_refused_with_what_to_do(robot: Robot) -> None:
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
