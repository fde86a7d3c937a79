"""Columns that are not what a map calls them: torques that are something else, one thing twice."""

from __future__ import annotations

from itertools import combinations
from math import pi
from typing import TYPE_CHECKING

import numpy as np

from hil.imports.suspicion import Suspicion

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array
    from hil.imports.evidence import Evidence
    from hil.imports.excerpt import Excerpt
    from hil.model.robot import Robot


CHANCE = 20
"""Samples just beside zero, all on one side of it: by chance one in a million."""
OFTEN, CLOSE = 0.95, 0.05
"""Share of the ordinary steps from sample to sample, and share of such a step that is just beside
zero: so close that either side of it is as likely."""
SAME = 0.05
"""Relative difference up to which a torque is a velocity: friction that is viscous alone, with a
coefficient of just 1 N m s/rad, is no robot's."""
_SMALL = 0.03


def misread_torques(
    excerpts: Sequence[Excerpt], evidence: Evidence, robot: Robot, unknown_gains: Sequence[int]
) -> Iterator[Suspicion]:
    """Torques without sign, torques that are velocities, columns that hold the same."""
    yield from _twice(excerpts, evidence)
    yield from _without_sign(excerpts)
    for joint in np.flatnonzero(evidence.moves).tolist():
        tau, qd = evidence.tau[:, joint], evidence.qd[:, joint]
        for factor, unit in ((1.0, "rad/s or m/s"), (180 / pi, "deg/s"), (30 / pi, "rpm")):
            if np.linalg.norm(tau - factor * qd) < SAME * np.linalg.norm(tau):
                yield Suspicion(
                    "still",
                    ("joints", joint, "torque"),
                    f"is the velocity of joint {joint + 1} in {unit}; name the torque's column",
                )
    yield from _small_torques(evidence, robot, unknown_gains)


def _twice(excerpts: Sequence[Excerpt], evidence: Evidence) -> Iterator[Suspicion]:
    n = evidence.q.shape[1]
    for i, j in combinations(range(n), 2):
        for key, arrays in (("position", [e.q for e in excerpts]),
                            ("torque", [e.tau for e in excerpts])):  # fmt: skip
            same = all(np.array_equal(array[:, i], array[:, j]) for array in arrays)
            if same and any(np.ptp(array[:, i]) > 0 for array in arrays):
                yield Suspicion(
                    "still",
                    ("joints", j, key),
                    f"is the same as that of joint {i + 1} in all samples; one of the two columns"
                    " is another's: correct it",
                )


def _without_sign(excerpts: Sequence[Excerpt]) -> Iterator[Suspicion]:
    """Torques that come to zero often and turn back each time."""
    found: dict[int, int] = {}
    for joint in range(excerpts[0].tau.shape[1]):
        parts = [excerpt.tau[:, joint] for excerpt in excerpts]
        if all(np.all(x >= 0) for x in parts) or all(np.all(x <= 0) for x in parts):
            found[joint] = sum(_touches(np.abs(x)) for x in parts)
    if sum(found.values()) >= CHANCE:
        joints = [joint for joint, times in found.items() if times]
        yield Suspicion(
            "still",
            ("joints", joints[0], "torque"),
            f"torques of joints {', '.join(str(joint + 1) for joint in joints)} come to zero"
            f" {sum(found.values())} times and never cross it: they have lost their signs, as sizes"
            " of currents have; name columns with signs",
        )


def _touches(x: Array) -> int:
    """Samples as close to zero as they would be by chance where they cross it."""
    return int(np.count_nonzero((x > 0) & (x < CLOSE * np.quantile(np.abs(np.diff(x)), OFTEN))))


def _small_torques(
    evidence: Evidence, robot: Robot, unknown_gains: Sequence[int]
) -> Iterator[Suspicion]:
    """All joints have very little torque, like that of motors taken for joints."""
    shares = np.abs(evidence.tau).max(axis=0) / robot.torque_limit
    if unknown_gains or not np.isfinite(shares).all():
        return
    widest = int(np.argmax(shares))
    if 0 < shares[widest] < _SMALL:
        yield Suspicion(
            "range",
            ("joints", widest, "torque"),
            f"has up to {np.abs(evidence.tau[:, widest]).max():.3g}"
            f" {'N m' if robot.revolute[widest] else 'N'}, {100 * shares[widest]:.2g} % of its"
            " limit, and no joint a greater share; are unit, gain and torque_side right?",
            certain=False,
        )
