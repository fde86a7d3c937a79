"""Position differences of fourth order in the sampling period, used for velocities.

The estimator applies them (`hil.estimation.signals`); predictions compute their effect on encoder
increments (`hil.planning.prediction.information`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.least_squares.window import weights

if TYPE_CHECKING:
    from hil.arrays import Array


FIRST = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0
"""First difference, for a sampling period of 1."""
SECOND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0
"""Second difference, for a sampling period of 1."""


def jerk_window(period: float) -> Array:
    """Return the taps of the filter for jerk, used to detect corners of a motion."""
    return np.asarray(np.convolve([0.5, 0.0, -0.5], rounding_window(period)) / period)


def rounding_window(period: float) -> Array:
    """Return the filter taps from positions, every `period` [s], to smoothed accelerations."""
    return np.asarray(np.convolve(SECOND, weights(period)) / period**2)
