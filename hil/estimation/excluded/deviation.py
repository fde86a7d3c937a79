"""Deviation of later recordings from earlier ones, relative to differences among the earlier ones.

A model of a real machine is never exact. Its residuals in two parts of the recordings differ by
model error as well as by noise, though nothing changed. So the earlier recordings are cut into
`PARTS` of equal duration, and base parameters of all parts leave the mean squares s_ak^2 of axis a
in part k. With n_a axes and the pooled standard deviation sigma of log s_ak^2,

    t_a = (log s_a^2 - mean_k log s_ak^2 - max(0, log c_a)) / (sigma sqrt(1 + 1 / PARTS))

of the mean square s_a^2 of later recordings has Student's distribution of n_a (PARTS - 1) degrees
of freedom if nothing changed. Here c_a is the ratio of the mean squares of the torque, later to
earlier: model error is at most proportional to the torque, such as that of a wrist with a new load.
Later recordings *deviate* if one t_a is significant (Bonferroni over axes). Finite changes, such as
an exchanged axis, are tested only if later recordings deviate. A finite change is the reason only
if the recordings, read with this change, do not deviate any more.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special

from hil.estimation.excluded.alternatives import Reading, explained
from hil.estimation.excluded.battery import FAMILIES, LEVEL

if TYPE_CHECKING:
    from hil.arrays import Array, Indices
    from hil.estimation.excluded.evidence import Evidence
    from hil.model.robot import Robot

PARTS = 4
"""Number of parts of the earlier recordings: parts of some seconds contain the recurring model
error, and each axis has three degrees of freedom.
"""
FEWEST = 10
"""Minimum number of rows of an axis in a part; with fewer, the standard deviation of a logarithm
of the mean square exceeds about one half.
"""


class Deviation(NamedTuple):
    """Mean squares of the earlier recordings, as left by the base parameters.

    Attributes
    ----------
    level : ndarray, shape (n_joints,)
        Mean logarithm over the parts; NaN for axes without enough rows.
    torque : ndarray, shape (n_joints,)
        Logarithm of the mean square of the torque of all parts.
    scatter : float
        Standard deviation of the logarithm of another part's mean square from `level`.
    degrees : int
    """

    level: Array
    torque: Array
    scatter: float
    degrees: int

    @classmethod
    def measure(cls, robot: Robot, evidence: Evidence) -> Deviation:
        """Measure differences between parts of the earlier recordings."""
        # rows as for later recordings: regressors of the smoothed motion
        early = replace(evidence.only(~evidence.is_later), later=None).project_out_own()
        stated = explained(robot, early, Reading.stated(robot))
        residual = early.project_out_friction(stated.residual)
        part = parts_of(early.time)
        logs = [
            _log_mean_squares(residual, np.where(part == k, early.axis, -1), robot.n_joints)
            for k in range(PARTS)
        ]
        torque = _log_mean_squares(early.torque, early.axis, robot.n_joints)
        variances = np.var(logs, axis=0, ddof=1)
        known = np.isfinite(variances)
        if not known.any():
            return cls(np.full(robot.n_joints, np.nan), torque, np.inf, 0)
        scatter = float(np.sqrt(variances[known].mean() * (1.0 + 1.0 / PARTS)))
        level = np.where(known, np.mean(logs, axis=0), np.nan)
        return cls(level, torque, scatter, int(known.sum()) * (PARTS - 1))

    def significant(self, evidence: Evidence, residual: Array) -> bool:
        """Return True if the later rows deviate on any axis; `residual` is of all rows."""
        logs = self.later(evidence, evidence.project_out_friction(residual))
        torque = self.later(evidence, evidence.torque)
        beyond = logs - self.level - np.maximum(torque - self.torque, 0.0)
        t = beyond / self.scatter if self.degrees else np.zeros_like(beyond)
        t = t[np.isfinite(t)]
        level = LEVEL / FAMILIES / max(t.size, 1)
        return bool(t.size and special.stdtr(self.degrees, -t.max()) < level)

    def least_left(self, evidence: Evidence, residual: Array, before: Array) -> float:
        """Return the least ratio of mean squares of the later rows, of residuals of all rows."""
        here, there = (
            self.later(evidence, evidence.project_out_friction(each)) for each in (residual, before)
        )
        return float(np.exp(np.nanmin(here - there)))

    def later(self, evidence: Evidence, values: Array) -> Array:
        """Return logarithms of mean squares of the later rows by axis, shape (n_joints,)."""
        axis = np.where(evidence.is_later, evidence.axis, -1)
        return _log_mean_squares(values, axis, len(self.level))


def parts_of(time: Array, n_parts: int = PARTS) -> Indices:
    """Return the part of each row, from 0; parts are consecutive and have equally many rows."""
    edges = np.quantile(time, np.arange(1, n_parts) / n_parts)
    return np.searchsorted(edges, time, side="right")


def _log_mean_squares(residual: Array, axis: Indices, n_joints: int) -> Array:
    """Return logarithms of mean squares by axis, shape (n_joints,); NaN with too few rows."""
    square = np.bincount(axis + 1, residual**2, n_joints + 1)[1:]
    count = np.bincount(axis + 1, minlength=n_joints + 1)[1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(count >= FEWEST, np.log(square / count), np.nan)
