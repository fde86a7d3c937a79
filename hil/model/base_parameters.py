"""Base parameters: minimal set of parameters of the torques, with readable expressions.

The ten standard parameters of each link cannot all be distinguished by motion. From the tips down
each link transfers parameters to its parent without a change of torque: Gautier and Khalil's
regrouping, analytic and for any tree of revolute and prismatic joints. Each remaining standard
parameter heads a base parameter, in the order of eq. (5). Then the sparsity of the robot file is
applied: absent parameters vanish and tied parameters merge. Base parameters that are now linearly
dependent are dropped, those without a present head first. Absent parameters do not change the set
of possible torques, so the values of base parameters may be assigned to their heads, with all other
standard parameters zero: `BaseParameters.placement`. Finally parameters of drives and springs are
added (`hil.model.added_parameters`): one equivalent to link parameters merges with them, the others
are base parameters of their own.

Every result is checked against a numeric rank of M(q) and g(q) in all standard parameters.

A base parameter is a sum, and its head, the standard parameter that names it, determines its role
in the torques: ``sx2`` in the gravity torques is the gravity of axis 2, ``Izz3`` of a revolute
joint the inertia about its own axis. So the words follow for any robot.

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

import re
from collections import Counter
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from hil.model.added_parameters import added_unit, merge_added
from hil.model.dependencies import GRAVITY, Dependencies, find_dependencies, influences
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
from hil.model.polynomial import Combination, Polynomial, add, combine, scale, text
from hil.model.robot_arrays import read_only

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from hil.arrays import Array
    from hil.model.robot import Robot


_ELIMINATION_ORDER = (9, 8, 3, 4, 2, 1, 0, 5, 7, 6)
"""Order of elimination: m, sz, Iyy as in Gautier and Khalil, then the rest."""
_ADDED = {
    "Ia": "rotor inertia of axis {}",
    "Iam": "rotor inertia of coupled motor {}",
    "k": "spring of axis {}",
    "kc": "spring of axis {}, cosine",
    "ks": "spring of axis {}, sine",
}
"""Meanings of added parameters (`hil.model.added_parameters`)."""


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
        # an orthonormal basis of the null space, as rows
        rows = np.vstack([felt @ rate, own])
        found.append(_echelon(np.linalg.svd(rows)[2][len(_span(rows)) :]))
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


def meanings(
    robot: Robot, heads: Sequence[str], matrix: Array, groups: Mapping[str, Collection[int]]
) -> tuple[str, ...]:
    """Describe every base parameter by unique words.

    Parameters
    ----------
    heads : sequence of str, length n_base
        Standard parameters at the head of each base parameter.
    matrix : ndarray, shape (n_base, n_standard)
        Matrix from standard to base parameters.
    groups : mapping
        As in `hil.model.base_parameters.BaseParameters`.
    """
    gravity = [heads[k] for k in groups.get(GRAVITY, ())]
    found = [_meaning(robot, head, matrix[k], gravity) for k, head in enumerate(heads)]
    several = Counter(found)
    return tuple(
        f"{words}, {head}" if several[words] > 1 else words
        for words, head in zip(found, heads, strict=True)
    )


def _meaning(robot: Robot, head: str, row: Array, gravity: Sequence[str]) -> str:
    letters, link = re.fullmatch(r"([A-Za-z]+)(\d+)", head).groups()  # type: ignore[union-attr]
    if letters in _ADDED:
        return _ADDED[letters].format(link)
    if letters.startswith("s"):
        along = letters[1]
        if f"s{along}{link}" not in gravity:
            return f"mass times {along} of link {link}"
        alone = sum(each in (f"sx{link}", f"sy{link}", f"sz{link}") for each in gravity) == 1
        return f"gravity of axis {link}" + ("" if alone else f", {along}")
    return f"mass moved by axis {link}" if letters == "m" else _inertia(robot, head, row)


def _inertia(robot: Robot, head: str, row: Array) -> str:
    one, other, link = head[1], head[2], head[3:]
    if one != other:
        return f"product of inertia {one}{other} of link {link}"
    if one == "z" and robot.revolute[int(link) - 1]:
        return f"inertia of axis {link}"
    names = robot.standard_parameters
    less = [each for each in "xyz" if each != one and row[names.index(f"I{each}{each}{link}")] < 0]
    if not less:
        return f"inertia {one}{one} of link {link}"
    return f"inertia {' - '.join(2 * each for each in (one, *less))} of link {link}"


_UNITS = {"I": "kg m2", "s": "kg m", "m": "kg"}


class RegroupingFailed(RuntimeError):
    """Conflict of analytic regrouping and numeric rank: an error of the program."""


@dataclass(frozen=True, eq=False)
class BaseParameters:
    """Base parameters of a robot.

    Attributes
    ----------
    names : tuple of str, length n_base
        Names ``p1`` and so on.
    meanings : tuple of str
        Meanings in words (`hil.model.base_parameters`).
    expressions : tuple of str
        Sums of standard parameters, with named lengths.
    units : tuple of str
        ``kg m2``, ``kg m`` or ``kg``.
    heads : tuple of str
        Standard parameters at the head of each sum.
    groups : dict
        Indices of the parameters in ``gravity``, ``diagonal`` and ``off_diagonal``.
    dependencies : Dependencies
        Occurrence in M(q) and g(q).
    matrix : array, shape (n_base, n_standard)
        K of p_base = K p_standard, for standard parameters as sparse and tied as in the robot file:
        ten of each link, then the added parameters.
    placement : array, shape (n_standard, n_base)
        Standard parameters equivalent to given base parameters: mostly the value at the head.
    """

    names: tuple[str, ...]
    meanings: tuple[str, ...]
    expressions: tuple[str, ...]
    units: tuple[str, ...]
    heads: tuple[str, ...]
    groups: dict[str, tuple[int, ...]]
    dependencies: Dependencies
    matrix: Array
    placement: Array

    def __len__(self) -> int:
        return len(self.names)

    @property
    def titles(self) -> tuple[str, ...]:
        """Meanings with names in brackets: ``gravity of axis 2 (p5)``."""
        pairs = zip(self.meanings, self.names, strict=True)
        return tuple(f"{meaning} ({name})" for meaning, name in pairs)


@lru_cache(maxsize=32)
def base_parameters(robot: Robot) -> BaseParameters:
    """Return the base parameters of `robot`, computed once.

    Raises
    ------
    RegroupingFailed
        The numeric cross-check disagrees.

    Examples
    --------
    >>> base = hil.base_parameters(hil.Robot.load("emps"))
    >>> base.names, base.units
    (('p1',), ('kg',))
    """
    heads, regrouped = _regroup(robot)
    sparse = [_put_in_sparsity(robot, row) for row in regrouped]
    matrix = np.zeros((len(sparse), 10 * robot.n_joints))
    for index, row in enumerate(sparse):
        for parameter, weight in row.items():
            matrix[index, parameter] = weight.evaluate(robot.file.lengths)
    names = enumerate(robot.standard_parameters)  # free parameters: present and not tied
    free = {k for k, name in names if name in robot.present and name not in robot.ties}
    kept, dependence = _independent_rows(matrix, [head in free for head in heads])
    placement = np.zeros((10 * robot.n_joints, len(kept)))
    placement[heads] = dependence
    mass, gravity = influences(robot)
    weights, own = merge_added(robot, _stack_elements(mass, gravity), placement)
    links = np.vstack([matrix[kept], np.zeros((len(own), matrix.shape[1]))])
    # added parameters not represented by base parameters of links
    unit = np.eye(weights.shape[1])[:, own]
    beside = np.zeros((len(placement), len(own))), np.zeros((len(unit), placement.shape[1]))
    matrix = np.hstack([links, weights])
    placement = np.block([[placement, beside[0]], [beside[1], unit]])
    # compare the number of base parameters with the numeric rank of M and g
    observed = _stack_elements(mass, gravity)
    stated = observed @ _sparsity(robot)
    rank = _rank(stated.T)
    if rank != len(matrix):
        raise RegroupingFailed(
            f"{robot.name}: {len(matrix)} base parameters, but the numeric rank is {rank};"
            " correct axes of the robot file that are almost, but not exactly, parallel or"
            " perpendicular"
        )
    error = np.abs(stated - observed @ placement @ matrix).max(initial=0.0)
    if error > ROUNDED_OFF * np.abs(stated).max(initial=0.0):
        raise RegroupingFailed(
            f"{robot.name}: torques by base parameters deviate by {error:g}; correct axes"
            " that are almost, but not exactly, parallel or perpendicular"
        )
    dependencies = find_dependencies(mass @ placement, gravity @ placement)
    standard, first = robot.standard_parameters, 10 * robot.n_joints
    every = [*(heads[k] for k in kept), *(first + k for k in own)]
    rows: list[Combination] = [dict(sparse[k]) for k in kept] + [{} for _ in own]
    for i, k in zip(*np.nonzero(weights), strict=True):
        rows[i][first + int(k)] = Polynomial.constant(float(weights[i, k]))
    heads_of, groups = tuple(standard[head] for head in every), dependencies.groups()
    return BaseParameters(
        meanings=meanings(robot, heads_of, matrix, groups),
        names=tuple(f"p{k}" for k in range(1, len(every) + 1)),
        expressions=tuple(text(row, head, standard) for row, head in zip(rows, every, strict=True)),
        units=tuple(
            added_unit(robot, name) if name in robot.added_parameters else _UNITS[name[0]]
            for name in heads_of
        ),
        heads=heads_of,
        groups=groups,
        dependencies=dependencies,
        matrix=read_only(matrix),
        placement=read_only(placement),
    )


def link_share(robot: Robot, link: int) -> tuple[str, ...]:
    """Return the contribution of a link (from 0) to every base parameter: ``l1^2 m6``, or ``0``."""
    heads, regrouped = _regroup(robot)
    rows = {
        robot.standard_parameters[head]: _put_in_sparsity(robot, row)
        for head, row in zip(heads, regrouped, strict=True)
    }
    shares = []
    for head in base_parameters(robot).heads:
        own = {k: weight for k, weight in rows.get(head, {}).items() if k // 10 == link}
        shares.append(text(own, -1, robot.standard_parameters))
    return tuple(shares)


def _regroup(robot: Robot) -> tuple[list[int], list[Combination]]:
    """Return head and combination of every base parameter of the full robot, in standard order."""
    found, one = transfers(robot), Polynomial.constant(1.0)
    bodies: list[list[Combination]] = [
        [{10 * link + k: one} for k in range(10)] for link in range(robot.n_joints)
    ]
    rows: list[tuple[int, Combination]] = []
    for link in reversed(range(robot.n_joints)):
        body, parent = bodies[link], robot.parents[link]
        directions, given = found[link]
        removed = combine(directions.T, [body[k] for k in given])
        rows += [
            (10 * link + k, add(body[k], scale(removed[k], -1.0)))
            for k in range(10)
            if k not in given
        ]
        if parent >= 0:
            received = combine(parameter_map(robot.symbolic_link_pose(link)), removed)
            bodies[parent] = [add(*each) for each in zip(bodies[parent], received, strict=True)]
    rows.sort(key=lambda row: row[0])
    return [head for head, _ in rows], [row for _, row in rows]


def _put_in_sparsity(robot: Robot, row: Combination) -> Combination:
    """Drop absent parameters, merge tied parameters, drop cancelled terms."""
    names, ties, total = robot.standard_parameters, robot.ties, Combination()
    for parameter, weight in row.items():
        if names[parameter] in robot.present:
            carrier = names.index(ties.get(names[parameter], names[parameter]))
            total = add(total, {carrier: weight})
    tidy = {parameter: weight.tidy() for parameter, weight in total.items()}
    return {parameter: weight for parameter, weight in sorted(tidy.items()) if weight}


def _independent_rows(matrix: Array, headed: Sequence[bool]) -> tuple[list[int], Array]:
    """Choose spanning rows of `matrix`, those with a present head first.

    Returns indices in order, and all rows as combinations of the kept rows, (n_rows, n_kept).
    """
    if len(matrix) and _rank(matrix) == len(matrix):  # most robots need no search
        return list(range(len(matrix))), np.eye(len(matrix))
    kept: list[int] = []
    for index in sorted(range(len(matrix)), key=lambda k: (not headed[k], k)):
        if _rank(matrix[[*kept, index]]) > len(kept):
            kept.append(index)
    kept.sort()
    if not kept:
        return [], np.zeros((len(matrix), 0))
    dependence: Array = np.linalg.lstsq(matrix[kept].T, matrix.T, rcond=None)[0].T.astype(float)
    dependence[np.abs(dependence) < ROUNDED_OFF] = 0.0
    dependence[kept] = np.eye(len(kept))
    return kept, dependence


def _stack_elements(mass: Array, gravity: Array) -> Array:
    """Stack the elements of M and g at all configurations, per unit of every standard parameter."""
    n = mass.shape[-1]
    return np.vstack([mass.reshape(-1, n), gravity.reshape(-1, n)])


def _sparsity(robot: Robot) -> Array:
    """Return the square matrix from free parameters to all standard parameters."""
    names = robot.standard_parameters
    result = np.zeros((len(names), len(names)))
    for k, name in enumerate(names):
        if name in robot.present:
            result[k, names.index(robot.ties.get(name, name))] = 1.0
    return result


def _rank(rows: Array) -> int:
    """Compute the rank of `rows` scaled to unit length, without zero rows."""
    norms = np.linalg.norm(rows, axis=1)
    seen = norms > ROUNDED_OFF * norms.max(initial=0.0)
    values = np.linalg.svd(rows[seen] / norms[seen, None], compute_uv=False)
    return int(np.sum(values > ROUNDED_OFF * values.max(initial=0.0)))
