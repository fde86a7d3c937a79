"""Unknown rotor inertias, coupled motors and springs are base parameters."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
import pytest
from urdf_robots import ROBOTS, urdf

from checked_files.yaml_file import FileError
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import gravity_torque, inverse_dynamics, mass_matrix, regressor
from hil.model.robot import Robot, parse_robot

if TYPE_CHECKING:
    from pathlib import Path


LIMITS = "q_min: -3, q_max: 3, velocity_limit: unknown, acceleration_limit: unknown"
TX40 = f"""
name: tx40
gravity: [0, 0, -9.81]
lengths: {{d3: 0.225, r3: 0.035, r4: 0.225}}
joints:
  - {{frame: {{alpha: 0}}, {LIMITS}, torque_limit: unknown}}
  - {{frame: {{alpha: -pi/2}}, {LIMITS}, torque_limit: unknown}}
  - {{frame: {{alpha: 0, d: d3, r: r3}}, {LIMITS}, torque_limit: unknown}}
  - {{frame: {{alpha: pi/2, r: r4}}, {LIMITS}, torque_limit: unknown}}
  - {{frame: {{alpha: -pi/2}}, {LIMITS}, torque_limit: unknown}}
  - {{frame: {{alpha: pi/2}}, {LIMITS}, torque_limit: unknown}}
