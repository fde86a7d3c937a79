"""A run interrupted or killed for real, over CAN frames, and completed afterwards."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hil.planning.plan import Plan, dump_plan
from hil.runs.run_folder import RunFolder


@pytest.fixture
def plan_file(tmp_path: Path, small_plan: Plan) -> Path:
    """Plan of ten rounds of the small plan."""
    measurements = tuple(
        m.model_copy(update={"id": f"{m.id}-{k}"})
        for k in range(10)
        for m in small_plan.measurements
    )
    path = tmp_path / "plan.yaml"
    path.write_text(dump_plan(small_plan.model_copy(update={"measurements": measurements})))
    return path


def start(plan_file: Path, folder: Path, *options: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(  # noqa: S603 - our own program
        [sys.executable, "-m", "hil", "run", str(plan_file), "-o", str(folder), *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_for_recordings(folder: Path, number: int, run: "subprocess.Popen[str]") -> None:
    while len(list(folder.glob("recordings/*.h5"))) < number:
        assert run.poll() is None, run.communicate()
        time.sleep(0.005)


@pytest.mark.parametrize(
    ("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 130), (signal.SIGKILL, -9)]
)
def test_an_interrupted_run_is_finished_by_resuming(
    plan_file: Path, tmp_path: Path, number: int, status: int
) -> None:
    folder = tmp_path / "run"
    run = start(plan_file, folder)
    wait_for_recordings(folder, 3, run)
    run.send_signal(number)
    _, err = run.communicate(timeout=60)
    assert run.returncode == status
    assert "Traceback" not in err
    if number != signal.SIGKILL:
        assert f"recordings so far are in {folder}" in err
    broken = RunFolder.open(folder)
    measured = {m.measurement.id for m in broken}
    assert 3 <= len(measured) < 30
    expected = "was killed" if number == signal.SIGKILL else "interrupted by the operator"
    assert broken.journal.sessions[0].reason == expected

    again = start(plan_file, folder, "--resume")
    out, err = again.communicate(timeout=120)
    assert (again.returncode, err) == (0, "")
    assert f"{30 - len(measured)} measurements in" in out
    finished = RunFolder.open(folder)
    assert finished.missing == ()
    assert [s.reason for s in finished.journal.sessions] == [expected, "finished"]
