"""Conventional identification on recordings with known parameters."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from synthetic import TABLE_3_A
from trajectory_run import COULOMB, VISCOUS, recorded, some_trajectory

from benchmarks.rivals import variants
from benchmarks.rivals.products import stack
from benchmarks.rivals.solution import solved_square, total_least_squares
from benchmarks.rivals.variants import (
    BOTH,
    COMPENSATED,
    CUSTOMARY,
    SLOW,
    VARIANTS,
    Variant,
    fit_trajectories,
    trajectories,
)
from hil.errors import NotEnoughData
from hil.model.robot import Robot

if TYPE_CHECKING:
    from benchmarks.rivals.friction_terms import Characteristic
    from hil.planning.trajectory import Trajectory


MU, OFFSET = 0.05, 0.01
"""Friction of the load as in the drift study, and constant torque
as a share of the torque limit.
"""


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load("manutec-r15")


@pytest.fixture(scope="module")
def trajectory(robot: Robot) -> Trajectory:
    return some_trajectory(robot)


def error(robot: Robot, found: Any) -> float:
    return float(np.linalg.norm(found.values - TABLE_3_A) / np.linalg.norm(TABLE_3_A))


@pytest.mark.parametrize("name", VARIANTS)
def test_without_noise_every_variant_finds_the_parameters(
    robot: Robot, trajectory: Trajectory, name: str
) -> None:
    found = fit_trajectories(robot, recorded(robot, trajectory), VARIANTS[name], name=name)
    assert found.method == name
    assert error(robot, found) < 2e-3


@pytest.mark.parametrize("name", ["residual weights, model 1", "instrumental, model 2"])
def test_with_noise_errors_are_of_the_stated_size(
    robot: Robot, trajectory: Trajectory, name: str
) -> None:
    found = fit_trajectories(robot, recorded(robot, trajectory, noise=0.02), VARIANTS[name])
    z = (found.values - TABLE_3_A) / found.standard_errors
    assert error(robot, found) < 0.02
    assert np.sqrt(np.mean(z**2)) < 4.0


def test_a_friction_that_the_model_lacks_spoils_the_parameters_and_one_that_it_has_does_not(
    robot: Robot, trajectory: Trajectory
) -> None:
    data = recorded(robot, trajectory, root=0.05)
    poor, fitting = (
        fit_trajectories(robot, data, Variant(terms)) for terms in ("model 1", "model 2")
    )
    assert error(robot, fitting) < 0.3 * error(robot, poor)


def test_friction_known_beforehand_is_subtracted(robot: Robot, trajectory: Trajectory) -> None:
    def characteristic_of_axis(axis: int) -> Characteristic:
        limit, fastest = robot.torque_limit[axis], robot.velocity_limit[axis]
        return lambda v: limit * (COULOMB * np.sign(v) + VISCOUS * v / fastest)

    data = recorded(robot, trajectory)
    known = [characteristic_of_axis(axis) for axis in range(6)]
    assert error(robot, fit_trajectories(robot, data, COMPENSATED[""], known)) < 2e-3
    assert error(robot, fit_trajectories(robot, data, COMPENSATED[""])) > 0.01


def test_a_level_that_has_changed_since_is_corrected(robot: Robot, trajectory: Trajectory) -> None:
    def characteristic_of_axis(axis: int) -> Characteristic:
        return lambda v: 0.8 * COULOMB * robot.torque_limit[axis] * np.sign(v)

    data = recorded(robot, trajectory, load=MU)
    known = [characteristic_of_axis(axis) for axis in range(6)]
    assert error(robot, fit_trajectories(robot, data, COMPENSATED["corrected"], known)) < 2e-3
    assert error(robot, fit_trajectories(robot, data, COMPENSATED[""], known)) > 0.01


def test_the_residual_of_each_axis_is_that_of_its_noise(
    robot: Robot, trajectory: Trajectory
) -> None:
    found = fit_trajectories(robot, recorded(robot, trajectory, noise=0.02), Variant("model 1"))
    assert found.residual / robot.torque_limit == pytest.approx(found.residual[0] / 945, rel=0.3)
    assert (found.degrees_of_freedom == trajectory.cycles - 1).all()
    assert found.drive_effect.shape == (len(TABLE_3_A), 2 * robot.n_joints)


def test_the_column_of_the_load_finds_friction_of_the_load(
    robot: Robot, trajectory: Trajectory
) -> None:
    data = recorded(robot, trajectory, load=MU, offset=OFFSET)
    without, offset, both = (
        fit_trajectories(robot, data, variant)
        for variant in (
            Variant("model 1"),
            Variant("model 1", offset=True),
            Variant("model 1", offset=True, load=True),
        )
    )
    assert error(robot, without) > 5e-3
    assert error(robot, offset) > 5e-3
    assert error(robot, both) < 1e-3
    assert (without.load_friction, offset.load_friction) == (None, None)
    assert both.load_friction is not None
    assert both.load_friction.mu == pytest.approx(np.full(6, MU), rel=0.05)


@pytest.mark.parametrize("name", [name for name, variant in VARIANTS.items() if variant.load])
def test_every_variant_with_the_column_finds_friction_of_the_load(
    robot: Robot, trajectory: Trajectory, name: str
) -> None:
    data = recorded(robot, trajectory, load=MU, offset=OFFSET)
    assert error(robot, fit_trajectories(robot, data, VARIANTS[name])) < 3e-3


def test_its_iteration_settles_well_before_it_must_end(
    robot: Robot, trajectory: Trajectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = recorded(robot, trajectory, noise=0.02, load=MU)
    settled = fit_trajectories(robot, data, VARIANTS["strongest"])
    monkeypatch.setattr(variants, "ROUNDS", 6)
    soon = fit_trajectories(robot, data, VARIANTS["strongest"])
    monkeypatch.setattr(variants, "ROUNDS", 30)
    monkeypatch.setattr(variants, "SETTLED", 0.0)
    late = fit_trajectories(robot, data, VARIANTS["strongest"])
    assert (soon.values == settled.values).all()
    assert (np.abs(settled.values - late.values) < 0.01 * late.standard_errors).all()


def test_without_friction_of_the_load_its_column_finds_none(
    robot: Robot, trajectory: Trajectory
) -> None:
    data = recorded(robot, trajectory, noise=0.02)
    found = fit_trajectories(robot, data, Variant("model 1", load=True))
    assert found.load_friction is not None
    assert (np.abs(found.load_friction.mu) < 5 * found.load_friction.standard_error).all()


@pytest.mark.parametrize("name", CUSTOMARY)
def test_without_its_column_a_method_knows_nothing_of_the_load(
    robot: Robot, trajectory: Trajectory, name: str
) -> None:
    """Inner products of a method's columns do not depend on the other columns of the regression."""
    data = stack(robot, recorded(robot, trajectory, noise=0.02), CUSTOMARY[name].slowest)
    found = variants.estimate_of(robot, data, CUSTOMARY[name], name)
    loaded = replace(data, products=data.loaded(TABLE_3_A))
    again = variants.estimate_of(robot, loaded, CUSTOMARY[name], name)
    assert (again.values == found.values).all()
    assert (again.scatter_covariance == found.scatter_covariance).all()


