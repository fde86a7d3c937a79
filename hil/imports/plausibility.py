"""Contradictions in a recording, found before the estimation.

Signs, the order of joints, degrees for radians and the motor's side for the joint's leave traces:
in the derivative of the position against the recorded velocity, in ranges and limits, and in
mechanics (`mechanics`). Certain contradictions refuse the import, unless the map accepts them;
others are stated.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.imports.clock import clock_suspicions
from hil.imports.evidence import Suspicion
from hil.imports.held import fast_steps, repeats
from hil.imports.mechanics import mechanical_suspicions
from hil.imports.misread import (
    compared,
    misread_torques,
    misread_velocities,
    range_suspicions,
    small,
)
from hil.imports.two_clocks import clock_of_velocities
from hil.model.frames import ROUNDED_OFF

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Mask
    from hil.imports.evidence import Evidence, Excerpt
    from hil.model.robot import Robot


def suspicions(
    excerpts: Sequence[Excerpt],
    evidence: Evidence,
    robot: Robot,
    alone: int | None = None,
    unknown_gains: Sequence[int] = (),
) -> list[Suspicion]:
    """Return all suspicions, certain ones first.

    Parameters
    ----------
    excerpts : sequence of Excerpt
    evidence : Evidence
        Evidence of all excerpts.
    robot : Robot
    alone : int, optional
        The joint, from 0, that is stated to move while all others stand still.
    unknown_gains : sequence of int
        Joints, from 0, of whose torques the size says nothing: then limits of torque and mechanics,
        which compares the torques of joints, are no checks.
    """
    found = [*_still(evidence, robot, alone), *range_suspicions(evidence, robot, unknown_gains)]
    if not any(suspicion.certain for suspicion in found):
        found += misread_torques(excerpts, evidence, robot)
        most = np.abs(evidence.tau).max(axis=0)
        low = [] if unknown_gains else [*small(evidence, robot, "torque", most, robot.torque_limit)]
        found += low
    if not any(suspicion.certain for suspicion in found):  # else no equation needs to be tried
        clock = list(clock_suspicions(excerpts, evidence, robot))
        # a factor common to all velocities is stated once, not for speeds and positions as well
        found = clock + found
        misread = [] if clock else list(misread_velocities(evidence, robot))
        if not clock and (clock := list(clock_of_velocities(excerpts, compared(evidence)))):
            # lags of another clock lower sizes and correlations of velocities
            certain = any(suspicion.certain for suspicion in misread)
            found = [replace(suspicion, certain=certain) for suspicion in clock] + found
            misread = []
        found += misread
        wrong = any(suspicion.certain for suspicion in found)
        held = [] if wrong else list(_held(excerpts, evidence))
        found += held
        found += () if clock or held else _coarse(evidence, robot)
    if not any(suspicion.certain for suspicion in found):
        ways, ranges = np.ptp(evidence.q, axis=0), robot.q_max - robot.q_min
        found += small(evidence, robot, "position", ways, ranges) if alone is None else ()
        # rotor inertias that are stated contradict torques of another unit or side
        shown = evidence.moves & ~coarse(evidence)
        found += () if unknown_gains or low else mechanical_suspicions(excerpts, robot, shown)
    return sorted(found, key=lambda suspicion: not suspicion.certain)


def _still(evidence: Evidence, robot: Robot, alone: int | None) -> Iterator[Suspicion]:
    ways = np.ptp(evidence.q, axis=0)
    for joint, (way, moves) in enumerate(zip(ways, evidence.moves, strict=True)):
        at = ("joints", joint)
        if np.ptp(evidence.tau[:, joint]) <= ROUNDED_OFF * np.abs(evidence.tau[0, joint]) and moves:
            torque = evidence.tau[0, joint]
            yield Suspicion(
                "still", (*at, "torque"), f"is {torque:g} throughout; name the column of its torque"
            )
        if not moves and (alone is None or joint == alone):
            unit = robot.position_unit(joint)
            yield Suspicion(
                "still",
                (*at, "position"),
                f"moves by {way:.2g} {unit} only, no more than noise or other joints make it:"
                f" nothing can be found of joint {joint + 1} save what gravity shows; is it the"
                " right column, in the right unit?",
                certain=alone is not None,
            )
        # other joints may move by 2 % of the moving joint's distance: servos yield
        if alone is not None and joint != alone and moves and way > 0.02 * ways[alone]:
            yield Suspicion(
                "still",
                ("kind",),
                f"joint {alone + 1} is to move alone, but joint {joint + 1} moves by {way:.3g}"
                f" {robot.position_unit(joint)}; write kind: free, or choose other rows",
            )


def _held(excerpts: Sequence[Excerpt], evidence: Evidence) -> Iterator[Suspicion]:
    """Yield suspicions of columns that repeat the previous row while the joint moves."""
    for joint in np.flatnonzero(evidence.moves).tolist():
        moving = fast_steps([each.q[:, joint] for each in excerpts])
        for key, name in (("position", "q"), ("velocity", "qd"), ("torque", "tau")):
            if share := repeats([getattr(each, name)[:, joint] for each in excerpts], moving):
                yield Suspicion(
                    "still",
                    ("joints", joint, key),
                    f"repeats the value of the row before in {100 * share:.0f} % of the rows in"
                    f" which joint {joint + 1} moves: its values are held, and come every"
                    f" {1.0 / (1.0 - share):.2g} rows on average, late by half of that; record it"
                    " as often as the others, or keep the rows in which it changes",
                    certain=False,
                )


def coarse(evidence: Evidence) -> Mask:
    """Return joints with more than half of the acceleration's power from noise of the position."""
    power = np.mean(evidence.qdd**2, axis=0)
    return np.asarray(evidence.noise_qdd**2 > power / 2)


def _coarse(evidence: Evidence, robot: Robot) -> Iterator[Suspicion]:
    """Yield suspicions of positions whose noise dominates the accelerations."""
    for joint in np.flatnonzero(evidence.moves & coarse(evidence)).tolist():
        unit = robot.position_unit(joint)
        yield Suspicion(
            "velocity",
            ("joints", joint, "position"),
            f"scatters so far that accelerations are known to ±{evidence.noise_qdd[joint]:.2g}"
            f" {unit}/s² only, more than the motion has; take the encoder's own resolution, or"
            " record faster motion",
            certain=False,
        )
