"""Torques against the shape of the robot's model: what else than the map says explains them?

A small regression of the base parameters, rotor inertia and friction of each joint says how much of
the torques the model explains. Then the same with one thing of the map changed: a sign, two joints
exchanged, degrees for radians, a zero shifted by a quarter turn. A change that explains far more is
what the map has wrong; a coupling or a load that the model lacks changes none of these.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from hil.imports.suspicion import Suspicion
from hil.model.dynamics import regressor

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from hil.imports.plausibility import Evidence
    from hil.model.robot import Robot

    Array = NDArray[np.float64]
    Motion = tuple[Array, Array, Array, Array]

POINTS = 400
"""Instants that are used, as far as there are so many."""
BETTER = 1.5
"""Ratio of residuals from which on another reading of the map is stated."""
CERTAIN = 4.0
"""And from which on it refuses the import."""
_RIDGE = 1e-9


@dataclass(frozen=True, eq=False)
class _Reading:
    """Another reading of the map: where it differs, in words, and what it makes of the data."""

    location: tuple[str | int, ...]
    message: str
    motion: Motion


def shape_suspicions(evidence: Evidence, robot: Robot) -> Iterator[Suspicion]:
    """The reading of the map that explains the torques far better than the map's own, if any."""
    step = max(1, len(evidence.q) // POINTS)
    motion = (evidence.q, evidence.qd, evidence.qdd, evidence.tau)
    motion = tuple(array[::step] for array in motion)  # type: ignore[assignment]
    moving = np.ptp(motion[0], axis=0) > 0.01 * (robot.q_max - robot.q_min)
    if len(motion[0]) * robot.n_joints < 30 * robot.n_joints or not moving.any():
        return
    scale = np.maximum(np.std(motion[3], axis=0), 1e-300)
    own = _unexplained(robot, motion, scale)
    readings = [(r, _unexplained(robot, r.motion, scale)) for r in _readings(robot, motion, moving)]
    if not readings:
        return
    best, least = min(readings, key=lambda reading: reading[1])
    ratio = own / max(least, 1e-6)
    if ratio > BETTER and least < 0.7:
        yield Suspicion(
            "shape",
            best.location,
            f"the model leaves {100 * own:.0f} % of the torques unexplained, and"
            f" {100 * least:.1f} % if {best.message}",
            certain=ratio > CERTAIN,
        )


def _unexplained(robot: Robot, motion: Motion, scale: Array) -> float:
    """Share of the torques' scatter that the model leaves, over all joints."""
    q, qd, qdd, tau = motion
    n, joints = q.shape
    a = np.zeros((n, joints, regressor(robot, q[:1], qd[:1], qdd[:1]).shape[-1] + 4 * joints))
    rigid = regressor(robot, q, qd, qdd)
    a[:, :, : rigid.shape[-1]] = rigid
    for joint in range(joints):
        at = rigid.shape[-1] + 4 * joint
        speed = max(float(np.max(np.abs(qd[:, joint]))), 1e-9)
        own = (np.tanh(qd[:, joint] / (0.05 * speed)), qd[:, joint], qdd[:, joint], np.ones(n))
        a[:, joint, at : at + 4] = np.stack(own, axis=1)
    flat = (a / scale[:, None]).reshape(n * joints, -1)
    flat /= np.maximum(np.linalg.norm(flat, axis=0), 1e-12)
    wanted = ((tau - tau.mean(axis=0)) / scale).ravel()
    x = np.linalg.solve(flat.T @ flat + _RIDGE * np.eye(flat.shape[1]), flat.T @ wanted)
    return float(np.linalg.norm(wanted - flat @ x) / max(np.linalg.norm(wanted), 1e-300))


def _readings(robot: Robot, motion: Motion, moving: NDArray[np.bool_]) -> Iterator[_Reading]:
    for joint in np.flatnonzero(moving).tolist():
        yield from _of_one_joint(robot, motion, joint)
    q, qd, qdd, tau = motion
    for i, j in combinations(range(robot.n_joints), 2):
        if robot.revolute[i] != robot.revolute[j]:
            continue
        order = np.arange(robot.n_joints)
        order[[i, j]] = j, i
        at, pair = ("joints", i), f"joints {i + 1} and {j + 1}"
        yield _Reading(
            (*at, "torque"), f"the torques of {pair} are exchanged", (q, qd, qdd, tau[:, order])
        )
        if moving[i] or moving[j]:
            exchanged = (q[:, order], qd[:, order], qdd[:, order])
            yield _Reading(at, f"{pair} are exchanged", (*exchanged, tau[:, order]))
            yield _Reading(
                (*at, "position"), f"the positions of {pair} are exchanged", (*exchanged, tau)
            )


def _of_one_joint(robot: Robot, motion: Motion, joint: int) -> Iterator[_Reading]:
    q, qd, qdd, tau = motion
    at, name = ("joints", joint), f"joint {joint + 1}"
    scales = np.ones(robot.n_joints)
    scales[joint] = -1
    yield _Reading(
        (*at, "position", "sign"),
        f"positions and torques of {name} had the other sign",
        (q * scales, qd * scales, qdd * scales, tau * scales),
    )
    yield _Reading(
        (*at, "torque", "sign"),
        f"the torques of {name} had the other sign",
        (q, qd, qdd, tau * scales),
    )
    if not robot.revolute[joint]:
        return
    for factor, unit in ((np.pi / 180, "degrees and stated as rad"), (180 / np.pi, "rad")):
        scales[joint] = factor
        if np.ptp(q[:, joint] * factor) < 20:
            yield _Reading(
                (*at, "position", "unit"),
                f"the positions of {name} were in {unit}",
                (q * scales, qd * scales, qdd * scales, tau),
            )
    for turn, words in ((np.pi / 2, "pi/2"), (-np.pi / 2, "-pi/2"), (np.pi, "pi")):
        shift = np.zeros(robot.n_joints)
        shift[joint] = turn
        yield _Reading(
            (*at, "position", "offset"),
            f"the positions of {name} had {words} rad more",
            (q + shift, qd, qdd, tau),
        )
