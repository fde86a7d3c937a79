"""Sensors that show a current with the power stage off. 1 per mille of 2 A are 0.1 N m here."""

from __future__ import annotations

import pytest
from fake_fieldbus import FakeFieldbus, axes_of
from local_bench import drives_file

from drivers.safety.current_offset import offsets

AXES = drives_file().axes


def found(second: list[int]) -> list[str]:
    """Return what is found while the current of axis 2 reads `second`, SYNC by SYNC [per mille]."""
    bus, readings = FakeFieldbus(len(AXES)), iter(second)

    def cycle() -> None:
        bus.currents = (0, next(readings), 0)

    messages = offsets(bus, axes_of(AXES), cycle, "before power-on")
    assert next(readings, None) is None
    return messages


@pytest.mark.parametrize("current", [70, -70])
def test_an_offset_of_more_than_two_percent_of_the_torque_limit_is_noted(current: int) -> None:
    (message,) = found([current] * 10)
    stated = "axis 2: before power-on its current reads 7 N m, at most 6 N m may be"
    assert message.startswith(stated)


@pytest.mark.parametrize("current", [50, -50, 0])
def test_a_smaller_offset_is_not(current: int) -> None:
    assert found([current] * 10) == []


@pytest.mark.parametrize(("peak", "noted"), [(700, True), (500, False)])
def test_the_mean_of_ten_readings_counts(peak: int, noted: bool) -> None:
    assert bool(found([0] * 9 + [peak])) is noted
