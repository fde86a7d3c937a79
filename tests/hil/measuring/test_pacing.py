"""Bus slowed down to a multiple of the wall clock, which advances only by sleep here."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from hil.measuring import feeding
from hil.measuring.feeding import PacedBus

if TYPE_CHECKING:
    from collections.abc import Sequence

    from conftest import IdealBus

    from drivers.drive_bus import Sample

OVERSLEPT = 1e-4
"""Duration by which this clock sleeps longer than requested [s]."""


class Clock:
    """Clock of the operating system in place of `time`."""

    def __init__(self) -> None:
        self.now = 100.0
        self.sleeps = 0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, duration: float) -> None:
        assert duration > 0
        self.now += duration + OVERSLEPT
        self.sleeps += 1


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    found = Clock()
    monkeypatch.setattr(feeding, "time", found)
    return found


@pytest.fixture
def lock_step(ideal_bus: IdealBus, monkeypatch: pytest.MonkeyPatch) -> IdealBus:
    """Bus that returns as many samples as requested."""

    def samples(limit: int) -> Sequence[Sample]:
        return [ideal_bus.sample() for _ in range(limit)]

    monkeypatch.setattr(ideal_bus, "samples", samples)
    return ideal_bus


def took(bus: PacedBus, samples: int, clock: Clock) -> float:
    """Return the duration of samples, taken as many at a time as the bus gives [s]."""
    begun = clock.now
    while samples:
        samples -= len(bus.samples(samples))
    return clock.now - begun


def test_samples_come_as_fast_as_in_real_time_then_faster(
    lock_step: IdealBus, clock: Clock
) -> None:
    paced, period = PacedBus(lock_step, 5.0), lock_step.period
    real = round(0.9 * feeding.REAL_TIME / period)
    assert took(paced, real, clock) == pytest.approx(real * period, abs=feeding.LATE)
    took(paced, round(5 * 4 * feeding.DOUBLED / period), clock)
    assert took(paced, 1000, clock) == pytest.approx(1000 * period / 5, abs=feeding.LATE)


def test_at_a_high_speed_samples_come_many_at_a_time_and_late_sleep_is_made_up_for(
    lock_step: IdealBus, clock: Clock
) -> None:
    paced, period = PacedBus(lock_step, 40.0, ramped=False), lock_step.period
    paced.sample()
    assert took(paced, 100_000, clock) == pytest.approx(100_000 * period / 40, rel=1e-3)
    assert clock.sleeps < 100_000 / 50
    assert len(paced.samples(7)) == 7


def test_real_time_shows_each_sample_when_it_is_due(lock_step: IdealBus, clock: Clock) -> None:
    paced = PacedBus(lock_step, 1.0)
    begun = paced.sample().time
    for _ in range(50):
        behind = clock.now - 100.0 - (paced.samples(1000)[-1].time - begun)
        assert abs(behind) <= feeding.AT_ONCE


def test_what_came_late_is_not_made_up_for(lock_step: IdealBus, clock: Clock) -> None:
    paced = PacedBus(lock_step, 1.0)
    took(paced, 5, clock)
    clock.now += 0.3
    period = lock_step.period
    assert took(paced, 26, clock) >= 25 * period - feeding.LATE
