"""End of a stream: all axes rest near the last set-point, or the stream fails."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from fake_fieldbus import PERIOD, FakeFieldbus
from local_bench import drives_file

from drivers.axis import Axis, AxisScale
from drivers.cia402.cyclic_position import GRACE, CyclicPosition
from drivers.cia402.states import State
from drivers.safety.trips import Trips

if TYPE_CHECKING:
    from drivers.drive_bus import MoveFailed

AXES = drives_file().axes
WINDOW = AXES[1].position_window / abs(AxisScale.derive(AXES[1]).position)
"""Following error window of axis 2 [increments]."""


def end(away: list[float]) -> tuple[float, MoveFailed | None]:
    """Stream rest, with axis 2 off by the values of `away` in turn [windows]; return duration and
    outcome.
    """
    bus = FakeFieldbus(len(AXES))
    for drive in bus.drives:
        drive.state = State.OPERATION_ENABLED
    trips = Trips(Axis.all(AXES, bus.drives), PERIOD)
    trips.arm(0.0, bus.positions)
    motion = CyclicPosition(bus, Axis.all(AXES, bus.drives), trips, PERIOD, bus.sync)
    rest = [-AxisScale.derive(axis).position * AxisScale.derive(axis).zero for axis in AXES]
    motion.begin(np.tile(rest, (3, 1)))
    begin, turn = bus.time, 0
    while motion.moving:
        bus.sync()
        bus.positions = (0, round(away[turn % len(away)] * WINDOW), 0)
        failed, turn = motion.advance(), turn + 1
        if failed is not None:
            return bus.time - begin, failed
    return bus.time - begin, None


@pytest.mark.parametrize("away", [[0.0], [0.4, -0.4], [1.8]])
def test_an_axis_that_trembles_or_stands_aside_a_little_has_arrived(away: list[float]) -> None:
    lasted, failed = end(away)
    assert failed is None
    assert AXES[1].position_window_time <= lasted < 0.1


@pytest.mark.parametrize("away", [[1.2, -1.2], [2.2]])
def test_an_axis_that_goes_on_or_stands_far_aside_fails_after_the_grace(away: list[float]) -> None:
    lasted, failed = end(away)
    assert str(failed).startswith("axis 2: not at rest at the end of its path after 2 s")
    assert lasted == pytest.approx(GRACE, abs=5 * PERIOD)
