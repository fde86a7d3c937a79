"""Drives with deviations in communication: usable ones, and ones that cannot share the bus."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import can
import pytest
from canopen_drive_bus import CanopenDriveBus
from local_bench import build, drives_file, never_energised
from personalities import drives_for, plant_file
from pydantic import ValidationError

from drivers.axis import AxisScale
from drivers.canopen.monitor import BusPicture
from drivers.canopen.sync_rate import achievable_rate, cycle_time
from drivers.cia402.states import State
from drivers.drive_bus import DriveFault, DriveRefused, Move
from drivers.drives_file import AxisDrive, DrivesFile

if TYPE_CHECKING:
    from pathlib import Path

Objects = dict[tuple[int, int], Any]

OFF = 1 << 31
SCALES = [AxisScale.derive(axis) for axis in drives_file().axes]
IDENTIFIER_AND_FRAME = (1 << 30) - 1
STATUS, POSITION, CURRENT, MODE = 0x60410010, 0x60640020, 0x60780010, 0x60610008


def tpdo(number: int, node: int, *words: int, kind: int = 1) -> Objects:
    """Return the records of a TPDO with these objects at each SYNC."""
    communication, mapping = 0x17FF + number, 0x19FF + number
    return {
        (communication, 1): ("u32", 0x80 + 0x100 * number + node),
        (communication, 2): ("u8", kind),
        (mapping, 0): ("u8", len(words)),
        **{(mapping, n): ("u32", word) for n, word in enumerate(words, start=1)},
    }


def fixed(changes: Objects, *, node: int = 2, only: Objects | None = None) -> Any:
    """Return local drives, one of which has other, read-only objects."""
    can_bus, drive_bus = build({node: changes})
    dictionary = can_bus.drives[node].node.object_dictionary
    for index, sub in changes if only is None else only:
        entry = dictionary[index]
        (entry[sub] if sub or index in {0x1A00, 0x1A01, 0x1600} else entry).access_type = "ro"
    return can_bus, drive_bus


def refused(can_bus: Any, drive_bus: CanopenDriveBus) -> str:
    with can_bus:
        with pytest.raises(DriveRefused) as caught:
            drive_bus.__enter__()
        assert never_energised(can_bus)
    return str(caught.value)


# What TPDOs carry


@pytest.mark.parametrize(
    "words",
    [
        (POSITION, STATUS, CURRENT),
        (CURRENT, POSITION, STATUS),
        (STATUS, CURRENT, POSITION),
    ],
)
def test_a_fixed_tpdo_is_read_in_the_order_that_the_drive_has(words: tuple[int, ...]) -> None:
    can_bus, drive_bus = fixed(tpdo(1, 2, *words))
    drive = can_bus.drives[2]
    with can_bus, drive_bus:
        drive.position = drive.target = 777.0
        drive.node.set_data(0x6078, 0, (-40 & 0xFFFF).to_bytes(2, "little"))
        first, second, third = drive_bus.sample().q
        assert second == SCALES[1].position_from_counts(777.0)
        assert (first, third) == (0.0, SCALES[2].position_from_counts(0.0))
        assert drive_bus.sample().tau[1] == -40 * SCALES[1].torque
        drive.state = "off"
        with pytest.raises(DriveFault, match=r"joint 2 .*left OPERATION ENABLED"):
            drive_bus.sample()


def test_a_fixed_pair_of_tpdos_may_carry_more_than_is_needed() -> None:
    changes = tpdo(1, 2, MODE, STATUS, POSITION) | tpdo(2, 2, 0x60770010, CURRENT)
    changes[0x6077, 0] = ("i16", 12)
    can_bus, drive_bus = fixed(changes, only=tpdo(1, 2, 0, 0, 0) | tpdo(2, 2, 0, 0))
    drive = can_bus.drives[2]
    with can_bus, drive_bus:
        drive.position = drive.target = -321.0
        drive.node.set_data(0x6078, 0, (55).to_bytes(2, "little"))
        sample = drive_bus.sample()
        assert sample.flags == (0, 0, 0)
        assert sample.q[1] == SCALES[1].position_from_counts(-321.0)
        assert sample.tau[1] == 55 * SCALES[1].torque


def test_a_lost_frame_of_a_pair_is_flagged_and_the_axis_is_not_guessed() -> None:
    can_bus, drive_bus = build({2: {(0x1A00, 3): None}})
    with can_bus, drive_bus:
        can_bus.outgoing = lambda frame: [] if frame.arbitration_id == 0x282 else [frame]
        flags = drive_bus.sample().flags
        can_bus.outgoing = lambda frame: [frame]
        assert [bool(flag) for flag in flags] == [False, True, False]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ((STATUS, MODE, CURRENT), "1A00:02 .* is fixed at 60610008h, 60640020h is needed"),
        ((POSITION, CURRENT), "1A00:00 .* is fixed at 2, 60410010h is needed"),
        ((STATUS, POSITION), "1A00:00 .* is fixed at 2, 60780010h is needed"),
        ((STATUS, POSITION, 0x20010001), "1A00:03 .* is fixed at 20010001h, whole bytes"),
    ],
)
def test_a_fixed_tpdo_that_lacks_what_is_needed_is_refused(
    words: tuple[int, ...], reason: str
) -> None:
    can_bus, drive_bus = fixed(tpdo(1, 2, *words))
    with can_bus, pytest.raises(DriveRefused, match=f"joint 2 .*{reason}"):
        drive_bus.__enter__()


def test_a_fixed_rpdo_in_another_order_is_refused() -> None:
    changes: Objects = {
        (0x1400, 1): ("u32", 0x202),
        (0x1600, 0): ("u8", 2),
        (0x1600, 1): ("u32", 0x60400010),
        (0x1600, 2): ("u32", 0x607A0020),
    }
    assert "1600:01 (object 1 of RPDO 1) is fixed at 60400010h, 607A0020h" in refused(
        *fixed(changes)
    )


def test_a_fixed_tpdo_that_does_not_answer_each_sync_is_refused() -> None:
    message = refused(*fixed(tpdo(1, 2, POSITION, STATUS, CURRENT, kind=255)))
    assert "1800:02 (transmission type of TPDO 1) is fixed at 255, 1 is needed" in message


@pytest.mark.parametrize("found", [0x40000191, 0x191, 0x20000191, 0xC0000191])
def test_an_identifier_that_is_locked_while_its_pdo_is_valid_is_changed_and_put_back(
    found: int,
) -> None:
    can_bus, drive_bus = build({2: {(0x1800, 1): ("u32", found), (0x1400, 1): ("u32", 0x222)}})
    drive = can_bus.drives[2]

    def locked(index: int, sub: int, value: int) -> int | None:
        if index not in {0x1400, 0x1800} or sub != 1 or drive.value(index, 1) & OFF:
            return None
        return 0x06090030 if (drive.value(index, 1) ^ value) & IDENTIFIER_AND_FRAME else None

    drive.forbids = locked
    with can_bus:
        with drive_bus:
            assert drive_bus.sample().flags == (0, 0, 0)
            assert drive.value(0x1800, 1) == found & 1 << 30 | 0x182
            assert drive.value(0x1400, 1) == 0x202
        assert drive.value(0x1800, 1) == found
        assert drive.value(0x1400, 1) == 0x222


def stated(*tpdos: tuple[int, ...]) -> DrivesFile:
    drives = drives_file()
    second = drives.axes[1].model_dump() | {"tpdos": tpdos}
    axes = [drives.axes[0], AxisDrive.model_validate(second), drives.axes[2]]
    return drives.model_copy(update={"axes": tuple(axes)})


def test_what_the_tpdos_carry_may_be_stated_for_those_who_only_listen() -> None:
    order = (POSITION, STATUS, CURRENT)
    can_bus, asking = fixed(tpdo(1, 2, *order))
    with can_bus, asking:
        pass
    note = "state tpdos: [[0x60640020, 0x60410010, 0x60780010]] in the drives file"
    assert any(note in found for found in asking.notes)
    drives = stated(order)
    can_bus, _ = fixed(tpdo(1, 2, *order))
    with can_bus, CanopenDriveBus(can_bus, drives) as drive_bus:
        drive = can_bus.drives[2]
        drive.position = drive.target = 500.0
        sample = drive_bus.sample()
        data = drive._mapped(0x1A00)
    assert not any("tpdos" in found for found in drive_bus.notes)
    picture = BusPicture(drives)
    picture.take(can.Message(arbitration_id=0x182, data=data, is_extended_id=False), 0.0)
    assert picture.axes[1].q == sample.q[1]
    assert picture.axes[1].state is State.OPERATION_ENABLED


def test_a_statement_that_the_drive_contradicts_is_refused_with_both() -> None:
    can_bus, _ = fixed(tpdo(1, 2, POSITION, STATUS, CURRENT))
    message = refused(can_bus, CanopenDriveBus(can_bus, stated((CURRENT, POSITION, STATUS))))
    assert "carry [[0x60640020, 0x60410010, 0x60780010]], the drives file states" in message
    assert "[[0x60780010, 0x60640020, 0x60410010]]; correct tpdos" in message


def transmitted_by(drive_bus: Any) -> list[Any]:
    """Return the TPDOs sent by each drive after set-up."""
    return [each.transmitted for each in drive_bus._session.connection.communications]


def test_a_stated_mapping_is_written_to_a_drive_that_takes_it() -> None:
    can_bus, _ = build()
    with can_bus, CanopenDriveBus(can_bus, stated((STATUS, POSITION), (CURRENT,))) as drive_bus:
        assert drive_bus.sample().flags == (0, 0, 0)
        assert can_bus.drives[2].value(0x1A00, 0) == 2
        assert can_bus.drives[2].value(0x1A01, 1) == CURRENT
    drives = stated((STATUS, POSITION), (CURRENT,))
    assert cycle_time(drives) == pytest.approx(cycle_time(drives, transmitted_by(drive_bus)))


@pytest.mark.parametrize(
    ("tpdos", "reason"),
    [
        (((STATUS, POSITION),), "0x60780010 is missing"),
        (((CURRENT, POSITION),), "0x60410010 is missing"),
        (((STATUS, POSITION, CURRENT, MODE),), r"objects of \[16, 32, 16, 8\] bits"),
        (((STATUS, POSITION, CURRENT, 0x20010001),), "whole bytes"),
        (((STATUS,), (POSITION,), (CURRENT,)), "at most 2"),
    ],
)
def test_a_statement_that_cannot_be_is_refused(
    tpdos: tuple[tuple[int, ...], ...], reason: str
) -> None:
    with pytest.raises(ValidationError, match=reason):
        stated(*tpdos)


def test_two_tpdos_count_in_the_bus_load() -> None:
    can_bus, drive_bus = build({2: {(0x1A00, 3): None}})
    with can_bus, drive_bus:
        sent = transmitted_by(drive_bus)
    drives = drives_file()
    assert [len(own) for own in sent] == [1, 2, 1]
    assert cycle_time(drives, sent) > cycle_time(drives)
    assert achievable_rate(drives, sent=sent) < achievable_rate(drives)


def test_a_current_as_a_real_number_gives_the_torques_of_one_in_milliampere(
    tmp_path: Path,
) -> None:
    found = {}
    for name in ("milliampere", "float-current"):
        with (
            can.Bus(plant_file(tmp_path, name), "sim_plant", ignore_config=True) as bus,
            CanopenDriveBus(bus, drives_for(name)) as drive_bus,
        ):
            for _ in range(20):
                found[name] = drive_bus.sample().tau
            steps = [axis.torque_resolution for axis in drive_bus.axes]
    assert found["float-current"] == pytest.approx(found["milliampere"], rel=1e-6)
    limits = [axis.limits.torque for axis in drives_for("float-current").axes]
    assert steps == pytest.approx([limit / 2**24 for limit in limits])


# Additional frames of the drives


def stubborn(identifier: int, kind: int = 255) -> Any:
    """Return local drives, the second with a TPDO 2 that cannot be switched off."""
    changes: Objects = {(0x1801, 1): ("u32", identifier), (0x1801, 2): ("u8", kind)}
    return fixed(changes)


@pytest.mark.parametrize(
    ("kind", "when"),
    [
        (255, "on event, not read"),
        (254, "on event, not read"),
        (253, "on request, not read"),
        (1, "at every SYNC, which takes up to 3.4% of the bus, not read"),
        (4, "at every 4. SYNC, which takes up to 0.8% of the bus, not read"),
    ],
)
def test_a_tpdo_that_cannot_be_switched_off_is_noted_with_what_it_costs(
    kind: int, when: str
) -> None:
    can_bus, drive_bus = stubborn(0x282, kind)
    with can_bus, drive_bus:
        assert drive_bus.sample().flags == (0, 0, 0)
    note = f"joint 2 (node 2): TPDO 2 cannot be switched off: still sent under 282h {when}"
    assert [n for n in drive_bus.notes if n.startswith(note)]


def test_a_tpdo_that_ignores_being_switched_off_is_noted_too() -> None:
    can_bus, drive_bus = build({2: {(0x1801, 1): ("u32", 0x282)}})
    can_bus.drives[2].insists[0x1801, 1] = 0x282
    with can_bus, drive_bus:
        pass
    assert any("TPDO 2 cannot be switched off" in note for note in drive_bus.notes)


@pytest.mark.parametrize(
    ("identifier", "other"),
    [
        (0x181, "by joint 1 (node 1), for its TPDO 1"),
        (0x182, "by joint 2 (node 2), for its TPDO 1"),
        (0x203, "its RPDO 1"),
        (0x303, "its RPDO 2"),
        (0x083, "its emergencies (1014)"),
        (0x080, "by this program, for SYNC"),
        (0x77F, "by this program, for its heartbeat"),
        (0x583, "the answers of its SDO server"),
    ],
)
def test_a_tpdo_under_an_identifier_in_use_is_refused_with_both(
    identifier: int, other: str
) -> None:
    message = refused(*stubborn(identifier))
    assert f"identifier {identifier:03X}h" in message
    assert "joint 2 (node 2)" in message
    assert "its TPDO 2, which cannot be switched off" in message
    assert other in message


# Emergencies with another identifier


def test_emergencies_are_heard_where_the_drive_sends_them() -> None:
    can_bus, drive_bus = build({2: {(0x1014, 0): ("u32", 0x6A2)}})
    with can_bus, drive_bus:
        can_bus.network.emit(0x6A2, b"\x10\x42" + bytes(6))
        for _ in range(4):
            drive_bus.sample()
        can_bus.network.emit(0x82, b"\x10\x43" + bytes(6))  # identifier of no drive
        for _ in range(4):
            drive_bus.sample()
    warnings = [note for note in drive_bus.notes if "warning" in note]
    assert len(warnings) == 1
    assert warnings[0].startswith("joint 2 (node 2): warning 4210 ")


def test_the_plant_s_emergencies_under_another_identifier_name_the_cause(tmp_path: Path) -> None:
    channel = plant_file(tmp_path, "moved-emergency")
    fault = tmp_path / "fault.yaml"
    fault.write_text("faults: [{what: fault, axis: 3, code: 0x2310, at: {time: 0.5}}]\n")
    with (
        can.Bus(channel, "sim_plant", ignore_config=True, faults=str(fault)) as bus,
        pytest.raises(DriveFault, match=r"joint 3 .*FAULT: 2310 "),
        CanopenDriveBus(bus, drives_for("moved-emergency")) as drive_bus,
    ):
        _sample_for_ever(drive_bus)


def _sample_for_ever(drive_bus: CanopenDriveBus) -> None:
    while True:
        drive_bus.sample()


def test_a_drive_that_sends_no_emergencies_is_noted() -> None:
    can_bus, drive_bus = build({2: {(0x1014, 0): ("u32", OFF | 0x82)}})
    with can_bus, drive_bus:
        pass
    assert any("no emergency messages" in note for note in drive_bus.notes)


def test_two_drives_with_one_identifier_of_emergencies_are_refused_with_both() -> None:
    message = refused(*build({2: {(0x1014, 0): ("u32", 0x83)}}))
    assert "joint 3 (node 3): identifier 083h" in message
    assert "by joint 2 (node 2), for its emergencies (1014)" in message


# Fixed software limits


def limits(low: int, high: int) -> Any:
    return fixed({(0x607D, 1): ("i32", low), (0x607D, 2): ("i32", high)})


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (-(2**30), 2**30, "only the driver enforces the axis's range"),
        (-50000, 2**30, "only the driver enforces the axis's range"),
    ],
)
def test_fixed_software_limits_are_noted_with_both_ranges(low: int, high: int, words: str) -> None:
    can_bus, drive_bus = limits(low, high)
    with can_bus, drive_bus:
        assert drive_bus.sample().reached
    note = next(note for note in drive_bus.notes if "software limits (607D) are fixed" in note)
    assert note.startswith("joint 2 (node 2)")
    assert "those of the drives file are [-2, 2] rad" in note
    assert note.endswith(words)


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (0, 0, "fixed at 0 and 0, which switches them off"),
        (5, -5, "fixed at 5 and -5, which switches them off"),
    ],
)
def test_fixed_software_limits_that_keep_the_axis_from_nothing_are_refused(
    low: int, high: int, words: str
) -> None:
    message = refused(*limits(low, high))
    assert message.startswith("joint 2 (node 2): software limits (607D) are fixed at ")
    assert words in message


# Limits that depend on each other


@pytest.mark.parametrize(
    ("limit", "profile"),
    [(0x607F, 0x6081), (0x60C5, 0x6083), (0x60C6, 0x6084), (0x6085, 0x6084)],
)
def test_a_limit_that_must_not_be_below_the_present_profile_is_written_and_put_back(
    limit: int, profile: int
) -> None:
    found: Objects = {(limit, 0): ("u32", 10_000_000), (profile, 0): ("u32", 5_000_000)}
    can_bus, drive_bus = build({2: found})
    drive = can_bus.drives[2]

    def interlocked(index: int, _: int, value: int) -> int | None:
        below = index == limit and value < drive.value(profile)
        above = index == profile and value > drive.value(limit)
        return 0x06090030 if below or above else None

    drive.forbids = interlocked
    with can_bus:
        with drive_bus:
            drive_bus.move({1: Move(0.1, 0.5, 5.0)})
            assert 0 < drive.value(profile) <= drive.value(limit) < 5_000_000
        assert (drive.value(limit), drive.value(profile)) == (10_000_000, 5_000_000)


def test_a_profile_within_the_limits_is_written_once() -> None:
    can_bus, drive_bus = build({2: {(0x6081, 0): ("u32", 10)}})
    written: list[int] = []
    can_bus.drives[2].forbids = lambda index, *_: written.append(index)
    with can_bus, drive_bus:
        assert written.count(0x6081) == 1


# Shifted or wrapped positions


def noted(objects: Objects) -> list[str]:
    can_bus, drive_bus = build({2: objects})
    with can_bus, drive_bus:
        return [note for note in drive_bus.notes if note.startswith("joint 2") and "607" in note]


@pytest.mark.parametrize(
    ("objects", "words"),
    [
        (
            {(0x607C, 0): ("i32", -70)},
            "607C:00 (home offset) is -70: positions shift by this offset",
        ),
        (
            {(0x607B, 1): ("i32", -180_000), (0x607B, 2): ("i32", 179_999)},
            "positions wrap around at -180000 and 179999 increments (607B), beyond all",
        ),
    ],
)
def test_positions_that_are_shifted_or_wrap_around_are_noted(objects: Objects, words: str) -> None:
    assert sum(words in note for note in noted(objects)) == 1


def test_a_drive_whose_positions_wrap_around_within_the_limits_is_refused() -> None:
    objects: Objects = {(0x607B, 1): ("i32", 0), (0x607B, 2): ("i32", 35_999)}
    reason = refused(*build({2: objects}))
    assert "wrap around in [0, 35999] (607B); limits [-129945, 130945] of the drives file" in reason


@pytest.mark.parametrize(
    "objects",
    [
        {},
        {(0x607C, 0): ("i32", 0)},
        {(0x607B, 1): ("i32", 0), (0x607B, 2): ("i32", 0)},
        {(0x607B, 1): ("i32", -(2**31)), (0x607B, 2): ("i32", 2**31 - 1)},
    ],
)
def test_positions_that_are_neither_are_not(objects: Objects) -> None:
    assert not any("607B" in note or "607C" in note for note in noted(objects))
