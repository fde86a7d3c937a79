"""Candidate standard parameters of an estimate, and their units in the programs.

The parameters are ``phi = P (p + L x) + Z z``: P puts each base parameter into the first standard
parameter of its sum, L L' is the covariance of p, so that x counts standard errors, and Z spans the
directions without torque. The likely bodies of the links are the units, so that all numbers have
similar size.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.consistent.likeliest import likeliest, rescaled
from hil.estimation.consistent.semidefinite import Inequality, least_squares
from hil.model.base_parameters import base_parameters
from hil.model.frames import pseudo_inertia

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.estimation.consistent.conditions import Condition
    from hil.estimation.consistent.semidefinite import Solved
    from hil.model.robot import Robot


_SAME_SCALE = 0.01
_RANK = 1e-9
_NEGLIGIBLE = 1e-13


@dataclass(frozen=True, slots=True, eq=False)
class Space:
    """Standard parameters phi = placement (p + root x) + free z.

    Attributes
    ----------
    placement : ndarray, shape (n_standard, n_base)
    p : ndarray, shape (n_base,)
        Estimate.
    root : ndarray, shape (n_base, n_moving)
        Root of the covariance of `p`.
    free : ndarray, shape (n_standard, n_free)
    likely : ndarray, shape (n_joints, 10)
    """

    placement: Array
    p: Array
    root: Array
    free: Array
    likely: Array

    @classmethod
    def create(
        cls, robot: Robot, whole: Robot, p: Array, covariance: Array, likely: Array
    ) -> Space:
        """Create the space around an estimate; `whole` is the robot with all link parameters."""
        unit = _units(likely, len(whole.added_parameters))
        scaled = base_parameters(whole).matrix * unit
        _, values, rows = np.linalg.svd(scaled / np.linalg.norm(scaled, axis=1)[:, np.newaxis])
        rank = int(np.sum(values > _RANK * values[0]))
        free = unit[:, np.newaxis] * rows[rank:].T
        return cls(base_parameters(robot).placement, p, _root(covariance), free, likely)

    def free_absent(self, robot: Robot) -> Space:
        """Return the space with the robot file's missing and tied parameters set free."""
        stated = set(robot.present) - set(robot.ties)
        absent = [k for k, name in enumerate(robot.standard_parameters) if name not in stated]
        return replace(self, free=np.hstack([self.free, np.diag(self._unit)[:, absent]]))

    @property
    def open_masses(self) -> tuple[int, ...]:
        """Links, from 1, with a mass that no torque determines."""
        rows = np.abs(self.free[9 : self.likely.size : 10]) / self.likely[:, 9:]
        return tuple(int(k) + 1 for k in np.flatnonzero(rows.max(axis=1, initial=0.0) > _RANK))

    def nearest(self, asked: Sequence[Condition]) -> Solved:
        """Solve for the smallest x, with any z, that meets the conditions."""
        directions = np.hstack([self.placement @ self.root, self.free])
        A = np.eye(self.root.shape[1], directions.shape[1])
        inequalities = [self._inequality(each, self.p, directions) for each in asked]
        return least_squares(A, np.zeros(len(A)), inequalities)

    def moved(self, solved: Solved) -> Array:
        """Return the base parameters p + L x of a solution."""
        return np.asarray(self.p + self.root @ solved.u[: self.root.shape[1]])

    def distance(self, solved: Solved) -> float:
        """Return the squared distance |x|^2 of a solution from the estimate."""
        return float(np.sum(solved.u[: self.root.shape[1]] ** 2))

    def likeliest(self, asked: Sequence[Condition], solved: Solved, *, scaled: bool) -> Array:
        """Return the likeliest standard parameters with the base parameters of a solution.

        Parameters
        ----------
        scaled : bool
            True if likely bodies are known up to scale.
        """
        z, space, n = solved.u[self.root.shape[1] :], self, self.likely.size
        start = self.placement @ self.moved(solved)
        # maximum number of alternations between bodies and scale of the likely bodies
        for _ in range(20 if scaled else 1):
            z = space._chosen(asked, self.moved(solved), z)
            scale = rescaled(space.likely, (start + self.free @ z)[:n].reshape(-1, 10))
            if np.allclose(scale[:, -1], space.likely[:, -1], rtol=_SAME_SCALE):
                break
            space = replace(space, likely=scale)
        return np.asarray(start + self.free @ z)

    def _chosen(self, asked: Sequence[Condition], p: Array, z: Array) -> Array:
        """Return the likeliest z for base parameters p."""
        if not z.size:
            return z
        n = self.likely.size
        every = [self._inequality(each, p, self.free) for each in asked]
        bodies = [each for each, of in zip(every, asked, strict=True) if of.link is not None]
        others = [each for each, of in zip(every, asked, strict=True) if of.link is None]
        added = self.free[n:] / self._unit[n:, np.newaxis]
        # pull of added parameters towards zero, in units of the links' inertia
        pull = 1e-6 * (1.0 + np.sum(added**2, axis=0))
        return likeliest(bodies, others, pull, z)

    @property
    def _unit(self) -> Array:
        return _units(self.likely, len(self.placement) - self.likely.size)

    def _inequality(self, condition: Condition, p: Array, directions: Array) -> Inequality:
        """Express a condition in coordinates of `directions` about p, in units of likely bodies."""
        constant, weights = condition.evaluate(self.placement @ p), condition.weights @ directions
        if condition.link is None:
            size = float(np.abs(condition.weights * self._unit).max())
            return Inequality(constant / size, weights / size)
        # turns the likely body's pseudo-inertia into the unit matrix
        back = np.linalg.inv(np.linalg.cholesky(pseudo_inertia(self.likely[condition.link])))
        return Inequality(
            back @ constant @ back.T, np.einsum("ij,jkn,lk->iln", back, weights, back)
        )


def _units(likely: Array, n_added: int) -> Array:
    """Return the units of the standard parameters from the likely bodies, shape (n_standard,)."""
    found = []
    for body in likely:
        inertia, mass = float(body[[0, 3, 5]].sum()), float(body[9])
        found += [inertia] * 6 + [float(np.sqrt(inertia * mass))] * 3 + [mass]
    return np.array(found + [float(np.mean(found[::10]))] * n_added)


def _root(covariance: Array) -> Array:
    """Return L with L L' = V, shape (n_base, rank)."""
    error = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    scale = np.where(error > 0, error, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    kept = values > _NEGLIGIBLE * max(values[-1], 1e-300)
    return np.asarray(scale[:, np.newaxis] * vectors[:, kept] * np.sqrt(values[kept]))
