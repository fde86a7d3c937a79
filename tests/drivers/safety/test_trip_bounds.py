"""Bounds of the driver's trips, each from both sides, without a bus."""

from __future__ import annotations

import math

import pytest
from fake_fieldbus import PERIOD, FakeFieldbus, axes_of
from local_bench import drives_file

from drivers.safety.trips import Trips

PER_RADIAN = 4096 * 100 / (2 * math.pi)
AT_REST = (0, 0, 0)


class Axes:
    """Three axes at rest at zero when supervision begins; tests place the first axis."""

    def __init__(self, **trip: float) -> None:
        self.trips = Trips(axes_of(drives_file(trip=trip).axes), PERIOD)
        self.bus = FakeFieldbus(3)
        self.trips.arm(0.0, AT_REST)

    def expect(self, here: float, target: float, *, moving: bool = False) -> None:
        self.trips.expect(0, round(here * PER_RADIAN), target, moving=moving)

    def stops(self, q: float, current: float = 0, syncs: int = 2) -> bool:
        """Return True if the axes are stopped within `syncs` SYNCs with the first axis at `q`."""
        self.bus.positions = (round(q * PER_RADIAN), 0, 0)
        self.bus.currents = (current, 0, 0)
        for _ in range(syncs):
            self.bus.time += PERIOD
            if self.trips.look(self.bus.time, self.bus) is not None:
                return True
        return False


@pytest.mark.parametrize("sign", [-1, 1])
def test_an_axis_at_its_highest_speed_may_be_seen_half_a_period_late_and_no_later(
    sign: int,
) -> None:
    way_in_two_syncs = 2.6 * 2 * PERIOD
    for late, stopped in ((0.45, False), (0.55, True)):
        axes = Axes(velocity=2.6)
        assert not axes.stops(0.0)
        assert axes.stops(sign * (way_in_two_syncs + 2.6 * late * PERIOD)) is stopped


@pytest.mark.parametrize("sign", [-1, 1])
def test_an_axis_that_is_sent_elsewhere_while_it_moves_may_overrun_and_one_at_rest_may_not(
    sign: int,
) -> None:
    for moving, stopped in ((True, False), (False, True)):
        axes = Axes(velocity=1000.0)
        axes.expect(0.0, sign * 0.5)
        axes.expect(sign * 0.3, sign * 0.1, moving=moving)
        assert axes.stops(sign * 0.5) is stopped
        axes = Axes(velocity=1000.0)
        axes.expect(0.0, sign * 0.5)
        axes.expect(sign * 0.3, sign * 0.7, moving=moving)
        assert axes.stops(0.0) is stopped


@pytest.mark.parametrize("sign", [-1, 1])
def test_the_corridor_ends_a_following_error_window_beside_the_way(sign: int) -> None:
    for beyond, stopped in ((0.049, False), (0.051, True)):
        for place in (0.5 + beyond, -beyond):
            axes = Axes(velocity=1000.0)
            axes.expect(0.0, sign * 0.5)
            assert axes.stops(sign * place) is stopped


def test_a_current_that_is_no_number_stops_all_axes_like_one_that_is_too_large() -> None:
    axes = Axes(torque_time=0.1)
    assert not axes.stops(0.0, math.nan, syncs=20)
    assert axes.stops(0.0, math.nan, syncs=20)
