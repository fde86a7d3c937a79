"""Contradictions in a recording, found before the estimation.

Wrong signs, a wrong order of joints, degrees for radians and motor-side values show in the
derivative of the position against the recorded velocity, in ranges and limits, or in mechanics
(`mechanics`). Certain contradictions refuse the import, unless the map accepts them; others are
stated.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.motion import ORDER
from hil.estimation.free_motion.settings import band_of, bandwidth, cut_off_of, floor, spectrum
from hil.imports.clock import clock_suspicions
from hil.imports.evidence import Suspicion
from hil.imports.held import fast_steps, repeats, saturated
from hil.imports.mechanics import mechanical_suspicions
from hil.imports.misread import (
    compared,
    misread_torques,
    misread_velocities,
    range_suspicions,
    small,
    unmeasurable,
)
from hil.imports.set_points import stepping_torques
from hil.imports.two_clocks import clock_of_velocities
from hil.least_squares.standstill import moving_in
from hil.model.frames import ROUNDED_OFF

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from hil.arrays import Array, Mask
    from hil.imports.evidence import Evidence, Excerpt
    from hil.model.robot import Robot
LOWERED = 0.02
"""Minimum reported bias of inertias: their usual error in a good identification."""


def suspicions(
    excerpts: Sequence[Excerpt],
    evidence: Evidence,
    robot: Robot,
    alone: int | None = None,
    unknown_gains: Sequence[int] = (),
    passive: Sequence[int] = (),
    reached: Callable[[], tuple[Array, Array]] | None = None,
    rate: float | None = None,
    whole: Callable[[], Sequence[Excerpt]] | None = None,
) -> list[Suspicion]:
    """Return the suspicions, certain ones first.

    Parameters
    ----------
    evidence : Evidence
        Evidence of all excerpts.
    alone : int, optional
        Joint, from 0, stated to move alone.
    unknown_gains : sequence of int
        Joints, from 0, with torques of unknown scale; torque limits and mechanics, which compare
        the torques of joints, are then not checked.
    passive : sequence of int
        Joints, from 0, without motor.
    reached : callable, optional
        Function that returns the least and greatest recorded positions; those of the excerpts by
        default.
    rate : float, optional
        Rate stated by the map [Hz], where it names no column of time.
    whole : callable, optional
        Function that returns excerpts of whole motions, by which mechanical suspicions are
        confirmed.
    """
    ranges = range_suspicions(evidence, robot, unknown_gains, reached)
    found = [*unmeasurable(evidence), *_still(evidence, robot, alone, passive), *ranges]
    low: list[Suspicion] = []
    if not any(suspicion.certain for suspicion in found):
        found += misread_torques(excerpts, evidence, robot)
        most = np.abs(evidence.tau).max(axis=0)
        # an equal limit may be a placeholder: first joints of a chain bear the following joints
        alike = robot.n_joints > 1 and np.ptp(robot.torque_limit) == 0
        if not (unknown_gains or alike):
            low = [*small(evidence, robot, "torque", most, robot.torque_limit)]
        found += low
    uneven: list[Suspicion] = []
    if not any(suspicion.certain for suspicion in found):  # otherwise no equations are needed
        clock = uneven = list(clock_suspicions(excerpts, evidence, robot, rate))
        # a common factor of all velocities gives a single suspicion, not further ones of speeds and
        # positions
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
        if not held and not wrong:
            held = list(stepping_torques(excerpts, evidence.moves))
        found += held
        found += () if clock or held else _noisy(excerpts)
    if not any(suspicion.certain for suspicion in found):
        if alone is None:
            found += _narrow(evidence, robot, reached)
        # stated rotor inertias contradict torques of another unit or side
        shown = evidence.moves & ~coarse(evidence) & (np.ptp(evidence.tau, axis=0) > 0)
        # accelerations of a wrong or uneven rate contradict any map
        if not (unknown_gains or low or uneven):
            misread_map = list(mechanical_suspicions(excerpts, robot, shown))
            # slow motions show too little in excerpts
            if misread_map and whole:
                misread_map = list(mechanical_suspicions(whole(), robot, shown))
            found += misread_map
    return sorted(found, key=lambda suspicion: (not suspicion.certain, suspicion.last))


def _still(
    evidence: Evidence, robot: Robot, alone: int | None, passive: Sequence[int]
) -> Iterator[Suspicion]:
    ways = np.ptp(evidence.q, axis=0)
    for joint, (way, moves) in enumerate(zip(ways, evidence.moves, strict=True)):
        at = ("joints", joint)
        torque = evidence.tau[:, joint]
        constant = np.ptp(torque) <= ROUNDED_OFF * np.abs(torque[0])
        if constant and moves and joint not in passive:
            without = ", or write torque: 0 if the joint has no motor" if not torque[0] else ""
            yield Suspicion(
                "still",
                (*at, "torque"),
                f"is {torque[0]:g} throughout; name the column of its torque{without}",
            )
        if not moves and (alone is None or joint == alone):
            moved = f"moves by only {way:.2g} {robot.position_unit(joint)}, within noise or the "
            moved += "effect of other joints"
            if way <= ROUNDED_OFF * np.abs(evidence.q[:, joint]).max():
                moved = "does not move"
            yield Suspicion(
                "still",
                (*at, "position"),
                f"{moved}: friction of joint {joint + 1} cannot be identified, and its torque is "
                "used only if neither a brake nor static friction carries the load; check column "
                "and unit",
                certain=alone is not None,
                last=alone is None,
            )
        # other joints may move by 2 % of the moving joint's distance, because servos yield
        if alone is not None and joint != alone and moves and way > 0.02 * ways[alone]:
            yield Suspicion(
                "still",
                ("kind",),
                f"joint {alone + 1} should move alone, but joint {joint + 1} moves "
                f"by {way:.3g} {robot.position_unit(joint)}; write kind: free, or choose other "
                "rows",
            )


def _narrow(
    evidence: Evidence, robot: Robot, reached: Callable[[], tuple[Array, Array]] | None
) -> list[Suspicion]:
    """Return a suspicion of ranges too small in the excerpts and in the whole recording."""
    widths = robot.q_max - robot.q_min
    found = [*small(evidence, robot, "position", np.ptp(evidence.q, axis=0), widths)]
    if found and reached:
        found = [*small(evidence, robot, "position", np.ptp(reached(), axis=0), widths)]
    return found


def _held(excerpts: Sequence[Excerpt], evidence: Evidence) -> Iterator[Suspicion]:
    """Yield suspicions of columns that repeat the previous row while the joint moves."""
    for joint in np.flatnonzero(evidence.moves).tolist():
        moving = fast_steps([each.q[:, joint] for each in excerpts])
        torques = [each.tau[:, joint] for each in excerpts]
        if bounds := saturated(torques, moving):
            yield Suspicion(
                "still",
                ("joints", joint, "torque"),
                f"is exactly {' or '.join(f'{bound:.6g}' for bound in bounds)} in "
                f"{100 * sum(bounds.values()):.0f} % of the rows in which joint {joint + 1} moves, "
                "and never beyond: saturated by a limit of the drive, a filter or the recorder; "
                "raise this limit, record slower motion, or choose rows without these",
                certain=False,
                first=True,
            )
            continue
        for key, name in (("position", "q"), ("velocity", "qd"), ("torque", "tau")):
            if share := repeats([getattr(each, name)[:, joint] for each in excerpts], moving):
                yield Suspicion(
                    "still",
                    ("joints", joint, key),
                    f"repeats the value of the previous row in {100 * share:.0f} % of the rows "
                    f"in which joint {joint + 1} moves: a held signal, new every "
                    f"{1.0 / (1.0 - share):.2g} rows and delayed by half of that on average; "
                    "record it at the rate of the others, or keep only rows with new values",
                    certain=False,
                )


def coarse(evidence: Evidence) -> Mask:
    """Return joints with more than half of the acceleration's power from noise of the position."""
    return np.asarray(evidence.noise_share > np.sqrt(0.5))


