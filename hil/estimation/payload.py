"""What a load at the last link is, from two identifications: with and without it.

A rigid load adds its own ten parameters phi to those of the last link n, so all base parameters
change by

    dp = p_with - p_without = K_n phi,

with the columns K_n of `hil.estimation.load_columns`: the expected changes of the paper's Table 3,
computed from the expressions of the base parameters. dp has the sum of both runs' covariances;
errors of torque constants and rotor inertias are the same in both and enter by the difference of
their effects. phi follows by generalised least squares with that covariance. Only what the robot
file calls present at the last link is free: the rest it states to be zero for the load too, and
`unseen` names it. What is left, dp - K_n phi, should be no larger than its covariance: a
chi-squared test.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from hil.errors import NoLoad
from hil.estimation.load_columns import load_columns, payload_names, without_mass
from hil.estimation.payload_figures import MASS, Payload
from hil.least_squares.solving import inverse, inverse_root, orthonormal

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot

    Array = NDArray[np.float64]

ABSENT = 0.01
"""Chance of a load's figures without a load, above which there is none."""
SWAPPED = 4.0
"""Standard errors below zero from which on a mass is negative."""


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


def require_load(found: Payload) -> None:
    """Refuse a load that does not stand out of its error, or whose mass is negative.

    Raises
    ------
    NoLoad
    """
    mass, error = found.phi[MASS], float(np.sqrt(found.phi_covariance[MASS, MASS]))
    refuse_negative(mass, error)
    shown = np.diag(found.phi_covariance) > 0
    x, V = found.phi[shown], found.phi_covariance[np.ix_(shown, shown)]
    chance = float(special.chdtrc(int(shown.sum()), float(x @ inverse(V) @ x)))
    if chance > ABSENT:
        raise no_load(mass, error, chance)


def refuse_negative(mass: float, error: float) -> None:
    """Refuse a mass below zero by more than its error allows [kg].

    Raises
    ------
    NoLoad
    """
    if error and mass < -SWAPPED * error:
        raise NoLoad(
            f"the mass of the load would be {mass:.4g} ± {error:.2g} kg: these runs are swapped, or"
            " the one without the load carried one; name the run without the load first"
        )


def no_load(mass: float, error: float, chance: float) -> NoLoad:
    """The error that a load does not stand out of its own error."""
    figure = f"its mass would be {mass:.3g} ± {error:.2g} kg" if error else "nothing changed"
    return NoLoad(
        f"no load stands out of its error: {figure} (p = {chance:.2g}); check that this run carries"
        " it, or record longer with a heavier one"
    )
