"""Robot files from Denavit-Hartenberg tables, against textbooks and Pinocchio."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
import pytest

from checked_files.yaml_file import UNSTATED, FileError
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import inverse_dynamics
from hil.model.readers.dh_table import read_dh
from hil.model.readers.robot_draft import draft_robot
from hil.model.robot import parse_robot

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from hil.model.readers.dh_table import DhRobot, Notation

    Array = NDArray[np.float64]
    Rows = list[tuple[float, float, float, float, str]]

NOTATIONS: tuple[Notation, Notation] = ("standard", "modified")
PUMA: Rows = [  # alpha [deg], a [m], d [m], theta [deg]
    (90, 0, 0.6718, 0, "revolute"), (0, 0.4318, 0.1397, -90, "revolute"),
    (-90, 0.0203, 0, 90, "revolute"), (90, 0, 0.4318, 0, "revolute"),
    (-90, 0, 0, 270, "revolute"), (0, 0, 0.0563, 0, "revolute"),
]  # fmt: skip
STANFORD: Rows = [
    (-90, 0, 0.412, 0, "revolute"), (90, 0, 0.154, 180, "revolute"),
    (0, 0, 0.3, -90, "prismatic"), (-90, 0, 0, 0, "revolute"),
]  # fmt: skip
ASKEW: Rows = [
    (17, 0.21, -0.3, 31, "revolute"), (-121, -0.13, 0.2, 12.5, "prismatic"),
    (45, 0.3, 0.1, -78, "revolute"), (3, 0.05, 0, 200, "prismatic"), (77, 0, 0.4, -5, "revolute"),
]  # fmt: skip
TABLES = {"Puma": PUMA, "Stanford": STANFORD, "askew": ASKEW}


def csv(rows: Rows, unit: str = "deg") -> str:
    factor = 1.0 if unit == "deg" else math.pi / 180
    lines = [f"{al * factor!r},{a!r},{d!r},{th * factor!r},{kind}" for al, a, d, th, kind in rows]
    return "\n".join([f"alpha [{unit}],a,d,theta,type", *lines])


def read(folder: Path, text: str, notation: Notation = "standard", name: str = "t.csv") -> DhRobot:
    (folder / name).write_text(text)
    return read_dh(folder / name, notation)


def textbook(row: tuple[float, float, float, float, str], q: float, notation: Notation) -> Array:
    """Return the transform of a row, as in textbooks (Spong, eq. 3.10; Craig, eq. 3.6)."""
    alpha, a, d, theta, kind = row
    alpha, theta = np.radians([alpha, theta])
    theta, d = (theta + q, d) if kind == "revolute" else (theta, d + q)
    ct, st, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    if notation == "standard":
        rows = [[ct, -st * ca, st * sa, a * ct], [st, ct * ca, -ct * sa, a * st], [0, sa, ca, d]]
    else:
        rows = [[ct, -st, 0, a], [st * ca, ct * ca, -sa, -d * sa], [st * sa, ct * sa, ca, d * ca]]
    return np.array([*rows, [0, 0, 0, 1]])


@pytest.mark.parametrize("notation", NOTATIONS)
@pytest.mark.parametrize("name", TABLES)
def test_every_frame_is_where_textbooks_have_it(
    tmp_path: Path, name: str, notation: Notation
) -> None:
    rows = TABLES[name]
    robot = read(tmp_path, csv(rows), notation)
    revolute = np.array([kind == "revolute" for *_, kind in rows])
    for q in np.random.default_rng(1).uniform(-2, 2, (10, len(rows))):
        expected = np.eye(4)
        for row, angle, found in zip(rows, q, robot.frames.poses(q, revolute), strict=True):
            before, expected = expected, expected @ textbook(row, angle, notation)
            if notation == "modified":
                assert found == pytest.approx(expected, abs=1e-12)
            else:  # our frame is on the joint's axis, the table's at the far end of the link
                link = textbook((row[0], row[1], 0, 0, "revolute"), 0, "standard")
                assert found @ link == pytest.approx(expected, abs=1e-12)
                assert found[:3, 2] == pytest.approx(before[:3, 2], abs=1e-12)


def pinocchio_of(rows: Rows, notation: Notation, gravity: Array) -> pin.Model:
    """Return the robot joint by joint, from textbook transforms, with random bodies."""
    model, after, rng = pin.Model(), np.eye(4), np.random.default_rng(3)
    model.gravity.linear = gravity
    for number, row in enumerate(rows):
        alpha, a, _, _, kind = row
        before = textbook((alpha, a, 0, 0, kind), 0, "modified")
        placed = after @ before if notation == "modified" else after
        joint = pin.JointModelRZ() if kind == "revolute" else pin.JointModelPZ()
        model.addJoint(number, joint, pin.SE3(placed), f"joint{number}")
        half = rng.normal(size=(3, 3))
        body = pin.Inertia(rng.uniform(1, 5), rng.normal(size=3), half @ half.T + np.eye(3))
        model.appendBodyToJoint(number + 1, body, pin.SE3.Identity())
        fixed = textbook(row, 0, notation)
        after = np.linalg.inv(before) @ fixed if notation == "modified" else fixed
    return model


def standard_parameters(model: pin.Model, poses: Array) -> Array:
    """Return Pinocchio's bodies in our frames, given the poses of our frames at q = 0."""
    data, found = model.createData(), []
    pin.forwardKinematics(model, data, pin.neutral(model))
    for k, pose in enumerate(poses, start=1):
        body = (pin.SE3(np.linalg.inv(pose)) * data.oMi[k]).act(model.inertias[k])
        m, s = body.mass, body.mass * body.lever
        I = body.inertia - m * pin.skew(body.lever) @ pin.skew(body.lever)  # noqa: E741
        found += [*I[0], I[1, 1], I[1, 2], I[2, 2], *s, m]
    return np.array(found)


