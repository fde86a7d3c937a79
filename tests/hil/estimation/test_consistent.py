"""Nearest physically consistent robot: distance and consistency."""

import numpy as np
import possible_models
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from nearest_bodies import independent_distance
from possible_models import bodies
from synthetic import TABLE_3_A

from hil.errors import InvalidValue, NotRealisable
from hil.estimation.consistent import nearest
from hil.estimation.consistent.conditions import (
    BodyBounds,
    likely_bodies,
    sized_bodies,
    tightened,
)
from hil.estimation.consistent.nearest import Space, nearest_robot, thickness_of
from hil.estimation.consistent.semidefinite import Inequality, least_squares
from hil.model.added_parameters import added_inertias
from hil.model.base_parameters import base_parameters
from hil.model.drive_train_file import CoupledMotor, Spring
from hil.model.dynamics import inverse_dynamics
from hil.model.frames import body_parameters
from hil.model.robot import Robot
from hil.planning.prediction.information import whole_range

JOINT = {
    "frame": {"alpha": 0.0},
    "q_min": -3.0,
    "q_max": 3.0,
    "velocity_limit": 2.0,
    "acceleration_limit": 5.0,
    "torque_limit": 100.0,
    "drive": {"gear_ratio": 100, "rotor_inertia": 1e-4, "torque_constant": 0.1},
}
UPRIGHT = (0.0, -9.81, 0.0)


def possible(name, seed=0):
    """Return a robot, and base parameters of bodies with positive masses, with standard errors."""
    robot = Robot.load(name if "/" in name else f"tests/robots/{name}.yaml")
    return robot, *possible_models.possible(robot, seed)


def seen(robot, found):
    """Return base parameters with all link parameters: of the found bodies, and of the found p."""
    whole, own = base_parameters(robot.free_links()), base_parameters(robot)
    phi = np.concatenate([found.bodies.ravel(), [*found.added.values()]])
    return whole.matrix @ phi, whole.matrix @ own.placement @ found.p


@pytest.mark.parametrize(
    ("inertia", "changes"),
    [
        ("unknown", {}),
        (1e-4, {"springs": (Spring(joint=2, shape="sine"),)}),
        (1e-4, {"couplings": (CoupledMotor(motor=2, joint=1, ratio=1.0),)}),
    ],
)
def test_likely_bodies_leave_out_unknown_rotors_springs_and_couplings(inertia, changes):
    joint = {**JOINT, "drive": {**JOINT["drive"], "rotor_inertia": inertia}}
    file = Robot.create("two", [joint] * 2, gravity=UPRIGHT).file
    robot = Robot(file.model_copy(update=changes), "two", "")
    most = np.abs(inverse_dynamics(robot, sized_bodies(robot), *whole_range(robot))).max(axis=0)
    assert (most / robot.torque_limit).max() == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("name", "seed"), [("pan-tilt", 1), ("scara", 3), ("hil/robots/manutec-r15.yaml", 2)]
)
def test_the_distance_is_that_of_an_independent_solver(name, seed):
    pytest.importorskip("scs", reason="needs SCS")
    robot, p, error = possible(name)
    far = p * np.random.default_rng(seed).uniform(-1.0, 1.0, len(p))
    bounds = BodyBounds(masses=dict.fromkeys(range(1, robot.n_joints + 1), (1.0, 60.0)))
    found = nearest_robot(robot, far, np.diag(error**2), bounds)
    expected = independent_distance(robot, far, np.diag(error**2), bounds)
    assert expected > 1.0
    assert found.distance == pytest.approx(expected, rel=1e-4)


