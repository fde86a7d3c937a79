"""Settings of the drives are kept, announced and restored, over real frames."""

from __future__ import annotations

import math
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

import can
import canopen
import local_drives
import pytest
from canopen_drive_bus import CanopenDriveBus
from downloads import Place, downloads
from hypothesis import given
from hypothesis import strategies as st
from local_bench import NODES, drives_file
from personalities import FIT, UNFIT, drives_for, plant_file
from probing_bench import Scripted

from checked_files.yaml_file import FileError, parse_yaml
from drivers.canopen.bus import CanopenBus
from drivers.commissioning.announcement import announce
from drivers.commissioning.held_values import COMMANDS
from drivers.drive_bus import DriveError, DriveRefused, Move
from drivers.found_settings.keeping import SettingsKeeper
from drivers.found_settings.settings_file import (
    SETTINGS,
    WRITTEN_ONCE,
    FoundDrive,
    FoundIdentity,
    FoundObject,
    FoundSettings,
    dump_found_settings,
    load_found_settings,
)
from drivers.operator_tools.home import home
from drivers.operator_tools.put_back import put_back
from hil.runs.atomic_file import write_file

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

LEFT_OUT = COMMANDS | {0x1003}
"""Commands and error history: the history is written by the drive alone,
and a master may clear it.
"""


def dictionaries(bus: can.BusABC) -> dict[Place, object]:
    """Return every value of the plant's drives that the bus can read and write."""
    found = {}
    for node in bus._plant._network.nodes:
        entries = node.dictionary._entries.values()
        for entry in entries:
            if entry.readable and entry.writable and entry.index not in LEFT_OUT:
                data = node.dictionary.upload(entry.index, entry.subindex)
                found[node.node_id, entry.index, entry.subindex] = data
    return found


@contextmanager
def heard(channel: str) -> Iterator[tuple[can.BusABC, Callable[[], list[can.Message]]]]:
    """Bus of a plant, and its frames since the last call."""
    with (
        can.Bus(channel, "sim_plant", ignore_config=True) as bus,
        can.Bus(channel, "sim_plant", ignore_config=True) as listener,
    ):

        def frames() -> list[can.Message]:
            return list(iter(lambda: listener.recv(0), None))

        yield bus, frames


def moved(axes: CanopenDriveBus) -> None:
    """Run a usual session: a move of an axis."""
    axes.move({4: Move(axes.sample().q[4] + 0.05, 0.5, 5.0)})
    while not axes.sample().reached:
        pass


def interrupted(axes: CanopenDriveBus) -> None:
    """Run a session interrupted by Ctrl-C in the middle of a move."""
    axes.move({4: Move(axes.sample().q[4] + 0.5, 0.5, 5.0)})
    for _ in range(50):
        axes.sample()
    raise KeyboardInterrupt


# Leaving drives as they were found


def streamed(axes: CanopenDriveBus) -> None:
    """Run a session with a path streamed at every SYNC."""
    here = axes.sample().q
    ramp = [0.01 * (1 - math.cos(math.pi * k / 100)) for k in range(101)]
    axes.stream([[q + way for q in here] for way in ramp])
    while not axes.sample().reached:
        pass


@pytest.mark.parametrize("session", [moved, interrupted, streamed])
@pytest.mark.parametrize("name", ["plain", *FIT])
def test_after_a_session_every_drive_holds_what_it_held(
    name: str, session: Callable[[CanopenDriveBus], None], tmp_path: Path
) -> None:
    with heard(plant_file(tmp_path, name)) as (bus, frames):
        before = dictionaries(bus)
        keeper = SettingsKeeper(tmp_path / "found.yaml", write_file)
        with (
            suppress(KeyboardInterrupt),
            CanopenDriveBus(bus, drives_for(name), keeper=keeper) as axes,
        ):
            changed = {p for p, v in dictionaries(bus).items() if v != before[p]}
            session(axes)
        after = dictionaries(bus)
        assert {p: (v, after[p]) for p, v in before.items() if v != after[p]} == {}
        written = {place for place in downloads(frames()) if place in before}
    kept = load_found_settings(tmp_path / "found.yaml")
    places = {(d.node, *each.key) for d in kept.drives for each in d.objects}
    assert len(changed) > 60
    assert changed <= written <= places
    assert keeper.unannounced == []
    assert kept.restored
    assert [note for note in axes.notes if "earlier values not restored" in note] == []