def filled(draft: str) -> str:
    """Return a draft with values in place of its marks."""
    text = re.sub(rf"q_min: {UNSTATED}.*", "q_min: -3", draft)
    text = re.sub(rf"rotor_inertia: {UNSTATED}.*", "rotor_inertia: 0", text)
    return re.sub(rf"{UNSTATED}.*", "3", text)


@pytest.mark.parametrize("notation", NOTATIONS)
@pytest.mark.parametrize("name", TABLES)
def test_a_drafted_robot_has_the_torques_of_its_table(
    tmp_path: Path, name: str, notation: Notation
) -> None:
    rows, gravity = TABLES[name], (1.0, -2.0, -9.0)
    table = read(tmp_path, csv(rows), notation)
    robot = parse_robot(filled(draft_robot(table, gravity)), "draft")
    model = pinocchio_of(rows, notation, np.array(gravity))
    poses = table.frames.poses(np.zeros(len(rows)), robot.revolute)
    p = base_parameters(robot).matrix @ standard_parameters(model, poses)
    data = model.createData()
    for q, qd, qdd in np.random.default_rng(2).uniform(-1, 1, (10, 3, len(rows))):
        expected = pin.rnea(model, data, q, qd, qdd)
        assert inverse_dynamics(robot, p, q, qd, qdd) == pytest.approx(expected, abs=1e-9, rel=1e-9)


# --- permitted tables -----------------------------------------------------------------------------

YAML = """
angles: rad
name: two
joints:
  - {alpha: pi/2, a: 0, d: 0.4, theta: q1, q_max: 2, q_min: -1, velocity_limit: 3}
  - {type: prismatic, alpha: 0, a: 0.2, theta: -pi/2}
"""
SAME = [
    ("t.yaml", YAML),
    ("t.csv", "name,alpha [deg],a [mm],d [mm],theta,type\n,90,0,400,,r\n,0,200,,-90,P\n"),
    ("t.csv", "# two\nα (rad);a;d;θ;type\n\n1.5708;0;0,4;q1*;R\n0;0,2;d2;-pi/2;P\n"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "text"), SAME)
def test_tables_that_say_the_same_are_the_same(tmp_path: Path, name: str, text: str) -> None:
    frames = read(tmp_path, text, "modified", name).frames
    assert frames.alpha.tolist() == [math.pi / 2, 0]
    assert frames.d.tolist() == [0, 0.2]
    assert frames.theta.tolist() == [0, -math.pi / 2]
    assert frames.r.tolist() == [0.4, 0]


