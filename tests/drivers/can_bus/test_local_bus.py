"""Frames between processes of one machine."""

from __future__ import annotations

import json
import os
import socket
import stat
import subprocess
import sys
import threading
import time
from contextlib import nullcontext
from typing import TYPE_CHECKING

import can
import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from drivers.can_bus import opening
from drivers.can_bus.local_bus import LocalBus
from drivers.can_bus.opening import open_can_bus
from drivers.drive_bus import BusUnavailable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

ECHO = """
import can
with can.Bus(CHANNEL, "local", ignore_config=True) as bus:
    print("here", flush=True)
    while (frame := bus.recv(10)) and frame.arbitration_id:
        bus.send(can.Message(arbitration_id=frame.arbitration_id + 1, data=frame.data,
                             is_extended_id=False))
"""


@pytest.fixture
def join(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., can.BusABC]]:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    joined: list[can.BusABC] = []

    def join_channel(channel: str = "bench", **options: object) -> can.BusABC:
        joined.append(can.Bus(channel, "local", ignore_config=True, **options))
        return joined[-1]

    yield join_channel
    for bus in joined:
        bus.shutdown()


def frame(identifier: int = 0x123, data: bytes = b"\1\2") -> can.Message:
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=False)


def test_python_can_finds_it_by_name(join: Callable[..., can.BusABC]) -> None:
    assert isinstance(join(), LocalBus)


def test_a_frame_goes_to_all_others_on_the_channel_and_not_back(
    join: Callable[..., can.BusABC],
) -> None:
    sender, first, second, elsewhere = join(), join(), join(), join("another")
    sender.send(frame())
    for receiver in (first, second):
        received = receiver.recv(1.0)
        assert received is not None
        assert received.equals(frame(), timestamp_delta=None, check_channel=False)
    assert sender.recv(0) is None
    assert elsewhere.recv(0) is None


@pytest.mark.skipif(sys.platform != "linux", reason="the kernel stamps frames on Linux alone")
def test_a_frame_bears_the_instant_at_which_it_was_sent_however_late_it_is_received(
    join: Callable[..., can.BusABC],
) -> None:
    sender, receiver = join(), join()
    sender.send(frame())
    assert receiver.recv(1.0) is not None  # both buses have found each other
    before = time.time()
    sender.send(frame())
    after = time.time()
    time.sleep(0.02)
    received = receiver.recv(1.0)
    assert received is not None
    assert before - 1e-5 <= received.timestamp <= after + 1e-5


def test_own_frames_come_back_on_request(join: Callable[..., can.BusABC]) -> None:
    bus = join(receive_own_messages=True)
    bus.send(frame())
    assert bus.recv(0) is not None


@hypothesis_settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    extended=st.booleans(),
    remote=st.booleans(),
    identifier=st.integers(0, 0x7FF),
    data=st.binary(max_size=8),
)
def test_every_classical_frame_arrives_as_it_was_sent(
    join: Callable[..., can.BusABC], extended: bool, remote: bool, identifier: int, data: bytes
) -> None:
    sent = can.Message(
        arbitration_id=identifier + (0x10000 if extended else 0),
        is_extended_id=extended,
        is_remote_frame=remote,
        dlc=len(data),
        data=None if remote else data,
    )
    with join() as sender, join() as receiver:
        sender.send(sent)
        received = receiver.recv(1.0)
    assert received is not None
    assert received.equals(sent, timestamp_delta=None, check_channel=False)


def test_thousands_of_frames_arrive_in_order_without_loss(
    join: Callable[..., can.BusABC],
) -> None:
    sender, receiver = join(), join()
    numbers = range(3000)
    thread = threading.Thread(
        target=lambda: [sender.send(frame(data=n.to_bytes(4)), 10.0) for n in numbers]
    )
    thread.start()
    received = [receiver.recv(10.0) for _ in numbers]
    thread.join()
    assert [int.from_bytes(message.data) for message in received if message] == list(numbers)