def test_after_homing_a_drive_holds_what_it_held(tmp_path: Path) -> None:
    drives = drives_for("plain")
    axis = drives.axes[4]
    assert axis.homing is not None
    homing = axis.homing.model_copy(update={"method": 37, "position": 0.5})
    with heard("manutec-r15") as (bus, _):
        before = dictionaries(bus)
        path = tmp_path / "found.yaml"
        keeper = SettingsKeeper(path, write_file)
        assert home(
            CanopenBus(bus), drives, axis, homing, Scripted(), patience=5, keeper=keeper
        ) == (pytest.approx(0.5, abs=1e-3))
        assert dictionaries(bus) == before
    assert keeper.unannounced == []
    kept = {each.index for each in load_found_settings(path).drives[0].objects}
    assert {0x6098, 0x6099, 0x609A, 0x607C, 0x6060} <= kept


@pytest.mark.parametrize("name", ["plain", *FIT])
def test_what_will_change_is_announced_without_writing_anything(name: str, tmp_path: Path) -> None:
    drives = drives_for(name)
    with heard(plant_file(tmp_path, name)) as (bus, frames):
        before = dictionaries(bus)
        off = CanopenBus(bus).unpowered(drives)
        asked = zip(off.servers, drives.axes, off.communications, strict=True)
        announced = {
            (axis.node, change.entry.index, change.entry.subindex): change
            for server, axis, by in asked
            for change in announce(server, axis, drives, drives.sync_period, by).changes
        }
        assert downloads(frames()) == []
        with CanopenDriveBus(bus, drives):
            changed = {p for p, v in dictionaries(bus).items() if v != before[p]}
    assert changed <= set(announced)
    for place, change in announced.items():
        data = before.get(place)
        if isinstance(data, bytes):
            present = int.from_bytes(data, "little", signed=change.entry.signed)
            assert change.present == present


def two_at_most(index: int, sub: int, value: int) -> int | None:
    """Abort like a drive whose TPDOs hold two objects."""
    too_many = sub > 2 or (sub == 0 and value > 2)
    return 0x06090011 if index in {0x1A00, 0x1A01} and too_many else None


def test_what_a_drive_with_room_for_two_objects_will_hold_is_announced_as_a_condition() -> None:
    can_bus, drives = local_drives.LocalBus(NODES, {}), drives_file()
    drive = can_bus.drives[2]
    drive.forbids = two_at_most
    with can_bus:
        off = CanopenBus(can_bus).unpowered(drives)
        server, by = off.servers[1], off.communications[1]
        announced = announce(server, drives.axes[1], drives, drives.sync_period, by)
        found = dict(values(drive))
        keeper = SettingsKeeper()
        with CanopenDriveBus(can_bus, drives, keeper=keeper):
            held = {place: data for place, data in values(drive) if data != found[place]}
        assert dict(values(drive)) == found
    assert keeper.unannounced == []
    last = {(c.entry.index, c.entry.subindex): c for c in announced.changes}
    pdos = {place for place in held if 0x1800 <= place[0] < 0x1C00}
    assert pdos >= {(0x1801, 1), (0x1801, 2), (0x1A01, 0), (0x1A01, 1), (0x1A00, 0)}
    for place in pdos:
        assert last[place].value.to_bytes(len(held[place]), "little") == held[place]
    conditional = {
        place for place, c in last.items() if c.entry.name.endswith("if TPDO 1 is smaller")
    }
    assert conditional == {(0x1801, 1), (0x1801, 2), (0x1A01, 0), (0x1A01, 1), (0x1A00, 0)}


@pytest.mark.parametrize("name", UNFIT)
def test_a_drive_that_is_refused_has_not_been_changed(name: str, tmp_path: Path) -> None:
    with heard(plant_file(tmp_path, name)) as (bus, _):
        before = dictionaries(bus)
        with pytest.raises(DriveRefused):
            CanopenDriveBus(bus, drives_for(name)).__enter__()
        assert dictionaries(bus) == before


def test_where_one_drive_is_refused_nothing_is_written_to_any() -> None:
    can_bus = local_drives.LocalBus(NODES, {3: {(0x1018, 1): ("u32", 9)}})
    with can_bus, pytest.raises(DriveRefused):
        CanopenDriveBus(can_bus, drives_file()).__enter__()
    assert {place[1] for place in downloads(can_bus.sent)} == {0x6040}


def test_all_found_values_are_on_the_disk_before_anything_is_written(tmp_path: Path) -> None:
    path = tmp_path / "found.yaml"
    can_bus = local_drives.LocalBus(NODES, {})
    at_first: list[FoundSettings] = []

    def look(frame: can.Message) -> None:
        if not at_first and any(place[1] not in COMMANDS for place in downloads([frame])):
            at_first.append(load_found_settings(path))

    can_bus.on_send = look
    with can_bus, CanopenDriveBus(can_bus, drives_file(), keeper=SettingsKeeper(path, write_file)):
        pass
    (then,) = at_first
    assert not then.restored
    assert [drive.node for drive in then.drives] == [1, 2, 3]
    end = load_found_settings(path)
    assert end.restored
    assert [d.objects for d in end.drives] == [d.finish().objects for d in then.drives]


