"""A joint without motor has torque 0: stated in the map, identified by the other joints."""

import numpy as np
import pytest
from small_recording import ROBOT, a_map, table, write_csv, write_map

import hil
from checked_files.yaml_file import FileError
from hil.errors import HilError
from hil.imports.importing import import_recordings
from hil.least_squares.standstill import share_at_top
from hil.model.robot import parse_robot

ARM = ROBOT.replace("q_min: -2,", "q_min: -4,").replace("q_max: 2,", "q_max: 4,")
ARM = ARM.replace("q_min: -2.5, q_max: 2.5", "q_min: -4, q_max: 4").replace(
    "limit: 10", "limit: 30"
)
TRUE = {"I1": 0.6, "S1": 1.5, "I2": 0.15, "S2": 0.5, "m2": 1.2, "l": 0.5}
VISCOUS = 0.02
"""Friction of the joint without motor [N m s/rad]."""


def swung(duration=16.0, rate=200.0):
    """Return columns of a pendulum hanging without motor on a driven link."""
    I1, S1, I2, S2, m2, l = TRUE.values()  # noqa: E741
    h, x, rows = 1.0 / (4.0 * rate), np.array([-np.pi / 2, 0.0, 0.0, 0.0]), []

    def slope(x, drive):
        q1, q2, v1, v2 = x
        c, s, g2 = l * S2 * np.cos(q2), l * S2 * np.sin(q2), 9.81 * S2 * np.cos(q1 + q2)
        friction = 0.5 * v1 + np.tanh(v1 / 0.02)
        first = drive + s * (2 * v1 * v2 + v2**2) - 9.81 * (S1 + m2 * l) * np.cos(q1) - g2
        second = -s * v1**2 - g2 - VISCOUS * v2
        a, b, d = I1 + I2 + m2 * l**2 + 2 * c, I2 + c, I2
        det = a * d - b * b
        first -= friction
        return np.array([v1, v2, (d * first - b * second) / det, (a * second - b * first) / det])

    for k in range(round(4 * rate * duration)):
        drive = 9.0 * np.sin(2 * np.pi * 0.31 * k * h) + 6.3 * np.sin(2 * np.pi * 0.83 * k * h + 1)
        drive += 3.6 * np.sin(2 * np.pi * 1.37 * k * h + 2)
        if k % 4 == 0:
            rows.append([k * h, *x, drive])
        middle = x + h / 2 * slope(x + h / 2 * slope(x, drive), drive)
        x = x + h * slope(middle, drive)
    t, q1, q2, v1, v2, m1 = np.array(rows).T
    m1 = m1 + 0.02 * np.random.default_rng(3).standard_normal(len(t))
    return {"t": t, "q1": q1, "q2": q2, "v1": v1, "v2": v2, "m1": m1, "m2": 0 * t}


COLUMNS = swung()


def imported(folder, torque, columns=COLUMNS, **changes):
    """Import a recording with `torque` as the second joint's; return run and statement."""
    content = a_map(**changes)
    content["joints"][1]["torque"] = torque
    if torque is None:
        del content["joints"][1]["torque"]
    write_csv(folder / "data.csv", columns)
    the_map = write_map(folder, content)
    (folder / "pair.yaml").write_text(ARM)
    stated = []
    return import_recordings([the_map], folder / "run", stated.append), stated[0]


ZEROS = {"column": "m2", "unit": "N m"}


def test_a_joint_without_motor_is_identified_with_its_friction(tmp_path):
    run, statement = imported(tmp_path, 0)
    assert statement.doubts == ()
    model = hil.identify(run)
    assert model.verdict.word == "good", str(model.verdict)
    named = dict(zip([f"p{k}" for k in range(1, 7)], model.values, strict=True))
    expected = {"p4": TRUE["I2"], "p5": TRUE["S2"], "p2": TRUE["S1"] + TRUE["l"] * TRUE["m2"]}
    assert {name: named[name] for name in expected} == pytest.approx(expected, rel=0.01)
    law = model.details.axes[1]
    assert law.plain["viscous"].value == pytest.approx(VISCOUS * law.speed, rel=0.02)
    assert 0 < law.plain["viscous"].standard_error < 0.1 * VISCOUS * law.speed
    text = str(model)
    assert "inf" not in text.replace("inform", "")
    assert "samples have the same maximum torque" not in text


def test_the_robot_of_the_run_has_no_unknown_rotor_at_this_joint(tmp_path):
    run, _ = imported(tmp_path, 0)
    first, second = run.robot.file.joints
    assert (second.drive.rotor_inertia, second.drive.gear_ratio) == (0, 20)
    assert first.drive.rotor_inertia == "unknown"


def test_a_missing_torque_names_both_remedies(tmp_path):
    with pytest.raises(FileError, match=r"joints\.1\.torque: missing; add this key, or torque: 0"):
        imported(tmp_path, None)


def test_a_column_of_zeros_names_both_remedies(tmp_path):
    with pytest.raises(FileError, match=r"is 0 throughout; .*, or write torque: 0 if the joint"):
        imported(tmp_path, ZEROS)


def test_another_constant_has_no_such_remedy(tmp_path):
    with pytest.raises(FileError) as refused:
        imported(tmp_path, ZEROS, COLUMNS | {"m2": 0 * COLUMNS["t"] + 2.0})
    assert "is 2 throughout; name the column of its torque;" in str(refused.value)


def test_a_wrong_sign_of_the_driven_joint_is_still_refused(tmp_path):
    with pytest.raises(FileError, match=r"joints\.0\.torque\.sign"):
        imported(tmp_path, 0, COLUMNS | {"m1": -COLUMNS["m1"]})


def test_arrays_of_zeros_are_identified_where_the_robot_has_no_rotor():
    robot = parse_robot(ARM.replace("rotor_inertia: unknown", "rotor_inertia: 0"), "arm.yaml")
    q, tau = (np.column_stack([COLUMNS[f"{key}{j}"] for j in (1, 2)]) for key in "qm")
    with pytest.raises(HilError, match=r"state rotor_inertia: 0 in the robot file if the"):
        hil.Run.import_arrays(robot, COLUMNS["t"], q, tau)
    model = hil.identify(hil.Run.import_arrays(robot, COLUMNS["t"], q, tau, accept=["still"]))
    assert model.values[3] == pytest.approx(TRUE["I2"], rel=0.01)


def test_velocities_follow_the_columns_of_a_joint_without_motor(tmp_path):
    run, _ = imported(tmp_path, 0, velocity=True)
    recording = next(iter(run)).recording
    assert recording.qd[:, 1] == pytest.approx(COLUMNS["v2"][: len(recording.qd)])
    assert not recording.tau[:, 1].any()


def test_a_torque_of_zero_is_no_limit():
    assert share_at_top(np.zeros(100)) == 0.0
    assert share_at_top(np.full(100, 3.0)) == 1.0


def test_motions_of_all_joints_with_motors_keep_their_columns(tmp_path):
    columns = table(10.0)
    run, _ = imported(tmp_path, ZEROS, columns)
    recording = next(iter(run)).recording
    assert recording.tau[:, 1] == pytest.approx(columns["m2"][: len(recording.tau)])
