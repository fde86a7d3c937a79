"""Robots from MJCF agree with MuJoCo's compiler."""

import re

import numpy as np
import pytest
from mjcf_robots import ARM, WRIST, write_arm

import hil
from hil.errors import FileError
from hil.model.readers.axes_to_frames import find_frames
from hil.model.readers.mjcf import read_mjcf

mujoco = pytest.importorskip("mujoco")


def test_joints_lie_where_mujoco_has_them_whatever_class_frame_unit_or_include_says_so(tmp_path):
    path = write_arm(tmp_path / "arm")
    chain, model = read_mjcf(path), mujoco.MjModel.from_xml_path(str(path))
    assert [joint.name for joint in chain.joints] == ["pan", "lift", "roll", "slide"]
    data, rng = mujoco.MjData(model), np.random.default_rng(2)
    for q in rng.uniform(-1.0, 1.0, (5, 4)):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        frames = chain.frames(q)
        way = np.where(chain.revolute, 0.0, q)[:, None] * data.xaxis  # anchors do not slide along
        np.testing.assert_allclose(frames[:, :3, 3], data.xanchor + way, atol=1e-9)
        axes = [T[:3, :3] @ joint.axis for T, joint in zip(frames, chain.joints, strict=True)]
        np.testing.assert_allclose(axes, data.xaxis, atol=1e-9)
        moved = find_frames(chain).poses(q, chain.revolute)
        np.testing.assert_allclose(np.abs((moved[:, :3, 2] * data.xaxis).sum(axis=1)), 1.0)


TREE = """<mujoco model="hand"><compiler angle="radian"/><worldbody>
<body name="palm" pos="0 0 1"><joint name="wrist" axis="0 0 1" ref="0.2"/>
  <inertial pos="0 0 0.1" mass="1" fullinertia="0.02 0.03 0.025 0.001 0.002 0.003"/>
  <body name="weld" pos="0.1 0 0" euler="0 0.3 0">
    <body name="thumb" pos="0 0 0.1"><joint name="t1" axis="0 1 0"/><joint name="t2" axis="1 0 0"/>
      <inertial pos="0.01 0 0.1" mass="0.3" diaginertia="0.002 0.003 0.001"/></body></body>
  <body name="finger" pos="-0.1 0 0.1" euler="0.4 0 0"><joint name="f1" axis="0 1 0"/>
    <inertial pos="0.01 0 0.1" mass="0.3" diaginertia="0.002 0.003 0.001"/>
    <body name="end" pos="0 0 0.1"><joint name="f2" type="slide" axis="0 0.6 0.8"/>
      <inertial pos="0 0.1 0.1" mass="0.2" diaginertia="0.002 0.003 0.001"/></body></body></body>
<body name="cube" pos="1 0 0"><freejoint/><geom size="0.1"/></body></worldbody></mujoco>"""


def test_a_tree_has_mujoco_s_torques(tmp_path):
    (path := tmp_path / "hand.xml").write_text(TREE)
    chain, robot = read_mjcf(path), hil.Robot.load(path)
    assert (chain.parents, chain.tip) == ((-1, 0, 1, 0, 3), "thumb, end")
    model = mujoco.MjModel.from_xml_path(str(path))
    data, rng, n = mujoco.MjData(model), np.random.default_rng(3), 5
    q, qd, qdd = rng.uniform(-1.0, 1.0, (3, 200, n))
    expected = np.empty((200, n))
    for k in range(200):
        data.qpos[:n], data.qvel[:n], data.qacc[:n] = q[k], qd[k], qdd[k]
        mujoco.mj_inverse(model, data)
        expected[k] = data.qfrc_inverse[:n]
    A = hil.regressor(robot, q, qd, qdd).reshape(200 * n, -1)
    p, _, rank, _ = np.linalg.lstsq(A, expected.ravel(), rcond=None)
    assert rank == A.shape[1]
    np.testing.assert_allclose(A @ p, expected.ravel(), atol=1e-10)
    one = hil.Robot.load(path, tip="thumb")
    assert (one.n_joints, one.is_chain) == (3, True)
    assert hil.Robot.load(path, tip="end, thumb").joint_names == ("wrist", "f1", "f2", "t1", "t2")