def test_limits_are_converted_and_what_is_missing_is_marked(tmp_path: Path) -> None:
    text = (
        "alpha [deg],a [mm],d,theta,type,q_min,q_max,velocity_limit,acceleration_limit,"
        "torque_limit\n"
        "0,0,0,0,R,-90,180,45,90,12\n0,0,0,0,P,-50,250,100,,\n"
    )
    draft = draft_robot(read(tmp_path, text), (0, 0, -9.81))
    robot = parse_robot(filled(draft), "draft")
    assert robot.q_min.tolist() == pytest.approx([-math.pi / 2, -0.05])
    assert robot.q_max.tolist() == pytest.approx([math.pi, 0.25])
    assert robot.velocity_limit.tolist() == pytest.approx([math.pi / 4, 0.1])
    assert robot.acceleration_limit[0] == pytest.approx(math.pi / 2)
    assert robot.torque_limit[0] == 12
    with pytest.raises(FileError, match="must be stated") as caught:
        parse_robot(draft, "draft.yaml")
    assert len(str(caught.value).splitlines()) == 3 + 5


def test_a_rounded_quarter_turn_is_one_and_is_stated(tmp_path: Path) -> None:
    table = read(tmp_path, "alpha [rad],a,d,theta\n1.5708,0,0,0\n0,0,0,-3.1416\n")
    assert table.frames.alpha[1] == math.pi / 2
    assert table.frames.theta[1] == -math.pi
    assert table.rounded == pytest.approx(3.1416 - math.pi)


HEAD = "alpha [deg],a,d,theta,type\n"


def test_whole_degrees_are_degrees(tmp_path: Path) -> None:
    for begin in range(-360, 361, 30):
        rows = [f"{angle},0,0,0,R\n" for angle in range(begin, begin + 30)]
        frames = read(tmp_path, HEAD + "".join(rows), "modified").frames
        assert np.degrees(frames.alpha) == pytest.approx(np.arange(begin, begin + 30))


WRONG = {
    "nothing": ("", r"t.csv:1: has no rows"),
    "no rows": (HEAD, r"joints: "),
    "no units": ("alpha,a,d,theta\n0,0,0,0\n", r"t.csv:1: the unit of angles is missing; write"),
    "an unknown unit": ("alpha [grad],a,d,theta\n0,0,0,0\n", r"t.csv:1: angles: 'grad': "),
    "two units": ("alpha [deg],a,d,theta [rad]\n", r"t.csv:1: rad of theta must be deg"),
    "a missing column": ("alpha [deg],a,theta\n", r"t.csv:1: has no column d"),
    "an unknown column": ("alpha [deg],a,d,theta,mass\n", r"t.csv:1: 'mass' must be one of alpha"),
    "a column twice": ("alpha [deg],a,a,theta,d\n", r"t.csv:1: a is stated twice"),
    "a short row": (HEAD + "0,0,0\n", r"t.csv:2: 3 cells must be 5"),
    "text": (HEAD + "0,0,0,0,R\n\n0,long,0,0,R\n", r"t.csv:4: joints.1.a: 'long' must be a number"),
    "no number": (HEAD + "0,1 m,0,0,R\n", r"t.csv:2: joints.0.a: '1 m' is not an expression"),
    "an unknown type": (HEAD + "0,0,0,0,ball\n", r"t.csv:2: joints.0.type: 'ball': must be"),
    "an empty cell": (HEAD + ",0,0,0,R\n", r"t.csv:2: joints.0.alpha: missing"),
    "a variable elsewhere": (
        HEAD + "0,0,d1,0,R\n", r"t.csv:2: joints.0.d: 'd1' must be a number; only theta of a rev"),
    "a variable with a factor": (HEAD + "0,0,0,-q1,R\n", r"'-q1' must be a number; only theta"),
    "a variable squared": (HEAD + "0,0,0,q1*q1+q1,R\n", r"must be linear in"),
    "degrees for rad": (
        "alpha [rad],a,d,theta\n90,0,0,0\n", r"t.csv:2: joints.0.alpha: 90 rad must be within"),
    "rad for degrees": (
        HEAD + "1.5708,0,0,0,R\n", r"t.csv:2: joints.0.alpha: 1.5708 degrees look like 1\*pi/2"),
    "millimetres": (HEAD + "0,0,400,0,R\n", r"t.csv:2: joints.0.d: 400 m must be within \+-20 m"),
    "an empty range": (
        "alpha [deg],a,d,theta,q_min,q_max\n0,0,0,0,90,-90\n", r"joints.0.q_max: -90 must be gre"),
    "too many joints": (HEAD + "0,0,0,0,R\n" * 31, r"t.csv:32: 31 rows must be at most 30"),
    "bytes": ("\0", r"t.csv:"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_stated_with_its_line(tmp_path: Path, case: str) -> None:
    text, message = WRONG[case]
    with pytest.raises(FileError, match=message) as caught:
        read(tmp_path, text)
    assert len(str(caught.value).splitlines()) == 1, caught.value
