"""Slowed-down paths: set-points and limits."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.cia402.path import OUT, RECOVERY, Path

PERIOD = 0.004
LIMITS = (2e5, 1e5)
"""Limits of acceleration [increments/s^2]."""
WINDOWS = (300.0, 300.0)
"""Following error windows [increments]."""
T = PERIOD * np.arange(1500)
SIZE = np.array([3e4, -1e4])


def swing(t: np.ndarray) -> np.ndarray:
    """Return a path of two axes that swing from rest to rest, at up to 0.93 of their limits."""
    phase = 2 * np.pi * np.clip(t, 0.0, 5.0) / 2.5
    return SIZE / 2 * np.column_stack([1 - np.cos(phase), 1 - np.cos(phase)])


def passed(calm: set[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return set-points, path positions and paces of a path that slows down in some periods."""
    path = Path(swing(T), LIMITS, WINDOWS, PERIOD)
    points, at, pace = [path.targets], [path.at], [path.pace]
    for number in range(4000):
        path.step(calm=number in calm)
        points.append(path.targets)
        at.append(path.at)
        pace.append(path.pace)
    return np.array(points), np.array(at), np.array(pace)


def test_at_its_own_pace_a_path_is_its_set_points() -> None:
    points, at, pace = passed(set())
    assert np.array_equal(points[: len(T)], np.rint(swing(T)))
    assert np.array_equal(at[: len(T)], np.arange(len(T)))
    assert pace.min() == 1.0


@pytest.mark.parametrize("begin", [150, 300, 420, 625, 900])
@pytest.mark.parametrize("duration", [3, 40, 600])
def test_a_path_slowed_down_stays_on_itself_and_within_the_limits_of_acceleration(
    begin: int, duration: int
) -> None:
    points, at, pace = passed(set(range(begin, begin + duration)))
    assert np.abs(points - swing(PERIOD * at)).max() < 1.0
    bend = np.diff(points, n=2, axis=0) / PERIOD**2
    rounding = 2 / PERIOD**2  # set-points are rounded to whole increments
    assert (np.abs(bend).max(axis=0) <= np.array(LIMITS) + rounding).all()
    assert pace[-1] == 1.0
    assert at[-1] == len(T) - 1
    if duration == 600:
        assert pace[begin : begin + duration].min() == 0.0


def test_it_comes_to_rest_and_goes_on_from_there() -> None:
    _, at, pace = passed(set(range(400, 1400)))
    assert pace[1000:1400].max() == 0.0
    assert at[1000] == at[1400] > 400
    again = 1400 + round(RECOVERY / PERIOD)
    assert (np.diff(pace[1400:again]) >= 0).all()
    assert pace[again + 200] == 1.0


def test_what_is_fed_forward_goes_with_the_pace_and_what_holds_the_axes_stays() -> None:
    offsets = np.tile([100.0, 70.0, 20.0], (len(T), 2, 1))
    path = Path(swing(T), LIMITS, WINDOWS, PERIOD, offsets)
    assert path.fed == [[100, 70]] * 2
    path.step()
    path.pace = 0.5
    assert path.fed == [[50, 20 + 50 // 4]] * 2
    path.note_late(3 * PERIOD)
    assert path.fed == [[0, 20]] * 2


def test_as_long_as_set_points_are_late_axes_overrun_by_no_more_than_their_windows() -> None:
    path, overrun = Path(swing(T), LIMITS, WINDOWS, PERIOD), []
    for number in range(1, 2000):
        if number % 20 == 0:
            path.note_late(2 * PERIOD)
        overrun.append(np.abs(path.overrun[0]) / WINDOWS)
        path.step()
    assert np.max(overrun[:20]) < np.max(overrun[60:]) < 1.1
    free = Path(swing(T), LIMITS, WINDOWS, PERIOD)
    assert max((free.step(), np.abs(free.overrun[0] / WINDOWS).max())[1] for _ in T) > 10


def test_the_more_often_set_points_are_late_the_slower_the_path_is_passed() -> None:
    paces = []
    for every in (10**6, 250, 20, 5):
        path = Path(swing(T), LIMITS, WINDOWS, PERIOD)
        for number in range(1, 1200):
            if number % every == 0:
                path.note_late(PERIOD)
            path.step()
        paces.append(path.at / 1199)
    assert paces[0] == 1.0
    assert paces == sorted(paces, reverse=True)
    assert paces[1] > 0.9
    assert 0.1 < paces[3] < 0.5


def test_set_points_that_are_all_a_little_late_slow_a_path_down_by_the_time_they_stay_out() -> None:
    path = Path(swing(T), LIMITS, WINDOWS, PERIOD)
    for number in range(1200):
        path.note_late(0.2 * PERIOD * (number % 2))
        path.step()
        path.at = min(path.at, 600.0)  # stay in the fast section of the swing
    assert path.pace == pytest.approx(OUT / 0.1, rel=0.02)


def test_stalls_that_never_end_slow_a_path_down_no_further_than_they_are_harmless() -> None:
    progress = []
    for stalled in (3, 12, 50):
        path = Path(swing(T), LIMITS, WINDOWS, PERIOD)
        for number in range(1, 1200):
            if number % 25 == 0:
                path.note_late(stalled * PERIOD)
            path.step()
        progress.append(path.at / 1199)
    assert progress == sorted(progress, reverse=True)
    assert progress[-1] > 0.1


@pytest.mark.parametrize("periods", [1.6, 3.0, 6.0])
def test_a_short_stall_takes_of_the_pace_what_the_limits_let_the_axes_lose_meanwhile(
    periods: float,
) -> None:
    path = Path(swing(T), LIMITS, WINDOWS, PERIOD)
    for _ in range(150):
        path.step()
    before, speeds = path.pace, np.abs(np.diff(swing(T)[149:152:2], axis=0)[0]) / (2 * PERIOD)
    path.note_late(periods * PERIOD)
    lost = (before - path.pace) * speeds
    assert (lost <= np.array(LIMITS) * periods * PERIOD * (1 + 1e-6)).all()
    assert path.pace > 0.5
    path.note_late(1000 * PERIOD)
    assert path.pace == 0.0