def test_where_nothing_can_be_kept_nothing_is_written(tmp_path: Path) -> None:
    can_bus = local_drives.LocalBus(NODES, {})
    keeper = SettingsKeeper(tmp_path / "gone" / "found.yaml", write_file)
    with can_bus, pytest.raises(FileError, match=r"found\.yaml: cannot be written"):
        CanopenDriveBus(can_bus, drives_file(), keeper=keeper).__enter__()
    assert {place[1] for place in downloads(can_bus.sent)} == {0x6040}


def test_an_object_that_is_written_unforeseen_is_kept_first(tmp_path: Path) -> None:
    path = tmp_path / "found.yaml"
    can_bus = local_drives.LocalBus(NODES, {2: {(0x607C, 0): ("i32", -70)}})
    offset = local_drives_entry(0x607C, "i32")
    keeper = SettingsKeeper(path, write_file)
    with can_bus:
        with CanopenDriveBus(can_bus, drives_file(), keeper=keeper) as axes:
            axes.servers[1].set(offset, 5)
            axes.servers[1].set(offset, 6)
            objects = load_found_settings(path).drives[1].objects
            assert [o.value for o in objects if o.index == 0x607C] == [-70]
        stated = "joint 2 (node 2): 607C:00 (x) was written without having been announced"
        assert stated in axes.notes
        assert can_bus.drives[2].node.get_data(0x607C, 0) == (-70).to_bytes(
            4, "little", signed=True
        )


def local_drives_entry(index: int, kind: str) -> Any:
    from drivers.fieldbus import Entry

    return Entry(index, 0, kind, "x")


def test_moves_of_known_profile_cost_no_request_more() -> None:
    can_bus = local_drives.LocalBus(NODES, {})
    with can_bus, CanopenDriveBus(can_bus, drives_file()) as axes:
        moved_to(axes, 0.1)
        can_bus.sent.clear()
        moved_to(axes, 0.0)
        assert [f for f in can_bus.sent if 0x600 < f.arbitration_id < 0x680] == []


def moved_to(axes: CanopenDriveBus, target: float) -> None:
    axes.move({0: Move(target, 0.5, 5.0)})
    while not axes.sample().reached:
        pass


# Order of restoring


def test_the_watchdog_is_put_back_last_and_never_to_a_drive_that_is_on() -> None:
    can_bus = local_drives.LocalBus(NODES, {})
    with can_bus, suppress(DriveError):
        with CanopenDriveBus(can_bus, drives_file()) as axes:
            can_bus.sent.clear()
            can_bus.drives[2].stuck |= {"enabled", "stopping"}
        written = downloads(can_bus.sent)
        assert [place[1:] for place in written if place[0] == 1][-1] == (0x1016, 1)
        assert {place[1] for place in written if place[0] == 2} == {0x6040}
        assert can_bus.drives[2].value(0x1016, 1) == 127 << 16 | 500
        assert any("joint 2 (node 2): earlier values not restored" in note for note in axes.notes)


def test_pdos_are_put_back_in_the_order_that_the_standard_asks_for() -> None:
    mapped = {(0x1A00, 0): ("u8", 1), (0x1A00, 1): ("u32", 0x60640020), (0x1800, 1): ("u32", 0x1A1)}
    can_bus = local_drives.LocalBus(NODES, {1: mapped})
    with can_bus:
        with CanopenDriveBus(can_bus, drives_file()):
            can_bus.sent.clear()
        written = [p[1:] for p in downloads(can_bus.sent) if p[0] == 1 and p[1] in {0x1800, 0x1A00}]
    off, identifier = (0x1800, 1), (0x1800, 1)
    order = [off, identifier, (0x1A00, 0), (0x1A00, 1), (0x1A00, 0), (0x1800, 2), (0x1800, 1)]
    assert [place for place in written if place[1] < 2 or place == (0x1800, 2)] == order
    assert can_bus.drives[1].value(0x1800, 1) == 0x1A1


def test_a_value_that_a_drive_does_not_take_back_keeps_no_other_from_it(tmp_path: Path) -> None:
    path = tmp_path / "found.yaml"
    can_bus = local_drives.LocalBus(NODES, {})
    with can_bus:
        with CanopenDriveBus(
            can_bus, drives_file(), keeper=SettingsKeeper(path, write_file)
        ) as axes:
            can_bus.drives[1].insists[0x6065, 0] = 77
        assert can_bus.drives[1].value(0x6081) == 0
        assert can_bus.drives[1].value(0x1016, 1) == 0
    (note,) = [note for note in axes.notes if "earlier values not restored" in note]
    assert "joint 1 (node 1)" in note
    assert f"hil drives restore {path}" in note
    kept = load_found_settings(path)
    assert [drive.restored for drive in kept.drives] == [False, True, True]
    assert not kept.restored


