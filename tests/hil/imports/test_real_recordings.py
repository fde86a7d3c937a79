"""Recordings of two real machines, if available."""

import numpy as np
import pytest
import yaml
from real_recordings import DATA, EMPS, at_hand

from checked_files.yaml_file import FileError
from hil.imports.importing import import_recordings

pytestmark = at_hand

TX40 = f"""
robot: staubli-tx40
files: ['{DATA}/tx40/pos_read_data.csv.gz']
time: {{rate: 5000}}
position_side: motor
torque_side: motor
joints:
"""
JOINT = """
  - position: {{column: {joint}, unit: rad, sign: {sign}}}
    torque:
      column: {{file: '{data}/tx40/curr_data.csv.gz', column: {torque}}}
      unit: N m
      sign: {sign}
"""


def tx40(torques=(1, 2, 3, 4, 5, 6)):
    """Return the map of the six axes, with their torque columns."""
    joints = enumerate(torques, start=1)
    return TX40 + "".join(
        JOINT.format(joint=joint, torque=torque, sign=-1 if joint == 4 else 1, data=DATA)
        for joint, torque in joints
    )


def imported(folder, text):
    (folder / "map.yaml").write_text(text)
    stated = []
    run = import_recordings([folder / "map.yaml"], folder / "run", stated.append, files=[DATA])
    return run, stated[0]


def test_a_carriage_that_goes_back_and_forth(tmp_path):
    run, stated = imported(tmp_path, EMPS)
    (measured,) = run
    recording, motion = measured.recording, measured.measurement
    stroke, steps = recording.stroke[1:], np.diff(recording.q[:, 0])
    assert stated.timing.instants == "even"
    assert recording.n_samples == 24_841
    assert motion.alone == 1
    assert set(stroke) == set(range(-1, 2 * motion.cycles))
    assert np.mean(steps[(stroke >= 0) & (stroke % 2 == 0)] > -1e-5) > 0.99
    assert np.mean(steps[(stroke >= 0) & (stroke % 2 == 1)] < 1e-5) > 0.99
    assert stated.suspicions == ()


def test_a_force_of_the_wrong_sign_is_refused(tmp_path):
    with pytest.raises(FileError, match="friction would accelerate joint 1"):
        imported(tmp_path, EMPS.replace("unit: V", "unit: V, sign: -1"))


def test_six_axes_with_a_coupled_wrist(tmp_path):
    run, stated = imported(tmp_path, tx40())
    (measured,) = run
    recording = measured.recording
    assert recording.n_samples == 45_000
    assert recording.period == pytest.approx(0.0002)
    assert measured.measurement.cycles == 8
    assert stated.suspicions == ()
    low, high = run.robot.q_min, run.robot.q_max
    assert np.all((recording.q > low) & (recording.q < high))


def test_torques_in_another_order_are_found(tmp_path):
    with pytest.raises(FileError, match="axes 3 and 4: torques exchanged"):
        imported(tmp_path, tx40(torques=(1, 2, 4, 3, 5, 6)))


def test_motors_taken_for_joints_are_found(tmp_path):
    text = tx40().replace("position_side: motor", "position_side: joint")
    with pytest.raises(FileError, match=r"the motor's side at a gear ratio of 32"):
        imported(tmp_path, text)


@pytest.mark.parametrize(
    ("joint", "parts", "says"),
    [
        (2, ("position", "velocity", "torque"), "axis 2: position and torque have the opposite"),
        (4, ("position", "velocity", "torque"), "axis 4: position and torque have the opposite"),
        (4, ("torque",), "axis 4: wrong sign of the torque"),
        (6, ("torque",), "friction would accelerate joint 6"),
        (1, ("torque",), "axis 1: wrong sign of the torque"),
    ],
)
def test_a_wrong_sign_of_an_arm_with_noise_that_is_not_white(tmp_path, joint, parts, says):
    text = (
        (DATA / "ur10" / "train.map.yaml")
        .read_text()
        .replace("ur10.robot", f"{DATA}/ur10/ur10.robot")
    )
    content = yaml.safe_load(text.replace("exc.db3", f"{DATA}/ur10/exc.db3"))
    for part in parts:
        content["joints"][joint - 1][part]["sign"] = -1
    with pytest.raises(FileError, match=says):
        imported(tmp_path, yaml.safe_dump(content))
