"""Log of a run's frames, and repetition of the run from the log."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import can
import numpy as np
import pytest
from canopen_drive_bus import CanopenDriveBus

from checked_files.yaml_file import FileError
from drivers.can_bus.frame_log import FrameLog
from drivers.can_bus.replay_bus import ReplayBus, ReplayLog
from drivers.drive_bus import BusUnavailable, SampleFlag
from drivers.drives_file import DrivesFile, load_drives
from drivers.opening import open_drive_bus
from hil.cli import main
from hil.measuring.campaign import run_campaign
from hil.measuring.sequencer import Recorded
from hil.model.robot import ROBOTS, Robot
from hil.planning.measurement import Gravity, Inertia
from hil.planning.plan import Plan, dump_plan
from hil.runs.run_folder import RunFolder
from sim_plant.plant import load_plant
from sim_plant.serving.server import serve

FORMATS = (".asc", ".blf", ".csv", ".db", ".log", ".trc", ".asc.gz")


@pytest.fixture(scope="module")
def drives() -> DrivesFile:
    return load_drives(ROBOTS / "manutec-r15.drives.yaml")


@pytest.fixture
def plan(small_plan: Plan) -> Plan:
    """Plan of two measurements of some seconds each."""
    shared = {"axis": 3, "q": (0.0,) * 6, "stroke": 0.4}
    first = Inertia(id="i1", velocity=1.5, acceleration=10.0, **shared)
    second = Gravity(id="g1", velocity=0.6, acceleration=8.0, cycles=1, **shared)
    return small_plan.model_copy(update={"measurements": (first, second), "attempts": 1})


def measure(path: Path, plan: Plan, robot: Robot, bus: CanopenDriveBus) -> RunFolder:
    folder = RunFolder.create(path, plan, robot)
    list(run_campaign(folder, bus))
    return folder


def refuse_differences(one: RunFolder, other: RunFolder) -> None:
    for ours, theirs in zip(one, other, strict=True):
        for name in ours.recording.units:
            mine, yours = (getattr(m.recording, name) for m in (ours, theirs))
            if name == "flags":  # a log has one instant for each SYNC, without its uncertainty
                mine, yours = (flags & ~np.uint8(SampleFlag.UNTIMED) for flags in (mine, yours))
            assert np.array_equal(mine, yours, equal_nan=mine.dtype.kind == "f"), name


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_run_is_reproduced_sample_for_sample_from_a_log_in_any_format(
    tmp_path: Path, plan: Plan, manutec: Robot, drives: DrivesFile, suffix: str
) -> None:
    log = tmp_path / f"frames{suffix}"
    bus = open_drive_bus(drives, "sim_plant", "manutec-r15", frame_log=log)
    original = measure(tmp_path / "run", plan, manutec, bus)
    again = measure(tmp_path / "again", plan, manutec, open_drive_bus(drives, "replay", str(log)))
    assert again.missing == ()
    refuse_differences(original, again)


@pytest.fixture(scope="module")
def logged_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with run, log and plan."""
    return tmp_path_factory.mktemp("logged")


@pytest.fixture
def log(logged_run: Path, plan: Plan, manutec: Robot, drives: DrivesFile) -> Path:
    """Log of a run of `plan`, recorded once."""
    path = logged_run / "frames.log"
    if not path.exists():
        bus = open_drive_bus(drives, "sim_plant", "manutec-r15", frame_log=path)
        measure(logged_run / "run", plan, manutec, bus)
    return path


def test_the_command_line_logs_and_replays(
    tmp_path: Path, plan: Plan, capsys: pytest.CaptureFixture[str]
) -> None:
    plan_file, log = tmp_path / "plan.yaml", tmp_path / "run.asc"
    plan_file.write_text(dump_plan(plan))
    for folder, options in (
        ("run", ["--frame-log", str(log)]),
        ("again", ["--interface", "replay", "--channel", str(log)]),
    ):
        with pytest.raises(SystemExit) as ended:
            main(["run", str(plan_file), "-o", str(tmp_path / folder), *options])
        assert ended.value.code == 0, capsys.readouterr().err
    folders = [RunFolder.open(tmp_path / name) for name in ("run", "again")]
    refuse_differences(*folders)
    assert folders[1].journal.sessions[0].bus == f"replay {log}"


def test_another_plan_than_the_logged_one_is_told_by_the_frame_where_they_part(
    log: Path, tmp_path: Path, plan: Plan, manutec: Robot, drives: DrivesFile,
    caplog: pytest.LogCaptureFixture,
) -> None:  # fmt: skip
    other = plan.measurements[1].model_copy(update={"velocity": 0.5})
    changed = plan.model_copy(update={"measurements": (plan.measurements[0], other)})
    with pytest.raises(
        BusUnavailable, match=r"frame \d+: the log has 60\d#\w+, now 60\d#\w+ is sent; replay with"
    ):
        measure(tmp_path / "run", changed, manutec, open_drive_bus(drives, "replay", str(log)))
    assert "emergency stop" not in caplog.text, "there is no robot"
    kept = RunFolder.open(tmp_path / "run")
    assert [m.id for m in kept.missing] == ["g1"], "what agreed was measured"


