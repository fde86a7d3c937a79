"""Detection of physically impossible parameters: indefinite mass matrix, negative inertias.

The kinetic energy u'M(q)u / 2 of bodies and rotors is positive for all velocities u at all
positions q. The energy of the links alone, without rotors, is not negative. The same holds for a
base parameter w'phi if each link's part of w is the inner product of its pseudo-inertia with a
positive semidefinite matrix (the cone of pseudo-inertias is its own dual) and no added inertia has
a negative factor: the inertia of an axis is an example, a difference of two inertias is not. All
these quantities are linear in the parameters, a'p + c, with standard error (a'Va)^1/2. At most
n_base of them are independent, so each is tested at the level `SIGNIFICANT` / n_base.

The tests cover single base parameters, and the velocities that minimise u'M(q)u at positions
throughout the ranges. The minimum is taken relative to the mean of each joint's own inertia, and
relative to its standard error, which detects small certain values beside large ones.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.estimation.intervals import SIGNIFICANT, combined_degrees, half_width
from hil.model.added_parameters import added_inertias
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import mass_matrix, regressor
from hil.model.frames import UNIT_PSEUDO_INERTIAS
from hil.model.motors import motor_inertia
from hil.planning.halton import halton

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.arrays import Array
    from hil.results.identified_robot import IdentifiedRobot

POSITIONS = 1000
"""Number of positions for testing M(q). For nine robots, with rods as links, the least eigenvalue
over 1000 positions is within 12 % of that over 30000."""
FEW = 50
"""Number of positions for the standard errors of the joints' own inertias, used as a unit."""
WORST = 20
"""Number of positions with the least eigenvalues tested further; their velocities are similar."""
_ROUNDING = 1e-9
"""Share of the greatest eigenvalue below which a negative eigenvalue is rounding."""


class Impossible(NamedTuple):
    """Identified quantity that should be positive.

    Attributes
    ----------
    what : str
        Name of the quantity.
    value, error : float
        Value and standard error.
    unit : str
        Unit; empty if the quantity has several units.
    certain : bool
        True for a value negative beyond the uncertainty.
    """

    what: str
    value: float
    error: float
    unit: str
    certain: bool


def impossible_inertias(model: IdentifiedRobot) -> Iterator[Impossible]:
    """Find negative eigenvalues of the mass matrix with rotors, and negative rotor inertias."""
    q = _positions(model)
    rotors = motor_inertia(model.robot, q)
    yield from _energy(model, q, rotors, "mass matrix")
    for k, row in enumerate(_sums(model)):
        if not row[: 10 * model.robot.n_joints].any() and _not_negative(model, row):
            yield from _parameter(model, k)


def impossible_links(model: IdentifiedRobot) -> Iterator[Impossible]:
    """Find negative base parameters, and negative eigenvalues of the mass matrix without rotors."""
    for k, row in enumerate(_sums(model)):
        if row[: 10 * model.robot.n_joints].any() and _not_negative(model, row):
            yield from _parameter(model, k)
    q = _positions(model)
    if motor_inertia(model.robot, q[:1]).any():
        still = np.zeros((len(q), model.robot.n_joints, model.robot.n_joints))
        yield from _energy(model, q, still, "mass matrix of the links without rotors")


def _sums(model: IdentifiedRobot) -> Array:
    """Return what each value of a model estimates, in standard parameters, (n_base, n_standard)."""
    K = base_parameters(model.robot).matrix
    return K if model.combination is None else np.asarray(model.combination @ K)


def _positions(model: IdentifiedRobot) -> Array:
    """Return positions throughout the ranges; half a turn either way for unknown ranges.

    Axes that were at rest stay where they were: their torque is also that of static friction.
    """
    robot = model.robot
    low, high = np.nan_to_num(robot.q_min, nan=-np.pi), np.nan_to_num(robot.q_max, nan=np.pi)
    found: Array = low + (high - low) * halton(POSITIONS, robot.n_joints)
    for axis, at in model.details.rest.items():
        found[:, axis - 1] = at
    return found


