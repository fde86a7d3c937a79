"""Drives without profile position mode: the driver plans and streams their motions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from local_bench import refused
from personalities import drives_for, plant_file

from drivers.drive_bus import DriveRefused, Move, MoveFailed, Tripped
from drivers.opening import open_drive_bus

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from canopen_drive_bus import CanopenDriveBus

PERIOD = 0.004


@pytest.fixture
def bus(tmp_path: Path) -> Iterator[CanopenDriveBus]:
    drives = drives_for("cyclic-only")
    with open_drive_bus(drives, "sim_plant", plant_file(tmp_path, "cyclic-only")) as entered:
        yield entered


def sample_until_reached(bus: CanopenDriveBus) -> np.ndarray:
    """Return positions of all samples until all axes have arrived."""
    found = [bus.sample()]
    while not found[-1].reached:
        found.append(bus.sample())
        assert len(found) < 2000
    return np.array([sample.q for sample in found])


def test_axes_are_held_where_they_stand_until_they_are_moved(bus: CanopenDriveBus) -> None:
    here = bus.sample().q
    for _ in range(500):
        assert bus.sample().reached
    assert bus.sample().q == pytest.approx(here, abs=1e-3)


def test_a_stroke_is_the_trapezoid_that_a_drive_would_make(bus: CanopenDriveBus) -> None:
    begin = np.array(bus.sample().q)
    bus.move({2: Move(begin[2] + 1.0, 1.0, 5.0)})
    q = sample_until_reached(bus)
    assert q[-1] == pytest.approx(begin + np.array([0, 0, 1.0, 0, 0, 0]), abs=2e-3)
    speed = np.diff(q[:, 2]) / PERIOD
    assert np.median(speed[60:240]) == pytest.approx(1.0, rel=1e-2)
    assert 1.2 < len(q) * PERIOD < 1.35  # motion of 1.2 s, then delay and standstill


def test_an_axis_goes_back_and_forth_while_another_creeps(bus: CanopenDriveBus) -> None:
    begin = np.array(bus.sample().q)
    bus.move({1: Move(begin[1] - 0.5, 0.25, 2.0)})
    creep = []
    for number in range(4):
        bus.move({4: Move(begin[4] + 0.2 * (1 - number % 2), 1.0, 5.0)})
        creep += [bus.sample().q[1] for _ in range(110)]
    sample_until_reached(bus)
    speed = np.diff(np.array(creep)) / PERIOD
    assert np.median(speed[50:400]) == pytest.approx(-0.25, rel=2e-2)
    assert np.abs(speed[50:400] + 0.25).max() < 0.05
    assert bus.sample().q == pytest.approx(begin + np.array([0, -0.5, 0, 0, 0, 0]), abs=2e-3)


def test_a_move_under_way_is_turned_round_and_halted(bus: CanopenDriveBus) -> None:
    begin = np.array(bus.sample().q)
    bus.move({4: Move(begin[4] + 1.0, 1.0, 5.0)})
    for _ in range(100):
        bus.sample()
    bus.move({4: Move(begin[4], 1.0, 5.0)})
    assert sample_until_reached(bus)[-1] == pytest.approx(begin, abs=2e-3)
    bus.move({4: Move(begin[4] + 1.0, 1.0, 5.0)})
    for _ in range(100):
        bus.sample()
    bus.halt()
    bus.sample()
    with pytest.raises(MoveFailed, match="wait for its end"):
        bus.move({4: Move(begin[4], 1.0, 5.0)})
    rest = sample_until_reached(bus)[-1]
    assert 0.2 < rest[4] - begin[4] < 0.6
    bus.move({4: Move(begin[4], 1.0, 5.0)})
    assert sample_until_reached(bus)[-1] == pytest.approx(begin, abs=2e-3)


def test_a_trip_is_reset_and_the_axes_are_moved_again(bus: CanopenDriveBus) -> None:
    begin = np.array(bus.sample().q)
    bus.move({4: Move(begin[4] + 1.0, 1.0, 5.0)})
    assert bus._session is not None
    bus._session._trips._lows = [10**7] * 6
    bus._session._cyclic_position._lows = [[10**7] * 6] * 5000
    with pytest.raises(Tripped, match="outside"):
        sample_until_reached(bus)
    bus.reset()
    bus.move({4: Move(begin[4], 1.0, 5.0)})
    assert sample_until_reached(bus)[-1] == pytest.approx(begin, abs=2e-3)


def test_a_drive_with_velocity_and_torque_modes_alone_is_refused() -> None:
    message = refused({2: {(0x6502, 0): ("u32", 0x300)}}, DriveRefused)
    assert (
        "neither profile position nor cyclic synchronous position mode (6502 = 00000300h" in message
    )
    assert "hold no position" in message
