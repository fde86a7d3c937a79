"""What a load at the last link is, from two identifications: with and without it.

A rigid load adds its own ten parameters phi to those of the last link n, so all base parameters
change by

    dp = p_with - p_without = K_n phi,

K_n being the columns of K (p = K p_standard) that belong to that link: the expected changes of the
paper's Table 3, computed from the expressions of the base parameters. dp has the sum of both runs'
covariances; errors of torque constants and rotor inertias are the same in both and enter by the
difference of their effects. phi follows by generalised least squares with that covariance. Only
what the robot file calls present at the last link is free: the rest it states to be zero for the
load too, and `unseen` names it. What is left, dp - K_n phi, should be no larger than its
covariance: a chi-squared test.

Centre of mass and the inertia about it follow from first moments and the inertia about the frame's
origin (Huygens and Steiner), their errors to first order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from hil.errors import NoLoad
from hil.estimation.intervals import MANY, combined_degrees, half_width
from hil.model.base_parameters import base_parameters
from hil.model.robot_file import LINK_PARAMETERS
from hil.regression.least_squares import inverse, inverse_root, orthonormal

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot

    Array = NDArray[np.float64]

ABSENT = 0.01
"""Chance of a load's figures without a load, above which there is none."""
MASS, _FIRST = 9, (6, 7, 8)
"""Where mass and first moments stand in eq. (4)."""
_SHOWN = 1e-9
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
    unidentifiable : tuple of str
        Of the load's ten those that the recordings do not determine.
    degrees : ndarray, shape (10,), optional
        Effective degrees of freedom of `phi_covariance`; many where there are none.
    chance : float, optional
        `p_value`, where the covariance behind `chi_squared` is itself uncertain.
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

    @property
    def p_value(self) -> float:
        """Chance of a misfit at least so large, were the load rigid and nothing else changed."""
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
        first = [(k, axis) for k, axis in zip(_FIRST, "xyz", strict=True) if k in present]
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

    def _central(self, k: int, name: str) -> Quantity:
        """About the centre of mass, axes parallel to the frame's."""
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
        return self._at(f"{name} about the centre", float(value), gradient, "kg m2")

    def _quantity(self, name: str, gradient: Array, unit: str) -> Quantity:
        return self._at(name, float(gradient @ self.phi), gradient, unit)

    def _at(self, name: str, value: float, gradient: Array, unit: str) -> Quantity:
        error = float(np.sqrt(gradient @ self.phi_covariance @ gradient))
        degrees = np.full(10, MANY) if self.degrees is None else self.degrees
        freedom = combined_degrees(gradient, np.diag(self.phi_covariance), degrees)
        half = half_width(np.array(error**2), np.zeros(()), freedom, 0.95)
        return Quantity(name, value, error, float(half), unit)


def estimate_payload(
    robot: Robot, without: Estimate, loaded: Estimate, mass: float | None = None
) -> Payload:
    """Find the load from two estimates of the same robot.

    Parameters
    ----------
    mass : float, optional
        Of the load, if it is known: held, all else is estimated [kg].

    Raises
    ------
    NoLoad
        The robot file states no parameter of the last link that a load could change.
    """
    change = loaded.p - without.p
    carried = loaded.drive_effect - without.drive_effect
    covariance = without.covariance + loaded.covariance + carried @ carried.T
    K, free = load_columns(robot)
    if not free.size:
        raise NoLoad(
            f"{robot.name}: no parameter of the last link is present in the robot file, so a load"
            " would show nowhere; add m, sx, sy, sz and inertias to its parameters"
        )
    known = np.zeros(10)
    if mass is not None:
        known[MASS], free = mass, without_mass(free)
    white = inverse_root(covariance).T
    Q, root = orthonormal(white @ K @ free)
    phi = known + free @ (root @ Q.T @ (white @ (change - K @ known)))
    left = white @ (change - K @ phi)
    return Payload(
        before=without.p,
        after=loaded.p,
        change=change,
        standard_error=np.sqrt(np.diag(covariance)),
        expected=K @ phi,
        covariance=covariance,
        phi=phi,
        phi_covariance=free @ root @ root.T @ free.T,
        stated_mass=mass,
        unseen=payload_names(robot)[0],
        chi_squared=float(left @ left),
        degrees_of_freedom=len(white) - Q.shape[1],
    )


def load_columns(robot: Robot) -> tuple[Array, Array]:
    """K_n, shape (n_base, 10), and how the free parameters make up phi, shape (10, n_free)."""
    own = slice(10 * (robot.n_joints - 1), 10 * robot.n_joints)
    names = robot.link_parameters[own]
    carriers = [name for name in names if name in robot.present and name not in robot.ties]
    free = np.array([
        [float(robot.ties.get(name, name) == carrier and name in robot.present)
         for carrier in carriers] for name in names
    ]).reshape(10, len(carriers))  # fmt: skip
    K = base_parameters(robot).matrix[:, own]
    shown = np.abs(K @ free).max(axis=0, initial=0.0) > _SHOWN
    return K, free[:, shown]


def payload_names(robot: Robot) -> tuple[tuple[str, ...], tuple[tuple[int, str], ...]]:
    """Of the load's ten parameters those that the robot file takes as zero, and the others.

    Returns
    -------
    absent : tuple of str
    present : tuple of (int, str)
        With their places in eq. (4).
    """
    last = {name[: -len(str(robot.n_joints))] for name in robot.present if _of_last(robot, name)}
    absent = tuple(name for name in LINK_PARAMETERS if name not in last)
    return absent, tuple((k, name) for k, name in enumerate(LINK_PARAMETERS) if name in last)


def require_load(found: Payload) -> None:
    """Refuse a load that does not stand out of its error.

    Raises
    ------
    NoLoad
    """
    shown = np.diag(found.phi_covariance) > 0
    x, V = found.phi[shown], found.phi_covariance[np.ix_(shown, shown)]
    chance = float(special.chdtrc(int(shown.sum()), float(x @ inverse(V) @ x)))
    if chance > ABSENT:
        raise no_load(found.phi[MASS], float(np.sqrt(found.phi_covariance[MASS, MASS])), chance)


def no_load(mass: float, error: float, chance: float) -> NoLoad:
    """The error that a load does not stand out of its own error."""
    figure = f"its mass would be {mass:.3g} ± {error:.2g} kg" if error else "nothing changed"
    return NoLoad(
        f"no load stands out of its error: {figure} (p = {chance:.2g}); check that this run carries"
        " it, or record longer with a heavier one"
    )


def without_mass(free: Array) -> Array:
    """Columns of the free parameters but that of the mass."""
    return free[:, free[MASS] == 0]


def _of_last(robot: Robot, name: str) -> bool:
    return name in robot.link_parameters[10 * (robot.n_joints - 1) :]


def _unit(k: int, n: int) -> Array:
    vector: Array = np.zeros(n)
    vector[k] = 1.0
    return vector
