"""SYNC timing of a run."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.drive_bus import SampleFlag
from hil.runs.journal import SyncTiming
from hil.runs.recording import Recording

PERIOD = 0.01


def recording(time, flags=None) -> Recording:
    n = len(time)
    still = np.full(n, -1, dtype=np.int16)
    flags = np.zeros((n, 2), dtype=np.uint8) if flags is None else flags
    return Recording(np.asarray(time), np.zeros((n, 2)), np.zeros((n, 2)), flags, still, still)


def test_lock_step_is_stated_as_such() -> None:
    timing = SyncTiming().add_recording(recording(PERIOD * np.arange(1000)))
    assert str(timing) == "1000 samples, 0 flagged, 0 left out; SYNC in lock-step"


def test_late_sync_shows_as_jitter() -> None:
    time = PERIOD * np.arange(101)
    time[50] += 0.002
    timing = SyncTiming().add_recording(recording(time))
    assert timing.worst == pytest.approx(0.002)
    assert timing.jitter == pytest.approx(0.002 * np.sqrt(2 / 101))
    assert str(timing).endswith("SYNC jitter 0.28 ms (rms), 2 ms at most")


def test_sync_that_is_left_out_is_counted_and_is_no_jitter() -> None:
    time = np.delete(PERIOD * np.arange(100), [20, 21, 50])
    timing = SyncTiming().add_recording(recording(time))
    assert timing.left_out == 3
    assert timing.worst < 1e-9


def test_flagged_samples_are_counted_once_and_limits_are_no_gap() -> None:
    flags = np.zeros((10, 2), dtype=np.uint8)
    flags[3] = SampleFlag.MISSING
    flags[4, 1] = SampleFlag.LATE
    flags[5] = SampleFlag.LIMIT
    assert SyncTiming().add_recording(recording(PERIOD * np.arange(10), flags)).flagged == 2


@given(st.lists(st.integers(2, 40), min_size=1, max_size=6), st.integers(0, 99))
def test_many_recordings_are_as_one(lengths: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    times = [PERIOD * np.arange(3 * n) for n in lengths]
    for time in times:
        time[1] += 0.3 * PERIOD * rng.random()
    timing = SyncTiming()
    for time in times:
        timing = timing.add_recording(recording(time))
    off = np.concatenate([np.diff(time) - PERIOD for time in times])
    assert timing.samples == sum(map(len, times))
    assert timing.jitter == pytest.approx(np.sqrt(np.sum(off**2) / timing.samples), rel=1e-6)
    assert timing.worst == pytest.approx(np.abs(off).max())
