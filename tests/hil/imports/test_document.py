"""docs/reference/recordings.md: its commands print the stated output; it
names every key and unit.
"""

import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from small_recording import ROBOT, table, write_csv

from hil import cli
from hil.imports import tables
from hil.imports.map_file import Check, Format, MappedJoint, Position, RecordingMap, Torque
from hil.imports.readers import ARRAYS, BAGS, HDF5, PARQUET, TEXT

ROOT = Path(__file__).parents[3]
DOCUMENT = (ROOT / "docs" / "reference" / "recordings.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w*)\n(.*?)```", DOCUMENT, re.DOTALL)


def write_recording(folder):
    """Write the documented `arm.csv`: polled in time, with a gap."""
    even = table(30.0)["t"]
    columns = table(time=even + np.random.default_rng(5).uniform(0, 0.002, len(even)))
    recorded = {
        "time [s]": columns["t"],
        **{f"q{j} [deg]": np.degrees(columns[f"q{j}"]) for j in (1, 2)},
        **{f"i{j} [A]": columns[f"m{j}"] / gain for j, gain in ((1, 2.5), (2, 1.2))},
    }
    kept = {name: np.delete(values, np.s_[3000:3100]) for name, values in recorded.items()}
    write_csv(folder / "arm.csv", kept, form="{:.6f}")
    (folder / "arm.yaml").write_text(ROBOT.replace("name: pair", "name: arm"))


def test_its_commands_print_what_it_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_recording(tmp_path)
    for language, block in BLOCKS:
        if language == "yaml":
            Path("map.yaml").write_text(block)
            continue
        command, _, printed = block.removeprefix("$ hil ").partition("\n")
        with pytest.raises(SystemExit) as left:
            cli.main(command.split())
        assert not left.value.code
        assert capsys.readouterr().out == printed


@pytest.mark.parametrize(
    "names",
    [
        *(model.model_fields for model in (RecordingMap, MappedJoint, Position, Torque, Format)),
        *map(
            get_args, (tables.TimeUnit, tables.PositionUnit, tables.VelocityUnit, tables.TorqueUnit)
        ),
        get_args(Check),
        (*TEXT, *ARRAYS, *HDF5[:2], *PARQUET[:1], *BAGS, ".mat"),
    ],
)
def test_it_names_every_key_unit_check_and_ending(names):
    assert [name for name in names if f"`{name}`" not in DOCUMENT] == []