def test_the_robot_has_the_file_s_ranges_limits_and_gravity(tmp_path):
    robot = hil.Robot.load(write_arm(tmp_path / "arm"))
    assert robot.name == "test-arm"
    assert robot.n_joints == 4
    np.testing.assert_allclose(robot.q_max[:2], np.radians([170, 100]))
    np.testing.assert_allclose(robot.q_max[3], 0.2)
    assert robot.torque_limit[1] == 80
    assert np.linalg.norm(robot.gravity) == pytest.approx(np.hypot(0.5, 9.7))
    # the frame's first axis is upright, so gravity has its part along it
    assert abs(robot.gravity[2]) == pytest.approx(9.7)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (('name="pan" axis="0 0 1" range="-170 170"', 'name="pan" type="ball"'),
         r"arm\.xml:\d+: joint 'pan'.*hinge"),
        (("<light", '<body name="loose" pos="1 0 0"><freejoint/><geom size="1"/></body><light'),
         None),
        (("</worldbody>", '</worldbody><equality><connect body1="tool" body2="stand" anchor="0 0 0"'
          "/></equality>"), r"arm\.xml:\d+: <connect> closes a loop"),
        (("<light", '<replicate count="2"><geom size="1"/></replicate><light'), "written out"),
        (("parts/wrist", "parts/none"), r"arm\.xml:22: includes 'parts/none\.xml'"),
        (('mass="2.5"', 'mass="-1"'), "cannot be compiled by MuJoCo: .*mass"),
        (("<light", '<body name="b2"><joint/><geom size="1"/><body><joint/><geom size="1"/><body>'
          '<joint/><joint axis="1 0 0"/><geom size="1"/></body></body></body><light'),
         None),
    ],
)  # fmt: skip
def test_what_cannot_be_taken_is_named_with_its_line_and_what_to_do(tmp_path, change, why):
    assert change[0] in ARM
    path = write_arm(tmp_path / "arm", ARM.replace(*change, 1))
    if why is None:  # loose objects do not belong to the arm, another chain as long makes a tree
        assert hil.Robot.load(path).n_joints == (8 if "b2" in change[1] else 4)
        return
    with pytest.raises(FileError, match=why):
        hil.Robot.load(path)


def test_a_free_base_is_refused(tmp_path):
    arm = ARM.replace('<geom type="box"', '<freejoint name="base"/><geom type="box"')
    arm = arm.replace(' euler="0 0 30"', "")
    with pytest.raises(FileError, match=r"arm\.xml:13: .*free base is not modelled: fix its base"):
        hil.Robot.load(write_arm(tmp_path / "arm", arm))


def test_springs_are_identified_and_compensated_gravity_is_named_as_left_out(tmp_path):
    wrist = WRIST.replace('name="roll"', 'name="roll" stiffness="3" springref="0.2"')
    wrist = wrist.replace('name="hand"', 'name="hand" gravcomp="1"')
    robot = hil.Robot.load(write_arm(tmp_path / "arm", wrist=wrist))
    assert "k3" in robot.added_parameters
    assert "not taken: " in robot.text
    assert "wrist.xml:2: gravcomp" in robot.text


TRIANGLES = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def write_mesh_tool(folder, *, file="tool.obj", stated=False):
    """Write the arm with a mesh tool, with or without an inertial; return its path."""
    asset = f'<asset><mesh name="tool" file="{file}" scale=".1 .1 .1"/></asset><worldbody>'
    arm = ARM.replace("<worldbody>", asset).replace("autolimits", 'meshdir="meshes" autolimits')
    inertial = '<inertial pos="0 0 0" mass="0.2" diaginertia="0.0002 0.0002 0.0002"/>'
    geom = '<geom type="mesh" mesh="tool"/>'
    return write_arm(folder, arm, WRIST.replace(inertial, geom + inertial * stated))


def test_only_what_moves_joints_is_compiled(tmp_path):
    """Other elements of a file allocate no memory, and their files are not read."""
    plain = read_mjcf(write_arm(tmp_path / "plain"))
    more = ARM.replace(
        "<worldbody>",
        '<asset><texture name="sky" type="2d" file="/not/there.png"/><material name="m"'
        ' texture="sky"/><hfield name="hills" nrow="2000" ncol="2000" size="1 1 1 1"/></asset>'
        '<custom><numeric name="table" size="1000000"/></custom><worldbody><geom type="hfield"'
        ' hfield="hills"/>',
    ).replace('size=".1 .1 .1"', 'size=".1 .1 .1" material="m"')
    chain = read_mjcf(write_arm(tmp_path / "more", more))
    assert (chain.model.nhfielddata, chain.model.ntex, chain.model.nnumericdata) == (0, 0, 0)
    np.testing.assert_array_equal(chain.model.body_inertia, plain.model.body_inertia)
    np.testing.assert_array_equal(chain.frames(np.ones(4)), plain.frames(np.ones(4)))


