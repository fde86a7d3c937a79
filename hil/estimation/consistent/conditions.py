"""Physical consistency of standard parameters, as linear matrix inequalities.

The pseudo-inertia [[S, s], [s', m]] of every link (`hil.model.frames.pseudo_inertia`) must be
positive definite. A bound with a physical meaning keeps the pseudo-inertia away from singularity:
the mass of a link must spread by at least a length t, the thickness, in every direction about its
centre:

    [[S - t^2 m 1, s], [s', m]] >= 0,

by Schur's complement the same as S - s s'/m >= t^2 m 1. With t > 0 and m > 0 the pseudo-inertia and
the inertia about the centre are positive definite, and the triangle inequalities hold. Masses and
centres of mass may be bounded (linear in mass and first moment). No link is larger than the robot:
the root-mean-square radius of its mass about the origin of its frame is at most R, tr S <= R^2 m.
The motors' share of the mass matrix, known and identified, must be positive semidefinite (Sousa and
Cortesao, Int. J. Robotics Research 33 (2014) 931-944, for the links).

Torques show only combinations of the links' parameters; the rest is chosen nearest to likely
bodies. Bodies stated in a URDF take precedence. Otherwise a link is a rod with rounded ends: the
capsule in the robot file, or the line from its frame to the next one; its mass is proportional to
its volume. The common scale of mass and size is left to the data
(`hil.estimation.consistent.nearest`); here all links have the density of water.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import InvalidValue
from hil.model.added_parameters import added_inertias
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import inverse_dynamics
from hil.model.frames import UNIT_PSEUDO_INERTIAS, body_parameters
from hil.planning.prediction.information import whole_range

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from hil.arrays import Array
    from hil.model.robot import Robot


SLENDERNESS, STOUTEST = 0.25, 0.1
"""Radius of a link over its length, and minimum radius over the robot's length."""
SHORTEST = 0.3
"""Minimum length of a robot [m], used where all axes meet."""


def likely_bodies(robot: Robot) -> Array:
    """Return the standard parameters of the links' likely bodies, shape (n_joints, 10)."""
    shapes = (ends_and_radius(robot, link) for link in range(robot.n_joints))
    return np.array([_rod(*shape) for shape in shapes])


def sized_bodies(robot: Robot) -> Array:
    """Return base parameters of the heaviest likely bodies that the drives can move, (n_base,).

    On motions through the full ranges, speeds and accelerations the most loaded axis just reaches
    its torque limit.
    """
    present = [name in robot.present for name in robot.link_parameters]
    matrix = base_parameters(robot).matrix[:, : len(present)]
    p = matrix @ (likely_bodies(robot).ravel() * present)
    most = np.abs(inverse_dynamics(robot, p, *whole_range(robot))).max(axis=0)
    sized: Array = p / (most / robot.torque_limit).max()
    return sized


def ends_and_radius(robot: Robot, link: int) -> tuple[Array, Array, float]:
    """Return ends and radius of a link (from 0) as a capsule in the link's frame [m]."""
    stated = robot.file.joints[link].capsule
    if stated is not None:
        return np.array(stated.ends[0]), np.array(stated.ends[1]), stated.radius
    reach = reach_of(robot)
    end = np.array([0.0, 0.0, 0.1 * reach])
    if (following := robot.next_link(link)) is not None:
        pose = robot.link_pose(following)
        middle = 0.0 if robot.revolute[following] else (robot.q_min + robot.q_max)[following] / 2
        end = pose[:3, 3] + middle * pose[:3, 2]
    length = float(np.linalg.norm(end))
    return np.zeros(3), end, max(SLENDERNESS * length, STOUTEST * reach)


def reach_of(robot: Robot) -> float:
    """Return the length of the stretched robot, at least `SHORTEST` [m]."""
    slides = np.where(robot.revolute, 0.0, np.maximum(np.abs(robot.q_min), np.abs(robot.q_max)))
    lengths = np.hypot(robot.d, robot.r) + slides + np.abs(robot.b)
    reaches = (float(np.sum(lengths[list(robot.path(link))])) for link in robot.last_links)
    return max(*reaches, SHORTEST)


