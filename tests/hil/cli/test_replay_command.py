"""`hil replay`: page and exit status."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING

from carriage_run import carriage, carriage_run, noisy_run

from hil.results.model import Model

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil


def test_the_command_writes_a_page_and_its_status_says_whether_a_limit_was_passed(
    tmp_path: Path, hil: Hil
) -> None:
    folder = carriage_run().save(tmp_path / "run").path
    carriage().save(tmp_path / "model.yaml")
    command = "replay", folder, "--model", tmp_path / "model.yaml", "--max-error"
    status, out, _ = hil(*command, "20mm")
    assert status == 0
    assert "rms error" in out
    assert "all position errors are within their limits" in out
    page = (folder / "replay.html").read_text()
    assert 'id="plot-positions"' in page
    carriage(6.0).save(tmp_path / "model.yaml")
    status, out, _ = hil(*command, "20mm")
    assert status == 3
    assert "mm, at most 20.0 mm allowed" in " ".join(out.split())
    assert hil(*command, "2")[0] == 1
    assert hil(*command, "20mm", "--kp", "5")[0] == 2


def test_the_values_of_the_robot_s_file_are_simulated_beside(tmp_path: Path, hil: Hil) -> None:
    folder = carriage_run().save(tmp_path / "run").path
    carriage().save(tmp_path / "model.yaml")
    assert hil("export", tmp_path / "model.yaml", "--to", "urdf", "-o", tmp_path / "x")[0] == 0
    (urdf,) = (tmp_path / "x").glob("*.urdf") if (tmp_path / "x").is_dir() else (tmp_path / "x",)
    lighter = re.sub(r'mass value="([^"]+)"', 'mass value="80"', urdf.read_text())
    (tmp_path / "file.urdf").write_text(lighter)
    command = "replay", folder, "--model", tmp_path / "model.yaml", "--json"
    status, out, _ = hil(*command, "--before", tmp_path / "file.urdf")
    assert status == 0
    found = json.loads(out)
    assert found["before"][0] > 5 * found["rms"][0]
    assert "values of the robot" in (folder / "replay.html").read_text()
    (tmp_path / "file.urdf").write_text(urdf.read_text())
    same = json.loads(hil(*command, "--before", tmp_path / "file.urdf")[1])
    assert same["before"][0] < 0.5 * found["before"][0]  # a URDF has no offset


def test_a_refined_model_states_both_errors_and_serves_the_commands_after_it(
    tmp_path: Path, hil: Hil
) -> None:
    folder = noisy_run(carriage()).save(tmp_path / "run").path
    status, out, _ = hil("identify", folder, "--refine", "simulation", "--json")
    assert status == 0
    found = json.loads(out)["refinement"]
    model = Model.load(folder)
    assert model.refinement is not None
    assert found == json.loads(model.refinement.model_dump_json())
    for command in ("report", folder), ("replay", folder, "--model", folder):
        assert hil(*command)[0] == 0
    words = " ".join((folder / "report.html").read_text().split())
    assert "Simulated positions, held out" in words
