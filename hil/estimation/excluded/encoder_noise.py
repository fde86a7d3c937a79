"""Bias of the tests of causes by encoder noise.

A position with the quantisation step d has an error of variance d^2 / 12, which differentiation
turns into an acceleration error of variance s^2. Predicted torque and columns share this error. So
the score of a column D~, adjusted for the estimated columns, has the bias

    beta = - sum over rows and joints of s_j^2 (d D~ / d qdd_j) (d tau / d qdd_j)

(W. A. Fuller, Measurement Error Models, 1987, section 2.2): rows whose acceleration is mostly noise
show less inertia than others. If a control loop follows its encoder, the axis moves with the
encoder steps, and there is no error. An unknown share of beta, between 0 and 1, is present, as in
`SimultaneousFit.steps`: scores are corrected by beta / 2, with the variance beta^2 / 12.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.estimation.excluded.columns import EvidenceRows, columns_of
from hil.least_squares.window import rounding_window
from hil.model.dynamics import regressor

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.estimation.excluded.columns import Column
    from hil.estimation.excluded.evidence import Evidence
    from hil.model.robot import Robot

MOST = 200
"""Approximate number of rows of a channel for the expected products. The products differ by a tenth
from those over all rows (seed 3106 of `benchmarks/fresh_plants.py`), which is less than the
uncertainty of the share of beta.
"""


class _Accelerated(NamedTuple):
    """Rows with the acceleration of a joint increased by one unit.

    Attributes
    ----------
    joint : int
    rows : EvidenceRows
    error : ndarray, shape (n,)
        Product of s_j^2, d tau / d qdd_j, and the number of evidence rows that the row represents.
    """

    joint: int
    rows: EvidenceRows
    error: Array


class EncoderNoise:
    """Expected products of torque errors and column errors by encoder noise."""

    def __init__(self, robot: Robot, p: Array, evidence: Evidence) -> None:
        self._robot, self._p, self._evidence = robot, p, evidence
        self._products: dict[int, dict[Column, Array]] = {}

    def column_products(self, name: Column) -> Array:
        """Return the expected products of a cause's column, shape (n_channels,).

        Zero for the columns of fitted compliances and of backlash.
        """
        if name.axis not in self._products:
            self._products[name.axis] = self._axis_products(name.axis)
        return self._products[name.axis].get(name, np.zeros(self._evidence.n_channels))

    @cached_property
    def parameter_products(self) -> Array:
        """Expected products of the base parameters' columns, shape (n_channels, n_base)."""
        e = self._rows.evidence
        found = np.zeros((e.n_channels, e.X.shape[1]))
        q, qd, qdd = e.motion[1]
        for joint, _, error in self._accelerated:
            more = qdd + np.eye(self._robot.n_joints)[joint]
            for channel in np.unique(e.axis):
                at = e.axis == channel
                moved, before = (
                    regressor(self._robot, q[at], qd[at], each[at], [channel])[:, 0]
                    for each in (more, qdd)
                )
                found[channel] += error[at] @ (moved - before)
        return found

    def _axis_products(self, axis: int) -> dict[Column, Array]:
        """Return the expected products of the columns of an axis, -1 for all axes."""
        e, found = self._rows.evidence, dict(columns_of(self._rows, axis))
        later = np.ones(len(e.axis)) if e.later is None else e.later
        sums = dict.fromkeys(found, np.zeros(e.n_channels))
        for _, rows, error in self._accelerated:
            for name, column in columns_of(rows, axis):
                products = error * (column - found[name]) * later
                sums[name] = sums[name] + np.bincount(e.axis, products, e.n_channels)
        return sums

    @cached_property
    def _rows(self) -> EvidenceRows:
        thin, _ = self._evidence.thinned(MOST)
        return EvidenceRows(self._robot, self._p, thin, self._evidence)

    @cached_property
    def _accelerated(self) -> list[_Accelerated]:
        """Rows with increased acceleration, for each joint with encoder noise."""
        rows, e, n_joints = self._rows, self._rows.evidence, self._robot.n_joints
        whole, thin = (np.bincount(each.axis, minlength=n_joints) for each in (self._evidence, e))
        stands_for = (whole / np.maximum(thin, 1))[e.axis]
        variance = np.array([
            s.resolution**2 / 12
            * np.sum(rounding_window(s.period) ** 2)
            for s in e.signals
        ])[e.source]  # fmt: skip
        found = []
        for joint in np.flatnonzero(variance.any(axis=0)).tolist():
            more = rows.accelerated(joint)
            torque = more.rigid + more.motor - rows.rigid - rows.motor
            found.append(_Accelerated(joint, more, stands_for * variance[:, joint] * torque))
        return found
