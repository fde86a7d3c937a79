"""A load that was found, and its figures: mass, centre of mass, inertia, each with its interval.

Centre of mass and the inertia about it follow from first moments and the inertia about the frame's
origin (Huygens and Steiner), their errors to first order.
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
"""Chance of what a rigid load leaves, from which on it is not rigid."""
_NAMES = (
    *LINK_PARAMETERS[:MASS],
    "mass",
    *(f"centre {axis}" for axis in "xyz"),
    *(f"{name} about the centre" for name in LINK_PARAMETERS[:6]),
)
_UNITS = *6 * ["kg m2"], *3 * ["kg m"], "kg", *3 * ["m"], *6 * ["kg m2"]
_CENTRE, _CENTRAL = 10, 13
"""Where the centre of mass and inertias about it begin among these."""


class Figure(FileModel):
    """One figure of a load."""

    name: str
    value: float
    standard_error: float
    half_width: Annotated[float, BeforeValidator(lambda x: x or 0.0)] = 0.0
    """Of the interval of 95 %; 0 where an earlier version kept none."""
    unit: str


class AxisMisfit(FileModel):
    """What measurements of one axis with a load leave beside those without.

    Attributes
    ----------
    axis : int
        Number from 1.
    ratio : float
        Of the mean squares.
    p_value : float
        Chance of a ratio at least as great, were the load rigid and nothing else changed.
    """

    axis: int
    ratio: float
    p_value: float


class Chance(NamedTuple):
    """Hotelling's T^2 of so many directions, and the chance of one at least as great."""

    square: float
    directions: int
    p_value: float


@dataclass(frozen=True, slots=True, eq=False)
class Load:
    """A load, and the robot and gains that were found with it.

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
        Zero for those that were stated, that the robot file leaves out or that are open.
    degrees : ndarray, shape (10,)
        Effective degrees of freedom.
    stated_mass : float or None
        The mass that was stated and held [kg]; None where it was estimated.
    unseen : tuple of str
        Of the load's ten those that the robot file leaves out of the last link.
    unidentifiable : tuple of str
        Of the load's ten those that the recordings do not determine.
    gains : ndarray, shape (n_joints,)
        [N m or N for one unit of the torque that was read with the load].
    gain_errors : ndarray, shape (n_joints,)
        Relative standard errors; 0 for gains that were taken as stated, inf for those that nothing
        determines.
    present, rigid : Chance
        Of no load at all, and of nothing but a rigid load; of no directions where the run with the
        load does not determine every change of the base parameters.
    misfit : tuple of AxisMisfit
        What strokes with the load contradict one another by, beside those without.
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
        """Mass [kg]; a stated one has no standard error."""
        return self._figures([MASS])[0]

    @property
    def rigid_chance(self) -> float:
        """Chance of the worst axis's misfit, as one of so many that were tested."""
        chances = [each.p_value for each in self.misfit]
        return min(1.0, len(chances) * min(chances)) if chances else 1.0

    @property
    def is_no_body(self) -> bool:
        """Whether a moment of inertia about the centre is negative beyond its error."""
        least = self.least_inertia()
        return least is not None and least[1] <= LOOSE

    @property
    def is_loose(self) -> bool:
        """Whether the axes' torques contradict a load that is rigid and fixed, or no body is so."""
        return self.rigid_chance <= LOOSE or self.is_no_body

    def quantities(self, level: float = 0.95) -> list[Figure]:
        """Mass, first moments, centre of mass and inertias, as far as they were estimated.

        Parameters
        ----------
        level : float
            Of the intervals.
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
        """Whether all first moments that shift an inertia to the centre are determined."""
        axes = set(LINK_PARAMETERS[k][1:])
        shifted_by = axes if len(axes) > 1 else set("xyz") - axes
        return not any(f"s{axis}" in self.unidentifiable for axis in shifted_by)

    def least_inertia(self) -> tuple[Figure, float] | None:
        """Moment about the centre that is least likely a body's, and its chance of being one.

        No moment of inertia is negative, so for all pairs of axes (Iii + Ijj) / 2 >= |Iij|. None
        where not all inertias were estimated.
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
        """Figures by their places among `_NAMES`."""
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
    """All that has a name, of a load's ten parameters, and its gradients by these, (19, 10)."""
    # steps along the imaginary axis, so small that only rounding is left of the error
    phi = phi + 1e-100j * np.vstack([np.zeros(10), np.eye(10)])
    # without a mass nothing is asked about a centre
    m = np.where(phi[0, MASS].real > 0, phi[:, MASS], 1.0)[:, np.newaxis]
    s = phi[:, FIRST_MOMENTS]
    away = s[:, :, np.newaxis] * s[:, np.newaxis] - np.eye(3) * (s**2).sum(axis=1)[:, None, None]
    central = phi[:, INERTIAS] + away[:, *np.triu_indices(3)] / m
    found = np.hstack([phi, s / m, central])
    return found[0].real, found[1:].imag.T / 1e-100
