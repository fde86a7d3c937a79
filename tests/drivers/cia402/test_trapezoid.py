"""Trapezoids of velocity from any motion to rest."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.cia402.path import Trapezoid

T = np.linspace(0.0, 12.0, 120_001)


@pytest.mark.parametrize("speed", [0.0, 0.7, 2.0, 3.0, -1.5])
@pytest.mark.parametrize("target", [5.0, 0.2, 0.0, -3.0])
def test_it_ends_at_rest_at_its_target_within_its_limits(speed: float, target: float) -> None:
    move = Trapezoid(0.0, speed, target, 2.0, 4.0)
    q, v = move.motion(T)
    assert (q[0], v[0]) == (0.0, speed if move.duration else 0.0)
    assert q[-1] == target
    assert v[-1] == 0.0
    assert np.abs(v).max() <= max(2.0, abs(speed)) + 1e-9
    assert np.abs(np.diff(v)).max() <= 4.0 * (T[1] - T[0]) * (1 + 1e-6)
    assert np.abs(np.diff(q) - (v[1:] + v[:-1]) / 2 * (T[1] - T[0])).max() < 1e-6
    assert move.duration < 6.0


def test_from_rest_it_is_that_of_profile_position() -> None:
    assert Trapezoid(1.0, 0.0, 4.0, 2.0, 4.0).duration == pytest.approx(3.0 / 2 + 2 / 4)
    assert Trapezoid(1.0, 0.0, 1.25, 2.0, 4.0).duration == pytest.approx(2 * 0.25**0.5 / 2)