def _rod(begin: Array, end: Array, radius: float) -> Array:
    """Return the standard parameters of a rod with rounded ends."""
    along, centre = end - begin, (begin + end) / 2
    # density of all links [kg/m^3]
    mass = 1000.0 * np.pi * radius**2 * (np.linalg.norm(along) + 4 * radius / 3)
    spread = np.outer(along, along) / 12 + radius**2 / 4 * np.eye(3)
    body = np.ones((4, 4))
    body[:3, :3] = spread + np.outer(centre, centre)
    body[:3, 3] = body[3, :3] = centre
    return np.array(body_parameters(mass * body))


THICKNESS = 1e-3
"""Minimum root-mean-square spread of a link's mass about its centre, in every direction [m]."""
LEAST_MASS, MOST_MASS = 1e-3, 1e3
"""Default bounds of a link's mass [kg]."""
LARGEST, ROBOTS = 2.0, 2.0
"""Largest root-mean-square radius of a link's mass about its frame's origin: this length [m], or
this multiple of the robot's length if greater."""
_MASS, _MOMENT = 9, slice(6, 9)
_HALF_TRACE = np.array([0.5, 0.0, 0.0, 0.5, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0])
_SPATIAL = np.diag([1.0, 1.0, 1.0, 0.0])


@dataclass(frozen=True, slots=True)
class BodyBounds:
    """Bounds on the bodies of the links.

    Attributes
    ----------
    thickness : float
        Minimum spread of the mass in every direction [m].
    masses : mapping of int to (float, float)
        Least and greatest mass by link, from 1 [kg].
    centres : mapping of int to (array_like, array_like)
        Corners of a box in the link's frame that holds its centre of mass, by link, from 1 [m].
    """

    thickness: float = THICKNESS
    masses: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    centres: Mapping[int, tuple[Array, Array]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse bounds that no body meets.

        Raises
        ------
        InvalidValue
        """
        if not self.thickness > 0:
            raise InvalidValue(f"thickness {self.thickness:g} m must be positive, such as 0.001")
        for link, (least, most) in self.masses.items():
            if not 0 < least < most:
                raise InvalidValue(
                    f"mass of link {link}: {least:g} to {most:g} kg must be positive and "
                    "ascending; write "
                    f"{link}:{min(abs(least), abs(most)) or LEAST_MASS:g}:"
                    f"{max(abs(least), abs(most)) or MOST_MASS:g}, or omit the bound"
                )

    def refuse_other_links(self, robot: Robot) -> None:
        """Refuse bounds of links missing in the robot.

        Raises
        ------
        InvalidValue
        """
        for link in (*self.masses, *self.centres):
            if not 1 <= link <= robot.n_joints:
                raise InvalidValue(
                    f"bounds of link {link}: {robot.name} has links 1 to {robot.n_joints}; "
                    "correct the number"
                )

    def mass(self, link: int) -> tuple[float, float]:
        """Return the bounds of a link's mass [kg]; links count from 1."""
        return self.masses.get(link, (LEAST_MASS, MOST_MASS))


@dataclass(frozen=True, slots=True, eq=False)
class Condition:
    """Linear matrix inequality ``constant + sum_k phi_k weights_k >= 0``.

    Attributes
    ----------
    name : str
        Subject of the condition: ``link 2``.
    weights : ndarray, shape (size, size, n_standard)
    constant : ndarray, shape (size, size)
    link : int, optional
        Index of the link, from 0, if the condition is that the link is a body.
    """

    name: str
    weights: Array
    constant: Array
    link: int | None = None

    def evaluate(self, phi: Array) -> Array:
        """Evaluate the matrix at standard parameters `phi`, shape (size, size)."""
        return np.asarray(self.weights @ phi + self.constant)


def conditions(robot: Robot, bounds: BodyBounds) -> list[Condition]:
    """Return all conditions on the standard parameters of a robot with complete links.

    Raises
    ------
    InvalidValue
        Bounds of a link missing in the robot.
    """
    bounds.refuse_other_links(robot)
    found: list[Condition] = []
    for link in range(robot.n_joints):
        own = np.array(UNIT_PSEUDO_INERTIAS)
        own[_MASS] -= bounds.thickness**2 * _SPATIAL
        weights = np.zeros((4, 4, len(robot.standard_parameters)))
        weights[..., 10 * link : 10 * link + 10] = np.moveaxis(own, 0, -1)
        found.append(Condition(f"link {link + 1}", weights, np.zeros((4, 4)), link))
        found += _bounded(robot, link, bounds)
    return [*found, *_motors(robot)]


def tightened(robot: Robot, bounds: BodyBounds) -> list[Condition]:
    """Return the conditions with a margin: twice the thickness, slightly tighter other bounds."""
    wide = conditions(robot, replace(bounds, thickness=2.0 * bounds.thickness))
    # margins to the bounds of masses, first moments and rotor inertias [kg, kg m, kg m^2]
    return [
        each if each.link is not None
        else replace(each, constant=each.constant - 1e-6 * np.eye(len(each.constant)))
        for each in wide
    ]  # fmt: skip


def largest_radius(robot: Robot) -> float:
    """Return the largest root-mean-square radius of a link about its frame's origin [m]."""
    return max(LARGEST, ROBOTS * reach_of(robot))


def _bounded(robot: Robot, link: int, bounds: BodyBounds) -> Iterator[Condition]:
    """Yield the scalar conditions on mass, size and centre of mass of a link."""
    mass, least_and_most = np.eye(10)[_MASS], bounds.mass(link + 1)
    for sign, bound, word in zip((1.0, -1.0), least_and_most, ("least", "greatest"), strict=True):
        yield _scalar(robot, f"{word} mass of link {link + 1}", link, sign * mass, -sign * bound)
    size = largest_radius(robot) ** 2 * mass - _HALF_TRACE
    yield _scalar(robot, f"size of link {link + 1}", link, size, 0.0)
    if link + 1 in bounds.centres:
        for sign, corner in zip((1.0, -1.0), bounds.centres[link + 1], strict=True):
            for moment, x in zip(np.eye(10)[_MOMENT], corner, strict=True):
                name = f"centre of mass of link {link + 1}"
                yield _scalar(robot, name, link, sign * (moment - x * mass), 0.0)


def _scalar(robot: Robot, name: str, link: int, own: Array, constant: float) -> Condition:
    weights = np.zeros((1, 1, len(robot.standard_parameters)))
    weights[0, 0, 10 * link : 10 * link + 10] = own
    return Condition(name, weights, np.array([[constant]]))


def _motors(robot: Robot) -> Iterator[Condition]:
    """Yield conditions on the motors' share of the mass matrix, by group of coupled joints."""
    added = added_inertias(robot)
    # joints with coupled motors are one group
    groups = [[j] for j in range(robot.n_joints)]
    for coupling in robot.couplings:
        tied = [g for g in groups if coupling.motor in g or coupling.joint in g]
        groups = [g for g in groups if g not in tied] + [sorted(j for g in tied for j in g)]
    for joints in sorted(groups):
        own = added[np.ix_(range(len(added)), joints, joints)]
        if not own.any():
            continue
        weights = np.zeros((len(joints), len(joints), len(robot.standard_parameters)))
        weights[..., 10 * robot.n_joints :] = np.moveaxis(own, 0, -1)
        named = " and ".join(str(j + 1) for j in joints)
        constant = np.diag(robot.reflected_inertia[joints])
        yield Condition(f"rotor of joint {named}", weights, constant)