@pytest.mark.parametrize("share", [0.05, 0.5, 0.75])
def test_a_log_that_breaks_off_is_replayed_up_to_there(
    log: Path, logged_run: Path, tmp_path: Path, plan: Plan, manutec: Robot, drives: DrivesFile,
    share: float,
) -> None:  # fmt: skip
    whole = log.read_bytes()
    cut = tmp_path / "cut.log"
    cut.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(BusUnavailable, match=r"cut\.log: ends after frame \d+"):
        measure(tmp_path / "run", plan, manutec, open_drive_bus(drives, "replay", str(cut)))
    original = RunFolder.open(logged_run / "run")
    for kept in RunFolder.open(tmp_path / "run"):
        truth = original.read(kept.measurement).recording
        assert np.array_equal(kept.recording.tau, truth.tau)


def test_a_resumed_run_is_replayed_session_by_session(
    tmp_path: Path, plan: Plan, manutec: Robot, drives: DrivesFile
) -> None:
    original = RunFolder.create(tmp_path / "run", plan, manutec)
    logs = [tmp_path / "first.log", tmp_path / "second.log"]
    bus = open_drive_bus(drives, "sim_plant", "manutec-r15", frame_log=logs[0])
    events = run_campaign(original, bus)
    while not isinstance(next(events), Recorded):
        pass
    events.close()
    bus = open_drive_bus(drives, "sim_plant", "manutec-r15", frame_log=logs[1])
    list(run_campaign(original, bus))
    again = RunFolder.create(tmp_path / "again", plan, manutec)
    with pytest.raises(BusUnavailable, match=r"first\.log: frame \d+"):
        list(run_campaign(again, open_drive_bus(drives, "replay", str(logs[0]))))
    list(run_campaign(again, open_drive_bus(drives, "replay", str(logs[1]))))
    refuse_differences(original, again)
    assert [each.session for each in again] == [each.session for each in original] == [0, 1]


def test_both_directions_time_and_channel_are_logged(log: Path) -> None:
    frames = list(can.LogReader(log))
    sent = [frame for frame in frames if not frame.is_rx]
    assert {0x080, 0x000, 0x601, 0x201, 0x77F} <= {frame.arbitration_id for frame in sent}
    received = {frame.arbitration_id for frame in frames if frame.is_rx}
    assert {0x181, 0x186, 0x581, 0x701} <= received
    assert not received & {frame.arbitration_id for frame in sent}
    assert all(a.timestamp <= b.timestamp for a, b in pairwise(frames))
    assert {frame.channel for frame in frames} == {"simulated_plant_manutec-r15"}


# --- on the wall clock ----------------------------------------------------------------------------


@contextmanager
def served_plant(channel: str) -> Iterator[can.BusABC]:
    """Plant on the wall clock, with a stock bus, in a thread."""
    stop = threading.Event()
    with can.Bus(interface="virtual", channel=channel) as theirs:
        plant = load_plant("manutec-r15")
        server = threading.Thread(target=serve, args=(theirs, plant, "wall", stop))
        server.start()
        try:
            yield can.Bus(interface="virtual", channel=channel)
        finally:
            stop.set()
            server.join()


def test_a_run_by_the_wall_clock_is_reproduced_with_its_instants(
    tmp_path: Path, plan: Plan, manutec: Robot, drives: DrivesFile
) -> None:
    slow = plan.model_copy(update={"sample_period": 0.02, "measurements": plan.measurements[1:]})
    slower = drives.model_copy(update={"sync_period": 0.02, "heartbeat_timeout": 5.0})
    log = tmp_path / "frames.log"
    with served_plant("logged") as bus:
        logged = CanopenDriveBus(FrameLog(bus, log), slower, pacing="wall-clock", owns_bus=True)
        original = measure(tmp_path / "run", slow, manutec, logged)
    begun = time.monotonic()
    again = measure(tmp_path / "again", slow, manutec, open_drive_bus(slower, "replay", str(log)))
    replayed = original.read(slow.measurements[0]).recording
    assert time.monotonic() - begun < 10 * replayed.time[-1], "nobody sleeps"
    assert np.ptp(np.diff(replayed.time)) > 0, "these are instants of a real clock"
    refuse_differences(original, again)


def frame(identifier: int, data: bytes, instant: float, *, sent: bool) -> can.Message:
    return can.Message(
        arbitration_id=identifier, data=data, timestamp=100.0 + instant, is_rx=not sent,
        is_extended_id=False, channel="can0",
    )  # fmt: skip


