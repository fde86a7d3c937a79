"""Found settings at the command line: listed beforehand, kept in the run, restored after a kill."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import can
import local_drives
import pytest
from canopen_drive_bus import CanopenDriveBus
from downloads import downloads
from local_bench import NODES, drives_file
from probing_bench import DRIVES, spoilt_plant
from two_processes import open_bus, plant_process

from checked_files.yaml_file import FileError
from drivers.canopen.bus import CanopenBus
from drivers.commissioning.announcement import announce
from drivers.drives_file import load_drives
from drivers.found_settings.settings_file import NAME, load_found_settings
from drivers.operator_tools import put_back
from hil.cli import bus_access
from hil.planning.plan import Plan, dump_plan
from hil.runs.run_folder import RunFolder
from hil.tasks import bus_state
from hil.tasks.bus_state import BusState

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from command_line import Hil


PLACE = ("local", f"restore-{os.getpid()}")


@pytest.fixture
def plan_file(tmp_path: Path, small_plan: Plan) -> Path:
    path = tmp_path / "plan.yaml"
    path.write_text(dump_plan(small_plan))
    return path


def test_what_changes_is_listed_for_each_drive_and_nothing_is_written(
    hil: Hil, plan_file: Path, tmp_path: Path
) -> None:
    with can.Bus("manutec-r15", "sim_plant", ignore_config=True) as listener:
        status, out, _ = hil("run", plan_file, "-o", tmp_path / "run", "--what-changes")
        sent = list(iter(lambda: listener.recv(0), None))
    assert status == 0
    assert sent
    assert downloads(sent) == []
    own = {frame.arbitration_id for frame in sent if frame.arbitration_id < 0x580}
    assert own == set(), "neither NMT nor SYNC nor process data"
    assert not (tmp_path / "run").exists()
    for number in range(1, 7):
        assert f"joint {number} (node {number})" in out
    (row,) = [line for line in out.splitlines() if "1016:01" in line][:1]
    assert row.split()[-2:] == ["0", f"{127 << 16 | 500:08X}h"]
    assert "no object was written, no axis was powered" in out


def test_a_run_keeps_what_was_found_in_its_folder_and_says_that_it_is_put_back(
    hil: Hil, plan_file: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    status, _, err = hil("run", plan_file, "-o", folder)
    assert (status, err) == (0, "")
    kept = load_found_settings(folder / NAME)
    assert kept.restored
    assert len(kept.drives) == 6
    assert all(len(drive.objects) > 30 for drive in kept.drives)
    assert RunFolder.open(folder).missing == ()
    status, out, _ = hil("drives", "restore", folder / NAME)
    assert (status, "nothing was written" in out) == (0, True)


def test_a_plan_beyond_the_drives_own_limits_is_refused_before_anything_moves(
    hil: Hil, plan_file: Path, tmp_path: Path
) -> None:
    plant = spoilt_plant(tmp_path, ("velocity_max: 5.2", "velocity_max: 1.0"))
    log = tmp_path / "frames.log"
    status, _, err = hil(
        "run", plan_file, "-o", tmp_path / "run", "--channel", plant, "--frame-log", log
    )
    assert status == 1
    assert "the plan exceeds what the drives allow; nothing has moved" in err
    assert "i1: 1.5 rad/s is above the limit of joint 3, 1.0" in err
    assert "joint 3 (joint 3): velocity of the drive 1 (607F), of the robot file 5.2" in err
    assert "607D" not in err, "which differs by rounding alone"
    with can.LogReader(log) as frames:
        commands = [f for f in frames if 0x200 < f.arbitration_id < 0x280]
    assert commands, "the drives were powered on"
    assert not any(frame.data[4] & 0x10 for frame in commands), "no set-point was given"
    assert not (tmp_path / "run").exists(), "nothing was measured, all drives are as found"


def test_the_ways_between_measurements_keep_within_the_drives_own_limits(
    hil: Hil, plan_file: Path, tmp_path: Path
) -> None:
    plant = spoilt_plant(tmp_path, ("velocity_max: 3.0", "velocity_max: 0.3"))
    status, _, err = hil("run", plan_file, "-o", tmp_path / "run", "--channel", plant)
    assert (status, err) == (0, "")
    notes = RunFolder.open(tmp_path / "run").journal.sessions[0].notes
    assert any("own max motor speed (6080) is 0.3" in note for note in notes)


def start(*arguments: object) -> subprocess.Popen[bytes]:
    return subprocess.Popen(  # noqa: S603 - our own program
        [sys.executable, "-m", "hil", *map(str, arguments)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def state_of_the_drives() -> dict[tuple[int, int, int], int]:
    """Return the changes that start-up would make, by asking the drives."""
    drives = load_drives(DRIVES)
    with open_bus(PLACE) as bus:
        found = {}
        off = CanopenBus(bus, "lock-step").unpowered(drives)
        for server, axis, by in zip(off.servers, drives.axes, off.communications, strict=True):
            announced = announce(server, axis, drives, drives.sync_period, by)
            for entry, value in announced.found.items():
                found[axis.node, entry.index, entry.subindex] = value
    return found


def let_time_pass(syncs: int) -> None:
    """Advance the plant's time without a master's heartbeat."""
    identity = bytes.fromhex("4018100100000000")
    with open_bus(PLACE) as bus:
        for _ in range(syncs):
            for identifier, data in ((0x80, b""), (0x601, identity)):
                bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))
            while (frame := bus.recv(60.0)) is None or frame.arbitration_id != 0x581:
                assert frame is not None


@pytest.mark.long
def test_after_kill_9_the_drives_are_put_back_once_they_are_off(
    hil: Hil, plan_file: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    where = ("--interface", PLACE[0], "--channel", PLACE[1])
    with plant_process(PLACE):
        before = state_of_the_drives()
        run = start("run", plan_file, "-o", folder, *where, "--pacing", "lock-step")
        while not list(folder.glob("recordings/*.h5")):
            assert run.poll() is None
            time.sleep(0.01)
        run.kill()
        run.wait()
        left = state_of_the_drives()
        assert len({place for place, value in left.items() if before.get(place) != value}) > 60

        status, _, err = hil("drives", "restore", folder / NAME, *where)
        assert status == 1
        assert "nothing was written" in err
        assert "joint 1 (node 1): shows OPERATION ENABLED" in err
        assert state_of_the_drives() == left

        for command in (
            ("run", plan_file, "-o", tmp_path / "other"),
            ("drives", "jog", DRIVES, 6, "--by", 1),
        ):
            status, _, err = hil(*command, *where)
            assert status == 1
            assert f"hil drives restore {folder / NAME} --interface local" in err
        assert not (tmp_path / "other").exists()
        assert state_of_the_drives() == left

        let_time_pass(400)  # longer than the drives' heartbeat time-out
        status, out, err = hil("drives", "restore", folder / NAME, *where)
        assert (status, err) == (0, "")
        assert "the settings of all drives are restored" in out
        assert {p: v for p, v in state_of_the_drives().items() if p in before} == before
        assert load_found_settings(folder / NAME).restored
        status, out, _ = hil("drives", "restore", folder / NAME, *where)
        assert (status, "nothing was written" in out) == (0, True)
        BusState(*PLACE).refuse_left_behind(None)


@pytest.mark.long
def test_a_command_without_a_folder_keeps_what_it_found_until_it_is_put_back(
    hil: Hil, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    text = DRIVES.read_text().replace("sync_period: 0.004", "sync_period: 0.04")
    slow = tmp_path / "slow.drives.yaml"
    slow.write_text(text.replace("heartbeat_timeout: 0.5", "heartbeat_timeout: 2"))
    where = ("--interface", PLACE[0], "--channel", PLACE[1])
    path = BusState(*PLACE).settings
    assert path.is_relative_to(tmp_path)
    seen: list[bool] = []
    real = bus_state.SettingsKeeper.close

    def close(self: bus_state.SettingsKeeper, *arguments: object) -> list[str]:
        seen.append(path.exists())
        return real(self, *arguments)

    monkeypatch.setattr(bus_state.SettingsKeeper, "close", close)
    with plant_process(PLACE, "--clock", "wall"):
        status, out, err = hil("drives", "jog", slow, 6, "--by", 1, *where, "--yes")
    assert (status, err) == (0, "")
    assert "off" in out
    assert seen == [True]
    assert not path.exists()


def test_restoring_states_what_drives_do_not_take_back_and_is_done(
    hil: Hil, tmp_path: Path
) -> None:
    path = tmp_path / NAME
    identity = "{vendor: 0x4D2, product: 0x402, revision: 0x10000, serial: 1}"
    path.write_text(
        f"bitrate: 1000000\ndrives:\n- name: joint 1\n  node: 1\n  identity: {identity}\n"
        "  objects:\n"
        "  - {index: 0x6072, subindex: 0, type: u16, value: 65535, name: max torque}\n"
        "  - {index: 0x6065, subindex: 0, type: u32, value: 7}\n"
    )
    status, out, err = hil("drives", "restore", path)
    assert status == 1
    assert "joint 1 (node 1): cannot write 65535 to object 6072:00 (max torque)" in err
    assert "except for refused objects: joint 1 6072:00 (max torque)" in out
    assert load_found_settings(path).restored
    status, out, err = hil("drives", "restore", path)
    assert (status, err) == (0, "")
    assert "nothing was written" in out
    assert "joint 1 6072:00 (max torque)" in out


# State left by sessions for the next session on their bus


BUS = ("virtual", "bench")
ON_BUS = ("--interface", BUS[0], "--channel", BUS[1])


@pytest.fixture
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Use a temporary state directory."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "hil" / "found-settings"


def killed_run(folder: Path) -> None:
    """Create the folder of a run killed while its drives had power."""
    folder.mkdir()
    with (
        bus_state.keeper_of_run(folder, *BUS) as keeper,
        local_drives.LocalBus(NODES, {}) as can_bus,
        CanopenDriveBus(can_bus, drives_file(), keeper=keeper),
    ):
        files = {p: p.read_bytes() for p in (folder / NAME, BusState(*BUS).word)}
    for path, content in files.items():
        path.write_bytes(content)


def test_where_the_folder_of_a_killed_run_is_gone_its_bus_is_refused_until_it_is_back(
    state: Path, tmp_path: Path
) -> None:
    folder, elsewhere = tmp_path / "run", tmp_path / "renamed"
    killed_run(folder)
    folder.rename(elsewhere)
    word = BusState(*BUS).word
    assert word.is_relative_to(state)
    for keeper in (
        bus_state.keeper_of_bus(*BUS),
        bus_state.keeper_of_run(tmp_path / "other", *BUS),
        bus_state.keeper_of_run(folder, *BUS),
    ):
        with pytest.raises(FileError, match="put its folder back") as caught, keeper:
            pass
        assert f"{folder / NAME}: is missing" in str(caught.value)
        assert f"remove {word}" in str(caught.value)
    elsewhere.rename(folder)
    with bus_state.keeper_of_run(folder, *BUS):
        pass
    assert word.exists(), "nothing was put back"


def test_a_run_that_writes_to_no_drive_leaves_nothing(state: Path, tmp_path: Path) -> None:
    with bus_state.keeper_of_run(tmp_path / "run", *BUS):
        assert not BusState(*BUS).word.exists(), "a kill leaves nothing either"
    assert [path.suffix for path in state.iterdir()] == [".lock"]


@pytest.mark.parametrize("content", [b"", b"\n", b"\xff\xfe", b"run/found-settings.yaml\n"])
def test_a_damaged_name_of_a_run_is_refused_with_the_remedy(
    content: bytes, state: Path, tmp_path: Path
) -> None:
    killed_run(tmp_path / "run")
    word = BusState(*BUS).word
    word.write_bytes(content)
    with (
        pytest.raises(FileError, match=r"hil drives restore FOLDER/found-settings\.yaml") as caught,
        bus_state.keeper_of_bus(*BUS),
    ):
        pass
    assert str(caught.value).startswith(f"{word}:")
    assert str(caught.value).endswith(f"then remove {word}")


@pytest.mark.parametrize("command", ["run", "check", "jog", "home", "restore"])
def test_beside_a_session_on_its_bus_every_command_to_drives_is_refused(
    command: str, hil: Hil, plan_file: Path, state: Path, tmp_path: Path
) -> None:
    killed_run(tmp_path / "killed")
    arguments = {
        "run": ("run", plan_file, "-o", tmp_path / "run"),
        "check": ("drives", "check", DRIVES),
        "jog": ("drives", "jog", DRIVES, 6, "--by", 1),
        "home": ("drives", "home", DRIVES, 5),
        "restore": ("drives", "restore", tmp_path / "killed" / NAME),
    }[command]
    with BusState(*BUS).locked():
        status, out, err = hil(*arguments, *ON_BUS)
    assert (status, out) == (1, "")
    assert "virtual bench: another process commands the drives of this bus now" in err
    assert f"{state / 'virtual-bench.lock'}; wait for its end" in err


@pytest.fixture
def buses(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str]]:
    """Record which buses are opened; each has the drives of a killed run."""
    opened: list[tuple[str, str]] = []

    def bus(interface: str, channel: str, _: object) -> CanopenBus:
        opened.append((interface, channel))
        return CanopenBus(local_drives.LocalBus(NODES, {1: {(0x1016, 1): ("u32", 1)}}))

    monkeypatch.setattr(bus_access, "open_fieldbus", bus)
    return opened


def test_settings_are_put_back_on_the_bus_of_the_killed_session(
    hil: Hil, state: Path, tmp_path: Path, buses: list[tuple[str, str]]
) -> None:
    killed_run(tmp_path / "killed")
    path = tmp_path / "killed" / NAME
    for where in (("--channel", "other"), ("--interface", "pcan", "--channel", BUS[1])):
        status, _, err = hil("drives", "restore", path, *where)
        assert status == 1
        assert f"{path}: belongs to drives on virtual bench, not on " in err
        assert "add --other-bus" in err
    assert buses == []
    status, out, _ = hil("drives", "restore", path)
    assert status == 0
    assert out.index("joint 1 (node 1): has no serial number") < out.index("1016:01")
    assert buses == [BUS]
    assert not BusState(*BUS).word.exists()


def test_settings_are_put_back_on_another_bus_where_that_is_stated(
    hil: Hil, state: Path, tmp_path: Path, buses: list[tuple[str, str]]
) -> None:
    killed_run(tmp_path / "killed")
    path = tmp_path / "killed" / NAME
    where = ("--interface", "pcan", "--channel", "PCAN_USBBUS2", "--other-bus")
    assert hil("drives", "restore", path, *where)[0] == 0
    assert buses == [("pcan", "PCAN_USBBUS2")]
    assert not BusState(*BUS).word.exists(), "the run's own bus may be used again"


def test_no_session_begins_while_settings_are_put_back(
    hil: Hil, state: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    killed_run(tmp_path / "killed")
    refused: list[str] = []

    def begin(*_: object) -> Iterator[None]:
        with pytest.raises(FileError) as caught, bus_state.keeper_of_bus(*BUS):
            pass
        refused.append(str(caught.value))
        return iter(())

    monkeypatch.setattr(put_back, "put_back", begin)
    hil("drives", "restore", tmp_path / "killed" / NAME, *ON_BUS)
    assert "another process commands the drives" in refused[0]


def test_on_the_virtual_plant_commands_without_a_folder_keep_nothing(
    hil: Hil, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert hil("drives", "jog", "manutec-r15", 6, "--by", 1, "--yes")[0] == 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("text", ["", "format: 2\n", "bitrate: 1\ndrives: []\n"])
def test_a_file_that_is_none_is_refused_at_its_line(hil: Hil, text: str, tmp_path: Path) -> None:
    path = tmp_path / NAME
    path.write_text(text)
    status, _, err = hil("drives", "restore", path)
    assert status == 1
    assert f"{path}:1: " in err


def test_names_in_a_file_are_neither_markup_nor_commands_to_the_terminal(
    hil: Hil, tmp_path: Path
) -> None:
    path = tmp_path / NAME
    identity = "{vendor: 0x4D2, product: 0x402, revision: 0x10000, serial: 1}"
    each = '{index: 0x6065, subindex: 0, type: u32, value: 7, name: "[/]\\e[2Jx"}'
    path.write_text(
        'bitrate: 1000000\ndrives:\n- name: "[/red]\\e]0;\\a"\n  node: 1\n'
        f"  identity: {identity}\n  objects:\n  - {each}\n"
    )
    status, out, err = hil("drives", "restore", path)
    assert (status, err) == (0, "")
    assert r"[/red]\x1b]0;\x07 (node 1)" in out
    assert r"[/]\x1b[2Jx" in out