def aborting(drive: Any, index: int, code: int = 0x06090030) -> None:
    """Let a drive refuse further values of an object."""
    fixed = index

    def refuse(index: int, **_: object) -> None:
        if index == fixed:
            raise canopen.SdoAbortedError(code)

    drive.node.add_write_callback(refuse)


def test_a_mode_that_cannot_be_written_is_left_as_the_session_chose_it(tmp_path: Path) -> None:
    path = tmp_path / "found.yaml"
    can_bus = local_drives.LocalBus(NODES, {})
    with can_bus:
        with CanopenDriveBus(
            can_bus, drives_file(), keeper=SettingsKeeper(path, write_file)
        ) as axes:
            aborting(can_bus.drives[1], 0x6060)
        assert can_bus.drives[1].value(0x6060) == 1
    assert load_found_settings(path).restored
    assert not any("earlier values not restored" in note for note in axes.notes)


def test_what_a_drive_does_not_take_back_is_reported_once_and_keeps_no_session_away(
    tmp_path: Path,
) -> None:
    path = tmp_path / "found.yaml"
    with crashed(path, SERIALS) as can_bus:
        settings = load_found_settings(path)
        aborting(can_bus.drives[2], 0x607F)
        first, second, third = put_back(CanopenBus(can_bus), settings)
        assert (first.problem, third.problem) == ("", "")
        assert "joint 2 (node 2): cannot write 0 to object 607F:00" in second.problem
        done = settings.update_drives([first.drive, second.drive, third.drive])
        assert done.restored
        assert [each.refused for each in done.drives][0::2] == [(), ()]
        assert [entry.index for entry in done.drives[1].refused] == [0x607F]
        assert parse_yaml(dump_found_settings(done), FoundSettings, "found.yaml") == done
        assert can_bus.drives[2].value(0x1016, 1) == 0


# A killed session


def crashed(path: Path, changes: dict[int, Any] | None = None) -> Any:
    """Return local drives after a killed session: switched off by the watchdog, with our values."""
    can_bus = local_drives.LocalBus(NODES, changes or {})
    with CanopenDriveBus(can_bus, drives_file(), keeper=SettingsKeeper(path, write_file)):
        kept = path.read_bytes()
        objects = {n: dict(values(drive)) for n, drive in can_bus.drives.items()}
    for node, drive in can_bus.drives.items():
        for (index, sub), data in objects[node].items():
            drive.node.set_data(index, sub, data)
    path.write_bytes(kept)
    return can_bus


def values(drive: Any) -> Iterator[tuple[tuple[int, int], bytes]]:
    for index, sub in local_drives.OBJECTS:
        with suppress(KeyError):
            if index not in {0x6040, 0x6041, 0x6061, 0x6064, 0x6078, 0x607A, 0x603F}:
                yield (index, sub), drive.node.get_data(index, sub)


def has_delivered_values(can_bus: Any, changes: dict[int, Any] | None = None) -> bool:
    """Return True if all drives have their values from before the first session."""
    fresh = local_drives.LocalBus(NODES, changes or {})
    return all(
        dict(values(drive)) == dict(values(fresh.drives[node]))
        for node, drive in can_bus.drives.items()
    )


SERIALS = {node: {(0x1018, 4): ("u32", 1000 + node)} for node in range(1, NODES + 1)}


def test_what_a_killed_session_left_is_put_back_and_doing_it_twice_is_harmless(
    tmp_path: Path,
) -> None:
    path = tmp_path / "found.yaml"
    with crashed(path, SERIALS) as can_bus:
        assert not has_delivered_values(can_bus, SERIALS)
        settings = load_found_settings(path)
        first = list(put_back(CanopenBus(can_bus), settings))
        assert has_delivered_values(can_bus, SERIALS)
        assert all(each.written and not each.problem for each in first)
        can_bus.sent.clear()
        again = list(put_back(CanopenBus(can_bus), settings))
        assert downloads(can_bus.sent) == []
        assert not any(each.written for each in again)
        done = settings.update_drives(each.drive for each in first)
        assert done.restored
        assert list(put_back(CanopenBus(can_bus), done)) == []


