"""Replaced and abandoned set-points: duration and reason."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from fake_fieldbus import PERIOD, FakeFieldbus
from local_bench import drives_file

from drivers.axis import Axis, AxisScale
from drivers.cia402.profile_position import GRACE, ProfilePosition
from drivers.cia402.states import State
from drivers.drive_bus import Move, MoveFailed

if TYPE_CHECKING:
    from collections.abc import Callable

PATIENCE = 0.5
LONG = Move(1.5, 0.5, 10.0)


@pytest.fixture
def bus() -> FakeFieldbus:
    found = FakeFieldbus(3)
    for drive in found.drives:
        drive.state = State.OPERATION_ENABLED
    found.sync()
    return found


def moving_on(bus: FakeFieldbus, **changes: Any) -> ProfilePosition:
    axes = drives_file(acknowledge_timeout=PATIENCE, **changes).axes
    return ProfilePosition(bus, Axis.all(axes, bus.drives), PERIOD)


def failure(bus: FakeFieldbus, motion: ProfilePosition) -> tuple[float, MoveFailed]:
    """Count SYNCs until a set-point fails; return the duration [s] and the failure."""
    begin = bus.time
    while bus.time < begin + 60.0:
        failed = motion.advance(bus.sync(), bus)
        if failed is not None:
            return bus.time - begin, failed
    raise AssertionError("it never failed")


def test_a_set_point_that_comes_before_the_last_is_acknowledged_takes_its_place(
    bus: FakeFieldbus,
) -> None:
    motion = moving_on(bus)
    motion.start({0: LONG})
    motion.start({0: Move(0.1, 0.5, 10.0)})
    while motion.active:
        assert motion.advance(bus.sync(), bus) is None
    q = AxisScale.derive(drives_file().axes[0]).position_from_counts(bus.positions[0])
    assert q == pytest.approx(0.1, abs=1e-3)


@pytest.mark.parametrize("acknowledge", ["taken", "reached"])
def test_a_set_point_that_nothing_follows_fails_when_the_patience_for_the_handshake_ends(
    bus: FakeFieldbus, acknowledge: str
) -> None:
    bus.drives[0].deaf = True
    motion = moving_on(bus, acknowledge=acknowledge)
    motion.start({0: LONG})
    lasted, failed = failure(bus, motion)
    assert lasted == pytest.approx(PATIENCE, abs=3 * PERIOD)
    assert "acknowledge it, for too long" in str(failed)


def test_an_axis_that_stays_where_it_is_fails_after_half_its_time_again_and_a_grace(
    bus: FakeFieldbus, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fake_fieldbus.STEP", 0)
    motion = moving_on(bus)
    motion.start({0: LONG})
    lasted, failed = failure(bus, motion)
    duration = 1.5 / 0.5 + 2 * 0.5 / 10.0
    assert lasted == pytest.approx(1.5 * duration + GRACE, abs=0.1)
    assert "on the way, for too long" in str(failed)


@pytest.mark.parametrize("deaf", [True, False])
@pytest.mark.parametrize("target", [1.5, 0.0005])
@pytest.mark.parametrize("alive", [True, False])
def test_a_drive_that_repeats_its_telegram_is_named_before_brake_encoder_and_window(
    bus: FakeFieldbus, monkeypatch: pytest.MonkeyPatch, *, deaf: bool, target: float, alive: bool
) -> None:
    monkeypatch.setattr("fake_fieldbus.STEP", 0)
    monkeypatch.setattr(
        "fake_fieldbus.FakeDrive.step", noisy(bus) if alive else lambda _drive: None
    )
    bus.drives[0].deaf = deaf
    motion = moving_on(bus)
    motion.start({0: Move(target, 0.5, 10.0)})
    _, failed = failure(bus, motion)
    on_the_way = target > 1.0 and not deaf
    repeats = "axis 1: position and current have not changed for "
    assert str(failed).startswith(repeats) is not alive
    assert ("the encoder has shown no motion" in str(failed)) is (alive and on_the_way)
    assert ("program hangs" in str(failed)) is not alive


def noisy(bus: FakeFieldbus) -> Callable[[object], None]:
    """Return a function for a period of a drive without motion, whose current has noise."""

    def step(_drive: object) -> None:
        bus.currents = tuple(current + 1 for current in bus.currents)

    return step
