"""Emergencies of drives: errors, warnings, and the stated reason of a fault."""

from __future__ import annotations

import pytest
from fake_fieldbus import FakeFieldbus

from drivers.cia402.objects import ERROR_CODE
from drivers.cia402.supervision import Supervision


def emergency(code: int) -> bytes:
    return code.to_bytes(2, "little") + bytes(6)


@pytest.fixture
def bus() -> FakeFieldbus:
    return FakeFieldbus(3)


@pytest.fixture
def supervision(bus: FakeFieldbus) -> Supervision:
    return Supervision(bus.drives)


def test_an_emergency_is_a_warning_one_sync_after_the_next_and_only_once(
    supervision: Supervision,
) -> None:
    assert not supervision.emergency
    found = []
    for _ in range(2):
        supervision.take_emergency(2, emergency(0x4210))
        assert supervision.emergency
        found.append([len(supervision.warnings()) for _ in range(3)])
        assert not supervision.emergency
    assert found == [[0, 1, 0], [0, 0, 0]]


@pytest.mark.parametrize("syncs", [0, 1])
def test_an_emergency_of_the_time_before_is_no_warning_any_more(
    supervision: Supervision, syncs: int
) -> None:
    supervision.take_emergency(2, emergency(0x4210))
    for _ in range(syncs):
        assert supervision.warnings() == []
    supervision.forget()
    assert not supervision.emergency
    assert [supervision.warnings() for _ in range(3)] == [[]] * 3


def test_the_same_emergency_of_another_drive_is_another_warning(supervision: Supervision) -> None:
    for node in (1, 2):
        supervision.take_emergency(node, emergency(0x4210))
    supervision.warnings()
    assert [warning[:15] for warning in supervision.warnings()] == [
        "axis 1: warning",
        "axis 2: warning",
    ]


@pytest.mark.parametrize("code", [0x0000, 0x0001, 0x00FF])
def test_a_code_of_class_00_says_that_the_error_is_gone(
    bus: FakeFieldbus, supervision: Supervision, code: int
) -> None:
    supervision.take_emergency(1, emergency(code))
    assert not supervision.emergency
    supervision.take_emergency(1, emergency(0x8611))
    assert supervision.reason(bus.drives[0]).startswith("8611")
    supervision.take_emergency(1, emergency(code))
    assert supervision.reason(bus.drives[0]) == "the drive does not say why"


@pytest.mark.parametrize("code", [0x0100, 0x1000, 0xFF00])
def test_a_code_of_any_other_class_is_an_error(supervision: Supervision, code: int) -> None:
    supervision.take_emergency(1, emergency(code))
    assert supervision.emergency


@pytest.mark.parametrize("length", [0, 1])
def test_a_frame_too_short_for_a_code_says_nothing(
    bus: FakeFieldbus, supervision: Supervision, length: int
) -> None:
    supervision.take_emergency(1, emergency(0x8611))
    supervision.take_emergency(1, bytes(length))
    assert supervision.reason(bus.drives[0]).startswith("8611")


def test_without_an_emergency_the_drive_is_asked_for_its_reason(
    bus: FakeFieldbus, supervision: Supervision
) -> None:
    bus.drives[1].put(ERROR_CODE, 0x7121)
    assert supervision.reason(bus.drives[1]).startswith("7121 (motor blocked)")
