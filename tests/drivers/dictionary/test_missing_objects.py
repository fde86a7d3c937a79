"""Data sheet, scan and start-up judge a drive alike."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from data_sheets import Place, Spec, sheet
from local_bench import build, never_energised
from local_drives import LocalBus

from drivers.canopen.eds_file import parse_eds
from drivers.canopen.monitor import scan_bus
from drivers.canopen.rules import RULES
from drivers.dictionary.review import review
from drivers.drive_bus import DriveRefused

if TYPE_CHECKING:
    from drivers.dictionary.review import Review

READ_ONLY, NO_DATA = 0x06010002, 0x08000024
SYNC_PERIOD = 4000
"""SYNC period of the local drives' bus [us]."""


def reviewed(changes: dict[Place, Spec | None]) -> Review:
    return review(parse_eds(sheet(changes).encode(), "drive.eds"), RULES)


def about(index: int, found: Review) -> list[str]:
    return [str(each) for each in found.findings if each.about.startswith(f"{index:04X}")]


UNSUITABLE: dict[int, tuple[str, int]] = {
    0x1005: ("u32", 0x40000080),
    0x1006: ("u32", 0),
    0x1019: ("u8", 240),
    0x6007: ("i16", 0),
    0x605A: ("i16", 0),
    0x605D: ("i16", 0),
    0x6065: ("u32", 0),
    0x6072: ("u16", 0),
    0x607F: ("u32", 0),
    0x6080: ("u32", 0xFFFFFFFF),
    0x6084: ("u32", 1000),
    0x6085: ("u32", 0),
    0x6086: ("i16", 1),
    0x60C5: ("u32", 0),
    0x60C6: ("u32", 0),
}
SUITABLE: dict[int, tuple[str, int]] = {
    0x1005: ("u32", 0x80000080),
    0x1006: ("u32", SYNC_PERIOD),
    0x1019: ("u8", 0),
    0x6007: ("i16", 2),
    0x605A: ("i16", 6),
    0x605D: ("i16", 2),
    0x6066: ("u16", 0),
    0x6068: ("u16", 7),
    0x6072: ("u16", 500),
    0x607F: ("u32", 20000),
    0x6080: ("u32", 100),
    0x6085: ("u32", 20000),
    0x6086: ("i16", 0),
    0x60C5: ("u32", 20000),
    0x60C6: ("u32", 20000),
}


def names(values: dict[int, tuple[str, int]]) -> list[str]:
    return [f"{index:04X}" for index in values]


@pytest.mark.parametrize(("index", "value"), UNSUITABLE.items(), ids=names(UNSUITABLE))
def test_a_value_that_cannot_be_written_and_does_not_serve_refuses_the_drive(
    index: int, value: tuple[str, int]
) -> None:
    kind, fixed = value
    code = {"u8": 5, "u16": 6, "u32": 7, "i16": 3}[kind]
    spec = {"AccessType": "ro", "DefaultValue": fixed, "DataType": code}
    found = reviewed({(index, 0): spec})
    assert not found.serves
    assert about(index, found)[0].startswith(f"{index:04X}:00")
    can_bus, drive_bus = fixed_at(index, value)
    with can_bus:
        with pytest.raises(DriveRefused, match=f"{index:04X}:00"):
            drive_bus.__enter__()
        assert never_energised(can_bus)


@pytest.mark.parametrize(("index", "value"), SUITABLE.items(), ids=names(SUITABLE))
def test_a_value_that_cannot_be_written_and_serves_refuses_no_drive(
    index: int, value: tuple[str, int]
) -> None:
    kind, fixed = value
    code = {"u8": 5, "u16": 6, "u32": 7, "i16": 3}[kind]
    spec = {"AccessType": "ro", "DefaultValue": fixed, "DataType": code}
    assert reviewed({(index, 0): spec}).serves
    can_bus, drive_bus = fixed_at(index, value)
    with can_bus, drive_bus:
        pass


def fixed_at(index: int, value: tuple[str, int]) -> tuple[Any, Any]:
    """Return drives, the second with a read-only object, and the driver on their bus."""
    can_bus, drive_bus = build({2: {(index, 0): value}})
    can_bus.drives[2].forbids = lambda at, *_: READ_ONLY if at == index else None
    return can_bus, drive_bus