def test_values_of_another_drive_are_refused_by_its_serial_number(tmp_path: Path) -> None:
    path = tmp_path / "found.yaml"
    with crashed(path, SERIALS) as can_bus:
        can_bus.drives[2].node.set_data(0x1018, 4, (4711).to_bytes(4, "little"))
        can_bus.sent.clear()
        with pytest.raises(DriveRefused) as caught:
            list(put_back(CanopenBus(can_bus), load_found_settings(path)))
        assert downloads(can_bus.sent) == []
    assert "joint 2 (node 2): not the drive of the file" in str(caught.value)
    assert "1018:04 (serial number) was 000003EAh, now it is 00001267h" in str(caught.value)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda drive: drive.go("enabled"), "joint 3 (node 3): shows OPERATION ENABLED"),
        (lambda drive: drive.go("stopping"), "joint 3 (node 3): shows QUICK STOP ACTIVE"),
        (lambda drive: setattr(drive, "powered", False), "joint 3 (node 3): no answer"),
    ],
)
def test_where_a_drive_is_energised_or_missing_nothing_is_put_back_to_any(
    spoil: Callable[[Any], None], words: str, tmp_path: Path
) -> None:
    path = tmp_path / "found.yaml"
    with crashed(path) as can_bus:
        spoil(can_bus.drives[3])
        can_bus.sent.clear()
        with pytest.raises(DriveError, match="nothing was written") as caught:
            list(put_back(CanopenBus(can_bus), load_found_settings(path)))
        assert downloads(can_bus.sent) == []
    assert words in str(caught.value)


def test_values_kept_by_a_killed_session_stand_for_the_next_one(tmp_path: Path) -> None:
    path = tmp_path / "found.yaml"
    with crashed(path) as can_bus:
        keeper = SettingsKeeper(path, write_file)
        with CanopenDriveBus(can_bus, drives_file(), keeper=keeper):
            pass
        assert has_delivered_values(can_bus)
        assert load_found_settings(path).restored


def test_limits_that_a_killed_session_wrote_are_not_taken_for_the_drives_own(
    tmp_path: Path,
) -> None:
    path, narrow = tmp_path / "found.yaml", drives_file().model_dump()
    with crashed(path) as can_bus:
        for each in narrow["axes"]:
            each["limits"]["velocity"] = 5.0
        wider = type(drives_file()).model_validate(narrow)
        keeper = SettingsKeeper(path, write_file)
        with CanopenDriveBus(can_bus, wider, keeper=keeper) as axes:
            assert [axis.velocity_max for axis in axes.axes] == [5.0, 5.0, 5.0]
            assert not any("own max profile velocity" in note for note in axes.notes)


def set_anew(drive: Any) -> None:
    """Set narrow limits as the maker's tool would."""
    drive.node.set_data(0x6072, 0, (300).to_bytes(2, "little"))
    drive.node.set_data(0x607D, 2, (60_000).to_bytes(4, "little"))


def test_limits_that_were_set_anew_after_a_kill_hold_in_the_next_session_and_after_it(
    tmp_path: Path,
) -> None:
    path = tmp_path / "found.yaml"
    ends = {(0x607D, 1): ("i32", -900_000), (0x607D, 2): ("i32", 900_000)}
    wide = {1: {(0x6072, 0): ("u16", 5000), **ends}}
    with crashed(path, wide) as can_bus:
        drive = can_bus.drives[1]
        assert drive.value(0x6072) == 3000
        set_anew(drive)
        keeper = SettingsKeeper(path, write_file)
        with CanopenDriveBus(can_bus, drives_file(), keeper=keeper) as axes:
            assert (drive.value(0x6072), drive.value(0x607D, 2)) == (300, 60_000)
            assert axes.held[0].own == {"torque": "6072", "q_max": "607D"}
        assert (drive.value(0x6072), drive.value(0x607D, 2)) == (300, 60_000)
        assert can_bus.drives[2].value(0x6072) == 0
    assert load_found_settings(path).restored
    (note,) = [note for note in axes.notes if "6072:00" in note]
    assert "held 5000 before and 3000 in an interrupted session" in note
    assert "joint 1 (node 1)" in note
    assert "300" in note


def test_what_was_set_anew_after_a_kill_is_not_put_back_and_reported(tmp_path: Path) -> None:
    path = tmp_path / "found.yaml"
    with crashed(path) as can_bus:
        set_anew(can_bus.drives[1])
        first, *others = put_back(CanopenBus(can_bus), load_found_settings(path))
        assert can_bus.drives[1].value(0x6072) == 300
        assert can_bus.drives[1].value(0x607D, 2) == 60_000
        assert can_bus.drives[1].value(0x6065) == 0
        assert can_bus.drives[2].value(0x6072) == 0
    assert first.drive.restored
    assert [line.split(" held ")[0] for line in first.left] == [
        "joint 1 (node 1): object 607D:02 (max position limit)",
        "joint 1 (node 1): object 6072:00 (max torque)",
    ]
    assert not {(0x6072, 0), (0x607D, 2)} & {(e.index, e.subindex) for e, *_ in first.written}
    assert [each.left for each in others] == [(), ()]


