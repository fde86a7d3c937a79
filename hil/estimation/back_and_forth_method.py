"""Identify base parameters and friction curves from recordings back and forth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotEnoughData, NotIdentifiable
from hil.estimation.back_and_forth import NAME, goes_back_and_forth
from hil.estimation.back_and_forth.description import (
    combinations,
    friction_curves,
    half_sums,
    remarks,
    residuals,
    samples,
)
from hil.estimation.back_and_forth.halves import halves_of
from hil.estimation.back_and_forth.result import BackAndForthFit
from hil.estimation.back_and_forth.solution import solve
from hil.estimation.estimate import Estimate, LeftOut
from hil.estimation.intervals import MANY
from hil.estimation.options import DEFAULTS
from hil.friction.law import FrictionLaw
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from hil.estimation.back_and_forth.halves import Halves
    from hil.least_squares.regression import Covariance
    from hil.model.robot import Robot
    from hil.runs.recording import Recorded

NONE = (
    "no strokes of a single axis among the recordings; import some with kind: "
    "{back_and_forth: JOINT} in the map, or omit --method"
)
OTHER = "no strokes of a single axis; this method uses no other recordings"


def fit_back_and_forth(
    robot: Robot,
    recorded: Recorded,
    covariance: Covariance = DEFAULTS.covariance,
) -> Estimate:
    """Identify base parameters and friction curves, without a friction law.

    Parameters
    ----------
    robot : Robot
    recorded : iterable of (RecordedMotion, Recording)
        Recordings; those of other motions than a single axis back and forth are skipped and listed.
    covariance : str
        Rule for the scatter over pairs (`hil.least_squares.regression`).

    Raises
    ------
    NotEnoughData
        No recording of a single axis back and forth, or no usable pair of strokes.
    NotIdentifiable
        No base parameter is excited by the strokes.
    """
    recordings, left_out = _condensed(robot, recorded)
    solution = solve(robot, recordings, covariance)
    fit, excited, names = solution.fit, solution.excitation, base_parameters(robot).names
    if not len(excited.kept):
        axes = ", ".join(str(axis + 1) for axis in sorted({each.axis for each in recordings}))
        raise NotIdentifiable(
            f"the strokes of axis {axes} identify no base parameter; record other axes, or state "
            "in the robot file which link parameters are present"
        )
    n, whole = len(names), samples(robot, recordings)
    left = residuals(whole, recordings, solution)
    cut_offs = [each.cut_off for each in recordings]
    return Estimate(
        method=NAME,
        p=fit.x[:n],
        covariance=fit.covariance[:n, :n],
        degrees_of_freedom=np.where(
            np.isin(np.arange(n), fit.kept), fit.degrees_of_freedom[:n], MANY
        ),
        effect=solution.effect[:n],
        stated=robot.stated_uncertainty,
        residual=np.where(left.torque > 0, left.rms, np.nan),
        condition={"all": fit.condition},
        local=(),
        left_out=tuple(left_out),
        n_measurements=len(recordings),
        friction_law=FrictionLaw.absent(robot.n_joints),
        details=BackAndForthFit(
            cut_off=(min(cut_offs), max(cut_offs)),
            cut_off_reason=recordings[0].cut_off_reason,
            pairs=sum(len(each.pairs) for each in recordings),
            curves=friction_curves(recordings, solution),
            relative_residual=left.relative,
            overall_residual=left.overall,
            not_identified=tuple(names[k] for k in excited.lost),
            combinations=combinations(robot, excited),
            remarks=tuple(remarks(robot, recordings, whole, solution, left)),
        ),
        half_sums=tuple(half_sums(each, solution) for each in recordings),
        combination=excited.combination,
    )


def _condensed(robot: Robot, recorded: Recorded) -> tuple[list[Halves], list[LeftOut]]:
    """Condense the recordings with usable pairs, and list the rejected ones."""
    found, others, useless = [], [], []
    for motion, recording in recorded:
        if not goes_back_and_forth(motion):
            others.append(LeftOut(motion.id, OTHER))
            continue
        if motion.unknown_gains:
            axes = ", ".join(map(str, motion.unknown_gains))
            raise NotIdentifiable(
                f"{motion.id}: the gain of axis {axes} is unknown and cannot be found from "
                "half-sums; state it in the map, or identify by --method 'free motion'"
            )
        try:
            halves = halves_of(robot, motion, recording)
        except NotEnoughData as error:
            useless.append(LeftOut(motion.id, str(error)))
            continue
        found.append(halves)
        useless += [LeftOut(motion.id, reason) for reason in halves.pairs.useless]
    if not (found or useless):
        raise NotEnoughData(NONE)
    if not found:
        raise NotEnoughData(f"no usable pair of strokes: {'; '.join(map(str, useless))}")
    return found, useless + others
