"""Torques against the shape of the robot's model: what else than the map says explains them.

A small regression of the base parameters, rotor inertia and friction of each joint says how much of
the torques the model explains. Then the same with one thing of the map changed: a sign, two joints
exchanged, degrees for radians, a zero shifted by a quarter turn, gravity from another side. A
change that explains far more is what the map has wrong; a coupling or a load that the model lacks
changes none of these. Where next to nothing is explained the torques are none of this robot.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from hil.imports.evidence import Suspicion
from hil.model.dynamics import regressor

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.arrays import Array, Mask
    from hil.imports.evidence import Evidence
    from hil.model.robot import Robot

    Motion = tuple[Array, Array, Array]

POINTS = 200
"""Instants that are used, as far as there are so many."""
BETTER = 1.3
"""Ratio of residuals from which on another reading of the map is stated."""
CERTAIN = 3.0
"""And from which on it refuses the import."""
NOTHING = 0.9
"""Share of the scatter of torques that is unexplained where they are not of this motion: less than
a fifth of their variance is explained. Public recordings of five machines have 0.24 at most."""
EXPLAINED = 0.1
"""Unexplained share, a hundredth of the variance, up to which the map's own reading is not refused:
all joints weigh alike, so one that is read wrong leaves more, 1 / sqrt(40) = 0.16 of 40 joints."""
_EXPLAINED = 0.7
_WELL = 0.35
_WIDEST = 20.0
_LEAST = 0.02
_UNITS = ((np.pi / 180, "in degrees, stated as rad"), (180 / np.pi, "in rad"))
_ORDINARY = (0.2, 4 * np.pi)
"""Widest range of all joints that makes nobody doubt the unit of them all [rad]."""
_RIDGE = 1e-9
"""What keeps equations of columns of unit length solvable: squares of what rounding leaves."""
_SLOW = 0.1
"""Share of a joint's greatest speed below which its torques do not count."""


@dataclass(frozen=True, eq=False)
class _Reading:
    """Another reading of the map: where it differs, in words, and what it makes of the data."""

    location: tuple[str | int, ...]
    message: str
    motion: Motion
    tau: Array
    gravity: Array | None = None