def _parameter(model: IdentifiedRobot, k: int) -> Iterator[Impossible]:
    base = base_parameters(model.robot)
    row, value = np.eye(len(base))[k], float(model.values[k])
    if model.identified[k] and value < 0 and _certain(model, row, value):
        error = float(model.standard_errors[k])
        yield Impossible(base.titles[k], value, error, base.units[k], certain=True)


def _energy(model: IdentifiedRobot, q: Array, rotors: Array, what: str) -> Iterator[Impossible]:
    """Find the most certain negative eigenvalue of M(q) and `rotors`, relative to M's diagonal.

    Sums of parameters, estimated by strokes of single axes, determine no mass matrix.
    """
    if model.combination is not None and not model.identified.all():
        return
    robot, p = model.robot, model.values
    moved = [k for k in range(robot.n_joints) if k + 1 not in model.details.rest]
    M = (mass_matrix(robot, p, q) + rotors)[:, moved][:, :, moved]
    own = np.abs(np.einsum("njj->nj", M)).mean(axis=0)
    unit = np.eye(robot.n_joints)[moved]
    some = q[:FEW]
    rows = np.array([energy_row(model, some, np.tile(u, (len(some), 1))) for u in unit])
    error = np.sqrt(_variance(model, rows)).mean(axis=1)
    found: list[tuple[float, float, float, Array]] = []
    for size in (own, error):
        if not (size > 0).all():
            continue
        scale = 1.0 / np.sqrt(size)
        values, vectors = np.linalg.eigh(M * np.outer(scale, scale))
        at = np.argsort(values[:, 0])[:WORST]
        at = at[values[at, 0] < -_ROUNDING * np.abs(values).max()]
        u = vectors[at, :, 0] * scale
        u /= np.linalg.norm(u, axis=1, keepdims=True)
        each = energy_row(model, q[at], u @ unit)
        own_error = np.sqrt(_variance(model, each))
        value = np.einsum("ni,nij,nj->n", u, M[at], u)
        found += zip(value / np.maximum(own_error, 1e-300), value, own_error, each, strict=True)
    if found:
        _, least, its_error, row = min(found, key=lambda each: each[0])
        yield Impossible(what, float(least), float(its_error), "", _certain(model, row, least))


def energy_row(model: IdentifiedRobot, q: Array, u: Array) -> Array:
    """Return u'M(q)u per unit of each base parameter, shape (n, n_base), for rows of q and u."""
    still = np.zeros_like(q)
    A = regressor(model.robot, q, still, u) - regressor(model.robot, q, still, still)
    return np.asarray(np.einsum("nj,njk->nk", u, A))


def _variance(model: IdentifiedRobot, rows: Array) -> Array:
    return np.asarray(np.einsum("...k,kl,...l->...", rows, model.covariance, rows)).clip(0.0)


def _certain(model: IdentifiedRobot, row: Array, value: float) -> bool:
    """Return True if a combination of the parameters is negative beyond its uncertainty."""
    V, D = model.scatter_covariance, model.drive_covariance
    scatter, stated = (np.array([max(float(row @ each @ row), 0.0)]) for each in (V, D))
    degrees = combined_degrees(row[np.newaxis], np.diag(V), model.degrees_of_freedom)
    level = 1.0 - 2.0 * SIGNIFICANT / len(row)  # one-sided
    return bool(value < -half_width(scatter, stated, degrees, level)[0])


def _not_negative(model: IdentifiedRobot, row: Array) -> bool:
    """Return True if a combination of standard parameters is non-negative for every robot."""
    robot = model.robot
    n = 10 * robot.n_joints
    inertial = added_inertias(robot).any(axis=(1, 2))
    # a shared inertia couples two accelerations and may have either sign
    own = np.array([np.count_nonzero(H) == 1 for H in added_inertias(robot)], dtype=bool)
    added = row[n:]
    if (added < 0).any() or added[~(inertial & own)].any() or not row.any():
        return False
    # <W, J> = w'phi for the symmetric W whose inner products with the unit pseudo-inertias are w
    units = np.array(UNIT_PSEUDO_INERTIAS).reshape(10, 16)
    for w in row[:n].reshape(-1, 10):
        W = (np.linalg.pinv(units) @ w).reshape(4, 4)
        least, *_, most = np.linalg.eigvalsh((W + W.T) / 2)
        if least < -_ROUNDING * max(most, -least):
            return False
    return True