@pytest.mark.parametrize(("timeout", "asleep"), [(0.1, False), (None, False), (0.05, True)])
def test_a_peer_that_answers_at_once_finds_us_awake_where_we_may_wait_long(
    join: Callable[..., can.BusABC],
    monkeypatch: pytest.MonkeyPatch,
    timeout: float | None,
    asleep: bool,
) -> None:
    peer, bus = join(), join()
    slept = False

    def sleep(_self: LocalBus, _timeout: float | None) -> None:
        nonlocal slept
        slept = True
        peer.send(frame())

    monkeypatch.setattr(LocalBus, "_wait", sleep)
    # time stands still until the peer has answered, even on a busy computer
    monkeypatch.setattr("drivers.sync_clock.time.perf_counter", lambda: 0.0)
    monkeypatch.setattr("drivers.sync_clock.os.sched_yield", lambda: peer.send(frame()))
    assert bus.recv(timeout) is not None
    assert slept == asleep


def test_two_who_send_to_each_other_first_do_not_wait_for_ever(
    join: Callable[..., can.BusABC],
) -> None:
    buses = [join(), join()]
    received: list[can.Message | None] = []

    def send_then_receive(bus: can.BusABC) -> None:
        for _ in range(1000):
            bus.send(frame(), 10.0)
        received.extend(bus.recv(10.0) for _ in range(1000))

    threads = [threading.Thread(target=send_then_receive, args=(bus,)) for bus in buses]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(received) == 2000
    assert None not in received


def test_a_peer_that_hangs_is_waited_for_once_and_misses_frames_until_it_reads_again(
    join: Callable[..., can.BusABC],
) -> None:
    sender, hanging, lively = join(), join(), join()
    begun = time.monotonic()
    for number in range(1000):
        sender.send(frame(data=number.to_bytes(2)), 0.5)
        received = lively.recv(1.0)
        assert received is not None
        assert int.from_bytes(received.data) == number
    assert time.monotonic() - begun < 10 * 0.5
    kept = 0
    while hanging.recv(0):
        kept += 1
    assert kept < 1000
    sender.send(frame(0x77))
    last = hanging.recv(1.0)
    assert last is not None
    assert last.arbitration_id == 0x77


def test_a_process_that_was_killed_is_dropped(
    join: Callable[..., can.BusABC], tmp_path: Path
) -> None:
    bus = join()
    with subprocess.Popen(  # noqa: S603 - our own program
        [sys.executable, "-c", ECHO.replace("CHANNEL", "'bench'")], stdout=subprocess.PIPE
    ) as peer:
        assert peer.stdout is not None
        peer.stdout.readline()
        bus.send(frame(0x100))
        answer = bus.recv(10.0)
        peer.kill()
    assert answer is not None
    assert answer.arbitration_id == 0x101
    bus.send(frame())
    assert len(list(tmp_path.glob("can-local-*/bench/*"))) == 1


def test_a_timeout_is_not_rounded_to_milliseconds(join: Callable[..., can.BusABC]) -> None:
    bus, took = join("a"), []
    for _ in range(50):
        begun = time.perf_counter()
        assert bus.recv(0.0012) is None
        took.append(time.perf_counter() - begun)
    assert 0.0012 <= min(took) < 0.0019


def test_who_leaves_is_no_longer_sent_to(join: Callable[..., can.BusABC]) -> None:
    bus, gone = join(), join()
    gone.shutdown()
    bus.send(frame())
    with pytest.raises(can.CanOperationError, match="shut down"):
        gone.recv(0)


@pytest.mark.parametrize("channel", ["", ".", "..", "a/b", "../a", "-a", "a b", "a\n", "n" * 300])
def test_a_channel_without_a_plain_name_is_refused(
    join: Callable[..., can.BusABC], channel: str
) -> None:
    with pytest.raises(can.CanInitializationError, match="channel"):
        join(channel)


