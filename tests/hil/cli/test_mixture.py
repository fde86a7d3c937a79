"""Runs of several kinds on the command line, identified and reported together."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import write_free_run
from small_run import write_run
from trajectory_run import recorded, some_trajectory
from twin_recordings import scale_gains

from hil import regression
from hil.planning.free_motion import FreeMotion
from hil.results.model import Model
from hil.runs.run import Run

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil

    from hil.model.robot import Robot


def test_strokes_and_an_import_are_one_identification(
    hil: Hil, manutec: Robot, tmp_path: Path
) -> None:
    ((trajectory, recording),) = recorded(manutec, some_trajectory(manutec), noise=0.002)
    duration = float(np.ptp(recording.time))
    motion = FreeMotion(id="csv", q=trajectory.q, duration=duration, cycles=2, source="made")
    first, csv = tmp_path / "first", tmp_path / "csv"
    write_run(first, manutec)
    write_free_run(csv, manutec, [(motion, recording)])

    status, out, _ = hil("identify", first, csv)
    assert status == 0
    assert "joint method" in out
    model = Model.load(first)
    assert model.method == "joint"
    assert model.provenance.together_with == (str(csv),)

    status, _, _ = hil("report", first)
    assert status == 0
    page = (first / "report.html").read_text()
    assert f"together with {csv}; as here" in page


@pytest.mark.usefixtures("skip_causes")
def test_unknown_gains_of_an_import_are_found_beside_strokes(
    manutec: Robot, tmp_path: Path
) -> None:
    ((trajectory, recording),) = recorded(manutec, some_trajectory(manutec), noise=0.01)
    duration = float(np.ptp(recording.time))
    motion = FreeMotion(id="csv", q=trajectory.q, duration=duration, cycles=2, source="made")
    truth = {axis: 10.0 * axis for axis in range(1, manutec.n_joints + 1)}
    first, csv = tmp_path / "first", tmp_path / "csv"
    write_run(first, manutec)
    run = write_free_run(csv, manutec, scale_gains([(motion, recording)], truth))

    found = regression(Run.open(first), run).fit()
    alone = regression(run).fit()
    for axis, gain in truth.items():
        name = f"axis {axis} gain"
        assert abs(found.params[name] - gain) < 4 * found.bse[name]
        assert found.bse[name] < min(0.01 * gain, alone.bse[name])
