"""Pieces of time: independent, and enough for an error from their scatter."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest

from hil.estimation.free_motion.accumulation import division
from hil.estimation.free_motion.motion import low_passed
from hil.least_squares.choice import FOLDS

if TYPE_CHECKING:
    from hil.estimation.free_motion.motion import Processing


@dataclass
class Band:
    """Band of the equation [Hz], and speeds of one axis."""

    band: float
    speed: np.ndarray = field(default_factory=lambda: np.ones(1))


def piece(band: float, usable: tuple[int, float], duration: float = 60.0) -> float:
    return division(cast("Processing", Band(band)), duration, usable=usable).piece


@pytest.mark.parametrize(("count", "usable"), [(1, 57.0), (3, 56.0), (7, 54.0)])
def test_a_minute_of_slow_motions_has_enough_pieces_for_errors(count: int, usable: float) -> None:
    length = piece(1.25, (count, usable))
    assert count * max(1, round(usable / count / length)) >= FOLDS


def test_pieces_are_never_shorter_than_five_periods() -> None:
    assert piece(1.25, (1, 10.0)) == pytest.approx(5.0 / 1.25)


def test_white_noise_makes_errors_from_pieces_of_five_periods_too_small_by_1_2_percent() -> None:
    band, period, n = 1.25, 0.025, 40_001
    impulse = np.zeros((n, 1))
    impulse[n // 2] = 1.0
    response = low_passed(impulse, period, band)[0][:, 0]
    correlation = np.fft.irfft(np.abs(np.fft.rfft(response, 4 * n)) ** 2)
    m = round(5.0 / (band * period))
    lags = np.arange(1, m)
    variance = m * correlation[0] + 2.0 * (m - lags) @ correlation[1:m]  # of the sum over a piece
    assert 1.0 - np.sqrt(variance / m) / response.sum() == pytest.approx(0.012, abs=0.001)


def test_longer_recordings_have_pieces_of_ten_periods() -> None:
    assert piece(1.25, (1, 300.0)) == pytest.approx(10.0 / 1.25)
