"""Robot files from a URDF, checked against Pinocchio's reading."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
import pytest
from urdf_robots import CONTINUOUS, REVOLUTE, ROBOTS, TREES, H, random_tree, urdf

from checked_files.yaml_file import UNSTATED, FileError
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import inverse_dynamics
from hil.model.readers.axes_to_frames import difference, find_frames
from hil.model.readers.robot_draft import draft_robot
from hil.model.readers.urdf import read_urdf
from hil.model.robot import Robot, parse_robot

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from hil.model.readers.urdf import UrdfChain

    Array = NDArray[np.float64]

GRAVITY = (0.0, 0.0, -9.81)
N_BASE = {"pan-tilt": 8, "SCARA": 8, "Cartesian": 3, "UR10e": 36, "Panda": 43}
"""Number of base parameters of rigid bodies, with gravity along a vertical first axis."""


def chain_of(folder: Path, text: str, base: str | None = None, tip: str | None = None) -> UrdfChain:
    path = folder / "robot.urdf"
    path.write_text(text)
    return read_urdf(path, base, tip)


def filled(draft: str) -> str:
    """Fill in values known to the user alone."""
    values = {
        "position": 3, "speed": 1, "acceleration": 5, "torque [": 50, "turns": 100,
        "of the motor, 0": 0, "of the motor [": 0.1,
    }  # fmt: skip

    def value(mark: re.Match[str]) -> str:
        number = next(v for words, v in values.items() if words in mark[2])
        return f"{mark[1]}{-number if 'least' in mark[2] else number}"

    return re.sub(rf"(?m)^(.*: ){UNSTATED} (.*)$", value, draft)


@pytest.mark.parametrize(
    ("name", "spelt"),
    [("Größe é 7", "Groesse-e-7"), ("Gro\u0308ße", "Groesse"), ("机器人", "robot")],
)
def test_letters_of_a_name_that_a_robot_file_lacks_are_spelt(
    tmp_path: Path, name: str, spelt: str
) -> None:
    draft = draft_robot(chain_of(tmp_path, urdf(name, ROBOTS["SCARA"])), GRAVITY)
    assert f"\nname: {spelt}\n" in draft


def robot_of(chain: UrdfChain, gravity: tuple[float, float, float] = GRAVITY) -> Robot:
    return parse_robot(filled(draft_robot(chain, gravity)), "draft")


def standard_parameters(model: pin.Model, chain: UrdfChain) -> Array:
    """Return Pinocchio's bodies in our frames: inertias about
    the origins, first moments, masses.
    """
    ours = find_frames(chain).poses(np.zeros(len(chain.joints)), chain.revolute)
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    found = []
    for joint, own in zip(chain.joints, ours, strict=True):
        k = model.getJointId(joint.name)
        body = (pin.SE3(np.linalg.inv(own)) * data.oMi[k]).act(model.inertias[k])
        m, s = body.mass, body.mass * body.lever
        I = body.inertia - m * pin.skew(body.lever) @ pin.skew(body.lever)  # noqa: E741
        found += [*I[0], I[1, 1], I[1, 2], I[2, 2], *s, m]
    return np.array(found)


@pytest.mark.parametrize("name", [*ROBOTS, *TREES])
def test_every_frame_moves_with_its_joint(tmp_path: Path, name: str) -> None:
    joints, parents = TREES.get(name) or (ROBOTS[name], None)
    chain = chain_of(tmp_path, urdf(name, joints, parents))
    assert parents is None or chain.parents == tuple(np.array(parents) - 1)
    revolute = chain.revolute
    frames, still = find_frames(chain), np.zeros(len(revolute))
    fixed = np.linalg.inv(chain.frames(still)) @ frames.poses(still, revolute)
    for q in np.random.default_rng(1).uniform(-2, 2, (10, len(revolute))):
        moved = chain.frames(q) @ fixed
        assert frames.poses(q, revolute) == pytest.approx(moved, abs=1e-9)


def test_axes_that_rounding_made_nearly_parallel_are_parallel(tmp_path: Path) -> None:
    """Five digits of three angles leave 2e-5 rad, and axes that meet kilometres away."""
    joints = [
        ("revolute", "0 0 0.1", "0 0 0", "0 0 1"),
        ("revolute", "0.4 0.1 0", "0 0 0", "0 0.00002 -1"),
        ("revolute", "0.3 0 0", "0 0.3 0", "0 1 0"),
    ]
    frames = find_frames(chain_of(tmp_path, urdf("cut", joints)))
    assert frames.alpha[1] == pytest.approx(np.pi)
    assert np.abs([frames.d, frames.r]).max() < 1.0


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_has_the_frames_of_its_urdf_whole_turns_aside(tmp_path: Path, name: str) -> None:
    chain = chain_of(tmp_path, urdf(name, ROBOTS[name]))
    draft = filled(draft_robot(chain, GRAVITY))
    turned = draft.replace("alpha: -pi/2", "alpha: 3*pi/2")
    assert difference(chain, parse_robot(turned, "draft")) == ""
    other = re.sub("alpha: [^,}]+", "alpha: 0.01", draft)
    assert "of joint" in difference(chain, parse_robot(other, "draft"))


@pytest.mark.parametrize("name", ROBOTS)
def test_a_drafted_robot_has_the_torques_of_the_urdf(tmp_path: Path, name: str) -> None:
    """Bodies of the URDF, at random states, against Pinocchio, with tilted gravity."""
    text = urdf(name, [(k.replace(CONTINUOUS, REVOLUTE), *rest) for k, *rest in ROBOTS[name]])
    exact = text.replace("3.141592654", str(math.pi)).replace("3.14159 ", f"{math.pi} ")
    exact = exact.replace("1.570796327", H)
    chain, gravity = chain_of(tmp_path, text), (1.0, -2.0, -9.0)
    robot = robot_of(chain, gravity)
    model = pin.buildModelFromXML(exact)
    model.gravity.linear = np.array(gravity)
    assert_torques(robot, model, chain, 1e-9)


@pytest.mark.parametrize("tree", [*TREES.values(), *range(50)])
def test_a_drafted_tree_has_the_torques_of_the_urdf(tmp_path: Path, tree: object) -> None:
    rng = np.random.default_rng(tree if isinstance(tree, int) else 0)
    joints, parents = random_tree(rng) if isinstance(tree, int) else tree
    text, gravity = urdf("tree", joints, parents), (1.0, -2.0, -9.0)
    tips = [f"link{k}" for k in range(1, len(joints) + 1)]
    chain = chain_of(tmp_path, text, "base", ",".join(tips))
    assert chain.parents == tuple(np.array(parents) - 1)
    model = pin.buildModelFromXML(text)
    model.gravity.linear = np.array(gravity)
    robot = robot_of(chain)
    own = find_frames(chain).base[:3, :3].T @ np.array(gravity)  # a file has nine digits of it
    assert_torques(robot.changed(gravity=tuple(own)), model, chain, 1e-10)


def assert_torques(robot: Robot, model: pin.Model, chain: UrdfChain, within: float) -> None:
    """Compare torques with Pinocchio's at random states."""
    p = base_parameters(robot).matrix @ standard_parameters(model, chain)
    order = [model.joints[model.getJointId(joint.name)].idx_v for joint in chain.joints]
    data, place = model.createData(), np.argsort(order)
    for q, qd, qdd in np.random.default_rng(2).uniform(-1, 1, (10, 3, robot.n_joints)):
        expected = pin.rnea(model, data, q[place], qd[place], qdd[place])[order]
        found = inverse_dynamics(robot, p, q, qd, qdd)
        assert found == pytest.approx(expected, abs=within, rel=within)