@given(seed=st.integers(0, 10_000), name=st.sampled_from(["pan-tilt", "scara", "cartesian"]))
@settings(max_examples=15, deadline=None)
def test_an_estimate_that_bodies_have_is_not_moved(seed, name):
    robot, p, error = possible(name, seed)
    found = nearest_robot(robot, p, np.diag(error**2))
    assert found.distance < 1e-8
    assert (found.binding, found.degrees_of_freedom, found.p_value) == ((), 0, 1.0)
    np.testing.assert_allclose(found.p, p, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    "name", ["pan-tilt", "scara", "cartesian", "ur10e", "panda", "ur10e-on-a-wall"]
)
def test_the_bodies_have_the_torques_of_the_base_parameters_and_are_thick_enough(name):
    robot, p, error = possible(name)
    far = p + 3.0 * error * np.random.default_rng(5).standard_normal(len(p))
    found = nearest_robot(robot, far, np.diag(error**2))
    rigid_error, of_base = seen(robot, found)
    np.testing.assert_allclose(rigid_error, of_base, rtol=1e-11, atol=1e-11 * np.abs(of_base).max())
    assert all(link.thickness > 1e-3 for link in found.links)
    assert (found.bodies[:, 9] > 1e-3).all()


def pendulum(**changes):
    return Robot.create("pendulum", [JOINT | changes], gravity=UPRIGHT)


def test_a_pendulum_whose_mass_is_bounded_needs_the_inertia_of_that_mass_where_its_centre_is():
    robot, s, most, sigma = pendulum(), 2.0, 10.0, 0.01
    assert base_parameters(robot).expressions == ("Izz1", "sx1", "sy1")
    p = np.array([0.1, s, 0.0])
    bounds = BodyBounds(thickness=1e-6, masses={1: (1.0, most)})
    found = nearest_robot(robot, p, np.diag([sigma, 1e-6, 1e-6]) ** 2, bounds)
    least = s**2 / most
    assert found.p[0] == pytest.approx(least, rel=1e-5)
    assert found.distance == pytest.approx(((least - p[0]) / sigma) ** 2, rel=1e-4)
    names = [each.name for each in found.binding]
    assert sorted(names) == ["greatest mass of link 1", "link 1"]


def test_the_published_parameters_of_the_manutec_r15_belong_to_no_bodies():
    """Any body has Ixx2 + Izz2 >= Iyy2, so p2 + p4 >= 0; published are -28.1 and 19.9."""
    robot = Robot.load("manutec-r15")
    covariance = np.diag((0.01 * np.maximum(np.abs(TABLE_3_A), 0.01)) ** 2)
    found = nearest_robot(robot, TABLE_3_A, covariance)
    p2, p4, p11, p12 = found.p[[1, 3, 10, 11]]
    assert p2 + p4 >= 0
    assert p12 - p11 >= 0
    assert (p2, p4) == (pytest.approx(-22.6, abs=0.05), pytest.approx(22.6, abs=0.05))
    assert found.p_value < 1e-9
    assert {"link 2", "link 5"} <= {each.name for each in found.binding}
    assert found.distance_complete == pytest.approx(found.distance, rel=0.01)


def test_least_squares_under_the_conditions_is_the_projection_in_its_own_information_matrix():
    robot, p, _ = possible("pan-tilt")
    rng = np.random.default_rng(8)
    X = rng.standard_normal((60, len(p))) * rng.uniform(10.0, 40.0, len(p))
    y = X @ (p * rng.uniform(-1.0, 1.0, len(p)))
    unconstrained, information = np.linalg.lstsq(X, y, rcond=None)[0], X.T @ X
    found = nearest_robot(robot, unconstrained, np.linalg.inv(information))
    whole = robot.free_links()
    space = Space.create(robot, whole, 0 * p, np.eye(len(p)), likely_bodies(robot))
    columns = np.hstack([space.placement, space.free])
    asked = [Inequality(c.constant, c.weights @ columns) for c in tightened(whole, BodyBounds())]
    A = np.hstack([X, np.zeros((len(X), space.free.shape[1]))])
    direct = least_squares(A, y, asked).u[: len(p)]
    assert found.distance > 1.0
    np.testing.assert_allclose(found.p, direct, rtol=1e-4, atol=1e-5)


def test_masses_that_no_torque_decides_are_named():
    robot, p, error = possible("cartesian")
    assert nearest_robot(robot, p, np.diag(error**2)).open_masses == ()
    robot, p, error = possible("scara")
    assert nearest_robot(robot, p, np.diag(error**2)).open_masses == (1, 2, 3, 4)


