"""The nearest parameters whose mass matrix is positive definite along the motion.

No set of bodies has a mass matrix that is not, and no simulator runs with one. Least squares knows
nothing of that: parameters that hardly move the torque may come out impossible. For a direction u
of velocities at a configuration q the kinetic energy u'M(q)u is linear in the parameters, so each
(q, u) with a negative one is a half-space to be entered. These are added one after the other, the
worst at each configuration (cutting planes), and the solution is moved by as little as possible in
a metric V,

    min (x - x_0)'V^-1 (x - x_0)  with  C x >= d,

which by duality is a least-squares problem with non-negative unknowns (Lawson and Hanson 1974).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import nnls

from hil.model.base_parameters import base_parameters
from hil.model.dynamics import mass_matrix, regressor
from hil.model.motors import motor_inertia

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.model.robot import Robot


LEAST = 1e-3
"""Least eigenvalue that is reached, in units of each joint's own inertia."""
ROUNDS = 40
"""Of added half-spaces, at most."""


def least_inertia(robot: Robot, p: Array, q: Array) -> float:
    """Least eigenvalue of the mass matrix with its rotors, in units of the joints' own inertias.

    Parameters
    ----------
    p : ndarray, shape (n_base,)
    q : ndarray, shape (n, n_joints)
        Configurations; the least of all counts.
    """
    scaled = _scaled(robot, p, q)[0]
    return float(np.linalg.eigvalsh(scaled)[:, 0].min())


def nearest_positive(robot: Robot, x: Array, V: Array, q: Array) -> Array:
    """Move a solution so that its mass matrix is positive definite.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Base parameters, then other unknowns.
    V : ndarray, shape (n, n)
        Inverse of the metric; of the normal equations, for the least that torques lose by it.
    q : ndarray, shape (n_configurations, n_joints)

    Returns
    -------
    ndarray, shape (n,)
        `x` itself where nothing was to be moved.
    """
    n_base = len(base_parameters(robot))
    found, rows, bounds = x, [], []
    for _ in range(ROUNDS):
        scaled, size = _scaled(robot, found[:n_base], q)
        values, vectors = np.linalg.eigh(scaled)
        # a little further than is asked for, so that what rounding leaves is still positive
        worst = np.flatnonzero(values[:, 0] < LEAST)
        if not len(worst):
            break
        for k in worst[np.argsort(values[worst, 0])][:5]:
            u = vectors[k, :, 0] / size
            rows.append(_energy(robot, q[k], u))
            bounds.append(2 * LEAST - float(u @ motor_inertia(robot, q[k]) @ u))
        C = np.pad(np.array(rows), [(0, 0), (0, len(x) - n_base)])
        found = x + V @ C.T @ _multipliers(C @ V @ C.T, np.array(bounds) - C @ x)
    return found


def _scaled(robot: Robot, p: Array, q: Array) -> tuple[Array, Array]:
    """Mass matrices over the joints' own inertias, and roots of these."""
    M = mass_matrix(robot, p, q) + motor_inertia(robot, q)
    own = np.abs(np.einsum("njj->nj", M)).mean(axis=0)
    size = np.sqrt(np.maximum(own, 1e-300))
    return M / np.outer(size, size), size


def _energy(robot: Robot, q: Array, u: Array) -> Array:
    """u'M(q)u per unit of each base parameter, shape (n_base,)."""
    still = np.zeros_like(q)
    return u @ (regressor(robot, q, still, u) - regressor(robot, q, still, still))


def _multipliers(S: Array, short: Array) -> Array:
    """Non-negative l that minimise l'S l / 2 - l'short."""
    values, vectors = np.linalg.eigh(S)
    kept = values > 1e-12 * values.max()
    root = vectors[:, kept] * np.sqrt(values[kept])
    return nnls(root.T, (vectors[:, kept] / np.sqrt(values[kept])).T @ short)[0]
