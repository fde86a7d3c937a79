"""Time stamps of recorders: even, late, doubled, coarse, unordered, with gaps."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_recording import motion

from hil.imports.instants import resampled
from hil.imports.samples import Samples
from hil.imports.segments import block_counts, blocks, pieces_of
from hil.imports.stamps import WrongStamps, timing_of

RATE = 200.0
N = 2001


def samples(time, at=None):
    """Return samples of the known motion, taken at `at` [s] and stamped `time`."""
    q, qd, tau = motion(time if at is None else at)
    values = np.concatenate([q, tau, qd], axis=1)
    return Samples(time, values, np.isfinite(time), (0,), from_date=False)


def found(time, at=None):
    return timing_of(samples(time, at), [np.arange(len(time))])


def error(timing, at):
    """Return the largest error of the estimated instants, up to a constant delay [s]."""
    errors = [s.instants - at[s.rows] for s in timing.stretches]
    return max(float(np.ptp(e)) for e in errors)


EVEN = np.arange(N) / RATE


def test_even_stamps_stay_as_they_are():
    timing = found(EVEN + 5.0)
    assert timing.instants == "even"
    assert timing.period == pytest.approx(1 / RATE)
    assert error(timing, EVEN) < 1e-9
    assert timing.counts.jitter == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("rate", [30.0, 60.0, 44.6, 123.0])
def test_even_stamps_rounded_to_milliseconds_lack_no_sample(rate):
    at = np.arange(N) / rate
    kept = np.delete(np.arange(N), np.arange(100, 1000, 150))
    for rows, gone in ((np.arange(N), 0), (kept, N - len(kept))):
        timing = found(at[rows].round(3), at[rows])
        assert timing.period == pytest.approx(1 / rate, rel=1e-3)
        assert timing.counts.bridged + timing.counts.gaps == gone
        assert error(timing, at[rows]) < 1.1e-3


def test_a_stamp_that_repeats_at_a_stated_rate_counts_once():
    stamped = EVEN.copy()
    stamped[1000:] -= 1 / RATE
    timing = timing_of(samples(stamped, EVEN), [np.arange(N)], RATE)
    (stretch,) = timing.stretches
    assert len(stretch.rows) == N - 1
    assert np.diff(stretch.instants).min() > 0.9 / RATE


def test_stamps_of_a_sampler_that_is_late_are_believed():
    late = EVEN + np.random.default_rng(1).uniform(0, 0.004, N)
    timing = found(late)
    assert timing.instants == "stamped"
    assert error(timing, late) < 1e-12


def test_stamps_of_a_stamper_that_is_late_are_counted():
    late = EVEN + np.random.default_rng(1).uniform(0, 0.004, N)
    timing = found(late, at=EVEN)
    assert timing.instants == "counted"
    assert error(timing, EVEN) < 1e-4
    assert timing.counts.gaps == 0


def test_a_clock_that_is_coarser_than_the_period_is_counted():
    timing = found(np.floor(EVEN / 0.016) * 0.016, at=EVEN)
    assert timing.instants == "counted"
    assert timing.period == pytest.approx(1 / RATE, rel=0.01)
    assert timing.counts.doubled > N / 2
    assert error(timing, EVEN) < 1e-4


def test_bursts_after_a_stall_are_no_gaps():
    late = EVEN.copy()
    for begin in range(100, 1900, 150):
        late[begin : begin + 30] = np.maximum(late[begin : begin + 30], late[begin + 30] - 1e-4)
    late += np.arange(N) * 1e-9
    timing = found(late, at=EVEN)
    assert timing.counts.gaps == 0
    assert timing.instants == "counted"
    assert error(timing, EVEN) < 1e-3


def test_gaps_split_and_are_counted():
    kept = np.delete(EVEN, np.r_[500:540, 1200:1300])
    timing = found(kept)
    assert [len(s.rows) for s in timing.stretches] == [500, 660, 701]
    assert timing.counts.gaps == 2
    assert timing.counts.lost == pytest.approx(140 / RATE)
    assert timing.counts.bridged == 0


@pytest.mark.parametrize("jitter", [0.0, 0.0002])
def test_single_samples_that_are_missing_are_bridged_in_their_places(jitter):
    kept = np.delete(EVEN, [300, 700, 701, 1500])
    stamps = kept + np.random.default_rng(2).uniform(0, jitter, len(kept)) if jitter else kept
    timing = found(stamps, at=kept)
    assert timing.counts.gaps == 0
    assert timing.counts.bridged == 4
    assert error(timing, kept) < 3e-4


def test_rows_that_stand_twice_are_left_out():
    twice = np.insert(EVEN, [400, 900], EVEN[[399, 899]])
    timing = found(twice)
    assert timing.counts.doubled == 2
    assert len(np.concatenate([s.rows for s in timing.stretches])) == N


def test_rows_out_of_order_are_sorted():
    mixed = EVEN.copy()
    mixed[[800, 801]] = mixed[[801, 800]]
    timing = found(mixed)
    assert timing.counts.disordered == 1
    assert np.all(np.diff(timing.stretches[0].instants) > 0)


def test_time_that_begins_anew_is_refused_with_its_row():
    with pytest.raises(WrongStamps, match=r"from 4.995 s to 0 s at row 1001; .* segment"):
        found(np.concatenate([EVEN[:1000], EVEN[:500]]))


def test_time_that_stands_still_is_refused():
    with pytest.raises(WrongStamps, match="time stamps do not increase"):
        found(np.ones(100))


# --- the grid -------------------------------------------------------------------------------------

sorted_instants = st.lists(st.floats(0.01, 1.0), min_size=3, max_size=30).map(np.cumsum)


@given(sorted_instants, st.tuples(*[st.floats(-10, 10)] * 3))
def test_parabolas_come_through_unchanged(instants, coefficients):
    grid = np.linspace(instants[0], instants[-1], 40)
    values = np.polyval(coefficients, instants)[:, None]
    wanted = np.polyval(coefficients, grid)
    np.testing.assert_allclose(resampled(instants, values, grid)[:, 0], wanted, atol=1e-6)


@given(sorted_instants, st.integers(0, 2**32))
def test_samples_on_the_grid_stay_as_they_are(instants, seed):
    values = np.random.default_rng(seed).normal(size=(len(instants), 3))
    np.testing.assert_array_equal(resampled(instants, values, instants), values)


@given(sorted_instants, st.floats(-5, 5))
def test_nothing_depends_on_samples_further_away_than_two(instants, elsewhere):
    values = np.zeros((len(instants), 1))
    values[0] = elsewhere
    if len(instants) > 3:
        grid = np.linspace(instants[3], instants[-1], 20)
        assert not resampled(instants, values, grid).any()


def test_an_uneven_recording_gives_the_motion_on_its_grid():
    late = EVEN + np.random.default_rng(3).uniform(0, 0.004, N)
    (stretch,) = found(late).stretches
    (piece,) = pieces_of(stretch)
    q = resampled(stretch.instants, motion(late)[0], piece.grid)
    assert np.abs(q - motion(piece.grid)[0]).max() < 2e-5


# --- pieces and blocks ----------------------------------------------------------------------------


@given(st.integers(2, 40_000), st.floats(0.001, 0.02))
def test_pieces_are_a_minute_at_most_and_leave_nothing_out(n, period):
    timing = timing_of(samples(np.arange(n) * period), [np.arange(n)], 1.0 / period)
    pieces = pieces_of(timing.stretches[0])
    if (n - 1) * period < 0.999:
        assert pieces == []
    else:
        assert sum(piece.n for piece in pieces) == n
        assert all(0.4 < piece.duration <= 60 + period for piece in pieces)
        assert all(a.first + a.n == b.first for a, b in pairwise(pieces))


@given(st.lists(st.floats(1.0, 60.0), min_size=1, max_size=40))
def test_blocks_are_of_some_seconds_and_enough(durations):
    counts = block_counts(durations)
    each = [duration / count for duration, count in zip(durations, counts, strict=True)]
    assert all(1.0 - 1e-9 <= length <= 30.0 + 1e-6 for length in each)
    if len(durations) == 1 and durations[0] >= 8:
        assert sum(counts) >= 8


def test_blocks_are_numbered_from_0_and_about_equal():
    numbers = blocks(1003, 4)
    assert sorted(np.bincount(numbers)) == [250, 251, 251, 251]
    assert np.all(np.diff(numbers) >= 0)
