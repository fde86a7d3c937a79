"""Packaged recordings equal those of the virtual pan-tilt head."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "pan_tilt"
SECONDS = 6.0


@pytest.fixture(scope="module")
def record() -> Any:
    """Script that makes the recordings."""
    spec = importlib.util.spec_from_file_location("record", EXAMPLE / "record.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_they_are_made_again_by_their_script(record: Any, tmp_path: Path) -> None:
    """The first seconds of one recording are measured anew, with one period of its trajectory."""
    plan = (EXAMPLE / "other.plan.yaml").read_text().replace("cycles: 3", "cycles: 1")
    plan = re.sub(r"file: .*", f"file: {record.ROBOT}", plan)
    (tmp_path / "plan.yaml").write_text(plan)
    record.write(record.measured(tmp_path / "plan.yaml"), tmp_path / "other.csv.gz")
    kept, made = (
        np.genfromtxt(folder / "other.csv.gz", delimiter=",", skip_header=1)
        for folder in (EXAMPLE, tmp_path)
    )
    n = round(SECONDS / (kept[1, 0] - kept[0, 0]))
    assert np.ptp(kept[:n, 1]) > 50
    np.testing.assert_allclose(made[:n], kept[:n], atol=1.5e-3)  # a digit, on another machine


def test_their_plant_is_the_twin_of_the_robot_that_was_planned_for(
    record: Any, tmp_path: Path
) -> None:
    command = [sys.executable, "-m", "sim_plant", "twin", str(record.ROBOT), "-o", str(tmp_path)]
    subprocess.run(command, check=True, capture_output=True)  # noqa: S603 - our own program
    assert (tmp_path / "plant.yaml").read_text() == (EXAMPLE / "plant.yaml").read_text()