@pytest.fixture
def written(tmp_path: Path) -> Callable[..., Path]:
    def write(*frames: can.Message, name: str = "some.log") -> Path:
        with can.Logger(tmp_path / name) as writer:
            for each in frames:
                writer(each)
        return tmp_path / name

    return write


SYNC = can.Message(arbitration_id=0x80, is_extended_id=False)


def test_a_telegram_that_came_late_comes_late_again(written: Callable[..., Path]) -> None:
    log = written(
        frame(0x80, b"", 0.0, sent=True),
        frame(0x181, b"\x01", 0.0015, sent=False),
        frame(0x182, b"\x02", 0.0095, sent=False),
        frame(0x80, b"", 0.010, sent=True),
        frame(0x000, b"\x80\x01", 0.020, sent=True),
    )
    with ReplayBus(str(log)) as bus:
        assert not bus.lock_step
        bus.send(SYNC)
        assert bus.recv(0.008).arbitration_id == 0x181
        assert bus.clock() == pytest.approx(0.0015)
        assert bus.recv(0.0065) is None
        assert bus.clock() == pytest.approx(0.008)
        assert bus.recv(bus.until_next_sent()).arbitration_id == 0x182
        bus.send(SYNC)
        assert bus.clock() == pytest.approx(0.010)


def test_without_directions_in_the_log_the_connection_set_tells_who_sent_what(
    written: Callable[..., Path],
) -> None:
    frames = [
        frame(0x000, b"\x80\x01", 0.0, sent=True),
        frame(0x601, bytes(8), 0.1, sent=True),
        frame(0x581, bytes(8), 0.2, sent=False),
        frame(0x701, b"\x05", 0.3, sent=False),
        frame(0x77F, b"\x05", 0.4, sent=True),
        frame(0x80, b"", 0.5, sent=True),
        frame(0x081, bytes(8), 0.6, sent=False),
        frame(0x181, bytes(8), 0.7, sent=False),
        frame(0x201, bytes(6), 0.8, sent=True),
    ]
    log = ReplayLog(written(*frames, name="some.csv"))
    assert [sent for _, _, sent in log] == [not each.is_rx for each in frames]


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("none.log", None),
        ("empty.log", b""),
        ("other.txt", b"hello\n"),
        ("damaged.blf", b"LOGG and more of what is no log"),  # python-can leaves this file open
    ],
)
def test_what_is_no_log_cannot_be_replayed(
    tmp_path: Path, drives: DrivesFile, name: str, content: bytes | None
) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(BusUnavailable, match="holds no frames"):
        open_drive_bus(drives, "replay", str(tmp_path / name))


# --- the file -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "stated"),
    [
        ("there.log", "already exists; choose another name"),
        ("run.xyz", r"choose \.asc or \.log"),
        ("nowhere/run.log", "No such file or directory"),
    ],
)
def test_a_log_that_cannot_be_written_is_told_before_anything_moves(
    tmp_path: Path, drives: DrivesFile, name: str, stated: str
) -> None:
    (tmp_path / "there.log").write_text("")
    with pytest.raises(FileError, match=stated):
        open_drive_bus(drives, "sim_plant", "manutec-r15", frame_log=tmp_path / name)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["there.log"]


class Echo(can.BusABC):
    """Bus that returns every sent frame."""

    def __init__(self) -> None:
        self.channel_info = "echo"
        self._frames: list[can.Message] = []
        super().__init__("echo")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self._frames.append(can.Message(arbitration_id=msg.arbitration_id + 1, data=msg.data))

    def recv(self, timeout: float | None = None) -> can.Message | None:
        return self._frames.pop(0) if self._frames else None

    def _apply_filters(self, filters: object) -> None:
        pass


def test_a_disk_that_is_full_is_told_once_and_the_bus_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(self: object, message: can.Message) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(can.CanutilsLogWriter, "on_message_received", full)
    with FrameLog(Echo(), tmp_path / "run.log") as bus:
        bus.send(can.Message(arbitration_id=0x601))
        stated = None
        while stated is None:
            try:
                bus.recv(0.0)
            except FileError as error:
                stated = str(error)
        assert (
            stated == f"{tmp_path}/run.log: cannot be written: [Errno 28] No space left on device"
        )
        bus.send(can.Message(arbitration_id=0x601))
        assert bus.recv(0.0) is not None


def test_a_stalling_disk_keeps_no_frame_from_being_sent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    released, write = threading.Event(), can.CanutilsLogWriter.on_message_received

    def stalled(self: can.CanutilsLogWriter, message: can.Message) -> None:
        assert released.wait(60)
        write(self, message)

    monkeypatch.setattr(can.CanutilsLogWriter, "on_message_received", stalled)
    with FrameLog(Echo(), tmp_path / "run.log") as bus:
        for number in range(1000):
            bus.send(can.Message(arbitration_id=number))
            assert bus.recv(0.0).arbitration_id == number + 1
        released.set()
    assert len(list(can.LogReader(tmp_path / "run.log"))) == 2000