def _noisy(excerpts: Sequence[Excerpt]) -> Iterator[Suspicion]:
    """Yield a suspicion of positions whose noise lowers the identified inertias.

    Noise has the share of the accelerations' power by which least squares lowers inertias, in the
    band of frequencies that identification uses, over the excerpts with motion of a joint.
    """
    moves, period = moving_in([each.extent for each in excerpts]), excerpts[0].period
    spectra = [
        (axis, spectrum(excerpts[k].q[:, axis], period)) for k, axis in np.argwhere(moves).tolist()
    ]
    cut_off, _ = cut_off_of([bandwidth(*each, period) for _, each in spectra], period, None)
    band = band_of(cut_off)
    powers = np.zeros((2, moves.shape[1]))  # of the noise, and of all
    for axis, (f, power) in spectra:
        weight = ((2 * np.pi * f) ** 2 / (1 + (f / band) ** (2 * ORDER))) ** 2
        powers[:, axis] += weight.sum() * floor(f, power, period), weight @ power
    shares = powers[0] / np.maximum(powers[1], np.finfo(float).tiny)
    if shares.max(initial=0.0) > LOWERED:
        poor = np.flatnonzero(shares > LOWERED).tolist()
        yield Suspicion(
            "velocity",
            ("joints", poor[0], "position"),
            f"noise of positions is {100 * shares.max():.2g} % of the accelerations up to "
            f"{band:.2g} Hz, those that identification uses, at most {100 * LOWERED:g} % allowed "
            f"(joints {', '.join(str(axis + 1) for axis in poor)}): inertias are lowered by as "
            "much; record the encoder's full resolution, or faster motion",
            certain=False,
        )
