"""Exciting trajectories: rest, limits, scales, gradient, reproducibility."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.optimize import approx_fprime
from synthetic import TABLE_3_A

from checked_files.yaml_file import parse_yaml
from hil.model.dynamics import inverse_dynamics, regressor
from hil.model.robot import Robot
from hil.planning.design import trajectories
from hil.planning.design.trajectories import (
    Basis,
    ExcitationCriterion,
    Search,
    condition,
    design_trajectory,
)
from hil.planning.dry_run import dry_run
from hil.planning.plan import Plan, PlannedRobot, dump_plan
from hil.planning.prediction import information
from hil.planning.strokes import REST
from hil.planning.trajectory import ACCELERATION_SHARE, Trajectory

QUICK = Search(random=20, refined=1, steps=8)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load("manutec-r15")


@pytest.fixture(scope="module")
def designed(robot: Robot) -> Trajectory:
    return design_trajectory(robot, cycles=2, search=QUICK)


def planned(robot: Robot, *trajectories: Trajectory) -> Plan:
    return Plan(robot=PlannedRobot(name=robot.name, digest=robot.digest), measurements=trajectories)


def test_velocity_and_acceleration_are_the_derivatives_of_position(designed: Trajectory) -> None:
    t, h = np.linspace(0, designed.period, 50), 1e-4
    (q0, v0, _), (_, v, a), (q1, v1, _) = (designed.motion(t + d) for d in (-h, 0, h))
    assert v == pytest.approx((q1 - q0) / (2 * h), abs=1e-5)
    assert a == pytest.approx((v1 - v0) / (2 * h), abs=1e-4)


def test_periods_begin_and_end_at_rest(designed: Trajectory) -> None:
    q, qd, qdd = designed.motion(np.array([0.0, designed.period]))
    assert q[0] == pytest.approx(q[1])
    assert np.abs(qd).max() < 1e-4
    assert np.abs(qdd).max() < 1e-3


def test_the_path_rests_before_and_after_all_periods(designed: Trajectory) -> None:
    path = designed.path(0.004)
    rest = round(REST / 0.004)
    assert path[:rest] == pytest.approx(np.tile(designed.start, (rest, 1)))
    assert path[-rest:] == pytest.approx(np.tile(designed.start, (rest, 1)), abs=1e-6)
    assert len(path) * 0.004 == pytest.approx(designed.duration, abs=0.01)


def test_a_designed_trajectory_passes_the_dry_run(robot: Robot, designed: Trajectory) -> None:
    result = dry_run(planned(robot, designed), robot)
    assert not result.problems
    assert result.counts == {"trajectory": 1}


@pytest.mark.parametrize(
    ("factor", "words"),
    [(3.0, "position of joint"), (3.0, "velocity of joint"), (3.0, "acceleration of joint")],
)
def test_the_dry_run_finds_limits_exceeded_between_the_ends(
    robot: Robot, designed: Trajectory, factor: float, words: str
) -> None:
    larger = {
        key: tuple(tuple(factor * a for a in row) for row in getattr(designed, key))
        for key in ("sine", "cosine")
    }
    result = dry_run(planned(robot, designed.model_copy(update=larger)), robot)
    assert any(words in problem.message for problem in result.problems)
    assert result.problems[0].location[:2] == ("measurements", 0)


def test_the_dry_run_refuses_more_than_half_of_the_acceleration_limit(
    robot: Robot, designed: Trajectory
) -> None:
    bounded = robot.acceleration_limit * ACCELERATION_SHARE
    _, _, qdd = designed.motion(np.linspace(0, designed.period, 2501))
    used = np.abs(qdd).max(axis=0) / bounded
    worst = int(used.argmax())
    for factor, refused in ((0.99 / used[worst], False), (1.02 / used[worst], True)):
        faster = designed.model_copy(update={"period": designed.period / np.sqrt(factor)})
        messages = [p.message for p in dry_run(planned(robot, faster), robot).problems]
        about = [text for text in messages if f"acceleration of joint {worst + 1}" in text]
        assert bool(about) is refused
    assert f"{-bounded[worst]:.5g} ... {bounded[worst]:.5g} rad/s^2, 50% of its limit" in about[0]
    assert "make the amplitudes smaller or the period longer" in about[0]


def test_the_dry_run_finds_a_trajectory_that_begins_in_motion(robot: Robot) -> None:
    sine = ((0.1,),) + ((0.0,),) * 5
    moving = Trajectory(id="t", q=(0.0,) * 6, period=10, sine=sine, cosine=((0.0,),) * 6)
    problems = dry_run(planned(robot, moving), robot).problems
    assert "joint 1 begins with velocity" in problems[0].message


def test_a_plan_with_a_trajectory_reads_back(robot: Robot, designed: Trajectory) -> None:
    plan = planned(robot, designed)
    assert parse_yaml(dump_plan(plan), Plan, "plan.yaml") == plan


def test_rows_of_different_lengths_are_refused() -> None:
    with pytest.raises(ValidationError, match="the same number of harmonics"):
        Trajectory(id="t", q=(0.0, 0.0), period=1, sine=((1.0,), ()), cosine=((1.0,), (1.0,)))


@pytest.mark.parametrize("criterion", get_args(ExcitationCriterion))
def test_the_gradient_is_that_of_the_cost(robot: Robot, criterion: ExcitationCriterion) -> None:
    basis = Basis(robot, 10.0)
    x = 1.2 * basis.random(np.random.default_rng(1))
    _, gradient = basis.cost(x, criterion, 3.0)
    flat = x.ravel()
    some = np.zeros_like(flat)
    some[::5] = 1.0
    slope = approx_fprime(
        np.zeros(1),
        lambda s: basis.cost((flat + s[0] * some).reshape(x.shape), criterion, 3.0)[0],
        1e-6,
    )
    assert float(gradient.ravel() @ some) == pytest.approx(float(slope[0]), rel=1e-3, abs=1e-4)


def test_optimising_beats_the_random_starts(robot: Robot) -> None:
    basis, rng = Basis(robot, 10.0), np.random.default_rng(0)
    random = [np.exp(basis.judge(basis.random(rng), "condition")) for _ in range(QUICK.random)]
    found = design_trajectory(robot, criterion="condition", search=QUICK)
    assert condition(robot, found) < 0.7 * min(random)


@pytest.mark.parametrize("criterion", get_args(ExcitationCriterion))
def test_no_criterion_leaves_the_wrist_at_rest(
    robot: Robot, criterion: ExcitationCriterion
) -> None:
    found = design_trajectory(robot, criterion=criterion, search=QUICK)
    motion = found.motion(np.linspace(0, found.period, 200))
    rms = np.sqrt(np.mean(inverse_dynamics(robot, TABLE_3_A, *motion) ** 2, axis=0))
    assert (rms[3:] > 1.5).all()


def test_log_det_is_what_is_taken_where_nobody_chooses(robot: Robot, designed: Trajectory) -> None:
    assert design_trajectory(robot, cycles=2, criterion="det", search=QUICK) == designed


@pytest.mark.parametrize("criterion", get_args(ExcitationCriterion))
def test_no_criterion_minds_the_units_of_parameters(
    robot: Robot, criterion: ExcitationCriterion, monkeypatch: pytest.MonkeyPatch
) -> None:
    x = Basis(robot, 10.0).random(np.random.default_rng(2))
    value = Basis(robot, 10.0).judge(x, criterion)
    finer = np.geomspace(1.0, 1e4, len(TABLE_3_A))

    def convert_units(*motion: Any, **joints: Any) -> Any:
        return regressor(*motion, **joints) / finer

    monkeypatch.setattr(trajectories, "regressor", convert_units)
    monkeypatch.setattr(information, "regressor", convert_units)
    assert Basis(robot, 10.0).judge(x, criterion) == pytest.approx(value, abs=1e-6)


@pytest.mark.parametrize("harmonics", [2, 15])
def test_as_many_harmonics_as_are_asked_for_keep_the_limits(robot: Robot, harmonics: int) -> None:
    least = Search(random=3, refined=1, steps=2)
    found = design_trajectory(robot, search=least, harmonics=harmonics)
    assert {len(row) for row in (*found.sine, *found.cosine)} == {harmonics}
    assert not dry_run(planned(robot, found), robot).problems


def test_a_single_harmonic_is_refused(robot: Robot) -> None:
    with pytest.raises(ValueError, match="1 harmonics must be at least 2"):
        design_trajectory(robot, harmonics=1)


def test_the_same_seed_gives_the_same_trajectory(robot: Robot, designed: Trajectory) -> None:
    assert design_trajectory(robot, cycles=2, search=QUICK) == designed
    assert design_trajectory(robot, cycles=2, seed=1, search=QUICK) != designed
