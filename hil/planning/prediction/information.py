"""Information of a measurement about all base parameters, friction eliminated.

The columns X of base parameters and common terms, and those of the friction of one measurement,
need no torque (`hil.regression.terms`). So the information X'X, friction's columns projected out of
X as the simultaneous estimator does it (`hil.estimation.condensed`), is known as soon as the motion
is planned.

What torque noise leaves of it is a matter of two more matrices. The estimator is least squares, so
the covariance of X'e is X' E(e e') X, with e

- white in the torque as it is read, but smoothed like everything (`white`), and
- friction that wanders: sign(v) times a random walk of the level, of which sign(v) and sign(v) t
  take the larger part away (`wander`, for a walk of unit intensity).

As the estimator does, this takes one of the samples within `APART`. Smoothed are not the columns
but the motion that they are functions of, which comes to the same where samples count.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.planning.prediction.predicted_samples import forecast
from hil.regression.least_squares import orthonormal
from hil.regression.terms import FEWEST, term_columns, usable
from hil.regression.window import APART, weights

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMeasurement
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
    """

    axis: int
    n: int
    information: Array
    white: Array
    wander: Array

    def times(self, n: int) -> Share:
        """Of `n` measurements alike, each with friction of its own."""
        return Share(self.axis, n * self.n, n * self.information, n * self.white, n * self.wander)


def shares(robot: Robot, measurement: ParameterMeasurement, period: float) -> list[Share]:
    """Information of `measurement`, sampled every `period` [s]: an item for each axis it moves.

    Every period of a trajectory counts as a measurement, as it does for the estimator.
    """
    planned = forecast(measurement, period)
    found = (_share(robot, planned, axis) for axis in measurement.moved)
    alike = measurement.cycles if measurement.streamed else 1
    return [share.times(alike) for share in found if share is not None]


def _share(robot: Robot, planned: Forecast, axis: int) -> Share | None:
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
    return Share(
        axis=axis,
        n=every * int(used.sum()) - basis.shape[1],
        information=every * X.T @ X,
        white=every**2 * _smoothed_noise(X, planned.period, every),
        wander=every**2 * taken.period * later.T @ later,
    )


def _smoothed_noise(X: Array, period: float, every: int) -> Array:
    """Covariance of X'e for white noise that passed the window, one of `every` samples taken."""
    window = weights(period)
    alike = np.correlate(window, window, mode="full")[len(window) - 1 :: every]
    total = alike[0] * X.T @ X
    for apart, share in enumerate(alike[1:], start=1):
        product = share * X[:-apart].T @ X[apart:]
        total += product + product.T
    return np.asarray(total)
