"""The method by name, from recordings back and forth to an estimate."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from hil.errors import NotEnoughData, NotIdentifiable
from hil.estimation.back_and_forth.description import combinations, remarks, residuals
from hil.estimation.back_and_forth.friction_curve import friction_curves
from hil.estimation.back_and_forth.half_sums import half_sums
from hil.estimation.back_and_forth.halves import halves_of
from hil.estimation.back_and_forth.recognition import NAME, goes_back_and_forth
from hil.estimation.back_and_forth.result import BackAndForthFit
from hil.estimation.back_and_forth.settings import speeds_of
from hil.estimation.back_and_forth.solution import solve
from hil.estimation.estimate import Estimate, LeftOut
from hil.estimation.free_motion.gathering import FreeMotions
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from hil.estimation.back_and_forth.halves import Halves
    from hil.estimation.back_and_forth.solution import Solution
    from hil.model.robot import Robot
    from hil.planning.free_motion import FreeMotion
    from hil.planning.measurement import RecordedMotion
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]


class BackAndForth(FreeMotions):
    """Recordings of axes that move back and forth, again and again, one at a time.

    Raises
    ------
    NotEnoughData
        There are none.
    """

    none: ClassVar[str] = (
        "no axis that moves back and forth by itself among the recordings; import some with kind:"
        " {back_and_forth: JOINT} in the map, or leave --method out"
    )

    def __iter__(self) -> Iterator[tuple[FreeMotion, Recording]]:
        return (each for each in super().__iter__() if goes_back_and_forth(each[0]))

    @property
    def others(self) -> list[LeftOut]:
        """Recordings that are passed over."""
        return [
            LeftOut(motion.id, "no axis that moves back and forth by itself; this method takes"
                               " no other recordings")
            for motion, _ in self._recorded
            if not goes_back_and_forth(motion)
        ]  # fmt: skip


def fit_back_and_forth(
    robot: Robot, recorded: Iterable[tuple[RecordedMotion, Recording]]
) -> Estimate:
    """Identify base parameters, and read friction off, without a law of friction.

    Parameters
    ----------
    robot : Robot
    recorded : iterable of (RecordedMotion, Recording)
        Others than of an axis that moves back and forth by itself are left out, and named so.

    Raises
    ------
    NotEnoughData
        No pair of strokes is of use.
    NotIdentifiable
        Strokes that show no base parameter.
    """
    motions = BackAndForth(recorded)
    recordings, left_out = _condensed(robot, motions)
    solution = solve(robot, recordings)
    _require_something(recordings, solution)
    rms, relative, overall = residuals(robot, recordings, solution)
    names = base_parameters(robot).names
    fit = BackAndForthFit(
        cut_off=(
            min(each.cut_off for each in recordings),
            max(each.cut_off for each in recordings),
        ),
        cut_off_reason=recordings[0].cut_off_reason,
        pairs=sum(each.n_pairs for each in recordings),
        curves=friction_curves(robot, recordings, solution),
        relative_residual=relative,
        overall_residual=overall,
        not_identified=tuple(names[k] for k in solution.excitation.lost),
        combinations=combinations(robot, solution),
        remarks=remarks(robot, recordings, solution),
    )
    n = len(names)
    effect = np.hstack([solution.of_torque, -solution.of_motor])[:n]
    drives, usual = effect * robot.stated_uncertainty, effect * robot.usual_uncertainty
    return Estimate(
        method=NAME,
        p=solution.x[:n],
        covariance=solution.covariance[:n, :n],
        degrees_of_freedom=solution.degrees_of_freedom[:n],
        drive_covariance=drives @ drives.T,
        drive_effect=drives,
        residual=rms,
        condition={"all": solution.condition},
        local=(),
        left_out=(*left_out, *motions.others),
        n_measurements=len(recordings),
        back_and_forth=fit,
        half_sums=half_sums(robot, recordings, solution),
        combination=solution.excitation.combination,
        usual_covariance=usual @ usual.T,
    )


def _condensed(robot: Robot, motions: BackAndForth) -> tuple[list[Halves], list[LeftOut]]:
    """All recordings of which pairs are of use, and what is left out of the others."""
    found, left_out, speed = [], [], speeds_of(robot, motions)
    for motion, recording in motions:
        if motion.unknown_gains:
            axes = ", ".join(map(str, motion.unknown_gains))
            raise NotIdentifiable(
                f"{motion.id}: the gain of axis {axes} is unknown, which half-sums do not show;"
                " state it in the map, or identify by --method 'free motion'"
            )
        try:
            halves = halves_of(robot, motion, recording, speed)
        except NotEnoughData as error:
            left_out.append(LeftOut(motion.id, str(error)))
            continue
        found.append(halves)
        left_out += [LeftOut(motion.id, reason) for reason in halves.useless]
    if not found:
        raise NotEnoughData(f"no pair of strokes is of use: {'; '.join(map(str, left_out))}")
    return found, left_out


def _require_something(recordings: Sequence[Halves], solution: Solution) -> None:
    if not len(solution.excitation.kept):
        axes = ", ".join(str(axis + 1) for axis in sorted({each.axis for each in recordings}))
        raise NotIdentifiable(
            f"the strokes of axis {axes} show no base parameter; record other axes, or state in the"
            " robot file which link parameters are present"
        )
