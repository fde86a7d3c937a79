"""Vertical slides: indistinguishable parameters are reported, and the remedy works."""

import numpy as np
import pytest
from free_run import recorded, some_motion
from urdf_robots import ROBOTS, urdf

from hil.errors import NotIdentifiable
from hil.estimation.identify import estimate
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import inverse_dynamics
from hil.model.robot import Robot

G = 9.81
UNKNOWN = {"gear_ratio": 1.0, "rotor_inertia": "unknown", "torque_constant": "unknown"}


def lift(rotor_inertia="unknown", gravity=(0.0, 0.0, -G), axis=0):
    """Slide and revolute joint on it, in either order."""
    limits = {
        "q_min": -3.0, "q_max": 3.0, "velocity_limit": 9.0, "acceleration_limit": 90.0,
        "torque_limit": 900.0,
    }  # fmt: skip
    slide = limits | {
        "frame": {"alpha": 0}, "type": "prismatic", "parameters": ["m"],
        "drive": UNKNOWN | {"rotor_inertia": rotor_inertia},
    }  # fmt: skip
    turning = limits | {
        "frame": {"alpha": "-pi/2" if axis == 0 else 0, "theta": 0},
        "parameters": ["Izz", "sx", "sy", "m"],
        "drive": UNKNOWN | {"rotor_inertia": 0.0},
    }
    joints = [slide, turning] if axis == 0 else [turning, slide]
    return Robot.create("lift", joints, gravity=gravity)


def recordings(robot, truth):
    return recorded(robot, truth, n=2, noise=0.02)


def truth_of(robot):
    """Return standard parameters of 30 kg on the slide, 8 kg of rotor and 5 kg on the revolute
    joint.
    """
    known = {"m": 30.0, "Izz": 0.9, "sx": 1.5, "sy": 0.4, "Ia": 8.0}
    standard = np.zeros(len(robot.standard_parameters))
    for number, name in enumerate(robot.standard_parameters):
        if name in robot.present:
            standard[number] = known.get(name.rstrip("12"), 0.0)
    return base_parameters(robot).matrix @ standard


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("gravity", [(0.0, 0.0, -G), (0.0, G * 0.6, -G * 0.8)])
def test_the_rotor_of_a_slide_along_gravity_is_named_with_what_to_state(axis, gravity):
    robot = lift(gravity=gravity, axis=axis)
    with pytest.raises(NotIdentifiable) as refused:
        estimate(robot, recordings(robot, truth_of(robot)), "free motion")
    message = str(refused.value)
    assert f"the rotor inertia of axis {axis + 1} (p" in message
    assert f"State the rotor_inertia of joint {axis + 1} in the robot file" in message
    assert "do not excite" not in message


def test_with_the_rotor_in_the_mass_torques_are_the_same_and_the_offset_has_its_weight():
    unknown, zero = lift(), lift(rotor_inertia=0.0)
    data = recordings(unknown, truth_of(unknown))
    found = estimate(zero, data, "free motion")
    q, qd, qdd = some_motion(np.arange(500) * 0.01, seed=7)
    expected = inverse_dynamics(unknown, truth_of(unknown), q, qd, qdd)
    torques = inverse_dynamics(zero, found.values, q, qd, qdd)
    assert found.details.unusual == ()
    assert any("offset the rotor's weight" in each for each in found.details.remarks)
    expected[:, 0] += 8.0 * G  # weight compensated by the friction offset
    np.testing.assert_allclose(torques, expected, atol=0.02 * np.abs(expected).max(axis=0).max())


@pytest.mark.parametrize(("name", "weighed"), [("SCARA", (2,)), ("Cartesian", (2,)), ("UR10e", ())])
def test_from_a_urdf_the_mass_of_a_slide_along_gravity_includes_the_rotor(tmp_path, name, weighed):
    (tmp_path / "robot.urdf").write_text(urdf(name, ROBOTS[name]))
    robot = Robot.load(tmp_path / "robot.urdf")
    assert robot.weighed_slides == weighed
    assert np.flatnonzero(~robot.rotor_inertia_unknown).tolist() == list(weighed)


def test_gravity_along_a_slide_on_a_tilting_link_is_not_constant():
    assert lift(gravity=(0.0, -G, 0.0), axis=1).weighed_slides == ()
    assert lift(gravity=(0.0, 0.0, -G), axis=1).weighed_slides == (1,)


def test_a_slide_across_gravity_needs_no_rotor_inertia():
    robot = lift(gravity=(0.0, -G, 0.0))
    found = estimate(robot, recordings(robot, truth_of(robot)), "free motion")
    assert np.isfinite(found.values).all()


def test_a_joint_at_rest_beside_a_slide_is_no_second_reason_for_refusal():
    refused, accepted = lift(), lift(rotor_inertia=0.0)
    data = recordings(refused, truth_of(refused))
    for _, recording in data:
        recording.q[:, 1] = 0.3
    with pytest.raises(
        NotIdentifiable, match=r"axis 1 \(p5\) .*from the mass moved by axis 1 \(p1\): "
    ):
        estimate(refused, data, "free motion")
    assert estimate(accepted, data, "free motion").details.not_identified == ("p2", "p3", "p4")