def test_several_longest_chains_are_a_tree_of_all_joints(tmp_path: Path) -> None:
    chain = chain_of(tmp_path, add_fingers())
    assert [joint.name for joint in chain.joints] == ["joint1", "joint2", "finger1", "finger2"]
    assert (chain.parents, chain.tip) == ((-1, 0, 1, 1), "left, right")
    text = draft_robot(chain)
    assert "parent: 2\n" in text
    assert "# several last links: left, right. If they meet in one body: loops are" in text


def test_part_of_a_tree_is_taken_by_its_last_links(tmp_path: Path) -> None:
    joints, parents = TREES["hand"]
    text = urdf("hand", joints, parents)
    chain = chain_of(tmp_path, text, "link1", "link5, link3")
    assert [joint.name for joint in chain.joints] == ["joint4", "joint5", "joint2", "joint3"]
    assert chain.parents == (-1, 0, -1, 2)
    assert chain_of(tmp_path, text, tip="link3").parents == (-1, 0, 1)


MOUNTED = """<robot name="arm">
<link name="world"/><link name="post"/><link name="base"/><link name="upper"/>
<joint name="turret" type="{turret}"><parent link="world"/><child link="post"/>
  <axis xyz="{about}"/><limit lower="-1" upper="1" effort="9" velocity="1"/></joint>
<joint name="mount" type="fixed"><parent link="post"/><child link="base"/>
  <origin rpy="0 0.13963 0.4"/></joint>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
  <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="1"/></joint>
</robot>"""


