"""Sensors with a current although the power stage is off. Here 1 per mille of 2 A is 0.1 N m."""

from __future__ import annotations

import pytest
from fake_fieldbus import FakeFieldbus, axes_of
from local_bench import drives_file

from drivers.drive_bus import SampleFlag
from drivers.safety.current_offset import measure_offsets

AXES = drives_file().axes


def found(second: list[int], flags: list[int] | None = None) -> list[str]:
    """Return the finding for readings `second` of axis 2's current, SYNC by SYNC [per mille]."""
    bus, readings, seen = FakeFieldbus(len(AXES)), iter(second), iter(flags or [0] * len(second))

    def cycle() -> None:
        bus.currents = (0, next(readings), 0)
        bus.flags = (0, next(seen), 0)

    messages = measure_offsets(bus, axes_of(AXES), cycle, "before power-on")
    assert next(readings, None) is None
    return messages


@pytest.mark.parametrize("current", [70, -70])
def test_an_offset_of_more_than_two_percent_of_the_torque_limit_is_noted(current: int) -> None:
    (message,) = found([current] * 10)
    stated = "axis 2: before power-on its current reads 7 N m, at most 6 N m allowed"
    assert message.startswith(stated)


@pytest.mark.parametrize("current", [50, -50, 0])
def test_a_smaller_offset_is_not(current: int) -> None:
    assert found([current] * 10) == []


@pytest.mark.parametrize(("peak", "noted"), [(700, True), (500, False)])
def test_the_mean_of_ten_readings_counts(peak: int, noted: bool) -> None:
    assert bool(found([0] * 9 + [peak])) is noted


@pytest.mark.parametrize("flag", [SampleFlag.MISSING, SampleFlag.LATE])
def test_only_readings_that_came_count(flag: SampleFlag) -> None:
    """A missing telegram repeats the previous current, possibly measured under power."""
    assert found([700] * 10, [flag] * 10) == []
    assert found([700] * 8 + [0] * 2, [flag] * 8 + [0] * 2) == []
    (message,) = found([0] * 8 + [70] * 2, [flag] * 8 + [0] * 2)
    assert "reads 7 N m" in message


def test_an_axis_that_somebody_else_switched_on_says_nothing_of_its_sensor() -> None:
    bus = FakeFieldbus(len(AXES))
    bus.currents, bus.words = (0, 700, 0), (0x0240, 0x0237, 0x0240)
    assert measure_offsets(bus, axes_of(AXES), lambda: None, "after power-off") == []
    bus.words = (0x0240, 0x0240, 0x0240)
    assert len(measure_offsets(bus, axes_of(AXES), lambda: None, "after power-off")) == 1
