"""docs/tutorials/recording.md: its two real machines take the commands of its last table."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from real_recordings import DATA, at_hand

from hil.results.model import Model

if TYPE_CHECKING:
    from command_line import Hil

ROOT = Path(__file__).parents[3]


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
