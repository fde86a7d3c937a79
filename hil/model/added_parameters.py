"""Parameters of drives and springs, identified together with the links' parameters.

A rotor inertia stated in the robot file is compensated (`hil.model.motors`). An unknown one is a
parameter like those of the links: ``Ia<j>``, the inertia of motor j reflected to joint j. A coupled
motor m, also turned by joint j (`Robot.couplings`), has a second parameter: ``Iam<m>``, which
couples the accelerations of both joints (Gautier's name for the Staubli's wrist, where more than a
single rotor with its gears turns). The matrix H_k of parameter k is constant, without gravity
torque: ``tau = H_k qdd`` per unit of the parameter.

A spring or counterbalance at joint j is a function of its position alone, ``k<j>`` times q_j, or
``kc<j>`` times cos q_j, or ``ks<j>`` times sin q_j, and so a part of g(q).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.model.frames import ROUNDED_OFF

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.arrays import Array
    from hil.model.robot import Robot


_SHAPES: dict[str, Callable[[Array], Array]] = {
    "linear": np.positive,
    "cosine": np.cos,
    "sine": np.sin,
}


def added_inertias(robot: Robot) -> Array:
    """Return H of the added parameters, shape (n_added, n_joints, n_joints); 0 for springs."""
    unit = np.eye(robot.n_joints)
    own = [np.outer(unit[j], unit[j]) for j in np.flatnonzero(robot.rotor_inertia_unknown)]
    shared = [
        c.ratio * (np.outer(unit[c.motor], unit[c.joint]) + np.outer(unit[c.joint], unit[c.motor]))
        for c in robot.couplings
    ]
    springs = [np.zeros_like(unit) for _ in robot.file.springs or ()]
    return np.array([*own, *shared, *springs]).reshape(-1, robot.n_joints, robot.n_joints)


def added_loads(robot: Robot, q: Array) -> Array:
    """Compute torques at q per unit of the added parameters, shape (n_samples, n_joints, n_added).

    Parameters
    ----------
    q : ndarray, shape (n_samples, n_joints)
        Positions [rad or m].
    """
    springs = robot.file.springs or ()
    found = np.zeros((*q.shape, len(robot.added_parameters)))
    for k, each in enumerate(springs, start=found.shape[-1] - len(springs)):
        found[:, each.joint - 1, k] = _SHAPES[each.shape](q[:, each.joint - 1])
    return found


def added_unit(robot: Robot, name: str) -> str:
    """Return the unit of an added parameter."""
    index = robot.added_parameters.index(name)
    springs = robot.file.springs or ()
    spring = index - len(robot.added_parameters) + len(springs)
    if spring >= 0:
        turns = bool(robot.revolute[springs[spring].joint - 1])
        linear = springs[spring].shape == "linear"
        return ("N m/rad" if turns else "N/m") if linear else ("N m" if turns else "N")
    joints = np.flatnonzero(added_inertias(robot)[index].any(axis=0))
    slides = int(np.sum(~robot.revolute[joints]))
    return ("kg m2", "kg m", "kg")[slides if len(joints) == 2 else 2 * slides]


def merge_added(robot: Robot, observed: Array, placement: Array) -> tuple[Array, list[int]]:
    """Express added parameters by the links' base parameters where both have equal effects.

    Parameters
    ----------
    observed : ndarray, shape (n, n_standard)
        Elements of M and g at many configurations, per unit of each standard parameter.
    placement : ndarray, shape (10 n_joints, n_link_base)
        Placement of the links' base parameters.

    Returns
    -------
    weights : ndarray, shape (n_base, n_added)
        Weights of added parameters in the base parameters. The base parameters of the links come
        first, then one for each index in `own`.
    own : list of int
        Indices of added parameters not expressed by other base parameters.
    """
    first = 10 * robot.n_joints
    known = observed[:, :first] @ placement
    own: list[int] = []
    columns = []
    for k, effect in enumerate(observed[:, first:].T):
        w = np.linalg.lstsq(known, effect, rcond=None)[0] if known.shape[1] else np.zeros(0)
        if np.linalg.norm(effect - known @ w) > ROUNDED_OFF * np.linalg.norm(effect):
            own.append(k)
            known = np.column_stack([known, effect])
            w = np.eye(known.shape[1])[-1]
        columns.append(w)
    weights = np.zeros((known.shape[1], len(columns)))
    for k, w in enumerate(columns):
        weights[: len(w), k] = np.where(np.abs(w) > ROUNDED_OFF, np.round(w, 9), 0.0)
    return weights, own
