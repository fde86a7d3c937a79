"""An axis moves if its range exceeds the noise of its positions."""

import numpy as np
import pytest

from hil.least_squares.standstill import extent, moving

T = 0.004
TIME = np.arange(0, 40, T)


def moves(*positions):
    """Return whether each axis moves; the last one moves by an additional radian."""
    q = np.column_stack([*positions, np.sin(TIME)])
    *found, last = moving([extent(q, T)])
    assert last
    return found


def noise(sigma, seed=0):
    return sigma * np.random.default_rng(seed).standard_normal(len(TIME))


@pytest.mark.parametrize("sigma", [0, 1e-6, 2e-4, 5e-4, 1e-2])
def test_noise_is_no_motion_however_large_it_is(sigma):
    assert moves(0.3 + noise(sigma)) == [False]


@pytest.mark.parametrize("sigma", [0, 1e-5, 5e-4, 2e-3])
def test_a_slow_motion_shows_through_noise(sigma):
    assert moves(20 * sigma * np.sin(0.3 * TIME) + 2e-3 * np.sin(TIME) + noise(sigma)) == [True]


@pytest.mark.parametrize("frequency", [0.1, 1, 5])
def test_quick_motion_is_no_noise(frequency):
    assert moves(0.1 * np.sin(2 * np.pi * frequency * TIME)) == [True]


def test_an_encoder_between_two_increments_stands():
    increment = 2 * np.pi / 4096
    assert moves(np.round(0.5 + np.sin(0.7 * TIME)) * increment) == [False]
    assert moves(np.round(8 * np.sin(0.7 * TIME)) * increment) == [True]


@pytest.mark.parametrize("size", [5e-5, 1e-3])
def test_an_axis_that_others_push_a_little_stands(size):
    assert moves(size * np.sin(2 * TIME)) == [False]


def test_an_axis_that_moves_in_one_of_two_recordings_moves():
    still, turns = (extent(q, T) for q in (np.zeros((99, 1)), TIME[:99, None]))
    assert moving([still, turns]).all()
    assert not moving([still, still]).any()
