"""Run folders: atomic recordings, resuming, refusals."""

import errno
import json
import os
import shutil
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from checked_files.yaml_file import FileError
from drivers.drive_bus import DriveFault, Sample, SampleFlag
from hil.measuring.campaign import run_campaign
from hil.measuring.sequencer import Recorded, Repeated
from hil.model.robot import Robot
from hil.planning.free_motion import FreeMotion
from hil.planning.measurement import Gravity, RecordedMotion
from hil.planning.plan import Plan
from hil.planning.trajectory import Trajectory
from hil.runs.atomic_file import locked, whole_folder
from hil.runs.journal import BusName, Session, SyncTiming
from hil.runs.recording import Finding, Recording
from hil.runs.recording_file import Measured, read_measured, write_measured
from hil.runs.run_folder import RunFolder

N = 50


@pytest.fixture
def recording() -> Recording:
    rng = np.random.default_rng(1)
    q = rng.normal(size=(N, 6))
    q[7, 2] = np.nan
    return Recording(
        time=0.004 * np.arange(N),
        q=q,
        tau=rng.normal(size=(N, 6)),
        flags=rng.integers(0, 16, (N, 6), dtype=np.uint8),
        stroke=np.repeat(np.array([-1, 0, 1, 2, -1], dtype=np.int16), N // 5),
        partner_stroke=np.full(N, -1, dtype=np.int16),
    )


@pytest.fixture
def folder(tmp_path: Path, small_plan: Plan, manutec: Robot) -> RunFolder:
    return RunFolder.create(tmp_path / "run", small_plan, manutec, "axes: []\n")


def test_what_is_written_is_read_back_bit_by_bit(folder: RunFolder, recording: Recording) -> None:
    finding = Finding("gaps", "2 samples lack a telegram; check the wiring", 2.0, 0.0)
    measured = Measured(folder.plan.measurements[2], recording, 3, (finding,), session=1)
    folder.write(measured)
    back = folder.read(folder.plan.measurements[2])
    assert back.measurement == measured.measurement
    assert (back.attempts, back.findings, back.session) == (3, (finding,), 1)
    for name in ("time", "q", "tau", "flags", "stroke", "partner_stroke"):
        ours, theirs = getattr(recording, name), getattr(back.recording, name)
        assert ours.dtype == theirs.dtype
        assert ours.tobytes() == theirs.tobytes()


WAVES = {"period": 0.1, "sine": ((0.1,),) * 6, "cosine": ((0.0,),) * 6, "cycles": 3}


@pytest.mark.parametrize(
    ("motion", "stroke", "group"),
    [
        (Trajectory(id="t", q=(0.0,) * 6, **WAVES), None, (-1, 0, 1, 2, -1)),
        (FreeMotion(id="f", q=(0.0,) * 6, duration=0.2, cycles=3), None, (-1, 0, 1, 2, -1)),
        (FreeMotion(id="a", q=(0.0,) * 6, duration=0.2, cycles=2, alone=1), (-1, 0, 1, 2, -1),
         (-1, 0, 0, 1, -1)),
        (Gravity(id="g", axis=1, q=(0.0,) * 6, stroke=0.4, velocity=0.4, acceleration=8.0),
         (-1, 0, 1, 2, -1), None),
    ],
)  # fmt: skip
def test_a_file_of_the_first_format_is_read_with_strokes_and_groups_apart(
    tmp_path: Path,
    manutec: Robot,
    recording: Recording,
    monkeypatch: pytest.MonkeyPatch,
    motion: RecordedMotion,
    stroke: tuple[int, ...] | None,
    group: tuple[int, ...] | None,
) -> None:
    with monkeypatch.context() as earlier:
        earlier.setattr("hil.runs.recording_file.FORMAT", 1)
        write_measured(tmp_path / "old.h5", Measured(motion, recording), manutec)
    found = read_measured(tmp_path / "old.h5").recording
    np.testing.assert_array_equal(found.stroke, np.repeat(stroke or (-1,) * 5, N // 5))
    if group is None:
        assert found.group is None
    else:
        np.testing.assert_array_equal(found.group, np.repeat(group, N // 5))
    write_measured(tmp_path / "new.h5", Measured(motion, found), manutec)
    again = read_measured(tmp_path / "new.h5").recording
    np.testing.assert_array_equal(again.stroke, found.stroke)
    np.testing.assert_array_equal(again.active, found.active)


def test_a_format_to_come_is_refused(
    tmp_path: Path, manutec: Robot, recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    motion = FreeMotion(id="f", q=(0.0,) * 6, duration=0.2)
    with monkeypatch.context() as later:
        later.setattr("hil.runs.recording_file.FORMAT", 4)
        write_measured(tmp_path / "f.h5", Measured(motion, recording), manutec)
    with pytest.raises(FileError, match=r"format 4 must be 1 to 3; use the version that wrote it"):
        read_measured(tmp_path / "f.h5")


def test_only_one_measures_into_a_folder_at_a_time(folder: RunFolder) -> None:
    with (
        locked(folder.path),
        pytest.raises(FileError, match="another process measures into this folder"),
        locked(folder.path),
    ):
        pass
    with locked(folder.path):
        assert not list(folder.path.glob("*lock*"))


def test_any_hdf5_tool_finds_units_and_the_measurement(
    folder: RunFolder, recording: Recording
) -> None:
    folder.write(Measured(folder.plan.measurements[0], recording))
    with h5py.File(folder.path / "recordings" / "g1.h5") as file:
        assert file["q"].attrs["unit"] == "rad"
        assert file["tau"].attrs["unit"] == "N m"
        assert json.loads(file.attrs["measurement"])["kind"] == "gravity"


def test_recordings_come_in_the_order_of_the_plan(folder: RunFolder, recording: Recording) -> None:
    gravity, inertia, coupling = folder.plan.measurements
    for measurement in (coupling, gravity):
        folder.write(Measured(measurement, recording))
    assert [measured.measurement for measured in folder] == [gravity, coupling]
    assert folder.missing == (inertia,)


def test_a_folder_opened_again_has_plan_robot_and_verbatim_files(
    folder: RunFolder, small_plan: Plan, manutec: Robot
) -> None:
    again = RunFolder.open(folder.path)
    assert again.plan == small_plan
    assert again.robot == manutec
    assert (folder.path / "robot.yaml").read_text() == manutec.text
    assert (folder.path / "drives.yaml").read_text() == "axes: []\n"


@pytest.mark.parametrize("position", [0.2, 0.5, 0.9])
def test_a_flipped_bit_is_noticed(folder: RunFolder, recording: Recording, position: float) -> None:
    measurement = folder.plan.measurements[0]
    folder.write(Measured(measurement, recording))
    path = folder.recording_path(measurement)
    with h5py.File(path, "r+") as file:
        tau = file["tau"][:]
        tau.flat[int(position * tau.size)] += 1e-12
        file["tau"][:] = tau
    with pytest.raises(FileError, match="checksum"):
        folder.read(measurement)


@pytest.mark.parametrize("keep", [0, 100, 3000])
def test_a_damaged_file_is_set_aside_and_measured_again(
    folder: RunFolder, recording: Recording, keep: int
) -> None:
    gravity, inertia, coupling = folder.plan.measurements
    for measurement in (gravity, inertia):
        folder.write(Measured(measurement, recording))
    path = folder.recording_path(gravity)
    path.write_bytes(path.read_bytes()[:keep])
    set_aside = RunFolder.open(folder.path).set_aside_damaged()
    assert len(set_aside) == 1
    assert "g1.h5" in set_aside[0]
    assert "kept as g1.h5.damaged, will be measured again" in set_aside[0]
    assert (folder.path / "recordings" / "g1.h5.damaged").exists()
    assert folder.missing == (gravity, coupling)


def test_a_recording_under_anothers_name_is_not_taken(
    folder: RunFolder, recording: Recording
) -> None:
    gravity, inertia, _ = folder.plan.measurements
    folder.write(Measured(gravity, recording))
    shutil.copy(folder.recording_path(gravity), folder.recording_path(inertia))
    with pytest.raises(FileError, match="holds another measurement than i1"):
        folder.read(inertia)


def test_what_a_kill_left_half_written_is_no_recording(
    folder: RunFolder, recording: Recording
) -> None:
    gravity, inertia, coupling = folder.plan.measurements
    folder.write(Measured(gravity, recording))
    whole = folder.recording_path(gravity).read_bytes()
    part = folder.path / "recordings" / "i1.h5.part"
    part.write_bytes(whole[: len(whole) // 2])
    again = RunFolder.open(folder.path)
    assert again.missing == (inertia, coupling)
    assert again.set_aside_damaged() == []
    assert not part.exists()


def test_an_existing_run_is_not_overwritten(
    folder: RunFolder, small_plan: Plan, manutec: Robot
) -> None:
    with pytest.raises(FileError, match="already exists; continue with --resume"):
        RunFolder.create(folder.path, small_plan, manutec)


def test_resuming_with_another_plan_robot_or_drives_is_refused(
    folder: RunFolder, small_plan: Plan, manutec: Robot, tmp_path: Path
) -> None:
    folder.refuse_changes(small_plan, manutec, "axes: []\n")
    with pytest.raises(FileError, match="the plan differs"):
        folder.refuse_changes(small_plan.model_copy(update={"travel": 0.5}), manutec, "axes: []\n")
    other = tmp_path / "other.yaml"
    other.write_text(manutec.text.replace("velocity_limit: 3.0", "velocity_limit: 2.9"))
    with pytest.raises(FileError, match="the robot file differs"):
        folder.refuse_changes(small_plan, Robot.load(other), "axes: []\n")
    with pytest.raises(FileError, match="the drives file differs"):
        folder.refuse_changes(small_plan, manutec, "axes: [1]\n")


def test_a_plan_changed_inside_the_folder_is_refused(folder: RunFolder) -> None:
    path = folder.path / "plan.yaml"
    path.write_text(path.read_text().replace("stroke: 0.4", "stroke: 0.3"))
    with pytest.raises(FileError, match="was changed since the run was started"):
        RunFolder.open(folder.path)


def test_a_folder_that_is_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="is not a run folder"):
        RunFolder.open(tmp_path / "nothing")
    with pytest.raises(FileError, match=r"run.json: cannot be read"):
        RunFolder.open(tmp_path)
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(FileError, match="is this the folder of a run"):
        RunFolder.open(tmp_path)


def test_a_full_disk_is_reported_once_and_clearly(
    folder: RunFolder, recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("hil.runs.atomic_file.os.fsync", full)
    with pytest.raises(FileError) as refused:
        folder.write(Measured(folder.plan.measurements[0], recording))
    path = folder.path / "recordings" / "g1.h5"
    assert str(refused.value) == f"{path}: cannot be written: No space left on device"
    assert not path.exists()


def test_a_place_that_cannot_be_written_is_refused(
    tmp_path: Path, small_plan: Plan, manutec: Robot
) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="cannot be made: Not a directory"):
        RunFolder.create(tmp_path / "file" / "run", small_plan, manutec)


def test_a_campaign_ends_in_a_folder_with_all_recordings(folder: RunFolder, ideal_bus) -> None:
    events = list(run_campaign(folder, ideal_bus, BusName("ideal", "test")))
    assert sum(isinstance(event, Recorded) for event in events) == 3
    again = RunFolder.open(folder.path)
    assert again.missing == ()
    assert [len(m.recording.time) > 200 for m in again] == [True] * 3
    session = again.journal.sessions[0]
    assert (session.bus, session.reason) == ("ideal test", "finished")
    assert [axis.identity for axis in session.axes] == ["ideal"] * 6
    assert session.ended is not None


def test_the_journal_keeps_why_an_attempt_was_repeated(folder: RunFolder, ideal_bus) -> None:
    def lost(sample: Sample) -> Sample:
        if not 2.5 < sample.time < 2.7:
            return sample
        nothing = (np.nan,) * len(sample.q)
        flags = (int(SampleFlag.MISSING),) * len(sample.q)
        return sample._replace(q=nothing, tau=nothing, flags=flags)

    ideal_bus.tamper = lost
    (repeated,) = (e for e in run_campaign(folder, ideal_bus) if isinstance(e, Repeated))
    (kept,) = RunFolder.open(folder.path).journal.sessions[0].repeated
    assert (kept.measurement, kept.attempt) == ("g1", 1)
    assert kept.findings == tuple(finding.message for finding in repeated.findings)
    assert "samples lack a telegram of axis 1, 2, 3, 4, 5, 6" in kept.findings[0]


def test_a_campaign_that_broke_off_is_finished_by_resuming(folder: RunFolder, ideal_bus) -> None:
    def fail(sample: Sample) -> Sample:
        if sample.time > 8:
            raise DriveFault("axis 3: over-current (2310)")
        return sample

    ideal_bus.tamper = fail
    with pytest.raises(DriveFault):
        list(run_campaign(folder, ideal_bus))
    assert ideal_bus.log[-1] == "powered off"
    broken = RunFolder.open(folder.path)
    assert broken.journal.sessions[0].reason == "DriveFault: axis 3: over-current (2310)"
    left = [m.id for m in broken.missing]
    assert 0 < len(left) < 3

    kept = broken.recording_path(broken.plan.measurements[0]).read_bytes()
    ideal_bus.tamper = lambda sample: sample
    again = [e for e in run_campaign(broken, ideal_bus) if isinstance(e, Recorded)]
    assert [e.measurement.id for e in again] == left
    assert broken.missing == ()
    assert [measured.session for measured in broken][-1] == 1
    assert broken.recording_path(broken.plan.measurements[0]).read_bytes() == kept


def test_ctrl_c_switches_off_and_keeps_what_was_measured(folder: RunFolder, ideal_bus) -> None:
    def interrupt(sample: Sample) -> Sample:
        if sample.time > 8:
            raise KeyboardInterrupt
        return sample

    ideal_bus.tamper = interrupt
    ideal_bus.notes = ("axis 1: warning 4210",)
    with pytest.raises(KeyboardInterrupt):
        list(run_campaign(folder, ideal_bus))
    assert ideal_bus.log[-1] == "powered off"
    again = RunFolder.open(folder.path)
    assert again.journal.sessions[0].notes == ("axis 1: warning 4210",)
    assert again.journal.sessions[0].reason == "interrupted by the operator"
    assert len(list(again)) == 3 - len(again.missing) > 0


def test_the_folder_of_a_run_without_recordings_can_be_discarded(
    folder: RunFolder, recording: Recording
) -> None:
    folder.write(Measured(folder.plan.measurements[0], recording))
    assert not folder.discard_if_empty()
    folder.recording_path(folder.plan.measurements[0]).unlink()
    assert folder.discard_if_empty()
    assert not folder.path.exists()


@pytest.mark.parametrize(
    ("bus", "stated", "simulated"),
    [
        ("socketcan sim_plant", False, False),
        ("anything", True, True),
        ("sim_plant manutec-r15", None, True),
        ("socketcan can0", None, False),
        ("", None, False),
    ],
)
def test_a_journal_states_whether_its_bus_was_the_virtual_plant_s(
    folder: RunFolder, bus: str, stated: bool | None, simulated: bool
) -> None:
    """Journals of earlier versions contain only the name of the bus."""
    journal = folder.journal.add_session(Session(started="x", bus=bus, simulated=stated))
    assert journal.simulated is simulated


@pytest.mark.parametrize("interface", ["sim_plant", "socketcan"])
def test_a_session_notes_whether_its_bus_is_the_virtual_plant_s(
    folder: RunFolder, interface: str
) -> None:
    with folder.session(BusName(interface, "a b")):
        pass
    (session,) = RunFolder.open(folder.path).journal.sessions
    assert (session.bus, session.simulated) == (f"{interface} a b", interface == "sim_plant")


def test_what_a_killed_session_recorded_is_in_its_journal(folder: RunFolder, ideal_bus) -> None:
    """The journal on the disk counts a recording as soon as its file exists."""
    campaign = run_campaign(folder, ideal_bus)
    first = next(event for event in campaign if isinstance(event, Recorded))
    recorded = first.recording.n_samples
    next(campaign)  # the following step writes the recording
    for _ in range(500):
        on_disk = RunFolder.open(folder.path).journal.sessions[-1]
        if on_disk.sync.samples:
            break
        time.sleep(0.01)
    campaign.close()
    assert on_disk.sync.samples >= recorded > 0
    assert on_disk.reason == "was killed"


def test_a_recording_that_a_kill_kept_from_the_journal_is_counted_by_the_next_session(
    folder: RunFolder, recording: Recording
) -> None:
    with folder.session(BusName("sim_plant", "a")) as number:
        folder.write(Measured(folder.plan.measurements[2], recording, session=number))
        killed = RunFolder.open(folder.path)
        with killed.session(BusName("sim_plant", "a")):
            pass
    first, second = killed.journal.sessions
    assert (first.sync.samples, second.sync.samples) == (N, 0)
    assert first.sync == SyncTiming().add_recording(recording)


def test_a_folder_that_a_killed_process_began_is_removed_by_the_next(tmp_path: Path) -> None:
    abandoned = tmp_path / ".run.0123abcd.part"
    (abandoned / "recordings").mkdir(parents=True)
    others = [tmp_path / ".other.0123abcd.part", tmp_path / ".run.part"]
    forgotten = tmp_path / ".elsewhere.0123abcd.part"
    for other in (*others, forgotten):
        other.mkdir()
    os.utime(forgotten, (0, 0))
    with whole_folder(tmp_path / "run") as part:
        assert not abandoned.exists()
        assert not forgotten.exists()
        with whole_folder(tmp_path / "run"):
            assert part.exists()  # a running process holds a lock on it
        (tmp_path / "run").rmdir()
    assert all(other.exists() for other in others)
    assert (tmp_path / "run").exists()


def test_the_folder_above_a_new_run_is_flushed_to_the_disk(
    tmp_path: Path, small_plan: Plan, manutec: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Otherwise a power cut loses the whole run, whose name is not on the disk."""
    flushed: list[Path] = []
    monkeypatch.setattr("hil.runs.atomic_file._flush_folder", flushed.append)
    RunFolder.create(tmp_path / "new" / "run", small_plan, manutec)
    assert {tmp_path, tmp_path / "new", tmp_path / "new" / "run"} <= set(flushed)
