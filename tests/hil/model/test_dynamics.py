"""Model against Pinocchio, against its own parts and against conservation of energy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic import TABLE_3_A

import hil
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import (
    gravity_torque,
    inverse_dynamics,
    mass_matrix,
    regressor,
)
from hil.model.motors import motor_inertia, motor_torque

if TYPE_CHECKING:
    from hil.model.robot import Robot

SEEDS = st.integers(0, 2**32 - 1)
PIN_ORDER = ("m", "sx", "sy", "sz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")


def pinocchio_model(robot: Robot) -> pin.Model:
    """Return Pinocchio's model with the frames of `robot`; a regressor needs no inertias."""
    model = pin.Model()
    model.gravity.linear = robot.gravity
    for k, parent in enumerate(robot.parents):
        first = pin.SE3(pin.utils.rotate("z", robot.gamma[k]), np.array([0, 0, robot.b[k]]))
        about_x = pin.SE3(pin.utils.rotate("x", robot.alpha[k]), np.array([robot.d[k], 0, 0]))
        about_z = pin.SE3(pin.utils.rotate("z", robot.theta[k]), np.array([0, 0, robot.r[k]]))
        joint = pin.JointModelRZ() if robot.revolute[k] else pin.JointModelPZ()
        model.addJoint(parent + 1, joint, first * about_x * about_z, f"joint {k + 1}")
    return model


def pinocchio_regressor(robot: Robot, q, qd, qdd):
    """Return the regressor of all standard parameters in our order, shape (n_samples, n, 10 n)."""
    model = pinocchio_model(robot)
    data = model.createData()
    found = [
        np.reshape(pin.computeJointTorqueRegressor(model, data, *state), (robot.n_joints, -1))
        for state in zip(q, qd, qdd, strict=True)
    ]
    names = [f"{p}{k}" for k in range(1, robot.n_joints + 1) for p in PIN_ORDER]
    return np.array(found)[:, :, [names.index(name) for name in robot.standard_parameters]]


def motion(n_joints: int, seed: int, n_samples: int = 20):
    rng = np.random.default_rng(seed)
    return rng.uniform(-2.0, 2.0, (3, n_samples, n_joints))


def sparse_standard_parameters(robot: Robot, rng: np.random.Generator):
    """Return random values of the present parameters, ties kept, zero elsewhere."""
    values = {name: rng.normal() for name in robot.present}
    values |= {tied: values[name] for tied, name in robot.ties.items()}
    return np.array([values.get(name, 0.0) for name in robot.standard_parameters])


@pytest.fixture
def random_parameters(manutec):
    return np.random.default_rng(5).normal(size=len(base_parameters(manutec)))


@pytest.mark.parametrize("tree", [False, True])
@settings(deadline=None, max_examples=30)
@given(seed=SEEDS)
def test_base_parameters_of_any_robot_give_pinocchios_torque(chains, tree, seed):
    robot = chains.random(seed, tree)
    q, qd, qdd = motion(robot.n_joints, seed)
    standard = sparse_standard_parameters(robot, np.random.default_rng(seed))
    torque = pinocchio_regressor(robot, q, qd, qdd) @ standard
    ours = regressor(robot, q, qd, qdd) @ (base_parameters(robot).matrix @ standard)
    assert np.allclose(ours, torque, rtol=0, atol=1e-11 * max(1.0, np.abs(torque).max()))


@pytest.mark.parametrize("tree", [False, True])
@settings(deadline=None, max_examples=50)
@given(seed=SEEDS)
def test_base_parameters_have_rank_and_span_of_pinocchios_regressor(chains, tree, seed):
    robot = chains.random(seed, tree)
    stacked = pinocchio_regressor(robot, *motion(robot.n_joints, seed, 60)).reshape(
        -1, 10 * robot.n_joints
    )
    present = [k for k, n in enumerate(robot.standard_parameters) if n in robot.present]
    rank = np.linalg.matrix_rank(stacked[:, present], tol=1e-8) if present else 0
    K = base_parameters(robot).matrix
    assert len(K) == rank
    both = np.vstack([stacked[:, present], K[:, present]])
    assert rank == (np.linalg.matrix_rank(both, tol=1e-8) if present else 0)


@pytest.mark.parametrize(("seed", "tree"), [(10_455, False), (10_404, True), (10_450, True)])
def test_rounding_errors_and_few_configurations_do_not_hide_or_feign_parameters(chains, seed, tree):
    """Rounding errors of 1e-9 were scaled up; 12 configurations were few for several branches."""
    assert base_parameters(chains.random(seed, tree).free_links())


