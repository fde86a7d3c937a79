"""Robot of a map: by name, file or URDF, with joints of any type."""

import re

import numpy as np
import pytest
import yaml
from small_recording import a_map, table, write_csv, write_map
from urdf_robots import ROBOTS, urdf

from checked_files.yaml_file import FileError
from hil.imports.importing import import_recordings
from hil.model.robot import Robot

TYPES = ("revolute", "revolute", "prismatic", "revolute")


def write_scara(folder):
    """Write a SCARA's URDF and a recording of its four joints; return the map's joints."""
    (folder / "scara.urdf").write_text(urdf("SCARA", ROBOTS["SCARA"]))
    t = np.arange(3000) / 250
    w = 2 * np.pi * np.array([0.3, 0.4, 0.5, 0.7])
    q, qd = 0.5 + 0.4 * np.sin(np.outer(t, w)), 0.4 * w * np.cos(np.outer(t, w))
    tau = 3 * np.tanh(qd / 0.05) + 2 * qd
    names = [f"{key}{j}" for key in ("q", "m") for j in range(1, 5)]
    write_csv(folder / "data.csv", {"t": t, **dict(zip(names, [*q.T, *tau.T], strict=True))})
    return [
        {
            "position": {"column": f"q{j}", "unit": "rad" if kind == "revolute" else "m"},
            "torque": {"column": f"m{j}", "unit": "N m" if kind == "revolute" else "N"},
        }
        for j, kind in enumerate(TYPES, start=1)
    ]


@pytest.mark.parametrize(
    "robot", ["scara.urdf", {"urdf": "scara.urdf", "from": "base", "to": "link4"}]
)
def test_a_urdf_is_a_robot(tmp_path, robot):
    joints = write_scara(tmp_path)
    run = import_recordings(
        [write_map(tmp_path, a_map(robot=robot, joints=joints))], tmp_path / "r"
    )
    assert [bool(turns) for turns in run.robot.revolute] == [t == "revolute" for t in TYPES]
    assert Robot.load(run.path / "robot.yaml").digest == run.robot.digest
    assert run["map-01"].recording.q.shape == (3000, 4)


@pytest.mark.parametrize("uncertain", [False, True])
def test_placeholders_of_limits_are_no_obstacle_for_recordings(tmp_path, uncertain):
    joints = write_scara(tmp_path)
    if uncertain:
        joints[2]["torque"] |= {"gain": 1.0, "gain_uncertainty": 0.03}
    text = (tmp_path / "scara.urdf").read_text()
    zeros = '<limit lower="0" upper="0" velocity="1000" effort="1000"/>'
    (tmp_path / "scara.urdf").write_text(re.sub("<limit [^>]*>", zeros, text))
    content = a_map(robot="scara.urdf", joints=joints)
    told = []
    run = import_recordings([write_map(tmp_path, content)], tmp_path / "r", told.append)
    notes = [line for line in told[0].lines() if "limits taken as unknown" in line]
    assert len(notes) == 1
    assert "range 0 to 0 rad of joint1, joint2 (allows no motion)" in notes[0]
    assert not told[0].warnings
    assert np.isnan(run.robot.torque_limit).all()


def test_part_of_a_chain_is_a_robot(tmp_path):
    joints = write_scara(tmp_path)[:2]
    robot = {"urdf": "scara.urdf", "to": "link2"}
    run = import_recordings(
        [write_map(tmp_path, a_map(robot=robot, joints=joints))], tmp_path / "r"
    )
    assert run.robot.n_joints == 2


def test_a_chain_that_goes_on_beyond_the_recording_is_named_with_its_end(tmp_path):
    joints = write_scara(tmp_path)[:3]
    content = a_map(robot="scara.urdf", joints=joints)
    with pytest.raises(
        FileError, match=r"3 joints must be 4, .* order: joint1, joint2,"
    ) as refused:
        import_recordings([write_map(tmp_path, content)], tmp_path / "r")
    content["robot"] = yaml.safe_load(str(refused.value).partition("robot: ")[2])
    run = import_recordings([write_map(tmp_path, content)], tmp_path / "r")
    assert run.robot.joint_names == ("joint1", "joint2", "joint3")


def test_gains_may_be_uncertain_where_the_urdf_knows_no_drives(tmp_path):
    joints = write_scara(tmp_path)
    joints[2]["torque"] |= {"gain": 1.0, "gain_uncertainty": 0.03}
    content = a_map(robot="scara.urdf", joints=joints)
    run = import_recordings([write_map(tmp_path, content)], tmp_path / "r")
    assert run.robot.torque_constant_uncertainty.tolist() == [0, 0, 0.03, 0]


def test_a_link_that_is_not_there_is_refused_at_its_line(tmp_path):
    joints = write_scara(tmp_path)
    content = a_map(robot={"urdf": "scara.urdf", "to": "hand"}, joints=joints)
    with pytest.raises(FileError, match=r"map.yaml:1: robot: .*scara.urdf.*hand"):
        import_recordings([write_map(tmp_path, content)], tmp_path / "r")


def test_millimetres_and_newtons_suit_joints_that_slide(tmp_path):
    joints = write_scara(tmp_path)
    joints[3]["torque"]["unit"] = "N"
    joints[2]["position"]["unit"] = "rad"
    with pytest.raises(FileError) as refused:
        import_recordings(
            [write_map(tmp_path, a_map(robot="scara.urdf", joints=joints))], tmp_path / "r"
        )
    assert [line.partition(": ")[2] for line in str(refused.value).splitlines()] == [
        "joints.2.position.unit: rad does not suit joint 3 of SCARA, which is prismatic; correct"
        " the unit, or the order of the joints",
        "joints.3.torque.unit: N does not suit joint 4 of SCARA, which is revolute; correct the"
        " unit, or the order of the joints",
    ]


def test_a_robot_that_comes_along_is_known_by_name(tmp_path):
    columns = table(3.0)
    write_csv(
        tmp_path / "data.csv", {"t": columns["t"], "q": columns["q1"] / 10, "u": columns["v1"]}
    )
    joint = {
        "position": {"column": "q", "unit": "m"},
        "torque": {"column": "u", "unit": "V", "gain": 35.0},
    }
    run = import_recordings(
        [write_map(tmp_path, a_map(robot="emps", joints=[joint]))], tmp_path / "r"
    )
    assert run.robot.digest == Robot.load("emps").digest
