r"""Nearest base parameters of physical bodies, and such bodies.

Standard parameters with the torques of base parameters p' are ``phi = P p' + Z z``: P puts each
base parameter into the first standard parameter of its sum, Z spans the directions without torque
(the null space of K of all links' parameters), z is free. Parameters left out of a robot file are
zero in the torques, not in the bodies: no body lacks Ixx. Consider all p' with a phi that meets the
conditions (`hil.estimation.consistent.conditions`). The nearest to the estimate p by its covariance
V,

    d^2 = min (p' - p)' V^-1 (p' - p),

is the solution of a semidefinite program. Least squares under the same conditions is the same
program. With the normal equations N p = v of an estimate that is linear in p, and W its weights,

    |y - X p'|_W^2 = |y - X p|_W^2 + (p' - p)' N (p' - p),

since the residual of p is W-orthogonal to X. So the constrained least-squares solution is the
projection of p with V = s^2 N^-1, for any scale s. Unknowns without conditions (friction) are
minimised over by taking their rows out of V = N^-1, which leaves N's Schur complement.

This program determines p' and leaves z open. It demands twice the thickness, to leave room for the
choice of z.

If the true parameters are bodies, d^2 is at most the distance to the truth, a chi-square of n_base
degrees of freedom. Where errors are small against the curvature of the set, only directions of
binding conditions count: d^2 is then a mixture of chi-squares of up to r (r + 1) / 2 degrees for
each matrix of rank deficiency r. The largest number of degrees gives the greatest p-value.

In the programs, candidates of standard parameters are ``phi = P (p + L x) + Z z``: P puts each base
parameter into the first standard parameter of its sum, L L' is the covariance of p, so that x
counts standard errors, and Z spans the directions without torque. The likely bodies of the links
are the units, so that all numbers have similar size.

Of all bodies with these base parameters, z chooses the nearest to likely bodies. The distance is
the entropic divergence of normal distributions with pseudo-inertias J and J_0,

    tr J_0^-1 J - log det J + log det J_0 - 4,

which depends on neither frames nor units and keeps each J well inside the cone of positive definite
matrices (Lee, Wensing and Park, IEEE Transactions on Robotics 36 (2020) 168-182). It is convex in J
and self-concordant; Newton's method with damped steps finds its minimum from any start (Boyd and
Vandenberghe, Convex Optimization, section 9.6). Other conditions, on masses and rotors, enter with
their log det.

Likely bodies from shapes are known up to scale: `rescaled` finds the common factors of mass, a, and
of length, b, that minimise the divergence. Let s, t and m be the sums of tr J_0^-1 J over the
spatial, the mixed and the mass block. In u = 1/b the total s u^2 + t u + m gives the minimum where
s u^2 - t u - 3 m = 0, and a is a quarter of the total's mean over the links.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from hil.errors import NotRealisable
from hil.estimation.consistent.conditions import BodyBounds, conditions, likely_bodies, tightened
from hil.estimation.consistent.result import BindingCondition, ConsistentRobot, LinkBody
from hil.estimation.consistent.semidefinite import Inequality, least_squares
from hil.model.base_parameters import base_parameters
from hil.model.frames import pseudo_inertia

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.estimation.consistent.conditions import Condition
    from hil.estimation.consistent.semidefinite import Solved
    from hil.model.robot import Robot

    _Blocks = Sequence[tuple[Inequality, float]]


_DECREMENT = 1e-9
_RIDGE = 1e-13
_ROUNDING = 1e-9
_SHORTEST_STEP = 1e-9
_SAME_SCALE = 0.01
_RANK = 1e-9
_NEGLIGIBLE = 1e-13


def likeliest(
    bodies: Sequence[Inequality], others: Sequence[Inequality], pull: Array, z: Array
) -> Array:
    """Minimise the divergence from likely bodies over the free coordinates z.

    Parameters
    ----------
    bodies : sequence of Inequality
        Matrix of each link as a function of z, in units that make the likely body the unit matrix;
        positive definite at the start.
    others : sequence of Inequality
        Further conditions that hold at the start.
    pull : ndarray, shape (n_free,)
        Small weight of each z's square, which decides directions that change no body.
    z : ndarray, shape (n_free,)
        Start.
    """
    # weight of a scalar condition's logarithm, against 1 of a body's log det
    weights = [1.0] * len(bodies) + [1e-3] * len(others)
    slope = np.sum([np.einsum("kkn->n", each.weights) for each in bodies], axis=0)
    inside = [_entered(each, z) for each in (*bodies, *others)]
    # minimise slope z + pull z^2 / 2 - sum weight log det by Newton's method
    blocks = list(zip(inside, weights, strict=True))
    # maximum number of Newton steps
    for _ in range(200):
        gradient, hessian = slope + pull * z, np.diag(pull)
        for block, weight in blocks:
            inverse = np.linalg.inv(block.constant + block.weights @ z)
            turned = np.einsum("ij,jkn->nik", inverse, block.weights)
            gradient = gradient - weight * np.einsum("nii->n", turned)
            hessian = hessian + weight * np.einsum("nij,mji->nm", turned, turned, optimize=True)
        unit = 1.0 / np.sqrt(np.diag(hessian))
        scaled = hessian * np.outer(unit, unit) + _RIDGE * np.eye(len(z))
        step = -unit * np.linalg.solve(scaled, unit * gradient)
        descent = -float(gradient @ step)
        if descent < _DECREMENT:
            break
        # a whole step, or nine tenths of the distance to a condition's boundary
        worst = 0.0
        for block, _ in blocks:
            root = np.linalg.inv(np.linalg.cholesky(block.constant + block.weights @ z))
            moved = root @ (block.weights @ step) @ root.T
            worst = max(worst, -float(np.linalg.eigvalsh((moved + moved.T) / 2)[0]))
        length = min(1.0, 0.9 / worst) if worst > 0 else 1.0
        here = _value(blocks, slope, pull, z)
        while _value(blocks, slope, pull, z + length * step) > here - 0.1 * length * descent:
            length /= 2
            if length < _SHORTEST_STEP:
                return z
        z = z + length * step
    return z


def rescaled(likely: Array, bodies: Array) -> Array:
    """Return likely bodies with the scale nearest to `bodies`, both of shape (n_joints, 10)."""
    spatial = mixed = mass = 0.0
    for expected, body in zip(likely, bodies, strict=True):
        parts = np.linalg.inv(pseudo_inertia(expected)) * pseudo_inertia(body)
        spatial += float(parts[:3, :3].sum())
        mixed += 2.0 * float(parts[:3, 3].sum())
        mass += float(parts[3, 3])
    u = (mixed + np.sqrt(mixed**2 + 12.0 * spatial * mass)) / (2.0 * spatial)
    heavier = (spatial * u**2 + mixed * u + mass) / (4.0 * len(likely))
    powers = np.array([2.0] * 6 + [1.0] * 3 + [0.0])
    return np.asarray(heavier * likely * u**-powers)


def _entered(block: Inequality, z: Array) -> Inequality:
    """Widen an inequality by the violation at the start, due to rounding in a solver."""
    lack = _ROUNDING - float(np.linalg.eigvalsh(block.constant + block.weights @ z)[0])
    return block._replace(constant=block.constant + max(lack, 0.0) * np.eye(len(block.constant)))


def _value(blocks: _Blocks, slope: Array, pull: Array, z: Array) -> float:
    """Return the function to be minimised; infinite where rounding crosses a boundary."""
    dets = 0.0
    for block, weight in blocks:
        try:
            root = np.linalg.cholesky(block.constant + block.weights @ z)
        except np.linalg.LinAlgError:
            return np.inf
        dets += 2.0 * weight * float(np.log(np.diag(root)).sum())
    return float(slope @ z + pull @ z**2 / 2) - dets


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
        # L with L L' = V, shape (n_base, rank)
        error = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        scale = np.where(error > 0, error, 1.0)
        values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
        kept = values > _NEGLIGIBLE * max(values[-1], 1e-300)
        return cls(
            base_parameters(robot).placement,
            p,
            np.asarray(scale[:, np.newaxis] * vectors[:, kept] * np.sqrt(values[kept])),
            free,
            likely,
        )

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


SHAPES = "the links' shapes"
"""Default source of the likely bodies."""


def nearest_robot(
    robot: Robot,
    p: Array,
    covariance: Array,
    bounds: BodyBounds | None = None,
    likely: Array | None = None,
    likely_from: str = SHAPES,
) -> ConsistentRobot:
    """Find the nearest robot of physical bodies.

    Parameters
    ----------
    p : ndarray, shape (n_base,)
    covariance : ndarray, shape (n_base, n_base)
        Covariance of `p`; directions of zero variance remain unchanged.
    bounds : BodyBounds, optional
    likely : ndarray, shape (n_joints, 10), optional
        Likely bodies of the links; by default from their shapes, with a free scale. `likely_from`
        names the source.

    Raises
    ------
    NotRealisable
        No bodies meet the conditions, or none could be found in double precision.
    """
    bounds = bounds or BodyBounds()
    whole = robot.free_links()
    asked = tightened(whole, bounds)
    expected = likely_bodies(robot) if likely is None else likely
    space = Space.create(robot, whole, p, covariance, expected)
    first = space.nearest(asked)
    distance, nearest = space.distance(first), space.moved(first)
    try:
        phi = space.likeliest(conditions(whole, bounds), first, scaled=likely is None)
    except np.linalg.LinAlgError as error:
        size = float(np.abs(first.u[space.root.shape[1] :]).max(initial=0.0))
        raise NotRealisable(
            f"links up to {size:.2g} times {likely_from} are beyond double precision; look for "
            "effects missing in the robot file (hil diagnose), or record more motion"
        ) from error
    bodies = phi[: 10 * robot.n_joints].reshape(-1, 10)
    thickness = np.array([thickness_of(body) for body in bodies])
    # minimum share of the thickness after rounding, which matters for links of a few grams
    if thickness.min() < 0.25 * bounds.thickness:
        raise NotRealisable(
            f"the links found are {1e3 * thickness.min():.2g} mm thick instead of "
            f"{1e3 * bounds.thickness:.2g} mm: the estimate is too far from physical consistency; "
            "look for effects missing in the robot file (hil diagnose), or record more motion"
        )
    # distance d below which the estimate itself meets all conditions
    outside = distance > 1e-4**2
    binding, degrees = _binding(space, asked, first) if outside else ((), 0)
    return ConsistentRobot(
        values=tuple(nearest.tolist()),
        change=tuple(((nearest - p) / np.sqrt(np.maximum(np.diag(covariance), 1e-300))).tolist()),
        distance=distance,
        degrees_of_freedom=degrees,
        p_value=float(special.chdtrc(degrees, distance)) if degrees else 1.0,
        distance_complete=_distance(space.free_absent(robot), asked) if outside else distance,
        thickness=bounds.thickness,
        masses=dict(bounds.masses),
        likely=likely_from,
        open_masses=space.open_masses,
        links=tuple(
            LinkBody(parameters=tuple(body.tolist()), thickness=float(own))
            for body, own in zip(bodies, thickness, strict=True)
        ),
        added=dict(zip(robot.added_parameters, phi[bodies.size :].tolist(), strict=True)),
        binding=binding,
    )


def thickness_of(body: Array) -> float:
    """Return the least root-mean-square spread of a body's mass about its centre [m]."""
    J = pseudo_inertia(body)
    spread = J[:3, :3] / J[3, 3] - np.outer(J[:3, 3], J[:3, 3]) / J[3, 3] ** 2
    return float(np.sqrt(max(np.linalg.eigvalsh(spread)[0], 0.0)))


def _distance(space: Space, asked: Sequence[Condition]) -> float:
    return space.distance(space.nearest(asked))


def _binding(
    space: Space, asked: Sequence[Condition], first: Solved
) -> tuple[tuple[BindingCondition, ...], int]:
    """Return binding conditions, and degrees of freedom by rank deficiency of their matrices."""
    spectra = [np.linalg.eigvalsh(each) for each in first.multipliers]
    greatest = max(values[-1] for values in spectra)
    found, degrees = [], 0
    for each, values in zip(asked, spectra, strict=True):
        # minimum share of the greatest multiplier for a binding condition
        if rank := int(np.sum(values > 1e-6 * greatest)):
            without = _distance(space, [other for other in asked if other is not each])
            found.append(BindingCondition(name=each.name, distance_without=without))
            degrees += rank * (rank + 1) // 2
    found.sort(key=lambda each: each.distance_without)
    return tuple(found), min(degrees, space.placement.shape[1])
