"""`hil export --patch`: written files, and incompatible options."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from mjcf_robots import ONE_JOINT, write_arm
from possible_models import model_of

from hil.export.patch import patched_file
from hil.model.base_parameters import base_parameters
from hil.model.robot import Robot

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil


def test_a_patched_file_is_written_with_those_that_it_includes(tmp_path: Path, hil: Hil) -> None:
    pytest.importorskip("mujoco")
    arm = write_arm(tmp_path / "arm", wrist=ONE_JOINT)
    robot = Robot.load(arm)
    file = patched_file(arm, robot)
    standard = np.concatenate([file.bodies().ravel(), file.rotors()])
    values = base_parameters(robot).matrix @ standard
    model_of(robot, values, 1e-6 + 0.0 * values).save(tmp_path / "model.yaml")
    command = "export", tmp_path / "model.yaml", "--to", "mjcf", "--patch", arm
    status, out, _ = hil(*command, "-o", tmp_path / "sim")
    assert status == 0
    assert "kept as they were: " in out
    assert (tmp_path / "sim/parts/wrist.xml").exists()
    assert (
        hil("export", tmp_path / "model.yaml", "--to", "c", "--patch", arm, "-o", tmp_path)[0] == 2
    )