def test_a_value_that_a_drive_rounds_is_ours_and_not_set_anew(tmp_path: Path) -> None:
    path = tmp_path / "found.yaml"
    can_bus = local_drives.LocalBus(NODES, {})
    can_bus.drives[1].insists[0x6065, 0] = 3_258
    with (
        can_bus,
        CanopenDriveBus(can_bus, drives_file(), keeper=SettingsKeeper(path, write_file)),
    ):
        kept = load_found_settings(path).drives[0].objects
        (window,) = [each for each in kept if each.index == 0x6065]
        assert (window.value, window.written) == (3_258, 3_258)


def test_what_a_session_will_write_is_on_the_disk_before_it_writes(tmp_path: Path) -> None:
    path = tmp_path / "found.yaml"
    at_first: list[FoundSettings] = []
    with crashed(path) as can_bus:

        def look(frame: can.Message) -> None:
            if not at_first and any(place[1] not in COMMANDS for place in downloads([frame])):
                at_first.append(load_found_settings(path))

        can_bus.on_send = look
        before = written(load_found_settings(path))
        with CanopenDriveBus(can_bus, drives_file(), keeper=SettingsKeeper(path, write_file)):
            again = written(load_found_settings(path))
    assert {0x6072, 0x607D, 0x607F, 0x6065} <= before == again
    assert before.isdisjoint({0x6060, 0x6081, 0x6083, 0x6084, 0x1016}), "which change in a session"
    assert again <= written(at_first[0])
    (torque,) = [o for o in at_first[0].drives[0].objects if o.index == 0x6072]
    assert (torque.value, torque.written) == (0, 3000)


@pytest.mark.parametrize(("identity", "doubtful"), [({}, True), (SERIALS, False)])
def test_values_of_a_killed_session_are_noted_where_drives_without_serial_number_may_be_swapped(
    identity: dict[int, Any], doubtful: bool, tmp_path: Path
) -> None:
    path = tmp_path / "found.yaml"
    with crashed(path, identity) as can_bus:
        keeper = SettingsKeeper(path, write_file)
        with CanopenDriveBus(can_bus, drives_file(), keeper=keeper) as axes:
            noted = [note for note in axes.notes if "has no serial number" in note]
    assert len(noted) == (NODES if doubtful else 0)


def written(settings: FoundSettings) -> set[int]:
    """Return the indices of the objects in a file with a value written by a session."""
    kept = [each for drive in settings.drives for each in drive.objects]
    return {each.index for each in kept if each.written is not None}


def test_a_file_about_another_drive_stops_a_session_before_anything_is_written(
    tmp_path: Path,
) -> None:
    path = tmp_path / "found.yaml"
    with crashed(path, SERIALS) as can_bus:
        can_bus.drives[1].node.set_data(0x1018, 4, (1).to_bytes(4, "little"))
        can_bus.sent.clear()
        before = path.read_bytes()
        with pytest.raises(DriveRefused, match=r"settings of another drive.*1018:04"):
            CanopenDriveBus(
                can_bus, drives_file(), keeper=SettingsKeeper(path, write_file)
            ).__enter__()
        assert {place[1] for place in downloads(can_bus.sent)} == {0x6040}
        assert path.read_bytes() == before


# The file


NUMBERS = {
    "u8": (0, 0xFF), "u16": (0, 0xFFFF), "u32": (0, 0xFFFFFFFF),
    "i8": (-128, 127), "i16": (-32768, 32767), "i32": (-(2**31), 2**31 - 1),
}  # fmt: skip
PLACES = st.tuples(st.sampled_from([0x1006, 0x1016, 0x1600, 0x1A00, 0x607D]), st.integers(0, 255))
U32 = st.none() | st.integers(0, 0xFFFFFFFF)


@st.composite
def objects(draw: Any) -> FoundObject:
    index, subindex = draw(PLACES)
    kind = draw(st.sampled_from(sorted(NUMBERS)))
    value = draw(st.integers(*NUMBERS[kind]))
    name = draw(st.text(max_size=20))
    written = draw(st.none() | st.integers(*NUMBERS[kind]))
    return FoundObject(
        index=index,
        subindex=subindex,
        type=kind,
        value=value,
        name=name,
        written=written,
        refused=draw(st.booleans()),
    )


@st.composite
def settings_of_drives(draw: Any) -> FoundSettings:
    nodes = draw(st.lists(st.integers(1, 127), unique=True, max_size=3))
    drives = [
        FoundDrive(
            name=draw(st.text(min_size=1, max_size=20).filter(str.strip)),
            node=node,
            identity=FoundIdentity(
                vendor=draw(U32), product=draw(U32), revision=draw(U32), serial=draw(U32)
            ),
            restored=draw(st.booleans()),
            objects=tuple(draw(st.lists(objects(), max_size=4, unique_by=lambda o: o.key))),
        )
        for node in nodes
    ]
    interface, channel = draw(st.sampled_from([(None, None), ("pcan", 'PCAN_USBBUS1: "a"')]))
    empty = FoundSettings(
        bitrate=500_000,
        sdo_timeout=draw(st.floats(0.01, 30)),
        interface=interface,
        channel=channel,
    )
    return empty.update_drives(drives)


