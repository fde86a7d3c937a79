"""A load that was found, and its figures: mass, centre of mass, inertia, each with its interval.

Centre of mass and the inertia about it follow from first moments and the inertia about the frame's
origin (Huygens and Steiner), their errors to first order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from hil.estimation.intervals import MANY, combined_degrees, half_width
from hil.model.robot_file import LINK_PARAMETERS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.load_misfit import AxisMisfit

    Array = NDArray[np.float64]

MASS, FIRST_MOMENTS, INERTIAS = 9, (6, 7, 8), (0, 1, 2, 3, 4, 5)
"""Where mass, first moments and inertias stand in eq. (4)."""
CONTRADICTS = 4.0
"""Standard errors between a stated mass and the one that is found, from which they contradict."""
_STEINER = {"Ixx": (7, 8), "Iyy": (6, 8), "Izz": (6, 7)}
"""First moments whose squares belong to each moment of inertia."""
_DEVIATION = {"Ixy": (6, 7), "Ixz": (6, 8), "Iyz": (7, 8)}


@dataclass(frozen=True, slots=True)
class Quantity:
    """One figure with its standard error and the half-width of its interval of 95 %."""

    name: str
    value: float
    standard_error: float
    half_width: float
    unit: str


@dataclass(frozen=True, slots=True, eq=False)
class Payload:
    """A load and how well it explains the change of the base parameters.

    Attributes
    ----------
    before, after, change, standard_error : ndarray, shape (n_base,)
        Base parameters without and with the load, their difference and its standard error.
    expected : ndarray, shape (n_base,)
        K_n phi of the load found.
    covariance : ndarray, shape (n_base, n_base)
        Of `change`.
    phi : ndarray, shape (10,)
        The load's standard parameters in the last link's frame, order of eq. (4).
    phi_covariance : ndarray, shape (10, 10)
    stated_mass : float or None
        The mass that was stated and held [kg]; None where it was estimated.
    unseen : tuple of str
        Of the load's ten those that the robot file leaves out of the last link.
    chi_squared : float
        Squares of what phi leaves of dp, by its covariance.
    degrees_of_freedom : int
        Of that; 0 where nothing is left to be tested.
    unidentifiable : tuple of str
        Of the load's ten those that the recordings do not determine.
    degrees : ndarray, shape (10,), optional
        Effective degrees of freedom of `phi_covariance`; many where there are none.
    chance : float, optional
        `p_value`, where the covariance behind `chi_squared` is itself uncertain.
    misfit : tuple of AxisMisfit
        What a rigid load leaves of each axis's torque, beside without it, where that was tested.
    """

    before: Array
    after: Array
    change: Array
    standard_error: Array
    expected: Array
    covariance: Array
    phi: Array
    phi_covariance: Array
    stated_mass: float | None
    unseen: tuple[str, ...]
    chi_squared: float
    degrees_of_freedom: int
    unidentifiable: tuple[str, ...] = ()
    degrees: Array | None = None
    chance: float | None = None
    misfit: tuple[AxisMisfit, ...] = ()

    @property
    def p_value(self) -> float:
        """Chance of a misfit at least so large, were the load rigid and nothing else changed.

        NaN where nothing was tested.
        """
        if self.chance is not None:
            return self.chance
        return float(special.chdtrc(self.degrees_of_freedom, self.chi_squared))

    @property
    def mass(self) -> Quantity:
        """Mass [kg]; a stated one has no standard error."""
        return self._quantity("mass", _unit(MASS, 10), "kg")

    def quantities(self) -> list[Quantity]:
        """Mass, first moments, centre of mass and inertias, as far as they were estimated."""
        present = [k for k in range(10) if self.phi_covariance[k, k] > 0]
        found = [self.mass] if MASS in present or self.stated_mass is not None else []
        heavy = bool(found) and self.phi[MASS] > 0
        first = [(k, axis) for k, axis in zip(FIRST_MOMENTS, "xyz", strict=True) if k in present]
        found += [self._quantity(LINK_PARAMETERS[k], _unit(k, 10), "kg m") for k, _ in first]
        found += [self._centre(k, axis) for k, axis in first if heavy]
        for k in (k for k in range(6) if k in present):
            found.append(self._quantity(LINK_PARAMETERS[k], _unit(k, 10), "kg m2"))
            found += [self._central(k, LINK_PARAMETERS[k])] if heavy and self._central_at(k) else []
        return found

    def _central_at(self, k: int) -> bool:
        """Whether all first moments that shift an inertia to the centre are determined."""
        name = LINK_PARAMETERS[k]
        moments = (LINK_PARAMETERS[j] for j in _STEINER.get(name, _DEVIATION.get(name, ())))
        return not any(moment in self.unidentifiable for moment in moments)

    def _centre(self, k: int, axis: str) -> Quantity:
        m = self.phi[MASS]
        gradient = _unit(k, 10) / m - _unit(MASS, 10) * self.phi[k] / m**2
        return self._at(f"centre {axis}", float(self.phi[k] / m), gradient, "m")

    def least_inertia(self) -> tuple[Quantity, float] | None:
        """Moment about the centre that is least likely a body's, and its chance of being one.

        No moment of inertia is negative, so for all pairs of axes (Iii + Ijj) / 2 >= |Iij|. None
        where not all inertias were estimated.
        """
        if not (np.all(np.diag(self.phi_covariance)[:6] > 0) and self.phi[MASS] > 0):
            return None
        found = []
        for name in _DEVIATION:
            (across, by), *both = (
                self._about_centre(LINK_PARAMETERS.index(each), each)
                for each in (name, f"I{2 * name[1]}", f"I{2 * name[2]}")
            )
            (first, by_first), (second, by_second) = both
            sign = np.sign(across) or 1.0
            value = (first + second) / 2 - sign * across
            gradient = (by_first + by_second) / 2 - sign * by
            figure = self._at("least inertia", value, gradient, "kg m2")
            chance = special.stdtr(self._degrees_of(gradient), value / figure.standard_error)
            found.append((figure, min(1.0, len(_DEVIATION) * float(chance))))
        return min(found, key=lambda each: each[1])

    def _central(self, k: int, name: str) -> Quantity:
        """About the centre of mass, axes parallel to the frame's."""
        value, gradient = self._about_centre(k, name)
        return self._at(f"{name} about the centre", value, gradient, "kg m2")

    def _about_centre(self, k: int, name: str) -> tuple[float, Array]:
        """An inertia about the centre of mass, and its gradient by phi."""
        m, gradient, value = self.phi[MASS], _unit(k, 10), self.phi[k]
        pairs = [(a, a, -1.0) for a in _STEINER.get(name, ())]
        pairs += [(*_DEVIATION[name], 1.0)] if name in _DEVIATION else []
        for a, b, sign in pairs:
            product = self.phi[a] * self.phi[b] / m
            value = value + sign * product
            gradient = gradient + sign * (
                _unit(a, 10) * self.phi[b] / m
                + _unit(b, 10) * self.phi[a] / m
                - _unit(MASS, 10) * product / m
            )
        return float(value), gradient

    def _quantity(self, name: str, gradient: Array, unit: str) -> Quantity:
        return self._at(name, float(gradient @ self.phi), gradient, unit)

    def _at(self, name: str, value: float, gradient: Array, unit: str) -> Quantity:
        error = float(np.sqrt(gradient @ self.phi_covariance @ gradient))
        freedom = self._degrees_of(gradient)
        half = half_width(np.array(error**2), np.zeros(()), freedom, 0.95)
        return Quantity(name, value, error, float(half), unit)

    def _degrees_of(self, gradient: Array) -> Array:
        degrees = np.full(10, MANY) if self.degrees is None else self.degrees
        return combined_degrees(gradient, np.diag(self.phi_covariance), degrees)


def _unit(k: int, n: int) -> Array:
    vector: Array = np.zeros(n)
    vector[k] = 1.0
    return vector