def test_can_fd_is_refused(join: Callable[..., can.BusABC]) -> None:
    with pytest.raises(can.CanOperationError, match="classical"):
        join().send(can.Message(arbitration_id=1, is_fd=True))


def test_a_channel_that_names_the_folder_above_deletes_nothing_there(
    join: Callable[..., can.BusABC], tmp_path: Path
) -> None:
    kept = tmp_path / "notes.txt"
    kept.write_text("kept")
    with pytest.raises(can.CanInitializationError, match="must be a name"):
        join("..").send(frame())
    assert kept.exists()


def test_what_is_no_socket_of_ours_stays_in_the_folder_of_a_channel(
    join: Callable[..., can.BusABC], tmp_path: Path
) -> None:
    with join("bench"):
        (folder,) = tmp_path.glob("can-local-*/bench")
    target = tmp_path / "notes.txt"
    target.write_text("kept")
    (folder / "1-1").write_text("a file with the name of a member")
    (folder / "1-2").symlink_to(target)
    (folder / "1-3").mkdir()
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as other:
        other.bind(str(folder / "other"))
    join("bench").send(frame())
    assert {path.name for path in folder.iterdir()} >= {"1-1", "1-2", "1-3", "other"}
    assert target.read_text() == "kept"


@pytest.mark.parametrize("planted", ["can-local-UID", "can-local-UID/bench"])
@pytest.mark.parametrize("kind", ["link", "open", "file"])
def test_a_folder_that_somebody_planted_is_refused(
    join: Callable[..., can.BusABC], tmp_path: Path, planted: str, kind: str
) -> None:
    path = tmp_path / planted.replace("UID", str(os.getuid()))
    if path.parent != tmp_path:
        path.parent.mkdir(mode=0o700)
    if kind == "link":
        (tmp_path / "target").mkdir(mode=0o700)
        path.symlink_to(tmp_path / "target")
    elif kind == "open":
        path.mkdir()
        path.chmod(0o770)
    else:
        path.touch(0o700)
    with pytest.raises(can.CanInitializationError, match="own with mode 0700"):
        join("bench")


def test_a_channel_on_which_nobody_else_is_is_not_taken_for_a_bus_of_dead_drives(
    join: Callable[..., can.BusABC], monkeypatch: pytest.MonkeyPatch
) -> None:
    del join  # sets the folder of the channels
    monkeypatch.setattr(opening, "COMPANY", 0.0)
    with pytest.raises(BusUnavailable) as refused:
        open_can_bus("local", "bench", {})
    said = str(refused.value)
    assert "no other program on this channel" in said
    assert f"user {os.getuid()}" in said
    assert "XDG_RUNTIME_DIR" in said
    assert "wiring" not in said


def test_a_program_that_joins_a_moment_later_is_waited_for(
    join: Callable[..., can.BusABC],
) -> None:
    later = threading.Timer(0.2, join)
    later.start()
    with open_can_bus("local", "bench", {}) as bus:
        later.join()
        bus.send(frame())
    with open_can_bus("local", "bench", {}):  # existing peers are found at once
        pass


@pytest.mark.parametrize(
    ("channel", "base", "said"),
    [
        ("a b", "", "must be a name such as bench"),
        ("bench", "gone", "XDG_RUNTIME_DIR names a folder that cannot be used: unset it"),
        ("bench", "d" * 110, "shorter path with XDG_RUNTIME_DIR"),
        ("n" * 110, "", "choose a shorter channel name"),
    ],
)
def test_a_channel_that_cannot_be_opened_says_so_once_and_what_to_do(
    join: Callable[..., can.BusABC],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    channel: str,
    base: str,
    said: str,
) -> None:
    del join
    if base and base != "gone":
        (tmp_path / base).mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / base))
    with pytest.raises(BusUnavailable) as refused:
        open_can_bus("local", channel, {})
    assert said in str(refused.value)
    assert str(refused.value).count("channel '") == 1
    assert "check channel and options" not in str(refused.value)


