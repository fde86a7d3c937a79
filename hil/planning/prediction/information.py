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
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.planning.prediction.predicted_samples import forecast
from hil.regression.least_squares import orthonormal
from hil.regression.terms import FEWEST, term_columns, usable

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
    used = usable(robot, planned, axis)
    if used.sum() < FEWEST:
        return None
    rows, common, friction = term_columns(robot, planned, axis)
    stacked = planned.smoothed(np.column_stack([rows, common, friction]))[used]
    kept = stacked.shape[1] - friction.shape[1]
    basis, _ = orthonormal(stacked[:, kept:])
    left = stacked[:, :kept] - basis @ (basis.T @ stacked[:, :kept])
    X = np.zeros((len(used), kept))
    X[used] = left
    smoothed = planned.smoothed(X)
    later = np.cumsum((X * friction[:, :1])[::-1], axis=0)
    return Share(
        axis=axis,
        n=len(left) - basis.shape[1],
        information=left.T @ left,
        white=smoothed.T @ smoothed,
        wander=planned.period * later.T @ later,
    )
