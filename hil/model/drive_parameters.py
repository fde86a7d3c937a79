"""Inertias of the drive trains that are to be identified, along with the links' parameters.

A rotor inertia that the robot file states is compensated (`hil.model.motors`). One that it leaves
unknown is a parameter like those of the links: ``Ia<j>``, the inertia of motor j as joint j feels
it. A coupled motor m, which the motion of joint j turns as well (`Robot.couplings`), has another
one: ``Iam<m>``, which joins the accelerations of both joints (Gautier's name for the Staubli's
wrist, where a single rotor and its gears are not all that turns).

All of them are constant and carry no weight, so that one matrix holds what there is to say:
``tau = H_k qdd`` per unit of parameter k.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.model.polynomial import Polynomial

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.model.combination import Combination
    from hil.model.robot import Robot

    Array = NDArray[np.float64]

_EXACT = 1e-9
"""Share of an inertia's effect that others may leave of it where they stand for it."""


def drive_inertias(robot: Robot) -> Array:
    """H of all unknown inertias of the drive trains, shape (n_unknown, n_joints, n_joints).

    They come in the order of `Robot.drive_parameters`.
    """
    unit = np.eye(robot.n_joints)
    own = [np.outer(unit[j], unit[j]) for j in np.flatnonzero(robot.rotor_inertia_unknown)]
    shared = [
        each.ratio
        * (
            np.outer(unit[each.motor], unit[each.joint])
            + np.outer(unit[each.joint], unit[each.motor])
        )
        for each in robot.couplings
    ]
    return np.array([*own, *shared]).reshape(-1, robot.n_joints, robot.n_joints)


def drive_unit(robot: Robot, index: int) -> str:
    """Unit of one of `Robot.drive_parameters`: that of the torque by the acceleration."""
    joints = np.flatnonzero(drive_inertias(robot)[index].any(axis=0))
    slides = int(np.sum(~robot.revolute[joints]))
    return ("kg m2", "kg m", "kg")[slides if len(joints) == 2 else 2 * slides]


@dataclass(frozen=True)
class MergedDrives:
    """How drive trains' inertias enter the base parameters.

    Attributes
    ----------
    weights : ndarray, shape (n_base, n_unknown)
        Of each inertia in each base parameter: those of the links first, then one headed by each of
        `own`.
    own : tuple of int
        Inertias, by index, that no other base parameters stand for.
    first : int
        Index of the first of them among the standard parameters.
    """

    weights: Array
    own: tuple[int, ...]
    first: int

    @property
    def heads(self) -> list[int]:
        """Standard parameters, by index, that head base parameters."""
        return [self.first + k for k in self.own]

    def matrix(self, links: Array) -> Array:
        """K of p_base = K p_standard from that of the links alone."""
        below = np.zeros((len(self.own), links.shape[1]))
        return np.hstack([np.vstack([links, below]), self.weights])

    def placement(self, links: Array) -> Array:
        """Standard parameters that act as base parameters do, from those of the links alone."""
        n_links, n_own = links.shape[1], len(self.own)
        found = np.zeros((len(links) + self.weights.shape[1], n_links + n_own))
        found[: len(links), :n_links] = links
        found[self.heads, n_links + np.arange(n_own)] = 1.0
        return found

    def rows(self, links: Sequence[Combination]) -> list[Combination]:
        """Base parameters as combinations of standard parameters."""
        rows: list[Combination] = [dict(row) for row in links] + [{} for _ in self.own]
        for i, k in zip(*np.nonzero(self.weights), strict=True):
            rows[i][self.first + int(k)] = Polynomial.constant(float(self.weights[i, k]))
        return rows


def merge_drives(robot: Robot, observed: Array, placement: Array) -> MergedDrives:
    """Find which inertias of the drive trains act as base parameters of the links do.

    Parameters
    ----------
    observed : ndarray, shape (n, n_standard)
        Elements of M and g at many configurations, per unit of each standard parameter.
    placement : ndarray, shape (10 n_joints, n_link_base)
        Of the links' base parameters.
    """
    first = 10 * robot.n_joints
    known = observed[:, :first] @ placement
    own: list[int] = []
    columns = []
    for k, effect in enumerate(observed[:, first:].T):
        w = np.linalg.lstsq(known, effect, rcond=None)[0] if known.shape[1] else np.zeros(0)
        if np.linalg.norm(effect - known @ w) > _EXACT * np.linalg.norm(effect):
            own.append(k)
            known = np.column_stack([known, effect])
            w = np.eye(known.shape[1])[-1]
        columns.append(w)
    weights = np.zeros((known.shape[1], len(columns)))
    for k, w in enumerate(columns):
        weights[: len(w), k] = np.where(np.abs(w) > _EXACT, np.round(w, 9), 0.0)
    return MergedDrives(weights, tuple(own), first)
