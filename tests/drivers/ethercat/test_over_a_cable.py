"""Our master and the plant in two processes on a cable, in a separate network namespace."""

from __future__ import annotations

import json
import subprocess
from typing import TYPE_CHECKING

import ethercat_processes
import pytest
from foreign_ethercat import THEIRS, carried_out, needs
from walked import File, Step, environment, steps

from drivers.ethercat.registers import ERROR, AlState
from hil.planning.plan import dump_plan
from hil.runs.run import Run

if TYPE_CHECKING:
    from pathlib import Path

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


@needs("pysoem")
@pytest.mark.long
def test_the_tutorial_is_walked_word_by_word(tmp_path: Path) -> None:
    """Cable, plant, `move.py` and our own master of the tutorial, in a network namespace."""
    link, *links, plant, file, scan, plan, run, identify = steps("docs/tutorials/ethercat.md")
    assert isinstance(file, File)
    (tmp_path / file.name).write_text(file.content, encoding="utf-8")
    ours = (scan, plan, run, identify)
    commands = [each.command for each in (link, *links, plant, *ours) if isinstance(each, Step)]
    assert len(commands) == len(links) + 6
    minutes, half = "--minutes 10", "--gravity 8 --inertia 14 --coupling 2"  # half the time
    assert minutes in commands[-3]
    commands[-3] = commands[-3].replace(minutes, half)
    *cable, serve = commands[:-4]
    script = [
        "set -e; export PYTHONUNBUFFERED=1; ip link set lo up",
        *cable,
        f"until ip link show {THEIRS} | grep -q 'state UP'; do sleep 0.02; done",
        f"{serve} > plant.txt 2>&1 &",
        "until [ $(wc -l < plant.txt) -ge 2 ]; do sleep 0.1; done",
        f"python {file.name}",
        *commands[-4:],
        "kill $!",
    ]
    done = subprocess.run(  # noqa: S603 - as our own page prints it
        ["unshare", "-n", "bash", "-c", "\n".join(script)],  # noqa: S607
        cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    for shown in ("6 drives", "enabled: True", "reached: True", "6 nodes"):
        assert shown in done.stdout
    assert "0 flagged, 0 left out; SYNC in lock-step" in done.stdout
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