@given(settings_of_drives())
def test_what_is_kept_is_read_again_as_it_was(settings: FoundSettings) -> None:
    assert parse_yaml(dump_found_settings(settings), FoundSettings, "found.yaml") == settings


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"index": 0x6040}, "6040h is not a setting"),
        ({"index": 0x607A}, "607Ah is not a setting"),
        ({"index": 0x1010}, "1010h is not a setting"),
        ({"index": 0x1F51}, "1F51h is not a setting"),
        ({"index": 0x2000}, "2000h is not a setting"),
        ({"index": 0x1000}, "1000h is not a setting"),
        ({"index": 0x1200}, "1200h is not a setting"),
        ({"index": 0x6410}, "6410h is not a setting"),
        ({"index": 0x6840}, "6840h is not a setting"),
        ({"type": "u8", "value": 256}, r"value 256 must be in \[0, 255\] of a u8"),
        ({"written": 1 << 32}, r"value 4294967296 must be in"),
        ({"type": "i8", "value": 128}, r"value 128 must be in \[-128, 127\] of a i8"),
    ],
)
def test_a_file_that_commands_a_drive_or_does_not_fit_is_refused_at_its_line(
    change: dict[str, object], words: str
) -> None:
    each = {"index": 0x6065, "subindex": 0, "type": "u32", "value": 1, **change}
    text = (
        "bitrate: 1000000\ndrives:\n- name: a\n  node: 1\n  identity: {}\n  objects:\n"
        f"  - {each}\n"
    )
    with pytest.raises(FileError, match=rf"found\.yaml:7: drives\.0\.objects\.0.*{words}"):
        parse_yaml(text, FoundSettings, "found.yaml")


# Never wider


PER_RADIAN = 4096 * 100 / (2 * math.pi)
RPM = 2 * math.pi / 60 / 100
OBJECTS = {
    (0x607F, 0): ("u32", round(1.5 * PER_RADIAN)),
    (0x6080, 0): ("u32", 1000),
    (0x60C5, 0): ("u32", round(9 * PER_RADIAN)),
    (0x60C6, 0): ("u32", round(8 * PER_RADIAN)),
    (0x6085, 0): ("u32", round(12 * PER_RADIAN)),
    (0x6072, 0): ("u16", 1200),
}


def entered(objects: dict[tuple[int, int], Any], node: int = 1) -> Any:
    can_bus = local_drives.LocalBus(NODES, {node: objects})
    return can_bus, CanopenDriveBus(can_bus, drives_file())


@pytest.mark.parametrize("place", OBJECTS)
def test_a_limit_of_the_drives_own_is_never_widened(place: tuple[int, int]) -> None:
    kind, value = OBJECTS[place]
    can_bus, drive_bus = entered({place: (kind, value)})
    with can_bus, drive_bus as axes:
        assert can_bus.drives[1].value(*place) == value
        (note,) = [n for n in axes.notes if n.startswith("joint 1") and f"({place[0]:04X})" in n]
    assert "tighter than the drives file's limits." in note
    assert "the drive's limit applies" in note