def test_rows_of_a_joint_hold_links_of_its_subtree_alone(chains):
    """Two arms on a torso: neither arm feels the other."""
    joint = chains.joint
    robot = chains.robot(
        joint(), joint(alpha="pi/2", d="a"), joint(d="b"),
        joint(parent=1, gamma="pi", b="a", alpha="pi/2", d="a"), joint(alpha="pi/2", d="b"),
    )  # fmt: skip
    q, qd, qdd = motion(5, 11)
    moves = (regressor(robot, q, qd, qdd) != 0).any(axis=0)
    links = [int(head[-1]) - 1 for head in base_parameters(robot).heads]
    assert moves[0].any()
    assert [set(np.array(links)[row].tolist()) for row in moves[1:]] == [{1, 2}, {2}, {3, 4}, {4}]
    M = mass_matrix(robot, np.ones(len(links)), q)
    assert (M[:, 1:3, 3:] == 0).all()
    assert (regressor(robot, q, qd, qdd, joints=[4, 1])[:, 0] != 0).any()


def test_ties_keep_the_torque(manutec):
    q, qd, qdd = motion(6, 1)
    standard = sparse_standard_parameters(manutec, np.random.default_rng(2))
    assert standard[50] == standard[53] != 0
    ours = regressor(manutec, q, qd, qdd) @ (base_parameters(manutec).matrix @ standard)
    assert np.allclose(ours, pinocchio_regressor(manutec, q, qd, qdd) @ standard, atol=1e-11)


def test_regressor_has_full_column_rank(manutec):
    columns = regressor(manutec, *motion(6, 3, 100)).reshape(-1, 14)
    assert np.linalg.cond(columns) < 100


@pytest.mark.parametrize("tree", [False, True])
@settings(deadline=None, max_examples=15)
@given(seed=SEEDS)
def test_all_torques_agree_to_rounding(chains, tree, seed):
    robot = chains.random(seed, tree)
    q, qd, qdd = motion(robot.n_joints, seed)
    p = np.random.default_rng(seed).normal(size=len(base_parameters(robot)))
    whole = inverse_dynamics(robot, p, q, qd, qdd)
    gravity = gravity_torque(robot, p, q)
    centrifugal = inverse_dynamics(robot, p, q, qd, 0.0) - gravity
    parts = np.einsum("sij,sj->si", mass_matrix(robot, p, q), qdd) + centrifugal + gravity
    faster = inverse_dynamics(robot, p, q, 2.0 * qd, 0.0) - gravity
    scale = 1e-12 * max(1.0, np.abs(whole).max(), np.abs(faster).max())
    assert np.allclose(regressor(robot, q, qd, qdd) @ p, whole, rtol=0, atol=scale)
    assert np.allclose(parts, whole, rtol=0, atol=scale)
    assert np.allclose(faster, 4.0 * centrifugal, rtol=0, atol=8 * scale)
    assert np.allclose(inverse_dynamics(robot, p, q, 0.0, 0.0), gravity, rtol=0, atol=scale)


def test_mass_matrix_is_symmetric_and_the_derivative_of_torque(manutec, random_parameters):
    q, qd, qdd = motion(6, 4)
    M = mass_matrix(manutec, random_parameters, q)
    assert np.allclose(M, M.swapaxes(1, 2), rtol=0, atol=1e-12)
    for j in range(6):
        ahead = inverse_dynamics(manutec, random_parameters, q, qd, qdd + np.eye(6)[j])
        here = inverse_dynamics(manutec, random_parameters, q, qd, qdd)
        assert np.allclose(ahead - here, M[:, :, j], rtol=0, atol=1e-11)


def test_mass_matrix_of_table_3_is_positive_definite(manutec):
    M = mass_matrix(manutec, TABLE_3_A, motion(6, 5, 500)[0])
    assert np.linalg.eigvalsh(M).min() > 0