def test_a_mesh_is_needed_where_it_makes_an_inertia_and_nowhere_else(tmp_path):
    assert read_mjcf(write_mesh_tool(tmp_path / "stated", stated=True)).model.nmesh == 0
    path = write_mesh_tool(tmp_path / "made")
    with pytest.raises(
        FileError, match=r"arm\.xml:\d+: 'tool\.obj' does not exist.*state the inertial"
    ):
        read_mjcf(path)
    (path.parent / "meshes").mkdir()
    (path.parent / "meshes" / "tool.obj").write_text(TRIANGLES)
    assert read_mjcf(path).model.body("tool").mass[0] == pytest.approx(1000 * 0.1**3 / 6)


@pytest.mark.parametrize(
    ("where", "instead"),
    [
        ("<worldbody>", "<worldbody>{}"),
        ("<worldbody>", '<worldbody><frame pos="1 0 0"><frame>{}</frame></frame>'),
        ('<body name="fore" pos="0.1 0.05 0">', '<body name="fore" pos="0.1 0.05 0">{}'),
        ('<frame euler="0 90 0">', '<frame euler="0 90 0">{}'),
    ],
)
def test_missing_meshes_of_the_world_and_of_bodies_with_inertials_are_not_needed(
    tmp_path, where, instead
):
    plain = read_mjcf(write_arm(tmp_path / "plain"))
    asset = '<asset><mesh name="lost" file="lost.stl"/></asset><worldbody>'
    arm = ARM.replace(where, instead.format('<geom type="mesh" mesh="lost"/>'))
    chain = read_mjcf(write_arm(tmp_path / "arm", arm.replace("<worldbody>", asset)))
    assert chain.model.nmesh == 0
    np.testing.assert_array_equal(chain.model.body_inertia, plain.model.body_inertia)


def test_a_mesh_of_a_class_is_needed_where_it_makes_an_inertia(tmp_path):
    shape = '<joint damping="0.3"/><geom type="mesh" mesh="tool"/>'
    stated = write_mesh_tool(tmp_path / "stated", stated=True)
    made = write_mesh_tool(tmp_path / "made")
    for path in (stated, made):
        text = path.read_text().replace('<joint damping="0.3"/>', shape)
        path.write_text(re.sub('<geom type="box".*', "", text))
        wrist = path.parent / "parts" / "wrist.xml"
        wrist.write_text(wrist.read_text().replace(' mesh="tool"', ""))
    assert read_mjcf(stated).model.nmesh == 0
    with pytest.raises(FileError, match=r"'tool\.obj' does not exist"):
        read_mjcf(made)


def test_a_missing_mesh_is_named_with_its_body(tmp_path):
    asset = '<asset><mesh name="lost" file="lost.stl"/></asset><worldbody>'
    arm = ARM.replace("<worldbody>", asset).replace(
        "autolimits", 'inertiafromgeom="true" autolimits'
    )
    arm = arm.replace(
        'name="fore" pos="0.1 0.05 0">', 'name="fore"><geom type="mesh" mesh="lost"/>'
    )
    with pytest.raises(FileError, match=r"'lost\.stl' does not exist, .* inertia of body 'fore'"):
        read_mjcf(write_arm(tmp_path / "arm", arm))


def test_files_outside_of_the_folder_are_not_read(tmp_path):
    (tmp_path / "mine.obj").write_text(TRIANGLES)
    path = write_mesh_tool(tmp_path / "arm", file="../../mine.obj")
    (path.parent / "meshes").mkdir()
    with pytest.raises(FileError, match=r"mine\.obj is outside of .*; copy it"):
        read_mjcf(path)
    (tmp_path / "mine.xml").write_text(WRIST)
    arm = ARM.replace("parts/wrist.xml", "../mine.xml")
    with pytest.raises(FileError, match=r"arm\.xml:\d+: .*mine.xml is outside of .*; copy it"):
        read_mjcf(write_arm(tmp_path / "other", arm))


def test_elements_within_one_another_without_end_are_refused(tmp_path):
    arm = ARM.replace("<worldbody>", "<worldbody>" + "<frame>" * 3000 + "</frame>" * 3000)
    with pytest.raises(FileError, match=r"arm\.xml:10: <frame> is nested 201 deep, at most 200"):
        read_mjcf(write_arm(tmp_path / "arm", arm))
