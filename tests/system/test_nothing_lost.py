"""Full, read-only and stalling disks, changed files, and killed processes lose no data."""

import errno
import os
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from small_run import write_run

from checked_files.yaml_file import FileError
from hil.cli import main
from hil.estimation.identify import estimate
from hil.measuring.campaign import Background, run_campaign
from hil.measuring.sequencer import Finished, Recorded
from hil.model.robot import Robot
from hil.planning.plan import Plan
from hil.results.identification import identify
from hil.results.model import Model
from hil.runs.pooling import recorded
from hil.runs.recording_file import Measured
from hil.runs.run_folder import RunFolder
from hil.tasks.measuring import prepared_folder

ROOT = Path(__file__).parents[2]
DRIVES = "axes: []\n"


@pytest.fixture
def folder(tmp_path: Path, small_plan: Plan, manutec: Robot) -> RunFolder:
    return RunFolder.create(tmp_path / "run", small_plan, manutec, DRIVES)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory, manutec: Robot) -> RunFolder:
    """Complete run; tests copy it and do not change it."""
    return write_run(tmp_path_factory.mktemp("whole") / "run", manutec)


def measured_ids(folder: RunFolder) -> list[str]:
    return [each.measurement.id for each in RunFolder.open(folder.path)]


# --- the disk -------------------------------------------------------------------------------------


