"""Commanded velocity of a streamed axis, the basis of a stop within the stream."""

from __future__ import annotations

import numpy as np
import pytest
from fake_fieldbus import PERIOD, FakeFieldbus
from local_bench import drives_file

from drivers.axis import Axis, AxisScale
from drivers.cia402.cyclic_position import DELAY, CyclicPosition
from drivers.cia402.states import State
from drivers.safety.trips import Trips

AXES = drives_file().axes
STEP = 100 * abs(AxisScale.derive(AXES[0]).position)
"""Distance of a hundred counts [rad]."""


def streaming(steps: list[int]) -> CyclicPosition:
    """Begin a stream in which axis 1 advances by this number of `STEP` per point."""
    bus = FakeFieldbus(len(AXES))
    for drive in bus.drives:
        drive.state = State.OPERATION_ENABLED
    trips = Trips(Axis.all(AXES, bus.drives), PERIOD)
    trips.arm(0.0, bus.positions)
    motion = CyclicPosition(bus, Axis.all(AXES, bus.drives), trips, PERIOD, bus.sync)
    path = np.zeros((len(steps) + 1, len(AXES)))
    path[1:, 0] = STEP * np.cumsum(steps)
    motion.begin(path)
    return motion


def led(steps: list[int]) -> list[float]:
    """Return the velocity of axis 1 after each set-point, in `STEP` per period."""
    motion, found = streaming(steps), []
    for _ in steps:
        found.append(motion.velocity(0) * PERIOD / STEP)
        assert motion.velocity(1) == 0.0
        motion.advance()
    return found


def test_the_step_to_the_next_set_point_counts_already() -> None:
    assert led([0, 0, 1, -2, 3]) == pytest.approx([0, 0, 1, 2, 3])


def test_a_step_counts_until_the_slowest_drive_has_made_it() -> None:
    quiet = [0] * (DELAY + 4)
    assert led([2, *quiet]) == pytest.approx([2.0] * (DELAY + 1) + [0.0] * 4)
