"""Figures of an estimated load: mass, centre of mass and inertia, with intervals.

Centre of mass and the inertia about it follow from first moments and the inertia about the frame's
origin (Huygens and Steiner), with errors to first order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np
from pydantic import BeforeValidator
from scipy import special

from checked_files.yaml_file import FileModel
from hil.estimation.intervals import combined_degrees, half_width
from hil.model.load import FIRST_MOMENTS, INERTIAS, MASS
from hil.model.robot_file import LINK_PARAMETERS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array


LOOSE = 0.001
"""Significance level of the tests for a rigid load."""
_NAMES = (
    *LINK_PARAMETERS[:MASS],
    "mass",
    *(f"centre {axis}" for axis in "xyz"),
    *(f"{name} about the centre" for name in LINK_PARAMETERS[:6]),
)
_UNITS = *6 * ["kg m2"], *3 * ["kg m"], "kg", *3 * ["m"], *6 * ["kg m2"]
_CENTRE, _CENTRAL = 10, 13
"""Indices of the first coordinate of the centre and of the first inertia about the centre."""


class Figure(FileModel):
    """Figure of a load: value, standard error, interval and unit."""

    name: str
    value: float
    standard_error: float
    half_width: Annotated[float, BeforeValidator(lambda x: x or 0.0)] = 0.0
    """Half-width of the 95 % interval; 0 in files of an earlier version."""
    unit: str


class AxisMisfit(FileModel):
    """Misfit of an axis with a load, over the misfit without the load.

    Attributes
    ----------
    axis : int
        Number from 1.
    ratio : float
        Ratio of the mean squares.
    p_value : float
        Probability of a ratio at least as great if the load is rigid and nothing else changed.
    """

    axis: int
    ratio: float
    p_value: float


class Chance(NamedTuple):
    """Hotelling's T^2, the number of directions, and the probability of a T^2 at least as great."""

    square: float
    directions: int
    p_value: float