@pytest.mark.parametrize("place", OBJECTS)
@pytest.mark.parametrize("unset", ["zero", "ones", "wide"])
def test_a_limit_that_is_not_set_or_wider_becomes_that_of_the_file(
    place: tuple[int, int], unset: str
) -> None:
    kind = OBJECTS[place][0]
    ones = (1 << int(kind[1:])) - 1
    value = {"zero": 0, "ones": ones, "wide": ones // 2}[unset]
    can_bus, drive_bus = entered({place: (kind, value)})
    ours = {
        0x607F: int(2 * PER_RADIAN), 0x6080: math.ceil(2 / RPM), 0x60C5: int(20 * PER_RADIAN),
        0x60C6: int(20 * PER_RADIAN), 0x6085: int(20 * PER_RADIAN), 0x6072: 3000,
    }  # fmt: skip
    with can_bus, drive_bus as axes:
        assert can_bus.drives[1].value(*place) == ours[place[0]]
        assert axes.held[0].own == {}
        assert axes.held[0].drive.limits == drives_file().axes[0].limits


def test_what_holds_is_what_the_driver_believes_and_what_moves_are_checked_against() -> None:
    can_bus, drive_bus = entered(OBJECTS)
    with can_bus, drive_bus as axes:
        info, limits = axes.axes[0], axes.held[0]
        assert info.velocity_max == pytest.approx(1000 * RPM)
        assert info.acceleration_max == pytest.approx(8, rel=1e-5)
        assert limits.drive.limits.torque == pytest.approx(120)
        assert limits.stop_deceleration == pytest.approx(8, rel=1e-5), "60C6 bounds 6085 too"
        assert limits.own == {"velocity": "6080", "acceleration": "60C6", "torque": "6072"}
        for move, words in (
            (Move(0.1, 1.2, 5.0), "velocity 1.2 .* the drive's own limit 6080"),
            (Move(0.1, 1.0, 8.5), "acceleration 8.5 .* the drive's own limit 60C6"),
        ):
            with pytest.raises(DriveError, match=words):
                axes.move({0: move})
        axes.move({0: Move(0.1, 1.0, 7.9), 1: Move(0.1, 1.2, 8.5)})


@pytest.mark.parametrize(("node", "inside", "outside"), [(1, -0.5, 0.6), (2, 0.5, -0.6)])
def test_a_target_beyond_the_drives_own_range_is_refused_by_its_object(
    node: int, inside: float, outside: float
) -> None:
    """Axis 2 has a reversed direction, and a zero other than 0."""
    zero = 500 * (node - 1)
    ends = {(0x607D, 1): ("i32", zero - 60_000), (0x607D, 2): ("i32", zero + 30_000)}
    can_bus, drive_bus = entered(ends, node)
    with can_bus, drive_bus as axes:
        low, high = sorted(s * n / PER_RADIAN for s, n in [(1, -60_000), (1, 30_000)])
        if node == 2:
            low, high = -high, -low
        assert (axes.axes[node - 1].q_min, axes.axes[node - 1].q_max) == pytest.approx((low, high))
        assert can_bus.drives[node].value(0x607D, 2) == zero + 30_000
        with pytest.raises(DriveError, match=r"must be in .* the drive's own limit 607D"):
            axes.move({node - 1: Move(outside, 0.5, 5.0)})
        axes.move({node - 1: Move(inside, 0.5, 5.0)})
    (note,) = [n for n in axes.notes if "607D" in n]
    assert "are narrower than the drives file's [-2, 2] rad; used:" in note


def test_a_streamed_path_beyond_the_drives_own_range_is_refused_by_its_object() -> None:
    ends = {(0x607D, 1): ("i32", -30_000), (0x607D, 2): ("i32", 30_000)}
    can_bus, drive_bus = entered(ends)
    ramp = [[0.5 * (1 - math.cos(math.pi * k / 500)), 0.0, 0.0] for k in range(501)]
    with can_bus, drive_bus as axes, pytest.raises(DriveError, match="own limit 607D"):
        axes.stream(ramp)


def test_each_end_of_the_range_is_the_tighter_one() -> None:
    can_bus, drive_bus = entered({(0x607D, 1): ("i32", -60_000), (0x607D, 2): ("i32", 900_000)})
    with can_bus, drive_bus:
        assert can_bus.drives[1].value(0x607D, 2) == round(2 * PER_RADIAN)
        low = can_bus.drives[1].node.get_data(0x607D, 1)
        assert int.from_bytes(low, "little", signed=True) == -60_000
        assert drive_bus.held[0].own == {"q_min": "607D"}


def test_ranges_with_nothing_in_common_are_refused_with_both() -> None:
    can_bus, drive_bus = entered({(0x607D, 1): ("i32", 200_000), (0x607D, 2): ("i32", 300_000)})
    with (
        can_bus,
        pytest.raises(DriveRefused, match=r"607D.*\[3.068, 4.6019\].*\[-2, 2\].*do not overlap"),
    ):
        drive_bus.__enter__()


def test_a_drive_without_6085_says_nothing_of_its_stop() -> None:
    can_bus, drive_bus = entered({})
    with can_bus, drive_bus as axes:
        assert axes.held[0].stop_deceleration is None


def test_every_setting_that_files_on_disk_may_hold_is_one() -> None:
    communication = {0x1005, 0x1006, 0x100C, 0x100D, 0x1016, 0x1017, 0x1019, *range(0x1400, 0x1C00)}
    communication |= {0x1C12, 0x1C13, 0x1C32, 0x1C33}  # over EtherCAT
    kept = {0x6007, 0x605A, 0x605D, 0x6065, 0x6066, 0x6067, 0x6068, 0x6072, 0x6073, 0x607D, 0x607F}
    kept |= {0x6080, 0x6085, 0x6086, 0x60C5, 0x60C6}
    changing = {0x6060, 0x607C, 0x6081, 0x6083, 0x6084, 0x6098, 0x6099, 0x609A, 0x60C2, 0x2010}
    assert communication | kept | changing == SETTINGS
    assert kept == WRITTEN_ONCE
    assert not SETTINGS & COMMANDS
