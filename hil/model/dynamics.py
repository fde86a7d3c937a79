"""Inverse dynamics, linear in the base parameters: A(q, qd, qdd) p of eq. (6).

Everything comes from one recursion (`hil.model.recursion`), so that A p, M qdd + c + g and the
inverse dynamics agree to rounding. Without a compiled recursion NumPy evaluates the same equations
(`hil.model.recursion_by_arrays`); the choice never changes within a process. Base parameters are
assigned to the standard parameters at their heads, all others being zero
(`hil.model.base_parameters`), so that the cost depends on the number of the robot's parameters.
Besides rigid bodies there are springs and unknown rotor inertias; known ones are in
`hil.model.motors`.

Shapes: q, qd, qdd are (n_samples, n_joints), or (n_joints,) for a single sample, and the results
have the same leading axes: none for a single sample. Torques in N m (forces in N), joint side.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.model import recursion_by_arrays
from hil.model.added_parameters import added_inertias, added_loads
from hil.model.base_parameters import base_parameters
from hil.model.frames import cos_sin

try:
    from hil.model import recursion
except ModuleNotFoundError:
    recursion = None  # type: ignore[assignment]

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import ArrayLike

    from hil.arrays import Array, Indices, Integers
    from hil.model.robot import Robot


_recursion: Any = recursion or recursion_by_arrays
_CHUNK = 2048
"""Samples per chunk, so that intermediate values stay in the cache."""


def regressor(
    robot: Robot,
    q: ArrayLike,
    qd: ArrayLike,
    qdd: ArrayLike,
    joints: Sequence[int] | None = None,
    gravity: ArrayLike | None = None,
) -> Array:
    """Compute the regressor A of the base parameters, eq. (6).

    Parameters
    ----------
    robot : Robot
    q, qd, qdd : array_like, shape (n_samples, n_joints) or (n_joints,)
        Positions, velocities, accelerations.
    joints : sequence of int, optional
        Joints of the rows, indices from 0; all by default. Fewer rows are computed faster.
    gravity : array_like, shape (3,), optional
        Gravity in the base frame, in place of the robot file's; base parameters remain those of the
        robot file [m/s^2].

    Returns
    -------
    array, shape (n_samples, n_rows, n_base)
        Torque per unit of each base parameter [N m per kg m^2, kg m or kg].

    Raises
    ------
    ValueError
        Shapes that do not fit the robot, or an unknown joint.

    Examples
    --------
    >>> robot = hil.Robot.load("manutec-r15")
    >>> hil.regressor(robot, np.zeros((100, 6)), 0.5, 0.0, joints=[1]).shape
    (100, 1, 14)
    """
    return regressors(robot, q, [(qd, qdd)], joints, gravity)[0]


def regressors(
    robot: Robot,
    q: ArrayLike,
    rates: Sequence[tuple[ArrayLike, ArrayLike]],
    joints: Sequence[int] | None = None,
    gravity: ArrayLike | None = None,
) -> list[Array]:
    """Compute regressors at the same positions for several velocities and accelerations."""
    model = _model(robot)
    wanted = np.arange(robot.n_joints) if joints is None else np.array(joints, dtype=np.int64)
    outside = wanted[(wanted < 0) | (wanted >= robot.n_joints)]
    if outside.size:
        raise ValueError(f"joint index {outside[0]} must be in 0..{robot.n_joints - 1}")
    rows = np.array(sorted(set(wanted.tolist())), dtype=np.int64)  # np.unique would import numpy.ma
    moved = [_samples(robot, q, *each) for each in rates]
    at = moved[0][0]
    every = np.empty((len(moved), at.size // robot.n_joints, rows.size, model.kinds.size))
    tree = model.frames, model.parents
    pull = robot.gravity if gravity is None else np.ascontiguousarray(gravity, dtype=np.float64)
    for part, states in _chunks(model, at, [each[1:] for each in moved]):
        for state, flat in zip(states, every[:, part], strict=True):
            _recursion.columns(
                state, *tree, pull, model.kinds, model.links, model.place[rows], flat
            )
    found = []
    for flat, (_, _, qdd) in zip(every, moved, strict=True):
        A = flat if model.mixing is None else flat @ model.mixing
        if len(model.added):
            A = np.concatenate([A, _added_columns(robot, model, at, qdd, rows)], axis=-1)
        if not np.array_equal(rows, wanted):
            A = A[:, np.searchsorted(rows, wanted)]
        found.append(A.reshape(*at.shape[:-1], wanted.size, A.shape[-1]))
    return found


def inverse_dynamics(
    robot: Robot, p: ArrayLike, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike
) -> Array:
    """Compute joint torques M(q) qdd + c(q, qd) + g(q) for base parameters `p` [N m].

    Examples
    --------
    >>> robot = hil.Robot.load("examples/pan_tilt/head.urdf")
    >>> hil.inverse_dynamics(robot, np.ones(8), np.zeros((100, 2)), 0.5, 0.0).shape
    (100, 2)
    """
    return inverse_dynamics_at(robot, p, q, [(qd, qdd)])[0]


def inverse_dynamics_at(
    robot: Robot, p: ArrayLike, q: ArrayLike, rates: Sequence[tuple[ArrayLike, ArrayLike]]
) -> list[Array]:
    """Compute joint torques at the same positions for several velocities and accelerations."""
    return _torques(robot, p, q, rates, robot.gravity)


def gravity_torque(robot: Robot, p: ArrayLike, q: ArrayLike) -> Array:
    """Compute gravity torques g(q) of eq. (6), shape of `q` [N m].

    Examples
    --------
    >>> robot = hil.Robot.load("examples/pan_tilt/head.urdf")
    >>> hil.gravity_torque(robot, np.ones(8), [0, 0.5]).round(2)
    array([ 0.  , -3.91])
    """
    return inverse_dynamics(robot, p, q, 0.0, 0.0)


def mass_matrix(robot: Robot, p: ArrayLike, q: ArrayLike) -> Array:
    """Compute the mass matrix M(q) of eq. (6), shape (n_samples, n_joints, n_joints) [kg m^2].

    Examples
    --------
    >>> robot = hil.Robot.load("examples/pan_tilt/head.urdf")
    >>> hil.mass_matrix(robot, np.ones(8), np.zeros((100, 2))).shape
    (100, 2, 2)
    """
    units = [(0.0, unit) for unit in np.eye(robot.n_joints)]
    return np.stack(_torques(robot, p, q, units, _WEIGHTLESS), axis=-1)


def coriolis_matrix(robot: Robot, p: ArrayLike, q: ArrayLike, qd: ArrayLike) -> Array:
    """Compute C(q, qd) of Christoffel's symbols, shape as of `mass_matrix` [N m s/rad].

    c(q, qd) of eq. (6) is quadratic in qd, so its symmetric bilinear form has the columns of C:
    c(q, qd + e) - c(q, qd - e) = 4 C e.
    """
    q, qd, _ = _samples(robot, q, qd, 0.0)
    rates = [(qd + e, 0.0) for e in (*np.eye(robot.n_joints), *-np.eye(robot.n_joints))]
    ahead, behind = np.split(np.stack(_torques(robot, p, q, rates, _WEIGHTLESS), axis=-1), 2, -1)
    return np.asarray((ahead - behind) / 4)


_WEIGHTLESS = np.zeros(3)


@dataclass(frozen=True)
class _Model:
    """Robot constants for the recursion.

    A frame that starts with gamma and b is two joints for the recursion, the first one at rest;
    `place` are the indices of the robot's joints among them. `mixing` is set if a base parameter is
    placed on several standard parameters. `added` are the indices of added parameters that are base
    parameters of their own, the last base parameters.
    """

    frames: Array
    parents: Integers
    theta: Array
    shift: Array
    revolute: Array
    place: Integers
    kinds: Integers
    links: Integers
    placement: Array
    mixing: Array | None
    added: Indices
    inertias: Array


@lru_cache(maxsize=32)
def _model(robot: Robot) -> _Model:
    every, n_links = base_parameters(robot).placement, 10 * robot.n_joints
    added = np.flatnonzero(every[n_links:].any(axis=1))
    placement = every[:n_links, : every.shape[1] - len(added)]
    carriers = np.flatnonzero(placement.any(axis=1)).astype(np.int64)
    carried = placement[carriers]
    rows: list[tuple[float, ...]] = []
    parents: list[int] = []
    place = [-1] * (robot.n_joints + 1)  # the base is the last
    own = zip(robot.alpha, robot.d, robot.theta, robot.r, robot.revolute, strict=True)
    for joint, row in enumerate(own):
        parents.append(place[robot.parents[joint]])
        if any(about_z := (robot.gamma[joint], robot.b[joint])):
            rows.append((0.0, 0.0, *about_z, 1.0))
            parents.append(len(parents) - 1)
        place[joint] = len(rows)
        rows.append(row)
    alpha, d, theta, shift, revolute = np.array(rows).T.copy()
    plain = np.array_equal(carried, np.eye(carriers.size))
    return _Model(
        frames=np.column_stack([[cos_sin(angle) for angle in alpha], d, revolute]),
        parents=np.array(parents, dtype=np.int64),
        theta=theta,
        shift=shift,
        revolute=revolute,
        place=(placed := np.array(place[:-1], dtype=np.int64)),
        kinds=carriers % 10,
        links=placed[carriers // 10],
        placement=carried,
        mixing=None if plain else carried,
        added=added,
        inertias=added_inertias(robot)[added],
    )


def _added_columns(robot: Robot, model: _Model, q: Array, qdd: Array, rows: Integers) -> Array:
    """Compute the columns of the added parameters, shape (n_samples, n_rows, n_added)."""
    q, qdd = (x.reshape(-1, robot.n_joints) for x in (q, qdd))
    accelerated = np.moveaxis(qdd @ model.inertias, 0, -1)
    return (accelerated + added_loads(robot, q)[..., model.added])[:, rows]


def _torques(
    robot: Robot,
    p: ArrayLike,
    q: ArrayLike,
    rates: Sequence[tuple[ArrayLike, ArrayLike]],
    gravity: Array,
) -> list[Array]:
    model = _model(robot)
    p = np.asarray(p, dtype=np.float64)
    n_links, n_added = model.placement.shape[1], len(model.added)
    if p.shape != (n_base := n_links + n_added,):
        raise ValueError(f"p has shape {p.shape}; {robot.name} has {n_base} base parameters")
    moved = [_samples(robot, q, *each) for each in rates]
    at = moved[0][0]
    values, tree = model.placement @ p[:n_links], (model.frames, model.parents)
    every = np.zeros((len(moved), at.size // robot.n_joints, model.revolute.size))
    for part, states in _chunks(model, at, [each[1:] for each in moved]):
        for state, flat in zip(states, every[:, part], strict=True):
            _recursion.torques(state, *tree, gravity, model.kinds, model.links, values, flat)
    if model.place.size < model.revolute.size:
        every = every[..., model.place]
    if n_added:
        own = p[n_links:]
        accelerated = np.tensordot(own, model.inertias, 1)
        for k, (_, _, qdd) in enumerate(moved):
            every[k] += qdd.reshape(every[k].shape) @ accelerated
        if gravity is not _WEIGHTLESS:
            every += added_loads(robot, at.reshape(every.shape[1:]))[..., model.added] @ own
    return list(every.reshape(-1, *at.shape))


def _samples(
    robot: Robot, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike
) -> tuple[Array, Array, Array]:
    """Broadcast velocities and accelerations to the shape of the positions."""
    q = np.asarray(q, dtype=np.float64)
    if q.ndim == 0 or q.shape[-1] != robot.n_joints:
        raise ValueError(f"q has shape {q.shape}; its last axis must be {robot.n_joints} joints")
    qd, qdd = (np.asarray(x, dtype=np.float64) for x in (qd, qdd))
    return (
        q,
        # broadcasting equal shapes takes a fifth of a call for few states
        qd if qd.shape == q.shape else np.broadcast_to(qd, q.shape),
        qdd if qdd.shape == q.shape else np.broadcast_to(qdd, q.shape),
    )


def _chunks(
    model: _Model, q: Array, rates: Sequence[tuple[Array, Array]]
) -> Iterator[tuple[slice, Iterator[Any]]]:
    """Yield chunks of the samples, with states for all `rates` as arguments of the recursion."""
    n = model.place.size
    q, flat = q.reshape(-1, n), [(qd.reshape(-1, n), qdd.reshape(-1, n)) for qd, qdd in rates]
    if n < model.revolute.size:
        q, flat = _spread(model, q), [(_spread(model, qd), _spread(model, dv)) for qd, dv in flat]
    states = _components if _recursion is recursion_by_arrays else _states
    for first in range(0, len(q), _CHUNK):
        part = slice(first, first + _CHUNK)
        yield part, states(model, q[part], [(qd[part], qdd[part]) for qd, qdd in flat])


def _spread(model: _Model, x: Array) -> Array:
    """Spread values of joints over all frames, shape (n_samples, n_frames)."""
    found = np.zeros((len(x), model.revolute.size))
    found[:, model.place] = x
    return found


def _states(model: _Model, q: Array, rates: Sequence[tuple[Array, Array]]) -> Iterator[Array]:
    """Yield states as arguments of `recursion.columns`, shape (5, n_samples, n_joints)."""
    state = np.empty((5, *q.shape))
    recursion.positions(q, model.theta, model.shift, model.revolute, state)
    for qd, qdd in rates:
        state[3], state[4] = qd, qdd
        yield state


def _components(
    model: _Model, q: Array, rates: Sequence[tuple[Array, Array]]
) -> Iterator[list[tuple[Any, ...]]]:
    """Yield states as arguments of `recursion_by_arrays.columns`, joint by joint."""
    positions = []
    for joint, revolute in enumerate(model.revolute):
        angle: Any = float(model.theta[joint])
        shift: Any = float(model.shift[joint])
        at = _component(q[:, joint])
        angle, shift = (angle + at, shift) if revolute else (angle, shift + at)
        positions.append((np.cos(angle), np.sin(angle), shift))
    for qd, qdd in rates:
        yield [
            (*at, _component(v), _component(a))
            for at, v, a in zip(positions, qd.T, qdd.T, strict=True)
        ]


def _component(x: Array) -> Array | float:
    """Return a contiguous array, or the number if broadcast from a scalar."""
    return float(x[0]) if x.strides == (0,) else np.ascontiguousarray(x)
