"""The methods by name, from recordings of free motions to an estimate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from hil.errors import NotEnoughData
from hil.estimation.estimate import Estimate, LeftOut
from hil.estimation.free_motion.accumulation import accumulate, division
from hil.estimation.free_motion.bias_test import bias_test
from hil.estimation.free_motion.choice import choose, without_choice
from hil.estimation.free_motion.description import (
    axis_friction,
    coupled_friction,
    dead_zone,
    remarks,
    residuals,
)
from hil.estimation.free_motion.first_estimate import first_estimate
from hil.estimation.free_motion.gains import effect_of_gains
from hil.estimation.free_motion.positive import least_inertia
from hil.estimation.free_motion.result import FreeMotionFit
from hil.estimation.free_motion.settings import processing_of
from hil.estimation.free_motion.solution import solve
from hil.estimation.free_motion.survey import configurations, survey
from hil.model.base_parameters import base_parameters
from hil.planning.free_motion import FreeMotion

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from hil.estimation.free_motion.solution import Solution, Solver
    from hil.estimation.free_motion.survey import Survey
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]

DEFAULT = "free motion"


@dataclass(frozen=True, slots=True)
class Variant:
    """One method.

    Attributes
    ----------
    solver : str
        See `hil.estimation.free_motion.solution`.
    terms : {"chosen", "classical"}
        Whether law of friction and dead zone are chosen, or friction is Coulomb's and viscous at
        all speeds.
    weighted : bool
        Rows of an axis by its residual variance.
    """

    solver: Solver = "least squares"
    terms: Literal["chosen", "classical"] = "classical"
    weighted: bool = True


VARIANTS: dict[str, Variant] = {
    DEFAULT: Variant(solver="positive", terms="chosen"),
    "least squares": Variant(weighted=False),
    "weighted least squares": Variant(),
    "instrumental variables": Variant(solver="instrumental"),
    "total least squares": Variant(solver="total"),
    "robust": Variant(solver="robust"),
}
"""All methods for free motions."""


class FreeMotions:
    """Free motions among recordings, again and again, one at a time.

    Raises
    ------
    NotEnoughData
        There are none.
    """

    none: ClassVar[str] = (
        "no free motions among the recordings; import some with hil import, or leave --method out"
    )

    def __init__(self, recorded: Iterable[tuple[RecordedMotion, Recording]]) -> None:
        # what can be read but once is kept; a run is read anew each time
        self._recorded = list(recorded) if isinstance(recorded, Iterator) else recorded
        if not any(True for _ in self):
            raise NotEnoughData(self.none)

    def __iter__(self) -> Iterator[tuple[FreeMotion, Recording]]:
        for motion, recording in self._recorded:
            if isinstance(motion, FreeMotion):
                yield motion, recording


def fit_free_motions(
    robot: Robot, recorded: Iterable[tuple[RecordedMotion, Recording]], name: str = DEFAULT
) -> Estimate:
    """Identify base parameters and friction.

    Parameters
    ----------
    robot : Robot
    recorded : iterable of (RecordedMotion, Recording)
        Others than free motions are left out. An iterator is read into memory; anything else is
        iterated several times.
    name : str
        One of `VARIANTS`.

    Raises
    ------
    NotEnoughData
        No free motions, or too short ones.
    NotIdentifiable
        Base parameters that the motions do not excite.
    """
    variant, motions = VARIANTS[name], FreeMotions(recorded)
    found = survey(motions)
    processing, reason = processing_of(found)
    first = first_estimate(robot, found, processing)
    divided = division(processing, found.stretches, found.duration)
    products = accumulate(
        robot,
        (recording for _, recording in motions),
        processing,
        divided,
        first,
        instruments=variant.solver == "instrumental",
    )
    chosen = variant.terms == "chosen"
    choice = choose(products) if chosen else without_choice(products, weighted=variant.weighted)
    visited = configurations(found)
    solution = solve(robot, products, choice, variant.solver, visited)
    plain = solve(
        robot, products, without_choice(products, weighted=True), "least squares", visited
    )
    rms, relative, overall = residuals(products, solution)
    n = len(base_parameters(robot))
    fit = FreeMotionFit(
        cut_off=processing.cut_off,
        band=processing.band,
        cut_off_reason=reason,
        dead_zone=dead_zone(choice),
        recorded_velocity=tuple(int(k) + 1 for k in np.flatnonzero(processing.recorded_velocity)),
        axes=axis_friction(solution, plain, choice, processing, products.n_shared),
        coupled=coupled_friction(robot, solution),
        relative_residual=tuple(None if np.isnan(r) else float(r) for r in relative),
        overall_residual=overall,
        bias_test=bias_test(robot, found, processing, choice, first),
        least_inertia=least_inertia(robot, solution.x[:n], visited),
        remarks=remarks(robot, products, solution, found),
    )
    gains = effect_of_gains(robot, products, choice, n)
    return _estimate(name, solution, found, rms, fit, gains)


def _estimate(
    name: str, solution: Solution, found: Survey, rms: Array, fit: FreeMotionFit, gains: Array
) -> Estimate:
    n = len(gains)
    return Estimate(
        method=name,
        p=solution.x[:n],
        covariance=solution.covariance[:n, :n],
        degrees_of_freedom=solution.degrees_of_freedom[:n],
        drive_covariance=gains @ gains.T,
        drive_effect=gains,
        residual=rms,
        condition={"all": solution.condition},
        local=(),
        left_out=tuple(LeftOut(each, "too few samples") for each in found.too_short),
        n_measurements=found.n_recordings,
        free=fit,
    )
