"""Commands without required values, with empty values, or with failing streams."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from checked_files.yaml_file import FileError
from hil.cli.measuring import OnBus, measure

if TYPE_CHECKING:
    from command_line import Hil

    from hil.model.robot import Robot
    from hil.planning.plan import Plan


def called(shell: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a shell line in which the program is ``$HIL``."""
    return subprocess.run(  # noqa: S603 - our own program
        ["/bin/sh", "-c", shell],
        cwd=folder,
        env={**os.environ, "HIL": f"{sys.executable} -m hil", **environment},
        capture_output=True,
        text=True,
        errors="replace",
        timeout=120,
        check=False,
    )


@pytest.mark.parametrize("command", ["run", "watch", "track"])
def test_a_command_alone_says_what_is_missing(hil: Hil, command: str) -> None:
    status, _, err = hil(command)
    assert status == 2
    assert "Missing" in err


@pytest.mark.parametrize("words", [("-o", ""), ("--output=",), ("--drives", "", "-o", "x")])
def test_an_empty_value_is_refused_before_it_becomes_the_current_folder(
    hil: Hil, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    status, _, err = hil("run", "nowhere.yaml", *words)
    assert status == 2
    assert "has no value" in err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("end", ["\n", "\r", "\u2028"])
def test_the_name_of_a_file_forges_no_line_of_a_message(hil: Hil, tmp_path: Path, end: str) -> None:
    status, _, err = hil("report", tmp_path / f"run{end}forged: all axes are off")
    assert status == 2
    assert "has a line break" in " ".join(err.replace("│", " ").split())
    assert not [line for line in err.splitlines() if line.startswith("forged")]


def test_what_ascii_cannot_show_is_replaced(tmp_path: Path) -> None:
    done = called("$HIL robot nö && $HIL robot scara-of-ö", tmp_path, PYTHONIOENCODING="ascii")
    assert "Traceback" not in done.stderr
    done = called("$HIL plan manutec-r15 -o p.yaml", tmp_path, PYTHONIOENCODING="ascii", LC_ALL="C")
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr
    assert (tmp_path / "p.yaml").is_file()


@pytest.mark.parametrize("end", ["| head -1", ">&-", ">&- 2>&-", "> /dev/full"])
def test_a_stream_that_nobody_reads_takes_no_result_away(tmp_path: Path, end: str) -> None:
    if end == "> /dev/full" and not Path("/dev/full").exists():
        pytest.skip("there is no /dev/full")
    done = called(f"$HIL plan manutec-r15 -o p.yaml {end}", tmp_path)
    assert "Traceback" not in done.stderr
    assert (tmp_path / "p.yaml").is_file()


def test_problems_of_a_plan_that_is_no_file_are_stated(
    small_plan: Plan, manutec: Robot, tmp_path: Path
) -> None:
    """The command made the plan itself, so no line of a file can be named."""
    first, *others = small_plan.measurements
    too_fast = first.model_copy(update={"velocity": 99.0})
    plan = small_plan.model_copy(update={"measurements": (too_fast, *others)})
    with pytest.raises(FileError, match=r"^the plan:1: measurements\.0"):
        measure(plan, manutec, Path("the plan"), tmp_path / "run", OnBus())
