"""Low-pass filter: passband, derivatives, and edge effects."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.estimation.free_motion.motion import Rates, low_passed, reach

PERIOD = 0.002


def wave(frequency: float, n: int = 8000) -> np.ndarray:
    t = PERIOD * np.arange(n)
    return np.stack([np.sin(2 * np.pi * frequency * t), np.cos(2 * np.pi * frequency * t)], axis=1)


@given(frequency=st.floats(0.2, 4.0))
def test_motion_below_the_cut_off_passes_with_its_derivatives(frequency: float) -> None:
    x, w = wave(frequency), 2 * np.pi * frequency
    edge = slice(2 * reach(PERIOD, 10.0), -2 * reach(PERIOD, 10.0))
    q, qd, qdd = low_passed(x, PERIOD, 10.0, derivatives=2)
    sine, cosine = x.T
    assert np.abs(q - x)[edge].max() < 2e-3
    assert np.abs(qd[:, 0] - w * cosine)[edge].max() < 2e-3 * w
    assert np.abs(qdd[:, 0] + w**2 * sine)[edge].max() < 2e-3 * w**2


def test_at_the_cut_off_half_is_left_and_far_above_it_nothing() -> None:
    middle = slice(3000, 5000)
    assert np.abs(low_passed(wave(10.0), PERIOD, 10.0)[0])[middle].max() == pytest.approx(0.5, 0.01)
    assert np.abs(low_passed(wave(40.0), PERIOD, 10.0)[0])[middle].max() < 1e-4


@given(every=st.integers(1, 12), n=st.integers(500, 700))
def test_decimation_takes_every_nth_of_the_same_samples(every: int, n: int) -> None:
    x = wave(1.0, n)
    whole, some = low_passed(x, PERIOD, 10.0)[0], low_passed(x, PERIOD, 10.0, every)[0]
    inner = slice(reach(PERIOD, 10.0) // every + 1, -reach(PERIOD, 10.0) // every - 1)
    assert len(some) == -(-n // every)
    assert some[inner] == pytest.approx(whole[::every][inner], abs=1e-2)


def test_what_is_wrong_beyond_an_end_reaches_no_further_than_is_stated() -> None:
    x = wave(1.0)
    cut = 3001
    whole, part = (low_passed(each, PERIOD, 10.0)[0] for each in (x, x[:cut]))
    inner = cut - 2 * reach(PERIOD, 10.0)
    assert np.abs(part[:inner] - whole[:inner]).max() < 1e-4


def test_rates_leave_enough_samples_to_both_low_passes() -> None:
    rates = Rates.choose(0.0002, 50.0, 15.0)
    assert 1.0 / (rates.period * rates.fine) >= 8 * 50.0
    assert 1.0 / (rates.period * rates.fine * rates.coarse) >= 4 * 15.0
    assert rates.fine > 1
