"""URDF and MJCF: simulated behaviour, and statements in the files."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
import yaml
from possible_models import model_of, possible
from urdf_robots import ROBOTS, urdf

from hil.errors import FileError, Mismatch
from hil.estimation.consistent.conditions import BodyBounds
from hil.export.formats import export
from hil.export.simulated_robot import comment, simulated_robot
from hil.export.urdf_file import bodies_of, body_of, given_urdf
from hil.friction.law import AxisLaw, FrictionLaw, TermValue
from hil.model.added_parameters import added_inertias
from hil.model.base_parameters import base_parameters
from hil.model.drive_train_file import CoupledMotor, Spring
from hil.model.dynamics import inverse_dynamics
from hil.model.motors import motor_torque
from hil.model.readers.urdf import UrdfReader
from hil.model.robot import Robot
from hil.results.consistency import find_consistent_robot
from hil.simulation.arm import Arm, Drive, Start
from hil.simulation.mujoco_arm import MujocoArm
from hil.tasks.exporting import exported_model

pinocchio = pytest.importorskip("pinocchio", minversion="3.0")  # earlier versions omit rotors

FILES = [
    *sorted(Path("tests/robots").glob("*.yaml")),
    Path("examples/pan_tilt/head.urdf"),
    Path("hil/robots/manutec-r15.yaml"),
]
AGREE = 1e-9


def consistent(robot, *, scatter=2.0, **options):
    p, error = possible(robot)
    p = p + scatter * error * np.random.default_rng(1).standard_normal(len(p))
    return find_consistent_robot(model_of(robot, p, error, **options))


def motions(n):
    rng = np.random.default_rng(3)
    return [rng.uniform(-1.0, 1.0, (4, n)) for _ in range(3)]


def torques(model):
    """Return torques of rigid bodies and rotors of the projected model, at some motions."""
    robot, motion = model.robot, motions(model.robot.n_joints)
    return inverse_dynamics(robot, model.consistent.p, *motion) + motor_torque(robot, *motion)


def mujoco_torques(text, n):
    model = mujoco.MjModel.from_xml_string(text)
    data, found = mujoco.MjData(model), []
    for q, qd, qdd in zip(*motions(n), strict=True):
        data.qpos[:], data.qvel[:] = q, qd
        mujoco.mj_forward(model, data)
        found.append(mass_matrix(model, data) @ qdd + data.qfrc_bias)
    return np.array(found)


def mass_matrix(model, data):
    """Return the full mass matrix by products with unit vectors, a call in all of MuJoCo's
    versions.
    """
    columns = []
    for unit in np.eye(model.nv):
        column = np.zeros(model.nv)
        mujoco.mj_mulM(model, data, column, unit)
        columns.append(column)
    return np.transpose(columns)


def pinocchio_torques(text, armature, gravity):
    model = pinocchio.buildModelFromXML(text)
    model.armature = np.asarray(armature)
    model.gravity.linear = np.array([0.0, 0.0, -np.linalg.norm(gravity)])
    data = model.createData()
    return np.array(
        [pinocchio.rnea(model, data, *each) for each in zip(*motions(model.nv), strict=True)]
    )


def written(model, name, given=None):
    (text,) = export(model, name, ("origin",), given).files.values()
    return text


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_mujoco_and_pinocchio_find_the_torques_of_the_projected_model(path):
    model = consistent(Robot.load(path))
    expected = torques(model)
    size = AGREE * np.abs(expected).max()
    mjcf = mujoco_torques(written(model, "mjcf"), model.robot.n_joints)
    np.testing.assert_allclose(mjcf, expected, atol=size)
    armature = [joint.armature for joint in simulated_robot(model).joints]
    found = pinocchio_torques(written(model, "urdf"), armature, model.robot.gravity)
    np.testing.assert_allclose(found, expected, atol=size)


def test_motors_that_turn_with_two_joints_are_in_mujoco_s_mass_matrix():
    drive = {"gear_ratio": 50, "rotor_inertia": "unknown", "torque_constant": 0.1}
    joint = {
        "q_min": -2.0, "q_max": 2.0, "velocity_limit": 2.0, "acceleration_limit": 5.0,
        "torque_limit": 50.0, "drive": drive,
    }  # fmt: skip
    frames = [{"alpha": 0.0}, {"alpha": 1.5707963267948966, "r": "0.2"}]
    plain = Robot.create("wrist", [joint | {"frame": frame} for frame in frames])
    file = plain.file.model_copy(
        update={"couplings": (CoupledMotor(motor=2, joint=1, ratio=-1.5),)}
    )
    model = consistent(Robot(file, "wrist", ""))
    assert added_inertias(model.robot)[-1][0, 1] == -1.5
    assert model.consistent.added["Iam2"] != 0
    found = mujoco_torques(written(model, "mjcf"), 2)
    np.testing.assert_allclose(found, torques(model), atol=1e-9)
    assert "motors turn with two joints" in written(model, "urdf")


def test_a_linear_spring_is_a_stiffness():
    plain = Robot.load("tests/robots/pan-tilt.yaml")
    file = plain.file.model_copy(update={"springs": (Spring(joint=2),)})
    model = consistent(Robot(file, "spring", ""), scatter=0.0)
    loaded = mujoco.MjModel.from_xml_string(written(model, "mjcf"))
    assert loaded.jnt_stiffness.ravel()[-1] == pytest.approx(model.consistent.added["k2"])
    assert "a URDF has no springs: k2 are left out" in written(model, "urdf")


def test_mjcf_states_limits_friction_and_motors():
    model = consistent(Robot.load("tests/robots/scara.yaml"))
    loaded, robot = mujoco.MjModel.from_xml_string(written(model, "mjcf")), model.robot
    np.testing.assert_allclose(loaded.jnt_range, np.column_stack([robot.q_min, robot.q_max]))
    np.testing.assert_allclose(loaded.actuator_ctrlrange[:, 1], robot.torque_limit)
    np.testing.assert_allclose(loaded.dof_frictionloss, 3.0, rtol=1e-9)
    np.testing.assert_allclose(loaded.dof_damping.ravel()[:4], 0.5, rtol=1e-9)
    np.testing.assert_allclose(loaded.dof_armature, robot.reflected_inertia)


def test_urdf_states_limits_and_friction():
    model = consistent(Robot.load("tests/robots/scara.yaml"))
    loaded, robot = pinocchio.buildModelFromXML(written(model, "urdf")), model.robot
    np.testing.assert_allclose(loaded.upperPositionLimit, robot.q_max)
    np.testing.assert_allclose(loaded.velocityLimit, robot.velocity_limit)
    np.testing.assert_allclose(loaded.effortLimit, robot.torque_limit)
    np.testing.assert_allclose(loaded.friction, 3.0)
    np.testing.assert_allclose(loaded.damping, 0.5)


@pytest.mark.parametrize("name", ["urdf", "mjcf"])
def test_the_file_states_origin_distance_and_cost_at_its_head(name):
    text = written(consistent(Robot.load("tests/robots/ur10e.yaml")), name)
    head = text[: text.index("-->")]
    assert "origin" in head
    assert "nearest physically consistent robot: distance" in head
    assert "active conditions: link" in head


@pytest.mark.parametrize("name", ["urdf", "mjcf"])
def test_a_model_without_friction_is_exported_without_and_says_so(name):
    model = consistent(Robot.load("tests/robots/pan-tilt.yaml"), friction=False)
    exported = export(model, name, ())
    assert any("no friction is stated" in remark for remark in exported.remarks)
    (text,) = exported.files.values()
    assert "damping" not in text


@pytest.fixture
def arm(tmp_path):
    """URDF with a fixed joint, a mesh and a gripper, the model of its chain, and its path."""
    text = urdf("askew arm", ROBOTS["askew"], rigid_link=True)
    shape = '<visual><geometry><mesh filename="package://arm/link2.stl"/></geometry></visual>'
    text = text.replace('<link name="link2">', f'<link name="link2"><!-- elbow -->{shape}')
    more = (
        '<link name="tool"><inertial><origin xyz="0 0 0.1"/><mass value="2"/>'
        '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="bolt" type="fixed"><parent link="link4"/><child link="tool"/>'
        '<origin xyz="0 0 0.2" rpy="0 0 1"/></joint>'
        '<link name="finger"><inertial><mass value="0.1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="grip" type="prismatic"><parent link="tool"/><child link="finger"/>'
        '<limit lower="0" upper="1" effort="1" velocity="1"/></joint>'
    )
    path = tmp_path / "arm.urdf"
    path.write_text(text.replace("</robot>", more + "</robot>"))
    model = consistent(Robot.load(path, tip="link4"), scatter=0.5)
    return model, given_urdf(path, model.robot), path


def test_a_given_urdf_keeps_everything_but_inertials_and_dynamics_of_the_chain(arm):
    model, given, path = arm
    text = written(model, "urdf", given)
    assert "package://arm/link2.stl" in text
    assert "<!-- elbow -->" in text
    after = path.parent / "after.urdf"
    after.write_text(text)
    before, links = UrdfReader(path), UrdfReader(after)
    np.testing.assert_array_equal(body_of(links, "finger"), body_of(before, "finger"))
    assert body_of(links, "tool") is None
    bodies = bodies_of(given_urdf(after, model.robot), model.robot)
    np.testing.assert_allclose(bodies, model.consistent.bodies, rtol=1e-9, atol=1e-12)
    assert "the inertial of link4 includes tool" in text
    assert "joints grip: remove the inertials of links mounted during" in text


def test_what_is_wrong_with_inertials_of_a_given_urdf_is_remarked_and_stands_in_the_file(arm):
    model, _, path = arm
    path.write_text(path.read_text().replace('<mass value="3"/>', '<mass value="-3"/>'))
    _, exported = exported_model(model, "urdf", path, path)
    (remark,) = (each for each in exported.remarks if "link3" in each)
    assert "arm.urdf:8: link 'link3': mass -3 kg must be positive; until then" in remark
    assert remark in " ".join(next(iter(exported.files.values())).split())


@pytest.mark.parametrize("name", ["urdf", "mjcf"])
def test_a_given_urdf_lends_names_and_frames_and_torques_stay_the_same(arm, name):
    model, given, _ = arm
    text = written(model, name, given)
    assert 'name="joint3"' in text
    armature = [joint.armature for joint in simulated_robot(model, given.chain).joints]
    if name == "mjcf":
        found = mujoco_torques(text, 4)
    else:
        without_finger = text[: text.rindex('<link name="finger">')] + "</robot>"
        found = pinocchio_torques(without_finger, armature, model.robot.gravity)
    expected = torques(model)
    np.testing.assert_allclose(found, expected, atol=AGREE * np.abs(expected).max())


def test_a_model_of_the_urdf_s_own_bodies_gets_them_back_though_torques_leave_much_open(arm):
    model, given, _ = arm
    likely, robot = bodies_of(given, model.robot), model.robot
    rotors = np.zeros(len(robot.added_parameters))
    p = base_parameters(robot).matrix @ np.concatenate([likely.ravel(), rotors])
    again = model_of(robot, p, 0.01 * np.ones(len(p)))
    found = find_consistent_robot(again, likely=likely, likely_from="arm.urdf").consistent
    np.testing.assert_allclose(found.bodies, likely, rtol=0.02, atol=0.02)
    by_shape = find_consistent_robot(again).consistent
    assert np.abs(by_shape.bodies - likely).max() > 0.1
    assert found.likely == "arm.urdf"


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (("0.1 0.2 0.3", "0.1 0.25 0.3"), r"from base to link4 \w+ of joint . is"),
        (('name="joint4" type="revolute"', 'name="joint4" type="prismatic"'), "its joints are"),
        (('name="joint4" type="revolute"', 'name="joint4" type="fixed"'), "its joints are|fewer"),
        (
            ('name="joint2" type="prismatic"', 'name="joint2" type="floating"'),
            "the longest chain has fewer",
        ),
    ],
)
def test_a_urdf_without_the_chain_is_refused(arm, tmp_path, change, why):
    model, _, path = arm
    other = tmp_path / "other.urdf"
    other.write_text(path.read_text().replace(*change))
    with pytest.raises(Mismatch, match=f"no chain of 4 joints has the frames of askew-arm.*{why}"):
        given_urdf(other, model.robot)


def test_a_urdf_that_is_none_is_refused(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text("<robot")
    with pytest.raises(FileError, match=r"arm\.urdf"):
        given_urdf(path, Robot.load("tests/robots/scara.yaml"))


def test_ros2_parameters_are_read_back(arm):
    model, _, _ = arm
    exported = export(model, "ros2", ("origin",))
    (text,) = exported.files.values()
    assert text.startswith("# origin\n")
    content = yaml.safe_load(text)
    parameters = content["joint_dynamics"]["ros__parameters"]
    assert parameters["joints"] == ["joint1", "joint2", "joint3", "joint4"]
    assert parameters["joint2"]["friction"]["coulomb"] == pytest.approx(3.0)
    assert parameters["joint2"]["friction"]["viscous"] == pytest.approx(0.5)
    limits = content["joint_limits"]["ros__parameters"]["joint_limits"]["joint1"]
    assert limits["has_acceleration_limits"] is False
    assert limits["max_position"] == 2.1


def test_bounds_of_masses_show_in_the_file():
    robot = Robot.load("tests/robots/pan-tilt.yaml")
    p, error = possible(robot)
    bounds = BodyBounds(masses={2: (3.0, 5.0)})
    model = find_consistent_robot(model_of(robot, p, error), bounds=bounds)
    loaded = mujoco.MjModel.from_xml_string(written(model, "mjcf"))
    assert 3.0 <= loaded.body_mass[-1] <= 5.0


def test_dry_friction_keeps_its_sign_where_joints_brake_hard_through_zero() -> None:
    robot = Robot.load("manutec-r15")
    model = find_consistent_robot(model_of(robot, *possible(robot)))
    loaded = mujoco.MjModel.from_xml_string(export(model, "mjcf", ()).files["manutec-r15.xml"])
    data, braking = mujoco.MjData(loaded), 15.0
    for axis, unit in enumerate(np.eye(robot.n_joints)):
        # except for the last step before the reversal
        for v in (0.5, 0.05, 1.01 * braking * loaded.opt.timestep, -0.01, -0.5):
            q, qd, qdd = 0.1 * unit, v * unit, -braking * unit
            data.qpos[:], data.qvel[:], data.qacc[:] = q, qd, qdd
            mujoco.mj_inverse(loaded, data)
            wanted = model.predict(q, qd, qdd)[axis]
            assert data.qfrc_inverse[axis] == pytest.approx(wanted, abs=0.01), (axis, v)


def test_dry_friction_stops_a_joint_of_the_simulation_and_holds_it() -> None:
    robot = Robot.load("manutec-r15")
    model = find_consistent_robot(model_of(robot, *possible(robot)))
    loaded = mujoco.MjModel.from_xml_string(export(model, "mjcf", ()).files["manutec-r15.xml"])
    loaded.opt.gravity[:] = 0.0
    data = mujoco.MjData(loaded)
    data.qvel[:] = 0.3
    mujoco.mj_step(loaded, data, 30000)
    assert np.abs(data.qvel).max() < 1e-6


def test_axes_with_stribeck_friction_coast_to_rest_as_by_the_law() -> None:
    robot = Robot.load("manutec-r15")
    terms = {"Coulomb": 8.0, "viscous": 9.0, "arc tangent": -2.5}
    law = AxisLaw(
        law="arc tangent", speed=2.0, held_out={}, speeds=(0.1, 2.0),
        terms={name: TermValue(value=x, standard_error=0.1) for name, x in terms.items()},
        plain={"viscous": TermValue(value=9.0, standard_error=0.1)},
    )  # fmt: skip
    model = model_of(robot, *possible(robot))
    model = find_consistent_robot(replace(model, friction_law=FrictionLaw(axes=(law,) * 6)))
    exported = export(model, "mjcf", ())
    assert sum("a polynomial of damping" in each for each in exported.remarks) == 6
    time, none = np.arange(0.0, 1.5, 0.002), np.zeros(6)
    still = model.gravity(np.zeros(6))
    for axis in (3, 4, 5):
        start = Start(none, np.eye(6)[axis] * 0.5, time, lambda *_: False)
        torque = np.tile(still, (len(time), 1))
        drive, arms = Drive(time, torque, 0.0 * torque, none, none), (Arm(model), MujocoArm(model))
        expected, way = (arm.run([start], drive)[0][-1, axis] for arm in arms)
        assert way == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("name", ["a-->", "a---><b/>", "----->", "- -->"])
def test_no_text_ends_a_comment_of_xml(name: str) -> None:
    assert "--" not in comment([name])
