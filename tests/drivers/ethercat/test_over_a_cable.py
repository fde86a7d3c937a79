"""Our master and the plant in two processes on a cable, in a separate network namespace."""

from __future__ import annotations

import json
from pathlib import Path

import ethercat_processes
import pytest
from foreign_ethercat import THEIRS, carried_out, needs

from drivers.ethercat.registers import ERROR, AlState
from hil.planning.plan import dump_plan
from hil.runs.run import Run

DOCS = Path(__file__).parents[3] / "docs"
SYNC_MANAGER_WATCHDOG = 0x1B


@needs()
def test_hil_run_measures(tmp_path: Path) -> None:
    from hil.model.robot import Robot
    from hil.planning.design.by_counts import design

    plan = design(Robot.load("manutec-r15"), {"gravity": 4, "inertia": 10, "coupling": 1})
    plan = plan.model_copy(update={"measurements": plan.measurements[:2]})
    file, folder = tmp_path / "plan.yaml", tmp_path / "run"
    file.write_text(dump_plan(plan))
    where = f"--interface ethercat --channel {THEIRS} --pacing lock-step"
    printed = carried_out("-m", "hil", "run", str(file), "-o", str(folder), *where.split())
    assert "2 measurements in" in printed
    assert "0 flagged" in printed
    assert len(Run.open(folder)) == 2
    assert "restored: true" in (folder / "found-settings.yaml").read_text()


@needs()
@pytest.mark.long
def test_the_commands_of_the_tutorial_measure_and_identify(tmp_path: Path) -> None:
    text = (DOCS / "tutorials" / "ethercat.md").read_text(encoding="utf-8")
    lines = text.split("## 4.")[1].split("```\n")[1].splitlines()
    script = tmp_path / "steps.py"
    script.write_text(
        f"import os, subprocess, sys\nos.chdir({str(tmp_path)!r})\nfor line in {lines!r}:\n"
        "    subprocess.run([sys.executable, '-m', *line.split()], check=True)\n"
    )
    printed = carried_out(str(script), timeout=600)
    assert "6 nodes" in printed
    assert "0 flagged, 0 left out; SYNC in lock-step" in printed
    assert (tmp_path / "runs" / "ethercat" / "model.yaml").exists()


@needs()
def test_drives_stop_by_themselves_when_the_driver_is_killed() -> None:
    printed = carried_out(ethercat_processes.__file__, "killed-driver", options="--clock wall")
    seen = json.loads(printed.splitlines()[-1])
    assert seen["begun"] == "moving"
    assert seen["al"] == [[AlState.SAFEOP | ERROR, SYNC_MANAGER_WATCHDOG]] * 6
    assert seen["watchdogs"] == [round(ethercat_processes.WATCHDOG * 1e4)] * 6
    assert not any(word & 0x4F == 0x07 and word & 0x20 for word in seen["words"]), "none enabled"


@needs()
def test_recordings_are_whole_when_the_plant_is_killed(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    printed = carried_out(ethercat_processes.__file__, "killed-plant", str(folder))
    seen = json.loads(printed.splitlines()[-1])
    assert seen["done"] == 2
    assert "joint 1" in seen["ended"]
    run = Run.open(folder)
    assert len([measured for measured in run if measured.recording.q.size]) == len(run) == 2
