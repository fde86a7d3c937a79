"""An interrupted or killed study leaves no process behind and can be continued."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from small_study import put, small_plans

from hil.runs.run_folder import RunFolder

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.model.robot import Robot


ROOT = Path(__file__).parents[2]


def processes_of(folder: Path) -> list[int]:
    """Return processes, except zombies, whose environment names the folder of the study."""
    mark, found = f"STUDY={folder}\0".encode(), []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            environment = (process / "environ").read_bytes()
        except OSError:  # it ended meanwhile
            continue
        if mark in environment:
            found.append(int(process.name))
    return found


class TestInterruption:
    """A study is a process with workers; each worker runs a campaign in a process."""

    @pytest.fixture
    def started(self, manutec: Robot, tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
        folder = put(small_plans(manutec), tmp_path / "study")
        options = "--scenario on --kind two-step --seeds 2 --first-seed 1 --workers 1"
        environment = os.environ | {"STUDY": str(folder)}
        with subprocess.Popen(  # noqa: S603 - our own program
            [sys.executable, "-m", "benchmarks.drift_study", "-o", folder, *options.split()],
            cwd=ROOT,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        ) as process:
            try:
                while not any(folder.glob("on/two-step/*/recordings/*.h5")):
                    assert process.poll() is None, process.communicate()
                    time.sleep(0.02)
                yield process
            finally:
                for number in processes_of(folder):
                    os.kill(number, signal.SIGKILL)

    def test_ctrl_c_leaves_no_process_and_says_how_to_go_on(
        self, started: subprocess.Popen[str], tmp_path: Path
    ) -> None:
        assert len(processes_of(tmp_path / "study")) >= 3
        started.send_signal(signal.SIGINT)
        _, err = started.communicate(timeout=120)
        assert processes_of(tmp_path / "study") == []
        folder = tmp_path / "study"
        assert err == f"stopped; what is done stays in {folder}, the same command continues\n"
        assert started.returncode == 130
        run = RunFolder.open(folder / "on" / "two-step" / "seed-1")
        assert run.missing
        assert run.journal.sessions[-1].reason == "interrupted by the operator"

    def test_killed_it_leaves_no_process_either(
        self, started: subprocess.Popen[str], tmp_path: Path
    ) -> None:
        started.kill()
        ends = time.monotonic() + 60
        while processes_of(tmp_path / "study"):
            assert time.monotonic() < ends
            time.sleep(0.05)
        run = RunFolder.open(tmp_path / "study" / "on" / "two-step" / "seed-1")
        assert run.journal.sessions[-1].reason == "interrupted by the operator"
