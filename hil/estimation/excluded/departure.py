"""Departure of later recordings from earlier ones, on the scale by which earlier ones differ.

A model of a real machine is never exact. What it leaves of one part of the recordings differs from
what it leaves of another, by model error as well as by noise, though nothing changed. So the
earlier recordings are cut into `PARTS` of equal duration, of which the base parameters of all of
them leave the mean squares s_ak^2 of axis a. With n_a axes and their pooled variance of log s_ak^2,

    t_a = (log s_a^2 - mean_k log s_ak^2) / (sigma sqrt(1 + 1 / PARTS))

of the mean square s_a^2 of later recordings has Student's distribution of n_a (PARTS - 1) degrees
of freedom where nothing changed. Later recordings *depart* where one t_a is significant (Bonferroni
over axes). Finite changes, such as an exchanged axis, are looked for only where they depart, and
one is the reason only if they do not depart any more once they are read so.
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
"""Parts of the earlier recordings: each as long as model error needs to repeat (some seconds), and
three degrees of freedom of each axis."""
FEWEST = 10
"""Rows of an axis in a part below which its mean square says nothing (half of its logarithm)."""


class Departure(NamedTuple):
    """Mean squares that base parameters leave of the earlier recordings.

    Attributes
    ----------
    level : ndarray, shape (n_joints,)
        Mean logarithm over the parts; NaN for axes without enough rows.
    scatter : float
        Standard deviation of the logarithm of another part's mean square from `level`.
    degrees : int
    """

    level: Array
    scatter: float
    degrees: int

    @classmethod
    def of(cls, robot: Robot, evidence: Evidence) -> Departure:
        """Measure how much parts of the earlier recordings differ."""
        # rows as later ones are read: regressors of the smoothed motion
        early = replace(evidence.only(~evidence.is_later), later=None).without_own()
        stated = explained(robot, early, Reading.stated(robot))
        residual = early.without_friction(stated.residual)
        part = parts_of(early.time)
        logs = [
            _log_mean_squares(residual, np.where(part == k, early.axis, -1), robot.n_joints)
            for k in range(PARTS)
        ]
        variances = np.var(logs, axis=0, ddof=1)
        known = np.isfinite(variances)
        if not known.any():
            return cls(np.full(robot.n_joints, np.nan), np.inf, 0)
        scatter = float(np.sqrt(variances[known].mean() * (1.0 + 1.0 / PARTS)))
        level = np.where(known, np.mean(logs, axis=0), np.nan)
        return cls(level, scatter, int(known.sum()) * (PARTS - 1))

    def significant(self, evidence: Evidence, residual: Array) -> bool:
        """Return True if the later rows depart on any axis; `residual` is of all rows."""
        axis = np.where(evidence.is_later, evidence.axis, -1)
        logs = _log_mean_squares(evidence.without_friction(residual), axis, len(self.level))
        t = (logs - self.level) / self.scatter if self.degrees else np.zeros_like(logs)
        t = t[np.isfinite(t)]
        level = LEVEL / FAMILIES / max(t.size, 1)
        return bool(t.size and special.stdtr(self.degrees, -t.max()) < level)


def parts_of(time: Array, n_parts: int = PARTS) -> Indices:
    """Return the part of each row, from 0; parts follow each other and have as many rows."""
    edges = np.quantile(time, np.arange(1, n_parts) / n_parts)
    return np.searchsorted(edges, time, side="right")


def _log_mean_squares(residual: Array, axis: Array, n_joints: int) -> Array:
    """Logarithms by axis, shape (n_joints,); NaN where an axis has too few rows."""
    square = np.bincount(axis + 1, residual**2, n_joints + 1)[1:]
    count = np.bincount(axis + 1, minlength=n_joints + 1)[1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(count >= FEWEST, np.log(square / count), np.nan)
