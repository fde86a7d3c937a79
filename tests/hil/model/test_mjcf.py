"""Robots from MJCF: what MuJoCo's compiler makes of a file is what the robot is."""

import numpy as np
import pytest
from mjcf_robots import ARM, WRIST, write_arm

import hil
from hil.errors import FileError
from hil.model.readers.axes_to_frames import frames_of
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
        moved = frames_of(chain).poses(q, chain.revolute)
        np.testing.assert_allclose(np.abs((moved[:, :3, 2] * data.xaxis).sum(axis=1)), 1.0)


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
        (('mass="2.5"', 'mass="-1"'), "MuJoCo does not compile it: .*mass"),
        (("<light", '<body name="b2"><joint/><geom size="1"/><body><joint/><geom size="1"/><body>'
          '<joint/><joint axis="1 0 0"/><geom size="1"/></body></body></body><light'),
         "name one with --to"),
    ],
)  # fmt: skip
def test_what_cannot_be_taken_is_named_with_its_line_and_what_to_do(tmp_path, change, why):
    assert change[0] in ARM
    path = write_arm(tmp_path / "arm", ARM.replace(*change, 1))
    if why is None:  # a loose object is no part of the arm
        assert hil.Robot.load(path).n_joints == 4
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