"""
COUPLED = TX40 + "couplings: [{motor: 6, joint: 5}]\n"
SPRINGS = COUPLED + "springs: [{joint: 2, shape: sine}, {joint: 3}, {joint: 5, shape: cosine}]\n"
LIFT = f"""
name: lift
gravity: [0, 0, -9.81]
joints: [{{type: prismatic, frame: {{alpha: 0}}, {LIMITS}, torque_limit: unknown}}]
"""


def load_urdf(name: str, folder: Path) -> Robot:
    path = folder / f"{name}.urdf"
    path.write_text(urdf(name, ROBOTS[name]))
    return Robot.load(path)


@pytest.mark.parametrize(
    ("name", "n_base", "own"),
    [
        ("UR10e", 40, ["Ia3", "Ia4", "Ia5", "Ia6"]),
        ("pan-tilt", 8, []),
        ("Cartesian", 3, []),  # the mass of the vertical slide includes the rotor
    ],
)
def test_inertias_that_no_link_stands_for_are_base_parameters_of_their_own(
    name: str, n_base: int, own: list[str], tmp_path: Path
) -> None:
    base = base_parameters(load_urdf(name, tmp_path))
    assert len(base) == n_base
    assert [head for head in base.heads if head.startswith("Ia")] == own


def test_a_coupled_wrist_has_one_inertia_more() -> None:
    assert len(base_parameters(parse_robot(TX40, "tx40.yaml"))) == 40
    base = base_parameters(parse_robot(COUPLED, "tx40.yaml"))
    assert (len(base), base.heads[-1], base.units[-1]) == (41, "Iam6", "kg m2")


def test_one_that_acts_as_a_link_does_merges_with_it() -> None:
    base = base_parameters(parse_robot(TX40, "tx40.yaml"))
    assert " + Iyy3 + Ia1 + " in base.expressions[0]
    assert sum("Ia2" in expression for expression in base.expressions) == 1
    lift = base_parameters(parse_robot(LIFT, "lift.yaml"))
    assert (lift.expressions, lift.units) == (("m1", "Ia1"), ("kg", "kg"))


@pytest.mark.parametrize("text", [TX40, COUPLED, SPRINGS, LIFT, LIFT + "springs: [{joint: 1}]"])
def test_torques_are_those_of_links_and_drive_trains_and_springs_together(text: str) -> None:
    robot = parse_robot(text, "robot.yaml")
    stated = "drive: {rotor_inertia: 0, torque_constant: unknown}, torque_limit"
    rigid = re.sub("(?m)^(couplings|springs).*$", "", text)
    links = parse_robot(rigid.replace("torque_limit", stated), "links")
    random = np.random.default_rng(5)
    standard = random.normal(size=len(robot.standard_parameters))
    q, qd, qdd = random.normal(size=(3, 40, robot.n_joints))
    p = base_parameters(robot).matrix @ standard
    k = base_parameters(links).matrix @ standard[: len(links.standard_parameters)]
    n = robot.n_joints
    drives = np.diag(standard[10 * n : 11 * n])
    if robot.couplings:
        drives[4, 5] = drives[5, 4] = standard[11 * n]
    load = np.zeros_like(q)
    if n == 6 and robot.file.springs:
        load[:, 1] = standard[-3] * np.sin(q[:, 1])
        load[:, 2] = standard[-2] * q[:, 2]
        load[:, 4] = standard[-1] * np.cos(q[:, 4])
    elif robot.file.springs:
        load[:, 0] = standard[-1] * q[:, 0]
    expected = inverse_dynamics(links, k, q, qd, qdd) + qdd @ drives + load
    assert regressor(robot, q, qd, qdd) @ p == pytest.approx(expected, abs=1e-9)
    assert inverse_dynamics(robot, p, q, qd, qdd) == pytest.approx(expected, abs=1e-9)
    assert mass_matrix(robot, p, q) == pytest.approx(mass_matrix(links, k, q) + drives, abs=1e-9)
    gravity = gravity_torque(links, k, q) + load
    assert gravity_torque(robot, p, q) == pytest.approx(gravity, abs=1e-9)
    some = regressor(robot, q, qd, qdd, joints=[n - 1])
    assert some == pytest.approx(regressor(robot, q, qd, qdd)[:, n - 1 :], abs=1e-12)


def test_a_spring_is_a_part_of_gravity_s_torque_unless_a_link_acts_like_it() -> None:
    base = base_parameters(parse_robot(SPRINGS, "tx40.yaml"))
    units = dict(zip(base.heads, base.units, strict=True))
    assert {name: unit for name, unit in units.items() if name[0] == "k"} == {
        "k3": "N m/rad", "kc5": "N m",
    }  # fmt: skip
    assert base.heads.index("k3") in base.groups["gravity"]
    assert sum("ks2" in expression for expression in base.expressions) == 1


def test_motors_turn_with_the_joints_that_they_are_coupled_to() -> None:
    ratios = iter([32, 33, 45, 48, 46, 31])
    drive = "drive: {{gear_ratio: {}, rotor_inertia: unknown, torque_constant: unknown}}, torque"
    text = re.sub("torque", lambda _: drive.format(next(ratios)), COUPLED)
    R = parse_robot(text, "tx40.yaml").motor_matrix
    assert np.diag(R).tolist() == [32, 33, 45, 48, 46, 31]
    assert (R[5, 4], np.count_nonzero(R)) == (31, 7)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            COUPLED.replace("joint: 5", "joint: 9"),
            r"robot.yaml:12: couplings.0.joint: 9 must be one of the 6 joints",
        ),
        (
            COUPLED.replace("joint: 5", "joint: 6"),
            r"robot.yaml:12: couplings.0.joint: 6 must be another joint than the motor's own",
        ),
        (
            COUPLED.replace("}]", "}, {motor: 6, joint: 4}]"),
            r"robot.yaml:12: couplings.1.motor: motor 6 is coupled already",
        ),
        (
            COUPLED.replace("}]", ", ratio: 0}]"),
            r"couplings.0.ratio: 0 must be within \+-100 and not 0",
        ),
        (SPRINGS.replace("joint: 3", "joint: 7"), r":13: springs.1.joint: 7 must be one of the 6"),
        (SPRINGS.replace("joint: 3}", "joint: 2, shape: sine}"), r"springs.1: is stated twice"),
        (
            LIFT + "springs: [{joint: 1, shape: sine}]",
            r"springs.0.shape: sine must be linear at a prismatic joint",
        ),
        (
            LIFT.replace("torque_l", "drive: {rotor_inertia: 1e-5, torque_constant: 1}, torque_l"),
            r"rotor_inertia 1e-05 kg m2 needs a known gear_ratio",
        ),
    ],
)
def test_what_cannot_be_is_refused(text: str, message: str) -> None:
    with pytest.raises(FileError, match=message):
        parse_robot(text, "robot.yaml")