@pytest.mark.parametrize("tree", [False, True])
@settings(deadline=None, max_examples=15)
@given(seed=SEEDS)
def test_power_into_the_arm_is_the_change_of_its_energy(chains, tree, seed):
    robot = chains.random(seed, tree)
    q, qd, qdd = motion(robot.n_joints, seed, 1)
    p = np.random.default_rng(seed).normal(size=len(base_parameters(robot)))
    power = np.sum(qd * (inverse_dynamics(robot, p, q, qd, qdd) - gravity_torque(robot, p, q)))

    def kinetic(t: float) -> float:
        velocity = qd + t * qdd
        M = mass_matrix(robot, p, q + t * qd + t**2 / 2 * qdd)
        return 0.5 * (velocity @ M[0] @ velocity.T).item()

    h = 1e-3
    slope = (8 * (kinetic(h) - kinetic(-h)) - (kinetic(2 * h) - kinetic(-2 * h))) / (12 * h)
    assert slope == pytest.approx(power, rel=1e-7, abs=1e-6)


def test_m44_is_as_the_paper_states(manutec, random_parameters):
    q = motion(6, 6)[0]
    p10, p11, p14 = random_parameters[[9, 10, 13]]
    M44 = mass_matrix(manutec, random_parameters, q)[:, 3, 3]
    s, c = np.sin(q[:, 4]), np.cos(q[:, 4])
    assert np.allclose(M44, p10 + p11 * s**2 + p14 * c**2, rtol=0, atol=1e-13)


def test_rows_of_single_joints_are_those_of_the_whole(manutec):
    q, qd, qdd = motion(6, 7)
    whole = regressor(manutec, q, qd, qdd)
    assert np.array_equal(regressor(manutec, q, qd, qdd, joints=[3]), whole[:, [3]])
    assert np.array_equal(regressor(manutec, q, qd, qdd, joints=[4, 0]), whole[:, [4, 0]])


def test_one_sample_comes_without_a_leading_axis(manutec, random_parameters):
    q, qd, qdd = motion(6, 8)
    assert regressor(manutec, q, qd, qdd).shape == (20, 6, 14)
    assert np.array_equal(
        regressor(manutec, q[0], qd[0], qdd[0]), regressor(manutec, q, qd, qdd)[0]
    )
    assert mass_matrix(manutec, random_parameters, q[0]).shape == (6, 6)
    assert gravity_torque(manutec, random_parameters, q[0]).shape == (6,)


@pytest.mark.parametrize("n_samples", [0, 1, 15, 16, 17, 2049])
def test_any_number_of_samples_gives_the_same_rows(manutec, n_samples):
    q, qd, qdd = motion(6, 9, 2049)
    few = regressor(manutec, q[:n_samples], qd[:n_samples], qdd[:n_samples])
    assert np.array_equal(few, regressor(manutec, q, qd, qdd)[:n_samples])


def test_a_sample_that_is_missing_spoils_no_other(manutec):
    q, qd, qdd = motion(6, 10)
    clean = regressor(manutec, q, qd, qdd)
    q[7] = np.nan
    spoiled = regressor(manutec, q, qd, qdd)
    assert np.isnan(spoiled[7]).any()
    assert np.array_equal(np.delete(spoiled, 7, axis=0), np.delete(clean, 7, axis=0))


def test_shapes_that_do_not_fit_are_refused(manutec):
    with pytest.raises(ValueError, match="last axis must be 6 joints"):
        regressor(manutec, np.zeros((3, 5)), 0.0, 0.0)
    with pytest.raises(ValueError, match="has 14 base parameters"):
        gravity_torque(manutec, np.zeros(13), np.zeros(6))
    with pytest.raises(ValueError, match=r"joint index 6 must be in 0..5"):
        regressor(manutec, np.zeros(6), 0.0, 0.0, joints=[6])


def test_motors_add_a_constant_diagonal_inertia(manutec):
    q, qd, qdd = motion(6, 11)
    reflected = np.array([14.3325, 57.33, 4.68, 1.56816, 1.1290752, 0.421443])
    H = motor_inertia(manutec, q)
    assert np.allclose(H, np.diag(reflected))
    assert H.shape == (20, 6, 6)
    assert np.allclose(motor_torque(manutec, q, qd, qdd), reflected * qdd)


def test_the_package_offers_the_model_by_name(manutec, random_parameters):
    q = np.zeros((2, 6))
    assert hil.Robot.load("manutec-r15") == manutec
    assert len(hil.base_parameters(manutec)) == 14
    assert hil.regressor(manutec, q, q, q).shape == (2, 6, 14)
    assert hil.mass_matrix(manutec, random_parameters, q).shape == (2, 6, 6)
    assert np.array_equal(
        hil.inverse_dynamics(manutec, random_parameters, q, q, q),
        hil.gravity_torque(manutec, random_parameters, q),
    )
    with pytest.raises(AttributeError, match="no_such"):
        hil.no_such  # noqa: B018