def test_one_variant_alone_keeps_low_speeds_and_stands_beside_its_fellow() -> None:
    names = list(VARIANTS)
    all_speeds = "all speeds, model 2"
    kept = [name for name in names if not VARIANTS[name].slowest]
    assert kept == [all_speeds, f"{all_speeds}, {BOTH}"]
    fellow = VARIANTS["residual weights, model 2"]
    assert fellow == replace(VARIANTS[all_speeds], slowest=SLOW)
    assert names[names.index("residual weights, model 2") + 1] == all_speeds


def test_low_speeds_can_be_left_out(robot: Robot, trajectory: Trajectory) -> None:
    data = recorded(robot, trajectory)
    every, fast = (stack(robot, data, slowest).products for slowest in (0.0, 0.05))
    assert (fast.counts < every.counts).all()
    assert len(every.blocks) == trajectory.cycles


def test_without_trajectories_nothing_can_be_identified() -> None:
    with pytest.raises(NotEnoughData, match="no trajectories"):
        trajectories([])


def test_a_singular_matrix_has_no_square_solution() -> None:
    with pytest.raises(np.linalg.LinAlgError):
        solved_square(np.ones((2, 2)), np.ones(2))


def test_total_least_squares_has_no_bias_by_noise_that_is_alike_in_all_columns() -> None:
    random = np.random.default_rng(3)
    x = np.array([1.0, -2.0])
    true = random.normal(size=(50000, 2))
    exact = np.column_stack([true, true @ x])
    noisy = exact + 0.3 * exact.std(axis=0) * random.normal(size=exact.shape)
    W, y = noisy[:, :2], noisy[:, 2]
    found = total_least_squares(W.T @ W, W.T @ y, float(y @ y))
    np.testing.assert_allclose(found, x, atol=0.03)
    assert np.abs(np.linalg.lstsq(W, y)[0] - x).max() > 0.1
