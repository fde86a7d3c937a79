"""The plant's dynamics against Pinocchio and against the estimator's independent model."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.model.base_parameters import base_parameters
from hil.model.dynamics import inverse_dynamics
from sim_plant.physics.rigid_body import WORK, bias_and_mass, forward_dynamics
from sim_plant.physics.state import MOTOR_INERTIA
from sim_plant.plant import load_plant

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.model.robot import Robot

    Array = NDArray[np.float64]

TABLE_3_A = (
    32.015, -28.058, -2.187, 19.905, 48.491, 9.602, 13.313,
    -15.836, 0.0, 0.0443, 0.2883, 0.1554, -0.1885, 0.3760,
)  # fmt: skip
REAL_BODIES = (
    32.13, -22.44, -2.184, 22.99, 47.18, 9.607, 13.303,
    -15.836, 0.0096, 0.0696, 0.1837, 0.1933, -0.1878, 0.3541,
)  # fmt: skip
PINOCCHIO = [0, 1, 2, 3, 4, 7, 5, 8, 9, 6]
"""Our columns of a body in Pinocchio's order: m, s, Ixx, Ixy, Iyy, Ixz, Iyz, Izz."""


class Arm(NamedTuple):
    """Arguments of `forward_dynamics`."""

    joints: tuple[int, ...]
    frames: Array
    bodies: Array
    gravity: Array
    kinds: Array | None
    motors: Array


@pytest.fixture(scope="module")
def truth() -> Arm:
    plant = load_plant("manutec-r15")
    return Arm(*plant._arm, plant.const[:, MOTOR_INERTIA])


def random_arm(n: int, rng: np.random.Generator, kinds: Array | None = None) -> Arm:
    """Return real bodies on frames of any orientation; joints
    are revolute unless `kinds` differs.
    """
    alpha = rng.uniform(-np.pi, np.pi, n)
    d, r = rng.uniform(-1.0, 1.0, (2, n))
    frames = np.column_stack(
        [np.cos(alpha), np.sin(alpha), d, -np.sin(alpha) * r, np.cos(alpha) * r]
    )
    bodies = []
    for _ in range(n):
        points, weights = rng.normal(size=(6, 3)), rng.uniform(0.2, 3.0, 6)
        second = np.einsum("k,ki,kj->ij", weights, points, points)
        inertia = np.trace(second) * np.eye(3) - second
        bodies.append([
            weights.sum(), *(weights @ points), *np.diag(inertia),
            inertia[0, 1], inertia[0, 2], inertia[1, 2],
        ])  # fmt: skip
    return Arm(
        tuple(range(n)),
        frames,
        np.array(bodies),
        rng.normal(size=3),
        kinds,
        rng.uniform(0.0, 20.0, n),
    )


def pinocchio_model(arm: Arm) -> pin.Model:
    """Return Pinocchio's model with the frames of `arm`, and the bodies of links with a mass."""
    model = pin.Model()
    model.gravity.linear = arm.gravity
    for k, (ca, sa, *origin) in enumerate(arm.frames):
        about_x = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
        slides, theta = (0.0, 0.0) if arm.kinds is None else arm.kinds[k]
        place = pin.SE3(about_x @ pin.utils.rotate("z", float(theta)), np.array(origin))
        moves = pin.JointModelPZ() if slides else pin.JointModelRZ()
        joint = model.addJoint(k, moves, place, f"joint {k + 1}")
        if arm.bodies[k, 0] > 0:
            body = pin.Inertia.FromDynamicParameters(arm.bodies[k, PINOCCHIO])
            model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    model.armature = arm.motors
    return model


def relative(found: Array, expected: Array) -> float:
    return float(np.abs(found - expected).max() / np.abs(expected).max())


@settings(deadline=None, max_examples=60)
@given(n=st.sampled_from([1, 3, 6]), seed=st.integers(0, 2**32 - 1))
@pytest.mark.long
def test_accelerations_of_any_arm_are_pinocchios(n: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    arm = random_arm(n, rng)
    model = pinocchio_model(arm)
    q, qd, tau = rng.uniform(-3.0, 3.0, (3, n)) * np.array([[1.0], [1.0], [100.0]])
    expected = pin.aba(model, model.createData(), q, qd, tau)
    assert relative(forward_dynamics(*arm, q, qd, tau), expected) < 1e-9


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**32 - 1))
def test_mass_matrix_and_bias_of_any_arm_are_pinocchios(seed: int) -> None:
    rng = np.random.default_rng(seed)
    arm = random_arm(6, rng)._replace(motors=np.zeros(6))
    model = pinocchio_model(arm)
    data = model.createData()
    q, qd = rng.uniform(-3.0, 3.0, (2, 6))
    bias, mass = bias_and_lower_triangle(arm, q, qd)
    assert relative(mass, np.tril(pin.crba(model, data, q))) < 1e-12
    assert relative(bias, pin.nonLinearEffects(model, data, q, qd)) < 1e-12