def test_a_full_disk_ends_the_campaign_with_axes_off_and_resuming_completes_it(
    folder: RunFolder, ideal_bus, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = folder.path / "recordings" / "i1.h5"
    flush = os.fsync

    def full(descriptor: int) -> None:
        if str(Path(f"/proc/self/fd/{descriptor}").readlink()).startswith(str(path)):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        flush(descriptor)

    with monkeypatch.context() as disk:
        disk.setattr(os, "fsync", full)
        with pytest.raises(FileError) as refused:
            list(run_campaign(folder, ideal_bus))
    assert str(refused.value) == f"{path}: cannot be written: {os.strerror(errno.ENOSPC)}"
    assert ideal_bus.log[-1] == "powered off"
    assert "i1" not in measured_ids(folder)
    assert not list(folder.path.rglob("*.part")), "what does not fit must not fill the disk"
    again = RunFolder.open(folder.path)
    list(run_campaign(again, ideal_bus))
    assert measured_ids(folder) == ["g1", "i1", "c1"]


@contextmanager
def nobody() -> Iterator[None]:
    """Drop root's right to write anywhere."""
    uid = os.geteuid()
    if uid == 0:
        os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(uid)


def test_in_a_read_only_folder_nothing_is_begun_and_nothing_moves(
    small_plan: Plan, manutec: Robot, ideal_bus
) -> None:
    with tempfile.TemporaryDirectory() as place:
        folder = RunFolder.create(Path(place) / "run", small_plan, manutec, DRIVES)
        for path in (Path(place), folder.path, folder.path / "recordings"):
            path.chmod(0o555)
        with nobody():
            with pytest.raises(FileError, match=r"run\.json: cannot be written: Permission denied"):
                list(run_campaign(RunFolder.open(folder.path), ideal_bus))
            with pytest.raises(FileError, match="cannot be made: Permission denied"):
                RunFolder.create(Path(place) / "other", small_plan, manutec)
        Path(place).chmod(0o755)
        folder.path.chmod(0o755)
        (folder.path / "recordings").chmod(0o755)
    assert ideal_bus.log == []


def test_a_stalling_disk_does_not_stop_the_robot(
    folder: RunFolder, ideal_bus, monkeypatch: pytest.MonkeyPatch
) -> None:
    released, write = threading.Event(), RunFolder.write

    def stalled(self: RunFolder, measured: Measured) -> None:
        assert released.wait(60)
        write(self, measured)

    monkeypatch.setattr(RunFolder, "write", stalled)
    recorded_events = 0
    for event in run_campaign(folder, ideal_bus):
        recorded_events += isinstance(event, Recorded)
        if isinstance(event, Finished):
            assert measured_ids(folder) == [], "the disk stalls"
            released.set()
    assert recorded_events == 3
    assert measured_ids(folder) == ["g1", "i1", "c1"]


def test_a_disk_that_takes_nothing_any_more_is_reported() -> None:
    released = threading.Event()
    with Background(waiting_max=1, patience=0.01) as background:
        background.do(lambda: released.wait(60))
        try:
            with pytest.raises(
                FileError, match=r"no file was written to disk for 0\.01 s, with 1 "
            ):
                _ = [background.do(lambda: None) for _ in range(2)]
        finally:
            released.set()


def test_what_was_queued_is_written_although_the_operator_interrupts() -> None:
    done: list[str] = []

    def interrupted() -> None:
        with Background() as background:
            background.do(lambda: done.append("written"))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert done == ["written"]


# --- changed files
# ---------------------------------------------------------------------------------


def test_a_drives_file_changed_inside_the_folder_is_refused(folder: RunFolder) -> None:
    (folder.path / "drives.yaml").write_text("axes: [1]\n")
    with pytest.raises(FileError, match=r"drives\.yaml: was changed since the run was started"):
        RunFolder.open(folder.path)


def test_other_drives_are_refused_when_a_run_is_resumed(
    folder: RunFolder, ideal_bus, monkeypatch: pytest.MonkeyPatch
) -> None:
    events = run_campaign(folder, ideal_bus)
    while not isinstance(next(events), Recorded):
        pass
    events.close()
    before = measured_ids(folder)
    described = [axis.__class__(**{**_plain(axis), "identity": "other"}) for axis in ideal_bus.axes]
    monkeypatch.setattr(type(ideal_bus), "axes", described)
    with pytest.raises(FileError, match="axis 1 was ideal when the run was started, now it is oth"):
        list(run_campaign(RunFolder.open(folder.path), ideal_bus))
    assert measured_ids(folder) == before
    assert ideal_bus.log[-1] == "powered off"


def _plain(axis) -> dict[str, object]:
    return {name: getattr(axis, name) for name in axis.__slots__}


@pytest.mark.parametrize(
    "left", ["", "plan.yaml", "plan.yaml robot.yaml drives.yaml.0a1b2c3d.part"]
)
@pytest.mark.parametrize("resume", [True, False])
def test_a_folder_whose_making_was_killed_is_made_anew(
    tmp_path: Path, small_plan: Plan, manutec: Robot, left: str, resume: bool
) -> None:
    path = tmp_path / "run"
    (path / "recordings").mkdir(parents=True)
    for name in left.split():
        (path / name).write_text("half a fi")
    folder, _ = prepared_folder(path, small_plan, manutec, DRIVES, resume=resume)
    assert RunFolder.open(path).plan == small_plan
    assert len(folder.missing) == 3


def test_a_folder_with_something_else_in_it_is_left_alone(
    tmp_path: Path, small_plan: Plan, manutec: Robot
) -> None:
    (tmp_path / "recordings").mkdir()
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(FileError, match="already exists"):
        RunFolder.create(tmp_path, small_plan, manutec)


def test_an_incomplete_run_says_so_wherever_it_is_used(
    undisturbed: RunFolder,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    path = Path(shutil.copytree(undisturbed.path, tmp_path / "run"))
    for measurement in undisturbed.plan.measurements[:2]:
        RunFolder.open(path).recording_path(measurement).unlink()
    monkeypatch.setattr("hil.report.page.report", lambda run, _: run.path / "report.html")
    for command in ("identify", "report"):
        with pytest.raises(SystemExit) as ended:
            main([command, str(path)])
        assert ended.value.code == 0
        printed = capsys.readouterr().out.replace("\n", " ")
        assert "2 of 39 measurements are missing; measure them with --resume" in printed
    assert Model.load(path).provenance.missing == 2


# --- the same data, the same estimate -------------------------------------------------------------


def test_a_corrupt_recording_is_measured_again_and_the_estimate_is_that_of_the_same_recordings(
    undisturbed: RunFolder, tmp_path: Path
) -> None:
    disturbed = RunFolder.open(Path(shutil.copytree(undisturbed.path, tmp_path / "run")))
    victim = disturbed.plan.measurements[4]
    again = disturbed.read(victim)
    path = disturbed.recording_path(victim)
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(FileError, match="measure it again with --resume"):
        identify(disturbed)
    assert len(disturbed.set_aside_damaged()) == 1
    disturbed.write(again)
    ours = identify(disturbed)
    theirs = estimate(undisturbed.robot, list(recorded(list(undisturbed))))
    assert np.array_equal(ours.values, theirs.values)
    assert np.array_equal(ours.scatter_covariance, theirs.scatter_covariance)


@pytest.mark.long
def test_a_campaign_killed_at_random_moments_loses_nothing(tmp_path: Path) -> None:
    program = f"import pathlib, figures, kill; figures.RESULTS = pathlib.Path({str(tmp_path)!r})"
    command = [sys.executable, "-c", f"{program}; kill.main()"]
    command += ["--kills", "3", "--counts", "6", "20", "2"]
    where = ROOT / "benchmarks"
    done = subprocess.run(command, cwd=where, capture_output=True, text=True, check=False)  # noqa: S603 - our own
    assert done.returncode == 0, done.stdout + done.stderr
    assert "3 kills" in done.stdout
    assert "lost: 0, wrong: 0" in done.stdout
    assert (tmp_path / "kill.json").exists()