def test_rotors_are_not_negative_however_they_are_estimated():
    joint = JOINT | {"drive": JOINT["drive"] | {"rotor_inertia": "unknown"}}
    swung = joint | {"frame": {"alpha": 0.0, "d": "0.3"}}
    robot = Robot.create("two", [joint, swung], gravity=UPRIGHT)
    assert robot.added_parameters == ("Ia1", "Ia2")
    base = base_parameters(robot)
    p = base.matrix @ np.concatenate([bodies(2, 1).ravel(), [0.1, -0.2]])
    found = nearest_robot(robot, p, np.diag(np.full(len(p), 0.01) ** 2))
    assert min(found.added.values()) >= 0
    assert found.distance > 1.0


def test_motors_that_turn_together_have_a_positive_share_of_the_mass_matrix():
    drive = JOINT["drive"] | {"rotor_inertia": "unknown"}
    joints = [JOINT | {"drive": drive, "frame": {"alpha": a}} for a in (0.0, 1.5707963267948966)]
    file = Robot.create("wrist", joints, gravity=UPRIGHT)
    coupled = file.file.model_copy(update={"couplings": (CoupledMotor(motor=2, joint=1),)})
    robot = Robot(coupled, "wrist", "")
    assert robot.added_parameters == ("Ia1", "Ia2", "Iam2")
    p = base_parameters(robot).matrix @ np.concatenate([bodies(2, 1).ravel(), [0.1, 0.1, 3.0]])
    found = nearest_robot(robot, p, np.diag(np.full(len(p), 0.05) ** 2))
    share = np.tensordot([*found.added.values()], added_inertias(robot), 1)
    assert np.linalg.eigvalsh(share)[0] > 0
    assert found.distance > 1.0


def test_masses_stay_within_their_bounds_and_centres_in_their_box():
    robot, p, error = possible("pan-tilt")
    box = (np.array([-0.3, -0.3, 0.0]), np.array([0.3, 0.3, 0.4]))
    bounds = BodyBounds(masses={2: (3.0, 5.0)}, centres={2: box})
    found = nearest_robot(robot, p, np.diag(error**2), bounds)
    mass, centre = found.bodies[1, 9], found.bodies[1, 6:9] / found.bodies[1, 9]
    assert 3.0 <= mass <= 5.0
    assert (centre >= box[0]).all()
    assert (centre <= box[1]).all()


@pytest.mark.parametrize(
    ("bounds", "message"),
    [
        (
            {"masses": {1: (5.0, 3.0)}},
            "mass of link 1: 5 to 3 kg must be positive and ascending; write 1:3:5",
        ),
        ({"masses": {1: (-1.0, 3.0)}}, "mass of link 1: -1 to 3 kg"),
        ({"thickness": 0.0}, "thickness 0 m must be positive"),
        ({"masses": {7: (1.0, 3.0)}}, "bounds of link 7: pan-tilt has links 1 to 2"),
    ],
)
def test_bounds_that_no_body_meets_are_refused(bounds, message):
    robot, p, error = possible("pan-tilt")
    with pytest.raises(InvalidValue, match=message):
        nearest_robot(robot, p, np.diag(error**2), BodyBounds(**bounds))


def test_bodies_beyond_double_precision_are_refused_with_what_to_do(monkeypatch):
    def lost(*_args):
        raise np.linalg.LinAlgError

    monkeypatch.setattr(nearest, "likeliest", lost)
    robot = Robot.load("manutec-r15")
    p, error = possible_models.possible(robot)
    with pytest.raises(
        NotRealisable, match=r"up to \d\S* times .* beyond double precision; .* more motion"
    ):
        nearest_robot(robot, p, np.diag(error**2))


def test_the_thickness_of_a_body_is_its_least_spread_about_its_centre():
    box, at, mass = np.array([0.6, 0.3, 0.02]), np.array([1.0, 2.0, 3.0]), 5.0
    J = np.zeros((4, 4))
    J[:3, :3] = mass * (np.diag(box**2 / 12) + np.outer(at, at))
    J[:3, 3] = J[3, :3] = mass * at
    J[3, 3] = mass
    assert thickness_of(np.array(body_parameters(J))) == pytest.approx(0.02 / np.sqrt(12))
