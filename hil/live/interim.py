"""Interim estimate during a run: parameters, and predicted torques of new recordings.

Each recording is condensed once; the duration of summation and solution does not depend on the
number of recordings. Lags, joint elasticity and friction of the load are left to identification
proper: this estimate is for display only.

A recording's torque is predicted before the recording is used. As in identification, friction is
fitted in each motion, so only the rigid bodies are predicted; within the span P = B B' of
friction's columns nothing is predicted, and the error of the rest is that of the parameters and of
the torque itself,

    tau = A p + P (tau - A p),   variance (1 - P) A V A' (1 - P)' + noise.

Noise is the median residual of such predictions for earlier recordings of the kind; it includes
torque ripple and unmodelled friction.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotEnoughData
from hil.estimation.condensed import ROTOR, condensed_blocks, stack
from hil.estimation.intervals import half_width
from hil.estimation.signals import signals
from hil.friction.equation import ASYMMETRIC, COMMON, LOAD
from hil.least_squares.regression import Regression
from hil.least_squares.solving import orthonormal, undetermined_beside
from hil.live import lines
from hil.model.base_parameters import base_parameters
from hil.planning.measurement import shows_parameters
from hil.results.prediction import FreeTorques

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from hil.arrays import Array
    from hil.estimation.condensed import Stacked
    from hil.least_squares.blocks import Blocks
    from hil.live.lines import Line
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.runs.recording import Recording

POINTS = 120
"""Maximum number of torque samples drawn per recording: one per two pixels of a chart."""


class Interim:
    """Interim estimate, updated by recordings.

    Parameters
    ----------
    robot : Robot
        Robot with known limits.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot, self._base = robot, base_parameters(robot)
        self._blocks: list[Blocks] = []
        self._free = FreeTorques(robot)
        n = len(self._base)
        self._p, self._covariance = np.zeros(n), np.zeros((n, n))
        self._left: dict[tuple[str, int], list[float]] = {}
        self._degrees, self._open = np.ones(n), np.ones(n, dtype=bool)

    def take(self, motion: RecordedMotion, recording: Recording) -> Iterator[Line]:
        """Add a recording; yield the values of line ``torque`` for the moved axes.

        Predicted torques are unknown until all parameters are determined. A recording without
        parameters, or too short, is skipped.
        """
        if not shows_parameters(motion):
            return
        try:
            s = signals(recording)
            stacks = stack(self._robot, motion, s)
        except NotEnoughData:
            return
        for each in (stacked for axes in stacks for stacked in axes):
            predicted = band = np.full(len(each.torques), np.nan)
            if not self._open.any():
                predicted, band = self._predict(motion, each)
            drawn = slice(None, None, -(-len(band) // POINTS))
            measured = each.torques.sum(axis=1)
            columns = (column[drawn, np.newaxis] for column in (measured, predicted, band))
            time = s.time[each.index[drawn]]
            yield lines.torque([each.axis], time, *columns, measurement=motion.id)
        if any(stacks):
            self._blocks.append(condensed_blocks(self._robot, stacks).drop(ROTOR))

    def parameters(self) -> Line:
        """Estimate the parameters; return the values of line ``estimate``."""
        if self._blocks:
            products, counts = (
                np.concatenate([getattr(each, name) for each in self._blocks])
                for name in ("products", "counts")
            )
            blocks = replace(self._blocks[0], products=products, counts=counts)
            own = blocks.layout.kept([COMMON[:LOAD]] * self._robot.n_joints)
            regression, n = Regression.weighed(blocks, own), len(self._base)
            self._open = undetermined_beside(regression.normal.information, n)
            if len(blocks) > 1:
                found = regression.uncertainty("jackknife")
                self._covariance = found.covariance[:n, :n]
                self._degrees = np.maximum(found.degrees_of_freedom[:n], 1.0)
                self._p = regression.solution[:n]
        half = half_width(np.diag(self._covariance), np.zeros(1), self._degrees, 0.95)
        recordings = sum(map(len, self._blocks))
        return estimate_line(self._robot, self._free, recordings, self._p, half, ~self._open)

    def _predict(self, motion: RecordedMotion, each: Stacked) -> tuple[Array, Array]:
        A, y = each.X[:, : each.n_base], each.torques[:, 0]
        common = each.X[:, [each.n_base + k for k in ASYMMETRIC]]
        basis, _ = orthonormal(np.hstack([each.friction, common]))
        left = A - basis @ (basis.T @ A)
        predicted = left @ self._p + basis @ (basis.T @ y) + each.torques[:, 1]
        variance = np.einsum("nk,kl,nl->n", left, self._covariance, left).clip(0.0)
        before = self._left.setdefault((motion.kind, each.axis), [])
        noise = sorted(before)[(len(before) - 1) // 2] if before else np.inf
        band = 1.96 * np.sqrt(variance + noise)
        before.append(float(np.mean((y + each.torques[:, 1] - predicted) ** 2)))
        return predicted, band


def estimate_line(
    robot: Robot,
    free: FreeTorques,
    recordings: int,
    p: Array,
    half: Array,
    known: NDArray[np.bool_],
) -> Line:
    """Return the values of line ``estimate``; arrays have the shape (n_base,)."""
    base, torque = base_parameters(robot), free.parameter_torques(np.where(known, half, 0.0))
    share = (torque / robot.torque_limit[:, np.newaxis]).max(axis=0)
    rows = [
        {
            "name": name,
            "meaning": base.meanings[k],
            "expression": str(base.expressions[k]),
            "unit": base.units[k],
            "value": float(f"{p[k]:.6g}") if known[k] else None,
            "half": float(f"{half[k]:.3g}") if known[k] else None,
            "share": float(f"{share[k]:.3g}") if known[k] else None,
        }
        for k, name in enumerate(base.names)
    ]
    return {"recordings": recordings, "parameters": rows}
