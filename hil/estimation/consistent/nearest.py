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

This program determines p' and leaves z open; `hil.estimation.consistent.likeliest` chooses z. The
program demands twice the thickness, to leave room for this choice.

If the true parameters are bodies, d^2 is at most the distance to the truth, a chi-square of n_base
degrees of freedom. Where errors are small against the curvature of the set, only directions of
binding conditions count: d^2 is then a mixture of chi-squares of up to r (r + 1) / 2 degrees for
each matrix of rank deficiency r. The largest number of degrees gives the greatest p-value.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from hil.errors import NotRealisable
from hil.estimation.consistent.conditions import BodyBounds, conditions, tightened
from hil.estimation.consistent.likely_bodies import likely_bodies
from hil.estimation.consistent.result import BindingCondition, ConsistentRobot, LinkBody
from hil.estimation.consistent.space import Space
from hil.model.frames import pseudo_inertia

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.estimation.consistent.conditions import Condition
    from hil.estimation.consistent.semidefinite import Solved
    from hil.model.robot import Robot


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
    robot : Robot
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
    phi = space.likeliest(conditions(whole, bounds), first, scaled=likely is None)
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
