"""Trapezoids of velocity."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hil.planning.trapezoid import Trapezoid

numbers = st.floats(-5, 5)
rates = st.floats(0.01, 50)
moves = st.builds(Trapezoid, numbers, numbers, rates, rates)


@given(moves)
@example(Trapezoid(0.0, 5e-324, 1.0, 0.5))  # its highest speed is 0 in floating point
def test_a_move_begins_at_start_and_ends_at_end(move: Trapezoid) -> None:
    q = move.q([-1.0, 0.0, move.duration, move.duration + 1])
    np.testing.assert_allclose(q, [move.start, move.start, move.end, move.end], atol=1e-9)


@given(moves)
def test_a_move_keeps_velocity_and_acceleration(move: Trapezoid) -> None:
    t = np.linspace(0, move.duration, 200)
    assert np.max(np.abs(move.motion(t)[1])) <= move.velocity * (1 + 1e-9)
    assert np.max(np.abs(move.motion(t)[2])) <= move.acceleration


@given(moves)
def test_velocity_is_the_derivative_of_position(move: Trapezoid) -> None:
    h = 1e-4
    t = np.linspace(0, move.duration, 37)
    slope = (move.q(t + h) - move.q(t - h)) / (2 * h)
    np.testing.assert_allclose(slope, move.motion(t)[1], atol=move.acceleration * h + 1e-9)


def test_a_long_move_cruises_and_a_short_one_is_a_triangle() -> None:
    long = Trapezoid(0.0, 1.0, 0.5, 2.0)
    assert long.window == pytest.approx((0.25, 2.0))
    assert long.motion(1.0)[1] == pytest.approx(0.5)
    short = Trapezoid(0.0, -0.02, 0.5, 2.0)
    assert short.window[0] == pytest.approx(short.window[1])
    assert short.peak == pytest.approx(0.2)
    assert short.duration == pytest.approx(0.2)


def test_a_move_of_zero_length_takes_no_time() -> None:
    still = Trapezoid(0.3, 0.3, 1.0, 1.0)
    assert still.duration == 0
    np.testing.assert_array_equal(still.q([0, 1]), [0.3, 0.3])
    np.testing.assert_array_equal(still.motion([0, 1])[2], [0, 0])
