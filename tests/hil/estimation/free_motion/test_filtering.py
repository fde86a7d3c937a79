"""Low-pass filter: passband, derivatives, and edge effects."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.estimation.free_motion.motion import (
    Processing,
    Rates,
    filtered_motion,
    low_passed,
    reach,
)
from hil.estimation.free_motion.settings import band_of
from hil.runs.recording import IDLE, Recording

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


@pytest.mark.parametrize("steepness", [8.0, 12.0, 17.0])
def test_what_is_wrong_beyond_an_end_reaches_no_further_than_is_stated(steepness: float) -> None:
    x = wave(1.0)
    cut = 3001
    whole, part = (low_passed(each, PERIOD, 10.0, steepness=steepness)[0] for each in (x, x[:cut]))
    inner = cut - 2 * reach(PERIOD, 10.0, steepness)
    assert np.abs(part[:inner] - whole[:inner]).max() < 1e-4


@pytest.mark.parametrize("cut_off", [3.0, 6.0, 9.0, 15.0, 30.0])
def test_the_equation_loses_no_acceleration_within_its_band(cut_off: float) -> None:
    # one that is smaller at high frequencies looks like a soft gear
    speed, none, band = np.ones(2), np.zeros(2), band_of(cut_off)
    q = wave(band)
    idle = np.full(len(q), IDLE, np.int16)
    recording = Recording(PERIOD * np.arange(len(q)), q, q, np.zeros(q.shape, np.uint8), idle, idle)
    processing = Processing(cut_off, band, speed, none.astype(bool), none, none)
    motion = filtered_motion(recording, processing)
    every = motion.rates.fine
    middle = slice(3000 // every, 5000 // every)
    found, expected = motion.qdd[middle], -((2 * np.pi * band) ** 2) * q[::every][middle]
    assert found == pytest.approx(expected, abs=1.1e-3 * np.abs(expected).max())


def test_rates_leave_enough_samples_to_both_low_passes() -> None:
    rates = Rates.choose(0.0002, 50.0, 15.0)
    assert 1.0 / (rates.period * rates.fine) >= 8 * 50.0
    assert 1.0 / (rates.period * rates.fine * rates.coarse) >= 4 * 15.0
    assert rates.fine > 1
