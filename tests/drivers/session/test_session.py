"""Connecting either succeeds or leaves all drives unpowered; the bus is always shut down."""

# ruff: noqa: PT012 - the tests examine both body and end of a with block

from __future__ import annotations

import logging
import threading
from typing import TYPE_CHECKING, Any

import local_drives
import pytest
from canopen_drive_bus import CanopenDriveBus
from local_bench import NODES, all_off, drives_file, never_energised

from drivers import opening
from drivers.drive_bus import DriveRefused, Move
from drivers.found_settings.keeping import SettingsKeeper

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import can


class OwnedBus(local_drives.LocalBus):
    closed = 0

    def shutdown(self) -> None:
        self.closed += 1
        super().shutdown()


@pytest.fixture
def can_bus() -> Iterator[Any]:
    bus = OwnedBus(NODES, {})
    yield bus
    bus.shutdown()


@pytest.fixture
def drive_bus(can_bus: Any) -> CanopenDriveBus:
    return CanopenDriveBus(can_bus, drives_file(), owns_bus=True)


def broken(*_: object, **__: object) -> None:
    raise RuntimeError("broken")


# Complete or absent


@pytest.mark.parametrize(
    "part",
    [
        "canopen.connection.PumpedNetwork",
        "canopen.connection.server_of",
        "canopen.connection.SyncProcessData",
        "canopen.connection.Heartbeats",
        "session.connection.Power",
        "session.session.SampleReader",
        "session.session.MissingTelegrams",
        "session.session.CyclicPosition",
        "session.session.Stopping",
    ],
)
def test_whichever_part_cannot_be_built_nothing_is_left_and_the_bus_can_be_entered_later(
    part: str, can_bus: Any, drive_bus: CanopenDriveBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = dict(vars(drive_bus))
    with monkeypatch.context() as patch:
        patch.setattr(f"drivers.{part}", broken)
        with pytest.raises(RuntimeError, match="broken"):
            drive_bus.__enter__()
    assert {**vars(drive_bus), "notes": before["notes"]} == before
    assert can_bus.closed == 1
    assert never_energised(can_bus)
    assert not any(drive.value(0x1016, 1) for drive in can_bus.drives.values())
    with drive_bus:
        drive_bus.sample()


def test_no_attribute_appears_after_the_constructor(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    stated = set(vars(drive_bus))
    with drive_bus:
        drive_bus.move({0: Move(0.1, 1.0, 10.0)})
        drive_bus.sample()
        assert set(vars(drive_bus)) == stated
    assert set(vars(drive_bus)) == stated


def test_what_a_session_found_stays_known_when_it_has_ended_and_nothing_else_serves(
    drive_bus: CanopenDriveBus,
) -> None:
    assert drive_bus.axes == drive_bus.held == drive_bus.servers == ()
    with drive_bus:
        axes, limits = drive_bus.axes, drive_bus.held
    assert (drive_bus.axes, drive_bus.held, len(drive_bus.servers)) == (axes, limits, NODES)
    with pytest.raises(DriveRefused, match="enter the bus first"):
        drive_bus.sample()


# A bus of ours


class Overflowing(SettingsKeeper):
    """Keeper of settings that fails at the end of the session, contrary to its interface."""

    def close(self, *_: object) -> list[str]:
        raise OSError("no space left on device")


def test_a_bus_of_ours_is_shut_down_though_what_was_found_cannot_be_kept(can_bus: Any) -> None:
    with (
        pytest.raises(OSError, match="no space left"),
        CanopenDriveBus(can_bus, drives_file(), owns_bus=True, keeper=Overflowing()) as drive_bus,
    ):
        drive_bus.sample()
    assert can_bus.closed == 1
    assert all_off(can_bus)
    with pytest.raises(DriveRefused, match="enter the bus first"):
        drive_bus.sample()


def test_a_bus_of_ours_is_shut_down_though_what_is_noted_cannot_be_logged(
    can_bus: Any, drive_bus: CanopenDriveBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(RuntimeError, match="broken"), drive_bus:
        drive_bus.sample()
        monkeypatch.setattr(SettingsKeeper, "close", lambda *_: ["not put back"])
        monkeypatch.setattr(logging.getLogger("drivers.session.servo_axes"), "warning", broken)
    assert can_bus.closed == 1
    assert all_off(can_bus)
    assert drive_bus.notes[-1] == "not put back"


def test_an_interrupt_raised_while_leaving_keeps_no_axis_powered(
    can_bus: Any, drive_bus: CanopenDriveBus
) -> None:
    pressed: list[int] = []

    def press(frame: can.Message) -> None:
        if frame.arbitration_id == 0x201 and not pressed:
            pressed.append(1)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), drive_bus:
        drive_bus.sample()
        can_bus.on_send = press
    assert all_off(can_bus)
    assert can_bus.closed == 1


@pytest.fixture
def opened(can_bus: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Local drives' bus, which any opening of a bus by name returns."""
    monkeypatch.setattr("drivers.can_bus.opening.open_can_bus", lambda *_: can_bus)
    return can_bus


def test_a_bus_that_was_opened_is_shut_down_where_no_drive_bus_can_stand_on_it(
    opened: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("drivers.session.servo_axes.ServoAxes", broken)
    with pytest.raises(RuntimeError, match="broken"):
        opening.open_drive_bus(drives_file(), "virtual", "x")
    assert opened.closed == 1


def test_a_bus_that_was_opened_is_shut_down_where_no_thread_can_write_its_log(
    opened: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(threading.Thread, "start", broken)
    with pytest.raises(RuntimeError, match="broken"):
        opening.open_drive_bus(drives_file(), "virtual", "x", frame_log=tmp_path / "frames.log")
    assert opened.closed == 1
