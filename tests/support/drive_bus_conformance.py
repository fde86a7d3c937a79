"""Requirements on every `DriveBus`, independent of the hardware.

Derive a test class from `DriveBusConformance` and give it a fixture ``open_bus`` that returns a
callable; each call gives a new, not yet entered `DriveBus` on the same machine. Joint 1 (index 0)
must be free to move by 0.1 rad about its present position.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import pytest

from drivers.drive_bus import DriveBus, LimitExceeded, Move, SampleFlag

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.drive_bus import Sample

STROKE = 0.1
NEAR = 3e-3
"""Largest distance of a held or finished axis from its target [rad]."""

BAD = SampleFlag.MISSING | SampleFlag.DOUBLED | SampleFlag.LATE


def travel(bus: DriveBus, limit: float = 30.0) -> list[Sample]:
    """Sample until all targets are reached."""
    samples = [bus.sample()]
    while not samples[-1].reached:
        samples.append(bus.sample())
        assert samples[-1].time - samples[0].time < limit
    return samples


class DriveBusConformance:
    """Contract of `drivers.drive_bus.DriveBus` as tests."""

    def test_it_is_a_drive_bus(self, open_bus: Callable[[], DriveBus]) -> None:
        bus = open_bus()
        assert isinstance(bus, DriveBus)
        assert bus.period > 0

    def test_the_axes_are_known_once_entered(self, open_bus: Callable[[], DriveBus]) -> None:
        with open_bus() as bus:
            assert len({axis.name for axis in bus.axes}) == len(bus.axes) > 0
            for axis in bus.axes:
                assert axis.identity
                assert axis.q_min < axis.q_max
                assert axis.velocity_max > 0
                assert axis.acceleration_max > 0
                assert axis.torque_resolution > 0
                assert axis.position_resolution > 0

    def test_a_sample_has_a_value_of_each_axis(self, open_bus: Callable[[], DriveBus]) -> None:
        with open_bus() as bus:
            sample = bus.sample()
            assert len(sample.q) == len(sample.tau) == len(sample.flags) == len(bus.axes)
            assert all(map(math.isfinite, sample.q + sample.tau))
            assert sample.reached

    def test_time_passes_by_one_period_a_sample(self, open_bus: Callable[[], DriveBus]) -> None:
        with open_bus() as bus:
            samples = [bus.sample() for _ in range(50)]
            assert samples[0].time >= 0
            steps = [after.time - before.time for before, after in pairwise(samples)]
            assert sum(steps) / len(steps) == pytest.approx(bus.period, rel=0.1)
            assert min(steps) > 0

    def test_several_samples_follow_each_other_and_are_no_more_than_asked_for(
        self, open_bus: Callable[[], DriveBus]
    ) -> None:
        with open_bus() as bus:
            taken = [bus.samples(limit) for limit in (1, 2, 30) for _ in range(5)]
            limits = sorted([1, 2, 30] * 5)
            assert all(0 < len(each) <= most for each, most in zip(taken, limits, strict=True))
            samples = [sample for each in taken for sample in each]
            steps = [after.time - before.time for before, after in pairwise(samples)]
            assert sum(steps) / len(steps) == pytest.approx(bus.period, rel=0.1)
            assert min(steps) > 0
            assert all(len(sample.q) == len(bus.axes) for sample in samples)

    def test_nothing_moves_without_a_command(self, open_bus: Callable[[], DriveBus]) -> None:
        with open_bus() as bus:
            first = bus.sample()
            samples = [bus.sample() for _ in range(100)]
            for sample in samples:
                assert sample.q == pytest.approx(first.q, abs=NEAR)
                assert not any(flag & BAD for flag in sample.flags)

    def test_a_move_goes_to_its_target_and_says_when(
        self, open_bus: Callable[[], DriveBus]
    ) -> None:
        with open_bus() as bus:
            start = bus.sample().q
            bus.move({0: Move(start[0] + STROKE, 0.4, 4.0)})
            samples = travel(bus)
            assert len(samples) * bus.period > STROKE / 0.4
            assert samples[-1].q[0] == pytest.approx(start[0] + STROKE, abs=NEAR)
            assert samples[-1].q[1:] == pytest.approx(start[1:], abs=NEAR)
            assert bus.sample().reached

    def test_a_move_keeps_to_its_velocity(self, open_bus: Callable[[], DriveBus]) -> None:
        with open_bus() as bus:
            start = bus.sample().q[0]
            bus.move({0: Move(start + STROKE, 0.2, 4.0)})
            q = [sample.q[0] for sample in travel(bus)]
            speed = max((b - a) / (5 * bus.period) for a, b in zip(q, q[5:], strict=False))
            assert speed == pytest.approx(0.2, rel=0.15)

    def test_all_axes_move_at_once(self, open_bus: Callable[[], DriveBus]) -> None:
        with open_bus() as bus:
            start = bus.sample().q
            bus.move({axis: Move(q + STROKE, 0.4, 4.0) for axis, q in enumerate(start)})
            end = travel(bus)[-1].q
            assert end == pytest.approx([q + STROKE for q in start], abs=NEAR)

    def test_a_move_of_zero_length_is_reached(self, open_bus: Callable[[], DriveBus]) -> None:
        with open_bus() as bus:
            for _ in range(2):
                bus.move({0: Move(bus.sample().q[0], 0.4, 4.0)})
                assert len(travel(bus)) < 100

    def test_forth_and_back_many_times_ends_where_it_began(
        self, open_bus: Callable[[], DriveBus]
    ) -> None:
        with open_bus() as bus:
            start = bus.sample().q[0]
            for turn in range(6):
                target = start + (0.02 if turn % 2 == 0 else 0.0)
                bus.move({0: Move(target, 0.4, 4.0)})
                assert travel(bus)[-1].q[0] == pytest.approx(target, abs=NEAR)

    def test_a_new_set_point_replaces_one_under_way(self, open_bus: Callable[[], DriveBus]) -> None:
        with open_bus() as bus:
            start = bus.sample().q[0]
            bus.move({0: Move(start + STROKE, 0.2, 4.0)})
            for _ in range(round(0.2 / bus.period)):
                assert not bus.sample().reached
            bus.move({0: Move(start, 0.2, 4.0)})
            samples = travel(bus)
            assert max(sample.q[0] for sample in samples) < start + 0.8 * STROKE
            assert samples[-1].q[0] == pytest.approx(start, abs=NEAR)

    def test_a_new_set_point_right_after_another_counts(
        self, open_bus: Callable[[], DriveBus]
    ) -> None:
        with open_bus() as bus:
            start = bus.sample().q[0]
            bus.move({0: Move(start + STROKE, 0.2, 4.0)})
            bus.move({0: Move(start + STROKE / 2, 0.2, 4.0)})
            assert travel(bus)[-1].q[0] == pytest.approx(start + STROKE / 2, abs=NEAR)

    def test_halt_brings_axes_to_rest_short_of_the_target(
        self, open_bus: Callable[[], DriveBus]
    ) -> None:
        with open_bus() as bus:
            start = bus.sample().q[0]
            bus.move({0: Move(start + STROKE, 0.1, 4.0)})
            for _ in range(round(0.3 / bus.period)):
                bus.sample()
            bus.halt()
            rest = travel(bus)[-1].q[0]
            assert rest < start + STROKE / 2
            for _ in range(50):
                assert bus.sample().q[0] == pytest.approx(rest, abs=NEAR)

    def test_after_a_halt_the_next_move_goes_to_its_own_target(
        self, open_bus: Callable[[], DriveBus]
    ) -> None:
        with open_bus() as bus:
            start = bus.sample().q[0]
            bus.move({0: Move(start + STROKE, 0.1, 4.0)})
            for _ in range(round(0.3 / bus.period)):
                bus.sample()
            bus.halt()
            rest = travel(bus)[-1].q[0]
            bus.move({0: Move(start, 0.4, 4.0)})
            samples = travel(bus)
            assert max(sample.q[0] for sample in samples) < rest + NEAR
            assert samples[-1].q[0] == pytest.approx(start, abs=NEAR)

    @pytest.mark.parametrize("key", ["target above", "target below", "not a number"])
    def test_a_target_outside_the_limits_is_refused(
        self, open_bus: Callable[[], DriveBus], key: str
    ) -> None:
        with open_bus() as bus:
            info = bus.axes[0]
            targets = {
                "target above": info.q_max + 0.01,
                "target below": info.q_min - 0.01,
                "not a number": math.nan,
            }
            with pytest.raises(LimitExceeded, match="target"):
                bus.move({0: Move(targets[key], 0.4, 4.0)})

    @pytest.mark.parametrize("factor", [1.01, 0.0, -0.5, math.nan, math.inf])
    def test_a_velocity_or_acceleration_outside_the_limits_is_refused(
        self, open_bus: Callable[[], DriveBus], factor: float
    ) -> None:
        with open_bus() as bus:
            here, info = bus.sample().q[0], bus.axes[0]
            with pytest.raises(LimitExceeded, match="velocity"):
                bus.move({0: Move(here, factor * info.velocity_max, 4.0)})
            with pytest.raises(LimitExceeded, match="acceleration"):
                bus.move({0: Move(here, 0.4, factor * info.acceleration_max)})

    def test_one_bad_set_point_keeps_all_axes_where_they_are(
        self, open_bus: Callable[[], DriveBus]
    ) -> None:
        with open_bus() as bus:
            start = bus.sample().q
            last = len(start) - 1
            with pytest.raises(LimitExceeded):
                bus.move({0: Move(start[0] + STROKE, 0.4, 4.0), last: Move(1e3, 0.4, 4.0)})
            for _ in range(50):
                assert bus.sample().q == pytest.approx(start, abs=NEAR)

    def test_an_exception_in_the_body_comes_through(self, open_bus: Callable[[], DriveBus]) -> None:
        class Mistake(Exception):
            pass

        with pytest.raises(Mistake), open_bus() as bus:  # noqa: PT012
            bus.sample()
            raise Mistake

    def test_leaving_in_mid_motion_stops_the_axes(self, open_bus: Callable[[], DriveBus]) -> None:
        with open_bus() as bus:
            start = bus.sample().q[0]
            bus.move({0: Move(start + STROKE, 0.1, 4.0)})
            for _ in range(round(0.2 / bus.period)):
                bus.sample()
        with open_bus() as bus:
            rest = bus.sample().q[0]
            assert start < rest < start + STROKE / 2
            for _ in range(50):
                assert bus.sample().q[0] == pytest.approx(rest, abs=NEAR)
