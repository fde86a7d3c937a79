"""Commands of the tutorials on virtual machines work in sequence."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from sim_plant.__main__ import app as sim_plant

if TYPE_CHECKING:
    import pytest
    from command_line import Hil

ROOT = Path(__file__).parents[3]
TUTORIALS = ROOT / "docs" / "tutorials"
COMMAND = re.compile(r"(?m)^(?:hil|python -m sim_plant) .*$")


def commands_of(name: str) -> list[str]:
    return COMMAND.findall((TUTORIALS / f"{name}.md").read_text(encoding="utf-8"))


def carried_out(hil: Hil, lines: list[str]) -> str:
    """Run commands and return their output."""
    printed = ""
    for line in lines:
        if line.startswith("python"):
            sim_plant(line.split()[3:], standalone_mode=False)
            continue
        status, out, err = hil(*line.split()[1:])
        assert (status, err) == (0, ""), line
        printed += out
    return printed


def test_one_axis_is_identified_and_validated_on_its_twin(
    hil: Hil, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = (TUTORIALS / "one-axis.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)
    Path("axis.yaml").write_text(shown)
    without_a_drive = [line for line in commands_of("one-axis") if "desk" not in line]
    on_the_twin = [
        line for line in without_a_drive if "socketcan" not in line and "eds" not in line
    ]
    printed = carried_out(hil, on_the_twin)
    assert len(on_the_twin) == 8
    assert re.findall(r"(?m)^good: .*$", text) == re.findall(r"(?m)^good: .*$", printed)
    assert "hold the truth for 2 of 2 parameters" in printed


def test_the_virtual_robot_is_identified_and_validated(
    hil: Hil, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = (TUTORIALS / "virtual-robot.md").read_text(encoding="utf-8")
    printed = carried_out(hil, commands_of("virtual-robot"))
    assert "hold the truth for 14 of 14 parameters" in printed
    (verdict,) = re.findall(r"(?m)^good: torque predicted within .* axis \d$", printed)
    assert verdict in text
    assert Path("runs/virtual/report.html").is_file()
