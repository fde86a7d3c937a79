"""Information of a measurement about all base parameters, friction eliminated.

The columns X of base parameters and common terms, and those of the friction of one measurement,
need no torque (`hil.least_squares.terms`). So the information X'X, friction's columns projected out
of X as the simultaneous estimator does it (`hil.estimation.condensed`), is known as soon as the
motion is planned.

What noise leaves of it is a matter of three more matrices. The estimator is least squares, so the
covariance of X'e is X' E(e e') X, with e

- white in the torque as it is read, but smoothed like everything (`white`),
- an inertia times the error of accelerations that are second differences of rounded positions,
  smoothed (`rounding`): of high frequency, so that much of it cancels where X changes slowly, and
- friction that wanders: sign(v) times a random walk of the level, of which sign(v) and sign(v) t
  take the larger part away (`wander`, for a walk of unit intensity).

As the estimator does, this takes one of the samples within `APART`. Smoothed are not the columns
but the motion that they are functions of, which comes to the same where samples count.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.least_squares.differences import rounding_window
from hil.least_squares.solving import orthonormal
from hil.least_squares.terms import FEWEST, term_columns, usable
from hil.least_squares.window import APART, weights
from hil.planning.prediction.predicted_samples import forecast

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMeasurement
    from hil.planning.prediction.noise import Differences
    from hil.planning.prediction.predicted_samples import Forecast

    Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Share:
    """Information that one axis's torque in one measurement will add.

    Attributes
    ----------
    axis : int
        Index from 0.
    n : int
        Usable samples less eliminated coefficients.
    information, white, wander : ndarray, shape (n_base + N_COMMON, n_base + N_COMMON)
        X'X, and the covariance of X'e for white noise of 1 N m and for friction whose level walks
        by 1 N m in 1 s [1/(N m)^2 times that of the parameters].
    rounding : ndarray, of the same shape
        The same for positions whose error is white, of 1 rad on an inertia of 1 kg m^2.
    """

    axis: int
    n: int
    information: Array
    white: Array
    wander: Array
    rounding: Array

    def times(self, n: int) -> Share:
        """Of `n` measurements alike, each with friction of its own."""
        parts = (self.information, self.white, self.wander, self.rounding)
        return Share(self.axis, n * self.n, *(n * part for part in parts))


def shares(
    robot: Robot,
    measurement: ParameterMeasurement,
    period: float,
    differences: Differences | None = None,
) -> list[Share]:
    """Information of `measurement`: an item for each axis it moves.

    Every period of a trajectory counts as a measurement, as it does for the estimator.

    Parameters
    ----------
    period : float
        Between the samples that are looked at [s].
    differences : Differences, optional
        Of rounded positions; exact ones without.
    """
    planned = forecast(measurement, period)
    found = (_share(robot, planned, axis, differences) for axis in measurement.moved)
    alike = measurement.cycles if measurement.streamed else 1
    return [share.times(alike) for share in found if share is not None]


def _share(
    robot: Robot, planned: Forecast, axis: int, differences: Differences | None
) -> Share | None:
    every = max(1, round(APART / planned.period))
    used = usable(robot, planned, axis)[::every]
    if every * used.sum() < FEWEST:
        return None
    taken = planned.thinned(every)
    rows, common, friction = term_columns(robot, taken, axis)
    columns = np.column_stack([rows, common])
    basis, _ = orthonormal(friction[used])
    X = np.zeros_like(columns)
    X[used] = columns[used] - basis @ (basis.T @ columns[used])
    later = np.cumsum((X * friction[:, :1])[::-1], axis=0)
    exact, kept = weights(planned.period), 1.0 if differences is None else differences.kept[axis]
    white = _smoothed_noise(X, exact, every)
    return Share(
        axis=axis,
        n=round(kept * every * int(used.sum())) - basis.shape[1],
        information=kept * every * X.T @ X,
        white=every**2 * _thinned(white, exact @ exact * X.T @ X, kept),
        wander=(kept * every) ** 2 * taken.period * later.T @ later,
        rounding=every**2 * _of_rounding(X, taken.period, differences, kept),
    )


def _of_rounding(X: Array, apart: float, differences: Differences | None, kept: float) -> Array:
    if differences is None:
        return np.zeros((X.shape[1], X.shape[1]))
    window = rounding_window(differences.period)
    whole = _smoothed_noise(X, window, max(1, round(apart / differences.period)))
    return _thinned(whole, window @ window * X.T @ X, kept)


def _thinned(whole: Array, alone: Array, kept: float) -> Array:
    """Covariance where chance leaves out all but a share `kept` of the samples.

    Parameters
    ----------
    whole : ndarray
        With all of them.
    alone : ndarray
        The same if no two samples had noise in common: what chance leaves cannot cancel.
    """
    return kept**2 * whole + kept * (1.0 - kept) * alone


def _smoothed_noise(X: Array, window: Array, every: int) -> Array:
    """Covariance of X'e for white noise that passed the window, one of `every` samples taken."""
    alike = np.correlate(window, window, mode="full")[len(window) - 1 :: every]
    later = alike[0] / 2 * X
    for apart, share in enumerate(alike[1:], start=1):
        later[:-apart] += share * X[apart:]
    half = X.T @ later
    return np.asarray(half + half.T)
