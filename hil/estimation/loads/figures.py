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
from hil.model.load import FIRST_MOMENTS, MASS
from hil.model.robot_file import LINK_PARAMETERS

if TYPE_CHECKING:
    from hil.arrays import Array


LOOSE = 0.001
"""Chance of what a rigid load leaves, from which on it is not rigid."""
_STEINER = {"Ixx": (7, 8), "Iyy": (6, 8), "Izz": (6, 7)}
"""First moments whose squares belong to each moment of inertia."""
_DEVIATION = {"Ixy": (6, 7), "Ixz": (6, 8), "Iyz": (7, 8)}


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


class _Estimated(NamedTuple):
    """A quantity, and its gradient by the ten parameters, shape (10,)."""

    name: str
    value: float
    gradient: Array
    unit: str


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
        return self._figure(self._quantity("mass", MASS, "kg"))

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
        return [self._figure(each, level) for each in self._estimated()]

    def _estimated(self) -> list[_Estimated]:
        present = [k for k in range(10) if self.covariance[k, k] > 0]
        known = MASS in present or self.stated_mass is not None
        found = [self._quantity("mass", MASS, "kg")] if known else []
        heavy = bool(found) and self.phi[MASS] > 0
        first = [(k, axis) for k, axis in zip(FIRST_MOMENTS, "xyz", strict=True) if k in present]
        found += [self._quantity(LINK_PARAMETERS[k], k, "kg m") for k, _ in first]
        found += [self._centre(k, axis) for k, axis in first if heavy]
        for k in (k for k in range(6) if k in present):
            found.append(self._quantity(LINK_PARAMETERS[k], k, "kg m2"))
            found += [self._central(k)] if heavy and self._central_at(k) else []
        return found

    def _central_at(self, k: int) -> bool:
        """Whether all first moments that shift an inertia to the centre are determined."""
        name = LINK_PARAMETERS[k]
        moments = (LINK_PARAMETERS[j] for j in _STEINER.get(name, _DEVIATION.get(name, ())))
        return not any(moment in self.unidentifiable for moment in moments)

    def _centre(self, k: int, axis: str) -> _Estimated:
        m = self.phi[MASS]
        gradient = _unit(k, 10) / m - _unit(MASS, 10) * self.phi[k] / m**2
        return _Estimated(f"centre {axis}", float(self.phi[k] / m), gradient, "m")

    def least_inertia(self) -> tuple[Figure, float] | None:
        """Moment about the centre that is least likely a body's, and its chance of being one.

        No moment of inertia is negative, so for all pairs of axes (Iii + Ijj) / 2 >= |Iij|. None
        where not all inertias were estimated.
        """
        if not (np.all(np.diag(self.covariance)[:6] > 0) and self.phi[MASS] > 0):
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
            figure = self._figure(_Estimated("least inertia", value, gradient, "kg m2"))
            chance = special.stdtr(self._degrees_of(gradient), value / figure.standard_error)
            found.append((figure, min(1.0, len(_DEVIATION) * float(chance))))
        return min(found, key=lambda each: each[1])

    def _central(self, k: int) -> _Estimated:
        """About the centre of mass, axes parallel to the frame's."""
        name = LINK_PARAMETERS[k]
        return _Estimated(f"{name} about the centre", *self._about_centre(k, name), "kg m2")

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

    def _quantity(self, name: str, k: int, unit: str) -> _Estimated:
        return _Estimated(name, float(self.phi[k]), _unit(k, 10), unit)

    def _figure(self, each: _Estimated, level: float = 0.95) -> Figure:
        error = float(np.sqrt(each.gradient @ self.covariance @ each.gradient))
        freedom = self._degrees_of(each.gradient)
        half = float(half_width(np.array(error**2), np.zeros(()), freedom, level))
        return Figure(
            name=each.name, value=each.value, standard_error=error, half_width=half, unit=each.unit
        )

    def _degrees_of(self, gradient: Array) -> Array:
        return combined_degrees(gradient, np.diag(self.covariance), self.degrees)


def _unit(k: int, n: int) -> Array:
    vector: Array = np.zeros(n)
    vector[k] = 1.0
    return vector