@settings(deadline=None, max_examples=60)
@given(n=st.sampled_from([2, 4]), seed=st.integers(0, 2**32 - 1))
@pytest.mark.long
def test_arms_that_slide_and_turn_from_any_angle_move_as_pinocchios(n: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    kinds = np.column_stack([rng.integers(0, 2, n), rng.uniform(-3.0, 3.0, n)])
    arm = random_arm(n, rng, kinds)
    model = pinocchio_model(arm)
    q, qd, tau = rng.uniform(-3.0, 3.0, (3, n)) * np.array([[1.0], [1.0], [100.0]])
    expected = pin.aba(model, model.createData(), q, qd, tau)
    assert relative(forward_dynamics(*arm, q, qd, tau), expected) < 1e-9
    bias, mass = bias_and_lower_triangle(arm, q, qd)
    data = model.createData()
    expected = np.tril(pin.crba(model, data, q)) - np.diag(arm.motors)
    assert relative(mass, expected) < 1e-9
    assert relative(bias, pin.nonLinearEffects(model, data, q, qd)) < 1e-9


@pytest.mark.parametrize("seed", range(10))
def test_accelerations_of_the_truth_are_those_of_pinocchios_regressor(
    truth: Arm, seed: int
) -> None:
    """The plant's links have no mass, so Pinocchio accepts only their parameters."""
    rng = np.random.default_rng(seed)
    model = pinocchio_model(truth)
    q, qd, tau = rng.uniform(-3.0, 3.0, (3, 6)) * np.array([[1.0], [1.0], [300.0]])

    def torque(qd: Array, qdd: Array) -> Array:
        columns = pin.computeJointTorqueRegressor(model, model.createData(), q, qd, qdd)
        return columns @ truth.bodies[:, PINOCCHIO].ravel()

    rest = torque(np.zeros(6), np.zeros(6))
    mass = np.column_stack([torque(np.zeros(6), unit) - rest for unit in np.eye(6)])
    expected = np.linalg.solve(mass + np.diag(truth.motors), tau - torque(qd, np.zeros(6)))
    assert relative(forward_dynamics(*truth, q, qd, tau), expected) < 1e-9


@pytest.mark.parametrize("seed", range(10))
def test_the_estimators_torques_cause_the_accelerations_that_they_belong_to(
    truth: Arm, manutec: Robot, seed: int
) -> None:
    q, qd, qdd = np.random.default_rng(seed).uniform(-3.0, 3.0, (3, 6))
    tau = inverse_dynamics(manutec, TABLE_3_A, q, qd, qdd) + truth.motors * qdd
    assert relative(forward_dynamics(*truth, q, qd, tau), qdd) < 1e-9


def test_the_truth_is_table_3_a(truth: Arm, manutec: Robot) -> None:
    base = base_parameters(manutec).matrix @ standard_parameters(truth.bodies, manutec)
    assert np.allclose(base, TABLE_3_A, rtol=0, atol=1e-12)


def test_the_second_plant_is_another_one_near_the_first(manutec: Robot) -> None:
    bodies = load_plant("manutec-r15-bodies")._arm[2]
    p = base_parameters(manutec).matrix @ standard_parameters(bodies, manutec)
    assert p == pytest.approx(REAL_BODIES)


def test_mass_matrix_of_the_truth_is_positive_definite_over_the_workspace(truth: Arm) -> None:
    """Joints 1 and 6 do not change M; without motors its least eigenvalue is 0.021 kg m^2."""
    grid = np.meshgrid(*[np.linspace(-np.pi, np.pi, 9)] * 4)
    least = least_with_motors = np.inf
    for inner in np.column_stack([axis.ravel() for axis in grid]):
        q = np.array([0.3, *inner, -0.7])
        mass = bias_and_lower_triangle(truth, q, np.zeros(6))[1]
        least = min(least, np.linalg.eigvalsh(mass)[0])
        least_with_motors = min(
            least_with_motors, np.linalg.eigvalsh(mass + np.diag(truth.motors))[0]
        )
    assert 0.020 < least < 0.05
    assert 0.67 < least_with_motors < 0.8


def bias_and_lower_triangle(arm: Arm, q: Array, qd: Array) -> tuple[Array, Array]:
    n = len(q)
    bias, mass = np.empty(n), np.zeros((n, n))
    bias_and_mass(*arm[:5], q, qd, bias, mass, np.empty((n, WORK)))
    return bias, mass


def standard_parameters(bodies: Array, robot: Robot) -> Array:
    order = ("m", "sx", "sy", "sz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
    ours = [f"{name}{k}" for k in range(1, len(bodies) + 1) for name in order]
    values = dict(zip(ours, bodies.ravel(), strict=True))
    return np.array([values[name] for name in robot.standard_parameters])