def test_a_folder_that_others_could_read_is_closed_to_them(
    join: Callable[..., can.BusABC], tmp_path: Path
) -> None:
    folder = tmp_path / f"can-local-{os.getuid()}"
    folder.mkdir()
    folder.chmod(0o755)
    join("bench")
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


@pytest.mark.parametrize(("mode", "refused"), [(0o777, True), (0o770, True), (0o1777, False)])
def test_a_place_open_to_others_is_refused(
    join: Callable[..., can.BusABC],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    mode: int,
    refused: bool,
) -> None:
    base = tmp_path / "s" / "o"
    base.mkdir(mode=0o700, parents=True)
    base.parent.chmod(mode)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(base))
    with (
        pytest.raises(can.CanInitializationError, match="can replace") if refused else nullcontext()
    ):
        join("bench")


TWO_USERS = """
import json, os, socket, sys
import can
from drivers.can_bus.local_bus import LocalBus

os.chroot(sys.argv[1])  # in the test's folder, since its parents admit this user alone
os.chdir("/tmp")
os.environ["XDG_RUNTIME_DIR"] = ""
MINE, THEIRS = 61_001, 61_002

def become(user):
    os.setgroups([]); os.setresgid(user, user, user); os.setresuid(user, user, user)

def as_user(user, act):
    reading, writing = os.pipe()
    if not os.fork():
        become(user)
        os.write(writing, json.dumps(act()).encode())
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as answer:
        said = json.load(answer)
    os.wait()
    return said

def tried(act, *arguments):
    try:
        act(*arguments)
    except (OSError, can.CanError) as error:
        return str(error)
    return ""

def send(bus):
    bus.send(can.Message(arbitration_id=0x99, is_extended_id=False))

def intrude():
    with LocalBus("bench") as theirs, socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as raw:
        send(theirs)
        folder = f"/tmp/can-local-{MINE}/bench"
        return {"list": tried(os.listdir, folder), "write": tried(raw.connect, member),
                "delete": tried(os.unlink, member), "plant": tried(os.mkdir, folder + "/x")}

def plant():
    os.umask(0)
    os.makedirs(f"/tmp/can-local-{MINE + 2}/bench")
    raw = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    raw.bind(f"/tmp/can-local-{MINE + 2}/bench/1-1")
    return ""

if sys.argv[2] == "intrude":
    os.setresuid(MINE, MINE, 0)
    with LocalBus("bench") as bus:
        member = str(bus._address)
        os.setresuid(0, 0, 0)
        said = as_user(THEIRS, intrude)
        said["heard"] = str(bus.recv(0.1))
else:
    as_user(THEIRS, plant)
    said = {"join": as_user(MINE + 2, lambda: tried(LocalBus, "bench")),
            "left": os.listdir(f"/tmp/can-local-{MINE + 2}/bench")}
print(json.dumps(said))
"""


def _two_users(folder: Path, what: str) -> dict[str, str]:
    if os.geteuid() != 0:
        pytest.skip("only root can act as two users")
    folder.chmod(0o755)
    (folder / "tmp").mkdir()
    (folder / "tmp").chmod(0o1777)
    done = subprocess.run(  # noqa: S603 - our own program
        [sys.executable, "-c", TWO_USERS, str(folder), what],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    if "os.chroot" in done.stderr:
        pytest.skip("this root may not change its root folder")
    assert not done.returncode, done.stderr
    said: dict[str, str] = json.loads(done.stdout)
    return said


def test_another_user_neither_reads_nor_sends_nor_deletes_on_a_channel(tmp_path: Path) -> None:
    said = _two_users(tmp_path, "intrude")
    for act in ("list", "write", "delete", "plant"):
        assert "Permission denied" in said[act], act
    assert said["heard"] == "None"


def test_a_channel_that_another_user_has_planted_is_refused_and_left_alone(tmp_path: Path) -> None:
    said = _two_users(tmp_path, "plant")
    assert "belongs to user 61002" in said["join"]
    assert said["left"] == ["1-1"]