@pytest.mark.parametrize(("turret", "about"), [("fixed", "1 0 0"), ("continuous", "0 0 1")])
def test_gravity_follows_the_mount_above_the_named_link(
    tmp_path: Path, turret: str, about: str
) -> None:
    text = MOUNTED.format(turret=turret, about=about)
    chain = chain_of(tmp_path, text, "base")
    model = pin.buildModelFromXML(text)
    frames = model.createData()
    pin.framesForwardKinematics(model, frames, pin.neutral(model))
    expected = frames.oMf[model.getFrameId("base")].rotation.T @ np.array(GRAVITY)
    assert chain.gravity() == pytest.approx(expected)
    assert chain.gravity((0.0, 0.0, -9.81)).tolist() == [0.0, 0.0, -9.81]


def test_gravity_below_a_joint_that_tilts_the_base_is_to_be_stated(tmp_path: Path) -> None:
    chain = chain_of(tmp_path, MOUNTED.format(turret="revolute", about="1 0 0"), "base")
    with pytest.raises(FileError, match=r"'turret' above 'base'.*gravity: \[X, Y, Z\]"):
        draft_robot(chain)
    assert "gravity" in draft_robot(chain, GRAVITY)


@pytest.mark.parametrize(("name", "count"), N_BASE.items())
def test_it_has_the_right_number_of_base_parameters(tmp_path: Path, name: str, count: int) -> None:
    assert len(base_parameters(robot_of(chain_of(tmp_path, urdf(name, ROBOTS[name]))))) == count


def test_limits_and_names_are_taken_over(tmp_path: Path) -> None:
    chain = chain_of(tmp_path, urdf("pan tilt", ROBOTS["pan-tilt"]))
    robot = robot_of(chain)
    assert robot.name == "pan-tilt"
    assert robot.q_min.tolist() == [-1.1, -1.2]
    assert robot.q_max.tolist() == [2.1, 2.2]
    assert robot.velocity_limit.tolist() == [1.1, 1.2]
    assert robot.torque_limit.tolist() == [51, 52]
    assert robot.joint_names == ("joint1", "joint2")


def test_what_a_urdf_does_not_say_is_to_be_stated(tmp_path: Path) -> None:
    draft = draft_robot(chain_of(tmp_path, urdf("SCARA", ROBOTS["SCARA"])), GRAVITY)
    with pytest.raises(FileError, match="acceleration_limit: must be stated") as caught:
        parse_robot(draft, "draft.yaml")
    lines = str(caught.value).splitlines()
    assert len(lines) == 4 * 4 + 2  # four values per joint; a continuous one has no range


def test_fixed_joints_are_merged(tmp_path: Path) -> None:
    plain = chain_of(tmp_path, urdf("x", ROBOTS["UR10e"]))
    welded = chain_of(tmp_path, urdf("x", ROBOTS["UR10e"], rigid_link=True))
    q = np.linspace(-1, 1, 6)
    assert welded.frames(q) == pytest.approx(plain.frames(q))


def test_a_rounded_quarter_turn_is_one(tmp_path: Path) -> None:
    rounded = [(k, xyz, rpy.replace(H, "1.5708"), axis) for k, xyz, rpy, axis in ROBOTS["Panda"]]
    chain = chain_of(tmp_path, urdf("Panda", rounded))
    assert chain.rounded == pytest.approx(1.5708 - math.pi / 2)
    assert len(base_parameters(robot_of(chain))) == N_BASE["Panda"]


