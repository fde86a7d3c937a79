"""Natural frequencies of an arm on soft gears, and the largest step of integration.

A light link between two soft gears is faster than either gear with its usual inertia: on the
manutec-r15 link 4, 0.044 kg m^2 alone, is three times faster than joint 4 with the links up to 6.
So all modes are checked. With inertias M of links and motors, and springs K and dampers D between
them, the leapfrog of `machine_step` with extrapolated velocities becomes unstable if a step h
reverses a mode (z = -1), that is, if

    M - D h - K h^2 / 4

becomes singular. Therefore the largest eigenvalue of inv(M) (K h^2 / 4 + D h) must be below one in
the whole workspace.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sim_plant.physics import soft_gears as fl
from sim_plant.physics import state as st
from sim_plant.physics.reflected_inertia import configurations, mass_matrix

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from sim_plant.physics.reflected_inertia import Arm

    Array = NDArray[np.float64]

FOLLOWED = 0.8
"""Largest accepted eigenvalue, with a margin for configurations between the tested ones."""
CONFIGURATIONS = 300


def refuse_steps_too_long(arm: Arm, const: Array, flaws: Array, reach: Array, step: float) -> None:
    """Check that the integration step can follow the soft gears.

    Parameters
    ----------
    arm : tuple
        Joints, frames, bodies, gravity, kinds of `sim_plant.physics.rigid_body`.
    const, flaws : ndarray, shape (n, ...)
    reach : ndarray, shape (n, 2)
        Range of travel of the axes [rad or m].
    step : float
        Integration step [s].

    Raises
    ------
    ValueError
        The step is too long for the gears, or links without motors have no positive inertia.
    """
    modes = list(_modes(arm, const, flaws, reach))
    limit = step
    while max(_share(mode, limit) for mode in modes) > FOLLOWED:
        limit /= 2
    if limit < step:
        fastest = max(float(np.sqrt(_largest(M, K))) for M, K, _ in modes) / (2 * np.pi)
        raise ValueError(
            f"the arm's fastest oscillation on its gears, {fastest:.0f} Hz, is too fast for steps"
            f" of {1e3 * step:g} ms; state step: {limit:g}, or a smaller stiffness"
        )


def _modes(arm: Arm, const: Array, flaws: Array, reach: Array) -> Iterator[tuple[Array, ...]]:
    """Yield M, K and D of links and motors at configurations all over the workspace."""
    n = len(reach)
    soft = flaws[:, fl.STIFFNESS] > 0
    motors, own = const[:, st.MOTOR_INERTIA], slice(None, n)
    K, D = (_between(flaws[:, column]) for column in (fl.STIFFNESS, fl.DAMPING))
    for q in configurations(reach, CONFIGURATIONS):
        M = np.diag(np.concatenate([np.where(soft, 0.0, motors), motors]))
        M[own, own] += mass_matrix(arm, q)
        if np.linalg.eigvalsh(M)[0] <= 0:
            raise ValueError(
                "soft gears need a positive definite M(q) of the links without motors; it is not "
                f"at q = {np.round(q, 2).tolist()}; state physically consistent link "
                "parameters, or omit stiffness"
            )
        yield M, K, D


def _between(value: Array) -> Array:
    """Return the matrix of springs or dampers between links and motors."""
    diagonal = np.diag(value)
    return np.block([[diagonal, -diagonal], [-diagonal, diagonal]])


def _share(mode: tuple[Array, ...], step: float) -> float:
    M, K, D = mode
    return _largest(M, K * step**2 / 4 + D * step)


def _largest(M: Array, A: Array) -> float:
    """Return the largest eigenvalue of inv(M) A, both symmetric."""
    root = np.linalg.inv(np.linalg.cholesky(M))
    return float(np.linalg.eigvalsh(root @ A @ root.T)[-1])
