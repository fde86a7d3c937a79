"""What contradicts itself in a recording, found before anything is estimated from it.

Signs, the order of joints, degrees for radians and the motor's side for the joint's leave traces:
in the derivative of the position against the recorded velocity, in ranges and limits, and in what
mechanics allows (`mechanics`). What is certain refuses the import, unless the map accepts it; the
rest is stated.
"""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING

import numpy as np

from hil.imports.evidence import Evidence, Suspicion
from hil.imports.mechanics import mechanical_suspicions
from hil.imports.misread import misread_torques, range_suspicions, small_motion
from hil.model.frames import ROUNDED_OFF

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array
    from hil.imports.evidence import Excerpt
    from hil.model.robot import Robot


FITS = 0.9
"""Correlation from which on two velocities count as of one joint."""
_NOISE = 1.0 - FITS
"""Share of noise in the power of both velocities that takes their correlation below `FITS`."""
_AGREES = 0.1


def suspicions(
    excerpts: Sequence[Excerpt],
    robot: Robot,
    alone: int | None = None,
    unknown_gains: Sequence[int] = (),
) -> list[Suspicion]:
    """All that is found, what is certain first.

    Parameters
    ----------
    excerpts : sequence of Excerpt
    robot : Robot
    alone : int, optional
        The joint, from 0, that is stated to move while all others stand still.
    unknown_gains : sequence of int
        Joints, from 0, of whose torques the size says nothing: then limits of torque and mechanics,
        which compares the torques of joints, are no checks.
    """
    evidence = Evidence.of(excerpts)
    found = [*_still(evidence, robot, alone), *range_suspicions(evidence, robot, unknown_gains)]
    if not any(suspicion.certain for suspicion in found):
        found += misread_torques(excerpts, evidence, robot, unknown_gains)
    if not any(suspicion.certain for suspicion in found):  # else no equation needs to be tried
        found += [*_velocities(evidence, robot), *_coarse(evidence, robot)]
    if not any(suspicion.certain for suspicion in found):
        found += small_motion(evidence, robot) if alone is None else ()
        found += () if unknown_gains else mechanical_suspicions(excerpts, robot)
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
        if alone is not None and joint != alone and moves and way > 0.02 * ways[alone]:
            yield Suspicion(
                "still",
                ("kind",),
                f"joint {alone + 1} is to move alone, but joint {joint + 1} moves by {way:.3g}"
                f" {robot.position_unit(joint)}; write kind: free, or choose other rows",
            )


def _velocities(evidence: Evidence, robot: Robot) -> Iterator[Suspicion]:
    """Recorded velocities against the derivatives of the positions, where these are no noise."""
    noisy = evidence.noise_qd**2 > _NOISE * np.mean(evidence.qd**2, axis=0)
    recorded = np.isfinite(evidence.recorded_qd).all(axis=0)
    for joint in np.flatnonzero(recorded & evidence.moves & ~noisy).tolist():
        own, other = evidence.recorded_qd[:, joint], evidence.qd[:, joint]
        at = ("joints", joint, "velocity")
        correlation = _correlation(own, other)
        if abs(correlation) < FITS:
            yield Suspicion("velocity", at, _fits_none(evidence, joint, correlation))
            continue
        scale = float(own @ other / (other @ other))
        if abs(scale - 1) > _AGREES:
            reason = _why_scaled(scale, float(robot.gear_ratio[joint]))
            yield Suspicion(
                "velocity",
                at,
                f"is {scale:.4g} times the derivative of the position of joint {joint + 1};"
                f" {reason}",
                certain=scale < 0 or abs(np.log(scale)) > np.log(1.5),
            )


def _coarse(evidence: Evidence, robot: Robot) -> Iterator[Suspicion]:
    """Positions whose noise makes more of the accelerations than the motion does."""
    power = np.mean(evidence.qdd**2, axis=0)
    for joint in np.flatnonzero(evidence.moves & (evidence.noise_qdd**2 > power / 2)).tolist():
        unit = robot.position_unit(joint)
        yield Suspicion(
            "velocity",
            ("joints", joint, "position"),
            f"scatters so far that accelerations are known to ±{evidence.noise_qdd[joint]:.2g}"
            f" {unit}/s² only, more than the motion has; take the encoder's own resolution, or"
            " record faster motion",
            certain=False,
        )


def _fits_none(evidence: Evidence, joint: int, correlation: float) -> str:
    own = evidence.recorded_qd[:, joint]
    others = [
        other
        for other in range(evidence.q.shape[1])
        if other != joint and abs(_correlation(own, evidence.qd[:, other])) > FITS
    ]
    if others:
        return (
            f"follows the position of joint {others[0] + 1}, not of joint {joint + 1}; correct the"
            " order of the columns"
        )
    return (
        f"does not follow the position of joint {joint + 1} (correlation {correlation:.2f});"
        " correct one of the columns, or leave velocity out"
    )


def _correlation(a: Array, b: Array) -> float:
    scale = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / scale if scale else 0.0


def _why_scaled(scale: float, gear: float) -> str:
    """State what makes velocities this factor too great against positions."""
    if scale < 0:
        return "one of the two has the wrong sign: correct sign"
    known = {
        180 / pi: "velocity is in degrees, or position in degrees and stated as rad: correct unit",
        pi / 180: "position is in degrees: correct its unit",
        1e3: "velocity is in mm/s: correct unit",
        1e-3: "position is in mm: correct its unit",
        30 / pi: "velocity is in rpm: correct unit",
        gear: f"velocity is on the motor's side at a gear ratio of {gear:g}: its unit is on"
        " the joint's side",
        1 / gear: f"position is on the motor's side at a gear ratio of {gear:g}: correct"
        " position_side",
    }
    for factor, reason in known.items():
        if factor != 1 and abs(scale / factor - 1) < _AGREES:
            return reason
    return "correct unit, per_unit or the column of time"