def test_part_of_a_robot_is_taken_by_its_links(tmp_path: Path) -> None:
    chain = chain_of(tmp_path, urdf("x", ROBOTS["Panda"]), "link2", "link5")
    assert [joint.name for joint in chain.joints] == ["joint3", "joint4", "joint5"]
    assert (chain.base, chain.tip) == ("link2", "link5")


FINGERS = """
<link name="left"/><link name="right"/>
<joint name="finger1" type="prismatic"><parent link="link2"/><child link="left"/></joint>
<joint name="finger2" type="prismatic"><parent link="link2"/><child link="right"/>{mimic}</joint>
</robot>"""


def add_fingers(mimic: str = "") -> str:
    text = urdf("x", ROBOTS["pan-tilt"])
    return text.replace("</robot>", FINGERS.format(mimic=mimic))


def test_a_finger_that_follows_another_one_ends_no_chain(tmp_path: Path) -> None:
    chain = chain_of(tmp_path, add_fingers('<mimic joint="finger1"/>'))
    assert [joint.name for joint in chain.joints] == ["joint1", "joint2", "finger1"]


def joint_of_type(kind: str) -> str:
    return urdf("x", ROBOTS["pan-tilt"]).replace(
        '<joint name="joint2" type="revolute"', f'<joint name="joint2" type="{kind}"'
    )


def add_loop() -> str:
    closing = '<joint name="p3" type="fixed"><parent link="right"/><child link="left"/></joint>'
    return add_fingers().replace("</robot>", closing + "</robot>")


def wrist_behind_a_mimic() -> str:
    text = urdf("x", [*ROBOTS["pan-tilt"], (REVOLUTE, "0 0 0.1", "0 0 0", "0 0 1")])
    start = text.index("</joint>", text.index('name="joint2"'))
    return text[:start] + '<mimic joint="joint1"/>' + text[start:]


def knuckle_behind(followed: str) -> str:
    text = urdf("x", ROBOTS["pan-tilt"])
    knuckle = (
        '<link name="knuckle"/><joint name="k" type="revolute"><parent link="link2"/>'
        f'<child link="knuckle"/><mimic joint="{followed}"/></joint></robot>'
    )
    return text.replace("</robot>", knuckle)


def test_a_joint_that_follows_no_joint_of_the_arm_does_not_matter(tmp_path: Path) -> None:
    assert len(chain_of(tmp_path, knuckle_behind("jaw")).joints) == 2


def insert_xacro(element: str) -> str:
    return urdf("x", ROBOTS["pan-tilt"]).replace("</robot>", f"{element}\n</robot>")


