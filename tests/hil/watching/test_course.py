"""Drawn torques: means of a few samples each, complete, with their band."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from hil.watching import watcher as module
from hil.watching.detector import Judged
from hil.watching.watcher import APART, HELD, Watcher

if TYPE_CHECKING:
    from collections.abc import Iterator

PERIOD = 0.004
EACH = round(APART / PERIOD)


class Detector:
    """Detector that predicts half of the measured torque, all in one block."""

    def __init__(self, model: object, period: float) -> None:
        del model, period
        self.windows, self.distance = np.array([2, 10, 25]), np.zeros(2)

    def take(self, time: np.ndarray, q: np.ndarray, tau: np.ndarray) -> Iterator[Judged]:
        outside = np.zeros((len(time), 3, 2))
        band = outside + np.array([1.0, 2.0, 3.0])[:, np.newaxis]
        moving = np.ones(q.shape, dtype=bool)
        yield Judged(time, tau, tau / 2, outside, outside + 9.0, band, moving)


@pytest.fixture
def watcher(monkeypatch: pytest.MonkeyPatch) -> Watcher:
    monkeypatch.setattr(module, "Detector", Detector)
    robot = SimpleNamespace(n_joints=2, torque_limit=np.array([100.0, 50.0]))
    return Watcher(SimpleNamespace(robot=robot), PERIOD, 5.0)  # type: ignore[arg-type]


def take(watcher: Watcher, first: int, number: int) -> None:
    k = np.arange(first, first + number)
    tau = np.column_stack([k, -k]).astype(float)
    watcher.take_all(PERIOD * k, np.zeros((number, 2)), tau)


@pytest.mark.parametrize("block", [1, 7, EACH, 95])
def test_means_follow_each_other_however_samples_come(watcher: Watcher, block: int) -> None:
    for first in range(0, 190, block):
        take(watcher, first, min(block, 190 - first))
    course = watcher.course()
    n = 190 // EACH
    assert course.time == pytest.approx(PERIOD * (EACH * np.arange(1, n + 1) - 1))
    assert course.measured[:, 0] == pytest.approx(EACH * np.arange(n) + (EACH - 1) / 2)
    assert course.predicted == pytest.approx(course.measured / 2)
    assert np.all(course.band == 2.0)  # window as long as the mean
    assert len(watcher.course().time) == 0
    take(watcher, 190, EACH)
    assert len(watcher.course().time) == 1


def test_what_nobody_takes_is_dropped(watcher: Watcher) -> None:
    for first in range(0, 4 * HELD * EACH, 1000):
        take(watcher, first, 1000)
    assert len(watcher._averaged) <= 2 * HELD
    assert len(watcher.course().time) == HELD


@pytest.mark.parametrize("block", [1, 95])
def test_a_trace_has_means_over_the_window_of_its_threshold(watcher: Watcher, block: int) -> None:
    for first in range(0, 380, block):
        take(watcher, first, min(block, 380 - first))
    stretch, _ = watcher.trace.stretches()
    last = np.arange(380)[-250:]
    assert stretch.time == pytest.approx(PERIOD * (last - 1))
    assert stretch.measured == pytest.approx(last - 0.5)  # of two samples
    assert stretch.predicted == pytest.approx(stretch.measured / 2)
    assert np.all(stretch.threshold == 9.0)