def shape_suspicions(evidence: Evidence, robot: Robot) -> Iterator[Suspicion]:
    """The reading of the map that explains the torques far better than the map's own, if any."""
    step = max(1, len(evidence.q) // POINTS)
    q, qd, qdd, tau = (
        array[::step] for array in (evidence.q, evidence.qd, evidence.qdd, evidence.tau)
    )
    notable = np.ptp(q, axis=0) > 0.01 * np.nan_to_num(robot.q_max - robot.q_min)
    moving = evidence.moves & notable
    if len(q) < POINTS // 2 or not moving.any() or not np.std(tau, axis=0).any():
        return
    motion = (q, qd, qdd)
    columns = _columns(robot, motion)
    own = _unexplained(columns, tau, qd)
    found: list[tuple[float, _Reading | None]] = [(own, None)]
    for reading in _readings(robot, motion, tau, moving):
        same = reading.motion is motion and reading.gravity is None
        its_columns = columns if same else _columns(robot, reading.motion, reading.gravity)
        found.append((_unexplained(its_columns, reading.tau, reading.motion[1]), reading))
    least, best = min(found, key=lambda each: each[0])
    ratio = own / max(least, 1e-6)
    if best is not None and ratio > BETTER and least < _EXPLAINED:
        yield Suspicion(
            "shape",
            best.location,
            f"the model leaves {100 * own:.3g} % of the torques unexplained, and"
            f" {100 * least:.3g} % if, say, {best.message}",
            certain=ratio > CERTAIN and least < _WELL and own > EXPLAINED,
        )
    elif own > NOTHING:
        yield Suspicion(
            "shape",
            ("joints", 0, "torque"),
            f"the model, friction and all, leaves {100 * own:.3g} % of the torques of all joints"
            " unexplained: they do not follow this motion; name the columns of torques, of the same"
            " recording and of this robot",
        )


def _columns(robot: Robot, motion: Motion, gravity: Array | None = None) -> Array:
    """Columns of the base parameters, inertia, friction and offset, shape (n, joints, columns)."""
    rigid = regressor(robot, *motion, gravity=gravity)
    n, joints, n_base = rigid.shape
    columns = np.zeros((n, joints, n_base + 4 * joints + 4 * len(robot.couplings)))
    columns[:, :, :n_base] = rigid
    for joint in range(joints):
        own = _own_columns(motion[1][:, joint], motion[2][:, joint])
        columns[:, joint, n_base + 4 * joint :][:, :4] = own
    for number, (motor, joint, _) in enumerate(robot.couplings):
        at = n_base + 4 * (joints + number)
        both = (motion[k][:, motor] + motion[k][:, joint] for k in (1, 2))
        columns[:, [motor, joint], at : at + 4] = _own_columns(*both)[:, None]
    return columns


def _own_columns(qd: Array, qdd: Array) -> Array:
    speed = max(float(np.max(np.abs(qd))), 1e-9)
    return np.stack([np.tanh(qd / (0.05 * speed)), qd, qdd, np.ones_like(qd)], axis=1)


def _unexplained(columns: Array, tau: Array, qd: Array) -> float:
    """Share of the torques' scatter that the model leaves, over all joints that are not too slow.

    A joint's rows are divided by the scatter of the torques that this reading gives it, as far as
    it is notable: a torque weighs the same whichever joint it is read as, so that no reading gains
    by giving a large torque to a joint that weighs little. Near a reversal friction is no function
    of velocity, and what is left there hides the rest.
    """
    scatter = np.std(tau, axis=0)
    scale = np.maximum(scatter, _LEAST * scatter.max())
    flat = (columns / scale[:, None]).reshape(tau.size, -1)
    design = flat / np.maximum(np.linalg.norm(flat, axis=0), 1e-12)
    fast = (np.abs(qd) >= _SLOW * np.abs(qd).max(axis=0)).ravel()
    wanted = ((tau - tau.mean(axis=0)) / scale).ravel()[fast]
    used = design[fast]
    gram = used.T @ used + _RIDGE * np.eye(design.shape[1])
    x = np.linalg.solve(gram, used.T @ wanted)
    return float(np.linalg.norm(wanted - used @ x) / np.linalg.norm(wanted))


def _readings(robot: Robot, motion: Motion, tau: Array, moving: Mask) -> Iterator[_Reading]:
    for joint in np.flatnonzero(moving).tolist():
        yield from _of_one_joint(robot, motion, tau, joint)
    widest = float(np.ptp(motion[0][:, robot.revolute], axis=0).max(initial=0.0))
    for factor, unit in _UNITS:
        if not _ORDINARY[0] < widest < _ORDINARY[1] and widest * factor < _WIDEST:
            scaled = np.where(robot.revolute, factor, 1.0)
            q, qd, qdd = (array * scaled for array in motion)
            message = f"the positions of all joints that turn were {unit}"
            yield _Reading(("joints", 0, "position", "unit"), message, (q, qd, qdd), tau)
    yield from _of_gravity(robot, motion, tau)
    for i, j in combinations(range(robot.n_joints), 2):
        if robot.revolute[i] != robot.revolute[j]:
            continue
        order = np.arange(robot.n_joints)
        order[[i, j]] = j, i
        at, pair = ("joints", i), f"joints {i + 1} and {j + 1}"
        exchanged = tau[:, order]
        yield _Reading((*at, "torque"), f"the torques of {pair} are exchanged", motion, exchanged)
        if moving[i] or moving[j]:
            q, qd, qdd = (array[:, order] for array in motion)
            yield _Reading(at, f"{pair} are exchanged", (q, qd, qdd), exchanged)
            message = f"the positions of {pair} are exchanged"
            yield _Reading((*at, "position"), message, (q, qd, qdd), tau)


def _of_gravity(robot: Robot, motion: Motion, tau: Array) -> Iterator[_Reading]:
    """Gravity along another axis of the base."""
    stated = np.array(robot.gravity)
    size = float(np.linalg.norm(stated))
    for direction in (*np.eye(3), *-np.eye(3)) if size else ():
        if direction @ stated < 0.9 * size:
            along = size * direction + 0.0
            message = (
                f"gravity were [{', '.join(f'{g:.3g}' for g in along)}] m/s² in the base frame"
            )
            yield _Reading(("robot",), message, motion, tau, along)


def _of_one_joint(robot: Robot, motion: Motion, tau: Array, joint: int) -> Iterator[_Reading]:
    q, qd, qdd = motion
    at, name, own = ("joints", joint), f"joint {joint + 1}", np.arange(robot.n_joints) == joint
    turned = np.where(own, -1.0, 1.0)
    message = f"the torques of {name} had the other sign"
    yield _Reading((*at, "torque", "sign"), message, motion, tau * turned)
    message = f"positions and torques of {name} had the other sign"
    mirrored = (q * turned, qd * turned, qdd * turned)
    yield _Reading((*at, "position", "sign"), message, mirrored, tau * turned)
    if not robot.revolute[joint]:
        return
    for factor, unit in _UNITS:
        if np.ptp(q[:, joint]) * factor < _WIDEST:
            scaled = np.where(own, factor, 1.0)
            message = f"the positions of {name} were {unit}"
            read = (q * scaled, qd * scaled, qdd * scaled)
            yield _Reading((*at, "position", "unit"), message, read, tau)
    for turn, words in ((np.pi / 2, "pi/2"), (-np.pi / 2, "-pi/2"), (np.pi, "pi")):
        message = f"the positions of {name} had {words} rad more"
        yield _Reading((*at, "position", "offset"), message, (q + turn * own, qd, qdd), tau)
