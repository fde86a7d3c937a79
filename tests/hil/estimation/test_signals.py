"""Signal processing: exact within its stated band, with correct limits of validity."""

import numpy as np
import pytest
from scipy import signal

from hil.errors import NotEnoughData
from hil.estimation.signals import CUTOFF, ORDER, signals
from hil.least_squares.window import HALF_WIDTH
from hil.runs.recording import Recording

PERIOD = 0.004


def recording(q, tau=None, time=None):
    n = len(q)
    none = np.full(n, -1, np.int16)
    time = np.arange(n) * PERIOD if time is None else time
    tau = np.zeros_like(q) if tau is None else tau
    return Recording(time, q, tau, np.zeros(q.shape, np.uint8), none, none)


def test_velocity_and_acceleration_of_a_fourth_degree_polynomial_are_exact():
    t = np.arange(200) * PERIOD
    q = np.column_stack([t**4 - t**2, 2 * t**3])
    s = signals(recording(q))
    inner = slice(3, -3)
    assert s.qd[inner, 0] == pytest.approx((4 * t**3 - 2 * t)[inner], abs=1e-10)
    assert s.qdd[inner, 1] == pytest.approx((12 * t)[inner], abs=1e-8)


def test_the_filter_has_no_phase_and_is_six_decibels_down_at_its_cutoff():
    t = np.arange(4000) * PERIOD
    wave = np.sin(2 * np.pi * CUTOFF * t)[:, np.newaxis]
    s = signals(recording(wave))
    middle = slice(500, -500)
    assert s.filtered(wave)[middle] == pytest.approx(wave[middle] / 2, abs=2e-3)


def test_the_filter_falls_off_like_order_eight():
    t = np.arange(4000) * PERIOD
    s = signals(recording(np.zeros((4000, 1))))

    def gain(f):
        return np.abs(s.filtered(np.sin(2 * np.pi * f * t))[1000:-1000]).max()

    warped = np.tan(np.pi * np.array([60.0, 30.0]) * PERIOD)
    expected = 1 / (1 + (warped[0] / warped[1]) ** 8)
    assert gain(60.0) == pytest.approx(expected, rel=0.02)


def test_the_filter_is_the_butterworth_filter_run_forth_and_back():
    """Ends are excluded: recordings rest there, and both filters ring in."""
    noise = np.random.default_rng(5).standard_normal((1500, 3))
    noise[:100], noise[-100:] = noise[100], noise[-101]
    sections = signal.butter(ORDER, 2 * CUTOFF * PERIOD, output="sos")
    found = signals(recording(noise)).filtered(noise)
    expected = signal.sosfiltfilt(sections, noise, axis=0)
    assert found[75:-75] == pytest.approx(expected[75:-75], abs=1e-9)


def test_the_smoothing_window_ends_where_it_says():
    impulse = np.zeros((201, 1))
    impulse[100] = 1.0
    s = signals(recording(impulse))
    touched = np.flatnonzero(s.smoothed(impulse)[:, 0])
    assert touched[0] >= 100 - HALF_WIDTH / PERIOD
    assert touched[-1] <= 100 + HALF_WIDTH / PERIOD
    assert s.smoothed(impulse).sum() == pytest.approx(1.0)


def test_a_recording_without_samples_is_refused_by_name():
    with pytest.raises(NotEnoughData, match="no usable sample"):
        signals(recording(np.zeros((0, 1))))


def test_a_missing_sample_spoils_its_neighbours_and_no_others():
    q = np.linspace(0, 1, 300)[:, np.newaxis]
    tau = np.ones_like(q)
    q[150], tau[150] = np.nan, np.nan
    s = signals(recording(q, tau))
    spoilt = np.flatnonzero(~s.valid[20:-20]) + 20
    assert spoilt.min() >= 150 - 10
    assert spoilt.max() <= 150 + 10
    assert not s.valid[150]
    assert np.isfinite(s.qdd).all()


def test_a_left_out_sync_counts_like_a_missing_sample():
    time = np.delete(np.arange(300) * PERIOD, [150, 151])
    q = time[:, np.newaxis].copy()
    s = signals(recording(q, time=time))
    assert len(s.time) == 300
    assert not s.valid[150]
    assert not s.valid[151]
    assert s.qd[s.valid] == pytest.approx(1.0)


def test_samples_away_from_a_reversal_know_nothing_of_it():
    torque = np.concatenate([np.full(200, 50.0), np.full(200, -50.0)])[:, np.newaxis]
    s = signals(recording(np.zeros((400, 1)), torque))
    reversal = np.zeros(400, dtype=bool)
    reversal[199:201] = True
    clean = s.away_from(reversal)
    assert np.abs(s.smoothed(torque)[clean, 0]) == pytest.approx(50.0)
