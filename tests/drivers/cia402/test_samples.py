"""Samples: counts converted to SI, last known limits, gaps as NaN with a flag."""

from __future__ import annotations

import math

import pytest
from fake_fieldbus import FakeFieldbus
from local_bench import drives_file

from drivers.axis import Axis, AxisScale
from drivers.cia402.samples import SampleReader
from drivers.cia402.states import Status
from drivers.drive_bus import SampleFlag

AXES = drives_file().axes
LIMIT, MISSING = int(SampleFlag.LIMIT), int(SampleFlag.MISSING)


@pytest.fixture
def bus() -> FakeFieldbus:
    found = FakeFieldbus(len(AXES))
    found.positions, found.currents = (1000, 1500, 2000), (10, 20, -30)
    return found


def test_positions_count_from_zero_and_currents_are_torques(bus: FakeFieldbus) -> None:
    sample = SampleReader(Axis.all(AXES, bus.drives)).sample(0.1, bus, reached=True)
    scales = [AxisScale.derive(axis) for axis in AXES]
    expected = [s.position_from_counts(p) for s, p in zip(scales, bus.positions, strict=True)]
    assert sample.q == pytest.approx(expected)
    assert sample.tau == pytest.approx([1.0, -2.0, -3.0])  # 0.1 N m per mille, joint 2 reversed
    assert (sample.time, sample.reached) == (0.1, True)


def test_an_axis_is_at_its_limit_from_when_that_is_noted_until_it_is_noted_that_it_is_not(
    bus: FakeFieldbus,
) -> None:
    reader, shown = SampleReader(Axis.all(AXES, bus.drives)), []
    shown.append(reader.sample(0.0, bus, reached=True).flags)
    for words in ((0x27, 0x27 | Status.INTERNAL_LIMIT, 0x27), (0x27, 0x27, 0x27)):
        reader.note_limits(words)
        shown.append(reader.sample(0.0, bus, reached=True).flags)
    assert shown == [(0, 0, 0), (0, LIMIT, 0), (0, 0, 0)]


def test_an_axis_whose_telegram_is_missing_has_no_values_and_both_flags(bus: FakeFieldbus) -> None:
    reader = SampleReader(Axis.all(AXES, bus.drives))
    reader.note_limits((0x27, Status.INTERNAL_LIMIT, 0x27))
    bus.flags, bus.irregular = (0, MISSING, 0), True
    sample = reader.sample(0.0, bus, reached=False)
    assert [math.isnan(q) for q in sample.q] == [False, True, False]
    assert [math.isnan(tau) for tau in sample.tau] == [False, True, False]
    assert sample.flags == (0, MISSING | LIMIT, 0)