@dataclass(frozen=True, slots=True, eq=False)
class Load:
    """Estimated load, with the robot and the gains of the same fit.

    Attributes
    ----------
    p : ndarray, shape (n_base,)
        Base parameters without the load.
    p_covariance : ndarray, shape (n_base, n_base)
    p_degrees : ndarray, shape (n_base,)
        Effective degrees of freedom.
    phi : ndarray, shape (10,)
        The load's standard parameters in the last link's frame, order of eq. (4).
    covariance : ndarray, shape (10, 10)
        Covariance of `phi`; zero for parameters stated, missing in the robot file, or undetermined.
    degrees : ndarray, shape (10,)
        Effective degrees of freedom.
    stated_mass : float or None
        Stated mass, fixed in the fit [kg]; None if the mass was estimated.
    unseen : tuple of str
        Parameters of the load missing in the robot file's last link.
    unidentifiable : tuple of str
        Parameters of the load not determined by the recordings.
    gains : ndarray, shape (n_joints,)
        Gains [N m or N per unit of the torque read with the load].
    gain_errors : ndarray, shape (n_joints,)
        Relative standard errors; 0 for stated gains, inf for undetermined gains.
    present, rigid : Chance
        Tests of no load at all, and of nothing but a rigid load; the latter without directions if
        the run with the load does not determine every change of the base parameters.
    misfit : tuple of AxisMisfit
        Misfit of strokes with the load, over the misfit of strokes without the load.
    """

    p: Array
    p_covariance: Array
    p_degrees: Array
    phi: Array
    covariance: Array
    degrees: Array
    stated_mass: float | None
    unseen: tuple[str, ...]
    unidentifiable: tuple[str, ...]
    gains: Array
    gain_errors: Array
    present: Chance
    rigid: Chance
    misfit: tuple[AxisMisfit, ...]

    @property
    def mass(self) -> Figure:
        """Mass of the load [kg]; a stated mass has no standard error."""
        return self._figures([MASS])[0]

    @property
    def rigid_chance(self) -> float:
        """Probability of the worst axis's misfit, corrected for the number of tested axes."""
        chances = [each.p_value for each in self.misfit]
        return min(1.0, len(chances) * min(chances)) if chances else 1.0

    @property
    def is_no_body(self) -> bool:
        """True if a central moment of inertia is significantly negative."""
        least = self.least_inertia()
        return least is not None and least[1] <= LOOSE

    @property
    def is_loose(self) -> bool:
        """True if torques contradict a rigid, fixed load, or if the load is not a physical body."""
        return self.rigid_chance <= LOOSE or self.is_no_body

    def quantities(self, level: float = 0.95) -> list[Figure]:
        """Return mass, first moments, centre of mass and inertias, as far as estimated.

        Parameters
        ----------
        level : float
            Probability of the intervals.
        """
        present = [k for k in range(10) if self.covariance[k, k] > 0]
        known = MASS in present or self.stated_mass is not None
        heavy = known and self.phi[MASS] > 0
        first = [k for k in FIRST_MOMENTS if k in present]
        listed = [*[MASS] * known, *first]
        listed += [_CENTRE + FIRST_MOMENTS.index(k) for k in first if heavy]
        for k in (k for k in INERTIAS if k in present):
            listed += [k, _CENTRAL + k] if heavy and self._central_at(k) else [k]
        return self._figures(listed, level)

    def _central_at(self, k: int) -> bool:
        """Return True if the first moments for shifting an inertia to the centre are determined."""
        axes = set(LINK_PARAMETERS[k][1:])
        shifted_by = axes if len(axes) > 1 else set("xyz") - axes
        return not any(f"s{axis}" in self.unidentifiable for axis in shifted_by)

    def least_inertia(self) -> tuple[Figure, float] | None:
        """Return the least plausible moment about the centre, and the chance that it is positive.

        No moment of inertia is negative, so (Iii + Ijj) / 2 >= |Iij| for all pairs of axes. None if
        not all inertias were estimated.
        """
        if not (np.all(np.diag(self.covariance)[:6] > 0) and self.phi[MASS] > 0):
            return None
        values, gradients = _derived(self.phi)
        found = []
        for across, *both in ((1, 0, 3), (2, 0, 5), (4, 3, 5)):
            weights = np.zeros(len(_NAMES))
            weights[_CENTRAL + np.array(both)] = 0.5
            weights[_CENTRAL + across] = -(np.sign(values[_CENTRAL + across]) or 1.0)
            value, gradient = float(weights @ values), weights @ gradients
            figure = self._figure("least inertia", value, gradient, "kg m2")
            chance = special.stdtr(self._degrees_of(gradient), value / figure.standard_error)
            found.append((figure, min(1.0, 3 * float(chance))))
        return min(found, key=lambda each: each[1])

    def _figures(self, listed: Sequence[int], level: float = 0.95) -> list[Figure]:
        """Return figures by index in `_NAMES`."""
        values, gradients = _derived(self.phi)
        return [
            self._figure(_NAMES[k], float(values[k]), gradients[k], _UNITS[k], level)
            for k in listed
        ]

    def _figure(
        self, name: str, value: float, gradient: Array, unit: str, level: float = 0.95
    ) -> Figure:
        error = float(np.sqrt(gradient @ self.covariance @ gradient))
        freedom = self._degrees_of(gradient)
        half = float(half_width(np.array(error**2), np.zeros(()), freedom, level))
        return Figure(name=name, value=value, standard_error=error, half_width=half, unit=unit)

    def _degrees_of(self, gradient: Array) -> Array:
        return combined_degrees(gradient, np.diag(self.covariance), self.degrees)


def _derived(phi: Array) -> tuple[Array, Array]:
    """Derive the named quantities of a load from ten parameters, with gradients, (19, 10)."""
    # complex steps, so small that the error is only rounding
    phi = phi + 1e-100j * np.vstack([np.zeros(10), np.eye(10)])
    # without a positive mass there is no centre; 1 avoids a division by zero
    m = np.where(phi[0, MASS].real > 0, phi[:, MASS], 1.0)[:, np.newaxis]
    s = phi[:, FIRST_MOMENTS]
    away = s[:, :, np.newaxis] * s[:, np.newaxis] - np.eye(3) * (s**2).sum(axis=1)[:, None, None]
    central = phi[:, INERTIAS] + away[:, *np.triu_indices(3)] / m
    found = np.hstack([phi, s / m, central])
    return found[0].real, found[1:].imag.T / 1e-100
