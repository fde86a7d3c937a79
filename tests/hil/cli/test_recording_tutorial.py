"""docs/tutorials/recording.md: its commands work in sequence and print the stated output."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
import yaml
from real_recordings import DATA, at_hand

from hil.ground_truth.true_parameters import true_parameters
from hil.results.model import Model

if TYPE_CHECKING:
    from command_line import Hil

ROOT = Path(__file__).parents[3]
TEXT = (ROOT / "docs" / "tutorials" / "recording.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"(?m)^hil .*$", TEXT)
PLANT = ROOT / "examples" / "pan_tilt" / "plant.yaml"
"""Virtual plant of the recordings."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("tutorial")
    (made / "examples").symlink_to(ROOT / "examples")
    return made


def test_every_step_works_and_the_verdict_is_the_one_that_stands_there(
    hil: Hil, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    assert len(COMMANDS) == 6
    printed = ""
    for line in COMMANDS:
        status, out, err = hil(*line.split()[1:])
        assert (status, err) == (0, ""), line
        printed += out
    (stands,) = re.findall(r"(?m)^good: torque pred.*$", TEXT)
    assert stands in printed
    rows = re.findall(r"(?m)^ \d  .*$", TEXT)
    assert len(rows) == 4
    assert all(row.split() in [line.split() for line in printed.splitlines()] for row in rows)
    model = Model.load("runs/head")
    truth, (low, high) = true_parameters(model.robot, PLANT), model.interval().T
    inside = (low <= truth) & (truth <= high)
    assert inside.sum() == 7
    missed = np.maximum(low - truth, truth - high)[~inside] / (high - low)[~inside]
    assert (missed < 0.1).all()


def test_the_map_that_is_shown_is_the_one_that_comes_along() -> None:
    (shown,) = re.findall(r"```yaml\n(.*?)```", TEXT, re.DOTALL)
    kept = (ROOT / "examples" / "pan_tilt" / "excitation.yaml").read_text(encoding="utf-8")
    assert yaml.safe_load(shown) == yaml.safe_load(kept)


@at_hand
@pytest.mark.parametrize(
    ("name", "map_name", "files"),
    [
        ("emps", "estimation", ("estimation.csv.gz",)),
        ("tx40", "tx40", ("pos_read_data.csv.gz", "curr_data.csv.gz")),
    ],
)
def test_real_machines_take_two_commands_after_their_map(
    hil: Hil, tmp_path: Path, name: str, map_name: str, files: tuple[str, ...]
) -> None:
    there = tmp_path / f"{map_name}.yaml"
    there.write_bytes((ROOT / "examples" / name / f"{map_name}.yaml").read_bytes())
    for file in files:
        shutil.copy(DATA / name / file, tmp_path)
    run = tmp_path / "run"
    assert hil("import", there, "-o", run)[0] == 0
    status, out, _ = hil("identify", run)
    assert status == 0
    assert "the mass matrix is positive definite along the motion" in " ".join(out.split())
    model = Model.load(run)
    assert model.details.overall_residual < {"emps": 0.037, "tx40": 0.082}[name]
    if name == "emps":
        (mass,) = model.values
        assert mass == pytest.approx(95.11, rel=0.01)
