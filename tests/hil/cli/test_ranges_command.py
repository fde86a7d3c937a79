"""`hil export --to ranges` of a carriage's recording."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
from carriage_run import carriage_run

import hil as package

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil


def test_ranges_are_drawn_about_the_identified_mass(tmp_path: Path, hil: Hil) -> None:
    folder = carriage_run().save(tmp_path / "run").path
    hil("identify", folder)
    status, out, _ = hil("export", folder, "--to", "ranges", "-o", tmp_path / "sim", "--force")
    assert status == 0
    assert "emps.ranges.json" in out
    (path,) = (tmp_path / "sim").iterdir()
    content, model = json.loads(path.read_text()), package.Model.load(folder)
    masses = np.array([each["mass"][0] + each["armature"][0] for each in content["samples"]])
    assert len(masses) == 50
    assert abs(masses.mean() - model.values[0]) < 0.5 * model.standard_errors[0]
    np.testing.assert_allclose(masses.std(), model.standard_errors[0], rtol=0.35)