@pytest.mark.parametrize(
    ("text", "tip", "message"),
    [
        ("", None, "1: invalid XML"),
        ("<robot><link", None, "1: invalid XML"),
        ("xacro: in-order processing\n<?xml version='1.0'?>\n<robot/>", None,
         "1: invalid XML: starts with 'xacro: in-order processing'; remove what stands before <"),
        ("<sdf/>", None, "1: <sdf> must be <robot>"),
        ('<robot><link name="a"/></robot>', None, "no chain of joints that move: it has 0 joints"),
        (add_fingers('<mimic joint="finger1"/>'), "right", r"10: joint 'finger2' mimics another"),
        (add_fingers('<mimic joint="finger1"/>'), "right", "end the chain .* couplings"),
        (wrist_behind_a_mimic(), None, "6: joint 'joint2' mimics another one, 'joint1', and has"),
        (knuckle_behind("joint2"), None, "7: joint 'k' mimics another one, 'joint2', and has no"),
        (knuckle_behind("joint2"), None, "with --to link2, in a map by robot: .urdf: robot.urdf, "),
        (joint_of_type("floating"), "link2", "6: joint 'joint2': type 'floating' must be"),
        (joint_of_type("Revolute"), None, "6: joint 'joint2': type 'Revolute' must be one of rev"),
        (add_loop(), None, "11: link 'left' is the child of joint 'finger1' already, and joint"),
        (add_loop(), None, "loops are not modelled. A parallelogram .* couplings: .{motor: 3"),
        (insert_xacro('<xacro:include filename="a"/>'), None, "7: <xacro:include> is not expanded"),
        (insert_xacro('<gazebo ref="${name}"/>'), None, r"7: ref '\$\{name\}' of <gazebo> is not"),
        (insert_xacro('<a><b c="$(find arm)/x"/></a>'), None, r"7: c '\$\(find arm\)/x' of <b> is"),
        (urdf("x", ROBOTS["UR10e"]), "tool0", "no link 'tool0'; links are base, link1"),
        (urdf("x", ROBOTS["UR10e"]), "base", "no joint between"),
        (urdf("x", [(REVOLUTE, "0 0", "0 0 0", "0 0 1")]), None, "4: xyz '0 0' must be 3 finite"),
        (urdf("x", [(REVOLUTE, "0 0 0", "0 0 0", "0 0 0")]), None, "axis 0 0 0 must have"),
        (urdf("x", [(REVOLUTE, "0 0 nan", "0 0 0", "0 0 1")]), None, "must be 3 finite numbers"),
        (
            urdf("x", ROBOTS["pan-tilt"]).replace('parent link="link1"', 'parent link="lnk1"'),
            None,
            "6: parent 'lnk1' is not a link of this file",
        ),
        ('<!DOCTYPE robot [<!ENTITY a "b">]>\n<robot/>', None, "1: declares an entity"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_with_its_line(
    tmp_path: Path, text: str, tip: str | None, message: str
) -> None:
    with pytest.raises(FileError, match=message):
        chain_of(tmp_path, text, None, tip)


def test_a_loop_of_links_is_refused(tmp_path: Path) -> None:
    text = urdf("x", ROBOTS["pan-tilt"]).replace('parent link="base"', 'parent link="link2"')
    with pytest.raises(FileError, match=r"robot.urdf:\d+: link 'link.' is above itself: joint 'jo"):
        chain_of(tmp_path, text)


def test_an_expanded_xacro_that_keeps_its_namespace_is_a_urdf(tmp_path: Path) -> None:
    space = ' xmlns:xacro="http://www.ros.org/wiki/xacro">'
    text = urdf("x", ROBOTS["pan-tilt"]).replace(">", space, 1)
    assert len(chain_of(tmp_path, text).joints) == 2


@pytest.mark.parametrize("name", ["arm.URDF", "description.xml", "arm.urdf.xacro"])
def test_a_urdf_is_read_whatever_its_ending(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text(urdf("x", ROBOTS["pan-tilt"]))
    assert Robot.load(tmp_path / name).n_joints == 2


@pytest.mark.parametrize(
    ("joint", "limits", "message"),
    [
        (
            "joint1",
            'lower="-170" upper="170"',
            "robot.urdf:4: joint 'joint1': q_min: -170 rad must",
        ),
        ("joint2", 'lower="2" upper="-2"', "robot.urdf:6: joint 'joint2': q_max: -2 rad must be"),
    ],
)
def test_a_wrong_limit_is_refused_at_its_line_of_the_urdf(
    tmp_path: Path, joint: str, limits: str, message: str
) -> None:
    text = re.sub(
        rf'(name="{joint}".*?<limit )lower="[^"]*" upper="[^"]*"',
        rf"\1{limits}",
        urdf("x", ROBOTS["pan-tilt"]),
        flags=re.DOTALL,
    )
    (tmp_path / "robot.urdf").write_text(text)
    with pytest.raises(FileError, match=message):
        Robot.load(tmp_path / "robot.urdf")


def test_a_urdf_in_the_place_of_a_robot_file_is_a_robot_that_cannot_be_moved(
    tmp_path: Path,
) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(urdf("Panda", ROBOTS["Panda"]))
    robot = Robot.load(path)
    assert np.isnan(robot.acceleration_limit).all()
    assert robot.rotor_inertia_unknown.all()
    assert np.isnan(robot.gear_ratio).all()
    path.unlink()
    with pytest.raises(FileError, match=r"arm\.urdf: cannot be read"):
        Robot.load(path)


def test_limits_that_no_joint_has_are_none(tmp_path: Path) -> None:
    text = urdf("pan tilt", ROBOTS["pan-tilt"])
    beyond = {'lower="-1.1"': 'lower="-10000"', 'upper="2.1"': 'upper="10000"',
              'velocity="1.1"': 'velocity="1e6"', 'effort="51"': 'effort="1e10"'}  # fmt: skip
    for stated, instead in beyond.items():
        assert stated in text
        text = text.replace(stated, instead)
    first, second = chain_of(tmp_path, text).joints
    assert np.isnan([first.lower, first.upper, first.velocity, first.effort]).all()
    assert (second.lower, second.upper) == (-1.2, 2.2)
    (note,) = chain_of(tmp_path, text).not_taken
    assert note == (
        "limits taken as unknown: lower -10000 of joint1 (exceeds 720, the greatest in any"
        " unit), upper 10000 of joint1 (exceeds 720, the greatest in any unit), velocity 1e+06"
        " rad/s of joint1 (no joint exceeds 40 rad/s: a placeholder or another unit), effort 1e+10"
        " N m of joint1 (no joint exceeds 100000 N m: a placeholder or another unit)"
    )
    # degrees are no valid limit: the robot file refuses them with a remark
    degrees = text.replace('upper="10000"', 'upper="120"')
    assert chain_of(tmp_path, degrees).joints[0].upper == 120.0


def limits(name: str, stated: str) -> str:
    """Return a URDF with the same attributes of <limit> for all joints."""
    return re.sub("<limit [^>]*>", f"<limit {stated}/>", urdf(name, ROBOTS[name]))


@pytest.mark.parametrize(
    ("stated", "unknown"),
    [
        ('lower="-2" upper="2" velocity="1000" effort="1000"', "velocity effort"),
        ('lower="-2" upper="2" velocity="172" effort="33"', "velocity"),
        ('lower="-2" upper="2" velocity="3" effort="1000"', "effort"),
        ('lower="-2" upper="2" velocity="3" effort="150000"', "effort"),
        ('lower="-1000" upper="1000" velocity="100" effort="100"', "lower upper velocity effort"),
        ('lower="0" upper="0" velocity="0" effort="0"', "lower upper velocity effort"),
        ('lower="0" upper="0" velocity="3" effort="33"', "lower upper"),
        ('lower="-2" upper="2" velocity="3" effort="33"', ""),
    ],
)
def test_placeholders_of_limits_are_unknown_and_named_in_one_line(
    tmp_path: Path, stated: str, unknown: str
) -> None:
    chain = chain_of(tmp_path, limits("UR10e", stated))
    for joint in chain.joints:
        for key in ("lower", "upper", "velocity", "effort"):
            assert math.isnan(getattr(joint, key)) == (key in unknown.split())
    robot = Robot.load(tmp_path / "robot.urdf")
    assert len(robot.not_taken) == bool(unknown) == robot.text.count("# not taken: ")
    assert np.isnan(robot.velocity_limit).all() == ("velocity" in unknown)
    assert chain.not_taken == parse_robot(robot.text, "copy").not_taken
    text = filled(draft_robot(chain))
    assert parse_robot(text, "draft").not_taken == chain.not_taken


def test_efforts_of_motors_are_no_placeholders(tmp_path: Path) -> None:
    text = urdf("pan tilt", ROBOTS["pan-tilt"]).replace('effort="51"', 'effort="100"')
    assert chain_of(tmp_path, text).joints[0].effort == 100.0


@pytest.mark.parametrize("before", ["\n", "\ufeff \n", "  ", "<!-- exported\nby hand -->"])
def test_blanks_and_comments_before_the_declaration_of_xml_do_no_harm(
    tmp_path: Path, before: str
) -> None:
    text = urdf("x", ROBOTS["pan-tilt"])
    line = int(chain_of(tmp_path, text).joints[0].place.split(":")[1])
    declared = f'{before}<?xml version="1.0" encoding="utf-8"?>\n{text}'
    joint = chain_of(tmp_path, declared).joints[0]
    assert f":{line + 1 + before.count(chr(10))}:" in joint.place
