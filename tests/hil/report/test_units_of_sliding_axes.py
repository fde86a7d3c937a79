"""Prismatic axes have units of m and N in tables, plots and recordings."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from hil.commands.diagnose import shifted_sinusoid
from hil.commands.payload import load_chart
from hil.estimation.absent_parameters import Phase, Sinusoid
from hil.estimation.drive_train import compliance_units
from hil.model.robot import Robot
from hil.planning.free_motion import FreeMotion
from hil.planning.measurement import ELEMENT_KINDS
from hil.results.load_file import ElementRecord
from hil.runs.recording import Recording
from hil.runs.recording_file import Measured, read_measured, write_measured

ROBOTS = Path(__file__).parents[2] / "robots"


@pytest.fixture(scope="module")
def scara() -> Robot:
    robot = Robot.load(ROBOTS / "scara.yaml")
    assert set(robot.revolute) == {True, False}
    return robot


def sliding(robot: Robot) -> int:
    return int(np.flatnonzero(~robot.revolute)[0])


def test_compliances(scara: Robot, manutec: Robot) -> None:
    assert compliance_units(manutec) == "µrad/(N m)"
    assert compliance_units(scara) == "µrad/(N m) or µm/N"


def test_columns_of_a_recording(scara: Robot, tmp_path: Path) -> None:
    n, joints = 5, scara.n_joints
    still = np.full(n, -1, np.int16)
    recording = Recording(
        0.01 * np.arange(n), np.zeros((n, joints)), np.zeros((n, joints)),
        np.zeros((n, joints), np.uint8), still, still,
    )  # fmt: skip
    motion = FreeMotion(id="a", q=(0.0,) * joints, duration=0.1, source="made")
    path = tmp_path / "a.h5"
    write_measured(path, Measured(motion, recording), scara)
    with h5py.File(path) as file:
        each = list(file["tau"].attrs["unit"])
        assert [unit == "N" for unit in each] == [not turns for turns in scara.revolute]
        assert file["q"].attrs["unit"][sliding(scara)] == "m"
        assert file["time"].attrs["unit"] == "s"
    assert read_measured(path).recording.n_samples == n


def test_plots_of_a_load_and_of_a_phase(scara: Robot) -> None:
    axis = sliding(scara)
    record = ElementRecord(
        id="g1", kind="gravity", axis=axis + 1, value=1.0, standard_error=0.1, model=1.0
    )
    wave = Sinusoid(0.0, 1.0, 0.0)
    phase = Phase(
        axis=axis + 1, over=1, q=(0.0,) * scara.n_joints, stated=wave, extended=wave,
        angle=(0.0,), torque=(0.0,), standard_error=(0.0,),
    )  # fmt: skip
    (load,) = load_chart([record], [record], ELEMENT_KINDS["gravity"], scara)
    (shift,) = shifted_sinusoid(phase, "sz1", scara)
    assert load.y_label == f"{ELEMENT_KINDS['gravity'].quantity} [N]"
    assert shift.y_label.endswith("[N]")
