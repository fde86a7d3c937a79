"""Find the nearest parameters with a positive definite mass matrix along the motion.

Rigid bodies always have a positive definite mass matrix, and every simulator needs one. Least
squares has no such constraint: parameters with little effect on the torque may come out impossible.
For a direction u of velocities at a configuration q the kinetic energy u'M(q)u is linear in the
parameters, so each (q, u) with a negative energy is a half-space constraint. Constraints are added
successively, the worst at each configuration (cutting planes), and the solution is moved by as
little as possible in a metric V,

    min (x - x_0)'V^-1 (x - x_0)  with  C x >= d,

which by duality is a non-negative least-squares problem (Lawson and Hanson 1974).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.model.base_parameters import base_parameters
from hil.model.dynamics import mass_matrix, regressor
from hil.model.motors import motor_inertia

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.model.robot import Robot


LEAST = 1e-3
"""Smallest eigenvalue of the result, in units of each joint's own inertia."""
ROUNDS = 40
"""Maximum number of rounds of added half-spaces."""


def least_inertia(robot: Robot, p: Array, q: Array) -> float:
    """Return the smallest eigenvalue of the mass matrix with rotors, in joint inertias.

    Parameters
    ----------
    p : ndarray, shape (n_base,)
    q : ndarray, shape (n, n_joints)
        Configurations; the smallest eigenvalue over all counts.
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
        Inverse of the metric; the inverse normal equations minimise the increase of the torque
        residuals.
    q : ndarray, shape (n_configurations, n_joints)

    Returns
    -------
    ndarray, shape (n,)
        Moved solution, or `x` if no correction was needed.
    """
    n_base = len(base_parameters(robot))
    found, rows, bounds = x, [], []
    for _ in range(ROUNDS):
        scaled, size = _scaled(robot, found[:n_base], q)
        values, vectors = np.linalg.eigh(scaled)
        # target slightly above the bound, so that the result is positive after rounding
        worst = np.flatnonzero(values[:, 0] < LEAST)
        if not len(worst):
            break
        for k in worst[np.argsort(values[worst, 0])][:5]:
            u = vectors[k, :, 0] / size
            # u'M(q)u per unit of the base parameters
            still = np.zeros_like(u)
            at_rest = regressor(robot, q[k], still, still)
            rows.append(u @ (regressor(robot, q[k], still, u) - at_rest))
            bounds.append(2 * LEAST - float(u @ motor_inertia(robot, q[k]) @ u))
        from scipy.optimize import nnls  # noqa: PLC0415 - takes long to load, seldom needed

        C = np.pad(np.array(rows), [(0, 0), (0, len(x) - n_base)])
        # non-negative multipliers l that minimise l'S l / 2 - l'(bounds - C x), with S = C V C'
        values, vectors = np.linalg.eigh(C @ V @ C.T)
        kept = values > 1e-12 * values.max()
        root = vectors[:, kept] * np.sqrt(values[kept])
        side = (vectors[:, kept] / np.sqrt(values[kept])).T @ (np.array(bounds) - C @ x)
        found = x + V @ C.T @ nnls(root.T, side)[0]
    return found


def _scaled(robot: Robot, p: Array, q: Array) -> tuple[Array, Array]:
    """Return mass matrices over the joint inertias, and the roots of these inertias."""
    M = mass_matrix(robot, p, q) + motor_inertia(robot, q)
    own = np.abs(np.einsum("njj->nj", M)).mean(axis=0)
    # inertias without data are zero: of the size of rounding beside the largest
    size = np.sqrt(np.maximum(own, max(1e-9 * own.max(), 1e-300)))
    return M / np.outer(size, size), size
