"""Dependencies of M(q) and g(q) on the parameters: Table 2, and the three groups.

Both are linear in the parameters, with coefficients analytic in q. An analytic function is either
identically zero or nonzero at almost every q; so a coefficient that vanishes at random
configurations is zero everywhere, except for a set of measure zero and for rounding errors of some
1e-15 of the largest coefficient, six orders of magnitude below the threshold.

Not every parameter in g(q) is identified from it. A constant gravity torque, such as that of a
vertical prismatic axis, is like a torque offset, and several masses may occur in one sum only. Such
a hidden parameter must be identified from M(q): acceleration is not affected by offsets.

The coefficients are computed from the joints' axes in each link's frame, independently of the
recursion of `hil.model.recursion`: M_ab = S_a' I S_b, g_a = S_a' I (0, -gravity).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.model.added_parameters import added_inertias, added_loads
from hil.model.frames import ROUNDED_OFF, UNIT_INERTIAS, adjoint, inverse, joint_motion

if TYPE_CHECKING:
    from hil.arrays import Array, Mask
    from hil.model.robot import Robot


GRAVITY, DIAGONAL, OFF_DIAGONAL = GROUPS = ("gravity", "diagonal", "off_diagonal")
"""Groups of section 4.4: p_g occurs in g(q), p_Md only on the diagonal of M(q), p_Mod only off it.

In this order, the matrix elements that identify a group contain no parameters of later groups.
"""


@dataclass(frozen=True)
class Dependencies:
    """Occurrence of the base parameters in M(q) and g(q).

    Attributes
    ----------
    mass : bool array, shape (n_joints, n_joints, n_base)
        True if parameter k occurs in M_ij(q).
    gravity : bool array, shape (n_joints, n_base)
        True if parameter k occurs in g_i(q).
    hidden : bool array, shape (n_base,)
        True if parameter k occurs in g(q), but g(q) with unknown offsets does not determine it.
    """

    mass: Mask
    gravity: Mask
    hidden: Mask

    def groups(self) -> dict[str, tuple[int, ...]]:
        """Return the indices of the parameters in every group of `GROUPS`, in order."""
        in_gravity = self.gravity.any(axis=0)
        on_diagonal = np.einsum("iik->ik", self.mass).any(axis=0) & ~in_gravity
        beside = ~in_gravity & ~on_diagonal
        members = (in_gravity, on_diagonal, beside)
        return {
            name: tuple(int(k) for k in np.flatnonzero(member))
            for name, member in zip(GROUPS, members, strict=True)
        }

    def sought(self) -> dict[str, tuple[int, ...]]:
        """Return the indices of the parameters that each group's own elements must identify.

        A hidden parameter is added to the group of the elements of M(q) in which it occurs.
        """
        on_diagonal = np.einsum("iik->ik", self.mass).any(axis=0)
        beside = self.mass.any(axis=(0, 1)) & ~on_diagonal
        more = {DIAGONAL: self.hidden & on_diagonal, OFF_DIAGONAL: self.hidden & beside}
        return {
            name: (*members, *np.flatnonzero(more[name]).tolist()) if name in more else members
            for name, members in self.groups().items()
        }


def find_dependencies(mass: Array, gravity: Array) -> Dependencies:
    """Find the occurrence of base parameters from their coefficients (`influences`)."""
    return Dependencies(_occurs(mass), _occurs(gravity), _hidden(gravity))


def influences(robot: Robot) -> tuple[Array, Array]:
    """Compute the coefficients of the standard parameters in M and g at random configurations.

    Returns
    -------
    mass : array, shape (n_configurations, n_joints, n_joints, n_standard)
    gravity : array, shape (n_configurations, n_joints, n_standard)
    """
    random = np.random.default_rng(22)
    # one would suffice for occurrence; for the rank, an element of M with parameters that no other
    # element shows needs as many, and each branch others
    number = 12 * len(robot.last_links)
    configurations = random.uniform(-np.pi, np.pi, (number, robot.n_joints))
    found = [_influences_at(robot, q) for q in configurations]
    added = np.moveaxis(added_inertias(robot), 0, -1)
    mass = [np.concatenate([each, added], axis=-1) for each, _ in found]
    loads = added_loads(robot, configurations)
    gravity = [np.hstack([each, load]) for (_, each), load in zip(found, loads, strict=True)]
    return np.array(mass), np.array(gravity)


def _influences_at(robot: Robot, q: Array) -> tuple[Array, Array]:
    n = robot.n_joints
    mass, gravity = np.zeros((n, n, 10 * n)), np.zeros((n, 10 * n))
    base = np.zeros((n, 6)), np.concatenate([np.zeros(3), -robot.gravity])
    placed = {-1: base}
    for link, parent in enumerate(robot.parents):
        into = adjoint(inverse(robot.pose_at(link, q[link])))
        axes, upward = placed[link] = placed[parent][0] @ into.T, into @ placed[parent][1]
        axes[link] = joint_motion(bool(robot.revolute[link]))[1]
        own = slice(10 * link, 10 * link + 10)
        mass[:, :, own] = np.einsum("ax,kxy,by->abk", axes, UNIT_INERTIAS, axes)
        gravity[:, own] = np.einsum("ax,kxy,y->ak", axes, UNIT_INERTIAS, upward)
    return mass, gravity


def _occurs(coefficients: Array) -> Mask:
    size = np.abs(coefficients)
    scale = size.max(initial=0.0)
    found: Mask = (size > ROUNDED_OFF * scale).any(axis=0)
    return found


def _hidden(gravity: Array) -> Mask:
    """Find parameters that gravity torques with unknown constant offsets do not determine."""
    size = np.sqrt(np.sum(gravity**2, axis=(0, 1)))
    found: Mask = size > ROUNDED_OFF * size.max(initial=0.0)
    if not found.any():
        return found
    varying = (gravity - gravity.mean(axis=0))[:, :, found] / size[found]
    _, values, directions = np.linalg.svd(varying.reshape(-1, int(found.sum())))
    rank = int(np.sum(values > ROUNDED_OFF))
    # a parameter is hidden if its component in the null space exceeds a millionth
    found[found] = np.linalg.norm(directions[rank:], axis=0) > 1e-6
    return found