@pytest.mark.parametrize("index", [0x6007, 0x605A, 0x6065, 0x6072, 0x6085, 0x60C5, 0x1006])
def test_a_read_only_object_of_unknown_value_is_a_remark(index: int) -> None:
    found = reviewed({(index, 0): {"AccessType": "ro"}})
    assert found.serves
    assert "cannot be written (ro)" in about(index, found)[0]


@pytest.mark.parametrize("index", [0x60C5, 0x60C6])
def test_an_acceleration_that_the_driver_alone_limits_is_stated(index: int) -> None:
    (stated,) = about(index, reviewed({(index, 0): None}))
    assert "is missing: only the driver enforces this limit, not the drive" in stated
    live = scan_bus(LocalBus(1, {1: {(index, 0): None}})).nodes[1].review
    assert live is not None
    assert about(index, live) == [stated]


@pytest.mark.parametrize(("one", "other"), [(0x607F, 0x6080), (0x6080, 0x607F), (0x6072, 0x6073)])
def test_of_two_objects_that_limit_the_same_one_is_enough(one: int, other: int) -> None:
    there: Spec = {"DataType": 7 if one != 0x6072 else 6}
    alone = reviewed({(one, 0): None, (other, 0): there})
    assert about(one, alone) + about(other, alone) == []
    neither = reviewed({(one, 0): None, (other, 0): None})
    assert "only the driver enforces this limit, not the drive" in about(one, neither)[0]


def test_a_limit_of_current_serves_in_place_of_one_of_torque_at_start_up() -> None:
    can_bus, drive_bus = build({2: {(0x6072, 0): None, (0x6073, 0): ("u16", 9999)}})
    with can_bus, drive_bus:
        stated = [note for note in drive_bus.notes if note.startswith("joint 2") and "6072" in note]
    assert stated == []


def test_a_drive_without_limits_of_torque_and_current_is_noted_once() -> None:
    can_bus, drive_bus = build({2: {(0x6072, 0): None, (0x6073, 0): None}})
    with can_bus, drive_bus:
        stated = [note for note in drive_bus.notes if note.startswith("joint 2") and "607" in note]
    assert stated == [
        "joint 2 (node 2): no object 6072:00 (max torque) nor 6073:00 (max current): only the"
        " driver enforces this limit, not the drive"
    ]


def test_a_fault_has_a_cause_where_603f_or_1003_states_it() -> None:
    history: Spec = {"DataType": 7, "AccessType": "ro"}
    assert about(0x603F, reviewed({(0x603F, 0): None, (0x1003, 1): history})) == []
    assert about(0x603F, reviewed({(0x603F, 0): None})) != []


def test_counts_are_compared_with_a_feed_where_there_is_no_encoder_resolution() -> None:
    feed: Spec = {"DataType": 7, "DefaultValue": 4096}
    assert about(0x608F, reviewed({(0x608F, 1): None, (0x6092, 1): feed})) == []
    assert "is not verified" in about(0x608F, reviewed({(0x608F, 1): None}))[0]


def test_the_reaction_to_a_lost_bus_goes_with_the_quick_stop() -> None:
    stays: Spec = {"AccessType": "ro", "DefaultValue": 6}
    fault: Spec = {"AccessType": "const", "DefaultValue": 1}
    stop: Spec = {"AccessType": "const", "DefaultValue": 3}
    assert about(0x6007, reviewed({(0x605A, 0): stays, (0x6007, 0): fault})) == []
    assert about(0x6007, reviewed({(0x605A, 0): stays, (0x6007, 0): stop})) != []
    assert about(0x6007, reviewed({(0x6007, 0): stop})) == []
    assert about(0x6007, reviewed({(0x6007, 0): fault})) != []


def test_a_history_without_errors_is_there() -> None:
    bus = LocalBus(1, {1: {(0x603F, 0): None, (0x1003, 1): ("u32", 0)}})
    bus.drives[1].hides = lambda index, _: NO_DATA if index == 0x1003 else None
    found = scan_bus(bus).nodes[1].review
    assert found is not None
    assert about(0x603F, found) == []


def test_a_scan_asks_whether_a_drive_expects_a_counter_in_sync() -> None:
    found = scan_bus(LocalBus(1, {1: {(0x1019, 0): ("u8", 10)}})).nodes[1].review
    assert found is not None
    assert found.serves, "start-up may set it to 0"
    assert "1019:00 (synchronous counter overflow value) is 10: " in about(0x1019, found)[0]
