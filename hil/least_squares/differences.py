"""Differences of positions, of fourth order in the sampling period: what velocities are made of.

Whatever measures takes them (`hil.estimation.signals`); whatever predicts asks what they make of
the increments of an encoder (`hil.planning.prediction.information`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.least_squares.window import weights

if TYPE_CHECKING:
    from hil.arrays import Array


FIRST = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0
"""First difference, of samples a period of 1 apart."""
SECOND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0
"""Second difference."""


def jerk_window(period: float) -> Array:
    """Taps that make the jerk by which corners of a motion are found."""
    return np.asarray(np.convolve([0.5, 0.0, -0.5], rounding_window(period)) / period)


def rounding_window(period: float) -> Array:
    """Taps that make smoothed accelerations of positions, sampled every `period` [s]."""
    return np.asarray(np.convolve(SECOND, weights(period)) / period**2)
