"""Robot files: derived values, and messages of refusals."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from checked_files.yaml_file import FileError
from hil.cli.plan_view import render_robot
from hil.errors import UnknownName
from hil.model.polynomial import parse
from hil.model.robot import Robot, available_robots, parse_robot
from hil.terminal.console import out


@pytest.fixture
def text(manutec) -> str:
    return manutec.text


def refusal(text: str, old: str, new: str) -> str:
    """Return the message for a robot file with the first `old` replaced by `new`."""
    assert old in text
    with pytest.raises(FileError) as caught:
        parse_robot(text.replace(old, new, 1), "robot.yaml")
    return str(caught.value)


def test_a_value_that_may_be_a_number_or_a_word_has_one_line_with_the_key_as_it_is_written(text):
    message = refusal(text, "torque_limit: 945", "torque_limit: unknwon")
    assert message == (
        "robot.yaml:18: joints.0.torque_limit: 'unknwon': must be a valid number, unable to parse"
        " string as a number, or must be 'unknown'"
    )


def test_a_missing_key_is_named_where_it_should_stand(text):
    message = refusal(text, "torque_limit: 945", "# nothing")
    assert "joints.0.torque_limit: missing; add this key" in message


def test_manutec_r15_is_the_papers_robot(manutec):
    assert manutec.n_joints == 6
    assert np.degrees(manutec.alpha).round(9).tolist() == [0, -90, 0, 90, -90, 90]
    assert manutec.d.tolist() == [0, 0, 0.5, 0, 0, 0]
    assert manutec.r.tolist() == [0, 0, 0, 0.73, 0, 0]
    assert manutec.gravity.tolist() == [0, 0, -9.81]
    assert len(manutec.present) == 26
    assert manutec.ties == {"Iyy6": "Ixx6"}


def test_limits_and_drive_trains_are_arrays_by_joint(manutec):
    assert np.degrees(manutec.q_max).round().tolist() == [165, 110, 150, 190, 115, 265]
    assert manutec.q_min.tolist() == (-manutec.q_max).tolist()
    assert manutec.velocity_limit.tolist() == [3.0, 1.5, 5.2, 3.1, 3.1, 4.1]
    assert manutec.acceleration_limit.tolist() == [15, 15, 15, 60, 60, 60]
    assert manutec.torque_limit.tolist() == [945, 1890, 540, 210, 186, 75]
    assert manutec.gear_ratio.tolist() == [105, 210, 60, 99, 79.2, 99]
    assert manutec.rotor_inertia.tolist() == [1.3e-3, 1.3e-3, 1.3e-3, 1.6e-4, 1.8e-4, 4.3e-5]
    assert manutec.torque_constant.tolist() == [1.1616, 1.1616, 1.1616, 0.2365, 0.2608, 0.0842]
    assert not manutec.rotor_inertia_uncertainty.any()
    assert not manutec.torque_constant_uncertainty.any()


def test_a_robot_cannot_be_changed(manutec):
    with pytest.raises(dataclasses.FrozenInstanceError):
        manutec.text = ""
    with pytest.raises(ValueError, match="read-only"):
        manutec.q_max[0] = 9.0


def test_a_robot_is_loaded_by_name_or_by_path(manutec, tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(manutec.text)
    assert Robot.load(path) == Robot.load(str(path)) == manutec
    assert Robot.load(path).source == str(path)
    assert Path(manutec.source).read_text() == manutec.text


def test_an_unknown_robot_lists_those_that_come_along():
    with pytest.raises(UnknownName, match=r"r2d2: unknown robot; available: .*manutec-r15"):
        Robot.load("r2d2")
    assert all("drives" not in name for name in available_robots())


def test_a_file_that_is_not_there_is_named():
    with pytest.raises(FileError, match=r"nowhere/robot\.yaml: cannot be read: No such file"):
        Robot.load("nowhere/robot.yaml")


def test_digest_is_of_the_content_and_not_of_the_layout(text):
    same = parse_robot(
        "# a comment\n" + text.replace("[0, 0, -9.81]", "[0,  0.0,  -9.810]"), "other.yaml"
    )
    other = parse_robot(text.replace("l1: 0.50", "l1: 0.51"), "robot.yaml")
    assert same.digest == Robot.load("manutec-r15").digest
    assert other.digest != same.digest
    assert len(same.digest) == 64


def test_all_ten_parameters_are_present_by_default(chains):
    assert len(chains.robot(chains.joint(), chains.joint()).present) == 20


def test_frames_may_be_written_in_lengths_and_pi(chains):
    robot = chains.robot(chains.joint(alpha="-3*pi/4", d="2*a - b/3 + 0.1", r="-(a + b)"))
    assert robot.alpha[0] == pytest.approx(-3 * math.pi / 4)
    assert robot.d[0] == pytest.approx(0.55)
    assert robot.r[0] == pytest.approx(-0.75)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("q_max: 2.880", "q_max: 165", "165 rad must be within +-20 rad: it looks like degrees"),
        ("q_max: 2.880", "q_max: 165", "write 2.88"),
        ("q_max: 2.880", "q_max: 165", "many turns"),
        ("q_max: 2.880", "q_max: -2.9", "-2.9 rad must be greater than q_min = -2.88 rad"),
        ("velocity_limit: 3.0", "velocity_limit: -1.2", "-1.2 rad/s must be positive"),
        ("velocity_limit: 3.0", "velocity_limit: 172", "it looks like degrees; write 3.002"),
        ("acceleration_limit: 15", "acceleration_limit: 0", "0 rad/s2 must be positive"),
        ("torque_limit: 945", "torque_limit: 9.45e5", "945000 N m must be at most 100000 N m"),
        ("torque_limit: 945", "torque_limit: .inf", "finite"),
        ("gear_ratio: 105", "gear_ratio: -105", "-105 must be positive"),
        ("gear_ratio: 105", "gear_ratio: 105000", "gear_ratio 105000 must be at most 10000"),
        ("rotor_inertia: 1.3e-3", "rotor_inertia: 13", "it looks like kg cm2"),
        ("torque_constant: 1.1616", "torque_constant: 1161.6", "it looks like mN m/A"),
        ("alpha: -pi/2", "alpha: -90", "it looks like degrees; write -1.5708, or pi/2"),
        ("alpha: -pi/2", "alpha: -1.57", "-1.57 rad is a rounded -1 pi/2; write -1*pi/2"),
        ("alpha: -pi/2", "alpha: l1", "must be an angle in rad"),
        ("alpha: -pi/2", "alpha: __import__('os')", "is not an expression"),
        ("d: l1", "d: l3", "l3 is not a length; known are l1, l2 in lengths"),
        ("d: l1", "d: 500", "500 m must be within +-20 m: it looks like millimetres"),
        ("d: l1", "d: l1 / l2", "is not an expression"),
        ("l1: 0.50", "l1: 500", "l1 looks like millimetres"),
        ("l1: 0.50", "l1: -0.50", "-0.5 m must be positive"),
        ("{l1: 0.50", "{m3: 0.50, l1: 0.50", "'m3' cannot name a length"),
        ("gravity: [0, 0, -9.81]", "gravity: [0, 0, -9810]", "9.81 on Earth"),
        ("gravity: [0, 0, -9.81]", "gravity: [0, -9.81]", "missing; add this key"),
        ("parameters: [Izz]", "parameters: [Izz, Izz]", "Izz is stated twice; remove one"),
        ("parameters: [Izz]", "parameters: [Jzz]", "must be 'Ixx'"),
        ("Iyy6 = Ixx6", "Iyy6 = Iyy1", "Iyy1 is not present; add it to its joint's parameters"),
        ("Iyy6 = Ixx6", "Iyy6 = sz6", "Iyy6 and sz6 have different units"),
        ("Iyy6 = Ixx6", "Iyy6 = Iyy6", "Iyy6 is tied twice or to itself"),
        ("- Iyy6 = Ixx6", "- Iyy6 = Ixx6\n  - Iyy6 = Izz6", "Iyy6 is tied twice"),
        ("- Iyy6 = Ixx6", "- Iyy6 = Ixx6\n  - Ixx6 = Izz6", "tie Iyy6 to what Ixx6 is tied to"),
        ("Iyy6 = Ixx6", "Iyy6 is Ixx6", "must read as in: Iyy6 = Ixx6"),
        ("name: manutec-r15", "name: ''", "'' must begin with a letter or digit"),
        ("q_max: 2.880", "qmax: 2.880", "unknown key; remove it or correct its spelling"),
        ("velocity_limit: 3.0\n", "\n", "missing; add this key"),
    ],
)
def test_what_is_wrong_is_said_with_value_bound_and_remedy(text, old, new, message):
    assert message in refusal(text, old, new)


def test_the_line_and_the_field_are_named(text):
    line = text[: text.index("velocity_limit: 5.2")].count("\n") + 1
    message = refusal(text, "velocity_limit: 5.2", "velocity_limit: -1.2")
    assert message == (f"robot.yaml:{line}: joints.2.velocity_limit: -1.2 rad/s must be positive")


def test_problems_across_fields_are_all_named_with_their_lines(text):
    wrong = text.replace("d: l1", "d: l3").replace("r: l2", "r: l4 + l5")
    with pytest.raises(FileError) as caught:
        parse_robot(wrong, "robot.yaml")
    lines = str(caught.value).splitlines()
    assert [line.split(": ")[1] for line in lines] == [
        "joints.2.frame.d",
        "joints.3.frame.r",
        "joints.3.frame.r",
    ]
    at = wrong[: wrong.index("l4 + l5")].count("\n") + 1
    assert lines[1] == (
        f"robot.yaml:{at}: joints.3.frame.r: l4 is not a length; known are l1, l2 in lengths"
    )


def test_sliding_joints_are_judged_in_metres(chains):
    slide = chains.joint("prismatic")
    with pytest.raises(FileError, match=r"400 m must be within .* it looks like millimetres"):
        chains.robot(slide.replace("q_max: 1", "q_max: 400"))
    with pytest.raises(FileError, match="-2 m/s must be positive"):
        chains.robot(slide.replace("velocity_limit: 1", "velocity_limit: -2"))


def test_polynomials_multiply_add_and_evaluate():
    square = parse("l1 - 2*l2") * parse("l1 - 2*l2")
    assert square.terms == {("l1", "l1"): 1.0, ("l1", "l2"): -4.0, ("l2", "l2"): 4.0}
    assert square.evaluate({"l1": 3.0, "l2": 0.5}) == 4.0
    assert not square - square


def test_the_view_names_joints(manutec, capsys):
    text = manutec.text.replace("- frame", "- name: base\n    frame", 1)
    render_robot(parse_robot(text, "manutec.yaml"))
    assert "base (revolute)" in capsys.readouterr().out


def test_the_view_shows_table_1_equation_22_by_group_and_table_2(manutec, monkeypatch, capsys):
    monkeypatch.setattr(out, "_width", 120)
    render_robot(manutec)
    shown = capsys.readouterr().out
    for piece in (
        "Ixx6, Iyy6 = Ixx6, Izz6, sz6, m6",
        "Ixx3 - Iyy3 + Iyy4 + 2 l2 sz4 + l2^2 (m4 + m5 + m6)",
        "l1 = 0.5 m, l2 = 0.73 m",
        "1, 2, 6, 8-14",
        "5, 8, 13",
    ):
        assert piece in shown
    order = [shown.index(f"\n p{k} ") for k in (5, 8, 13, 1, 2, 14, 3)]
    assert order == sorted(order)


def test_more_joints_than_any_robot_has_are_refused(chains):
    with pytest.raises(FileError, match=r"joints: .*at most 30 items"):
        chains.robot(*[chains.joint()] * 31)
