"""Transfer of link parameters to the link before without a change of torque.

A change of the standard parameters of link j and its parent i has no effect on torques if it leaves
the kinetic energy, and the potential energy up to a constant, unchanged for every motion. From the
tips down this splits into one question per joint: which changes delta of link j's ten parameters
(i) are invisible to the joint's own rate, and (ii) look the same to all motions of link i at every
q_j? These changes form the space T_j. Link i cancels a change in T_j if the change, expressed in
frame i, is subtracted from its parameters. Other children of link i do not matter, since their
terms depend on their own joints. For a revolute joint T_j always contains m, sz and Ixx = Iyy, for
a prismatic one the whole inertia: the general rules of Gautier and Khalil (IEEE Trans. Robotics and
Automation 6, 1990). Their special rules apply where the previous links cannot move freely (parallel
axes, axes along gravity, prismatic joints before the second revolute direction): there T_j is
larger.

The observable part of link j is the span D_j of linear functionals of its parameters: the energies'
terms. Motion of joint j multiplies parameters by exp(q L), so spans over all q are Krylov spaces of
L, and the infinite set of configurations needs only finitely many conditions (Wensing, Niemeyer,
Slotine, Int. J. Robotics Research 43, 2024)::

    V_j = span over q of (velocities of link i seen in frame j), and the joint's own axis s
    D_j = span over q of (D_i seen in frame j), and v' I(.) s for all v in V_j
    T_j = {delta : d L exp(q L) delta = 0 for all d in D_i, q;  v' I(delta) s = 0 for v in V_j}

with D_0 the potential energy of a body at the base. Velocities are (angular, linear).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.model.frames import (
    ROUNDED_OFF,
    UNIT_INERTIAS,
    adjoint,
    adjoint_rate,
    inverse,
    joint_motion,
    parameter_map,
    parameter_rate,
)

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.model.robot import Robot


_ELIMINATION_ORDER = (9, 8, 3, 4, 2, 1, 0, 5, 7, 6)
"""Order of elimination: m, sz, Iyy as in Gautier and Khalil, then the rest."""


def transfers(robot: Robot) -> list[tuple[Array, list[int]]]:
    """Compute the transferable parameters T_j of every joint; see the module.

    Returns
    -------
    directions : array, shape (n_given, 10)
        Basis of T_j in echelon form: row i is 1 at ``given[i]`` and 0 at the others of `given`.
    given : list of int
        Parameters transferred from link j.
    """
    felt = np.zeros((1, 10))
    felt[0, 6:9] = robot.gravity / max(float(np.linalg.norm(robot.gravity)), ROUNDED_OFF)
    spans = {-1: (np.zeros((0, 6)), felt)}
    found = []
    for joint, parent in enumerate(robot.parents):
        velocities, felt = spans[parent]
        pose = robot.link_pose(joint)
        generator, axis = joint_motion(bool(robot.revolute[joint]))
        velocities = _krylov(velocities @ adjoint(inverse(pose)).T, adjoint_rate(generator).T)
        velocities = _span(np.vstack([velocities, axis]))
        rate = parameter_rate(generator)
        felt = _krylov(felt @ parameter_map(pose), rate)
        own = np.array([v @ UNIT_INERTIAS @ axis for v in velocities])
        found.append(_echelon(_null_space(np.vstack([felt @ rate, own]))))
        spans[joint] = velocities, _span(np.vstack([felt, own]))
    return found


def _krylov(rows: Array, step: Array) -> Array:
    """Compute the span of rows exp(q step) over all q, the smallest invariant space with `rows`."""
    space = _span(rows)
    while True:
        larger = _span(np.vstack([space, space @ step]))
        if len(larger) == len(space):
            return space
        space = larger


def _span(rows: Array) -> Array:
    """Compute an orthonormal basis of the rows' span.

    The rows stay unscaled: of orthonormal functionals, small ones are rounding errors.
    """
    _, values, basis = np.linalg.svd(rows, full_matrices=False)
    spanning: Array = basis[values > ROUNDED_OFF * values.max(initial=0.0)]
    return spanning


def _null_space(rows: Array) -> Array:
    """Compute an orthonormal basis of the null space of `rows`, as rows."""
    return np.linalg.svd(rows)[2][len(_span(rows)) :]


def _echelon(basis: Array) -> tuple[Array, list[int]]:
    basis = basis.copy()
    given: list[int] = []
    for column in _ELIMINATION_ORDER:
        rank = len(given)
        if rank == len(basis):
            break
        pivot = rank + int(np.argmax(np.abs(basis[rank:, column])))
        if abs(basis[pivot, column]) < ROUNDED_OFF:
            continue
        basis[[rank, pivot]] = basis[[pivot, rank]]
        basis[rank] /= basis[rank, column]
        others = np.arange(len(basis)) != rank
        basis[others] -= np.outer(basis[others, column], basis[rank])
        given.append(column)
    nearest = np.round(basis)
    snapped = np.where(np.abs(basis - nearest) < ROUNDED_OFF, nearest, basis)
    return snapped + 0.0, given
