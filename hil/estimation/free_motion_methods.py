"""The methods by name, from recordings of free motions to an estimate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.estimate import Estimate, LeftOut
from hil.estimation.free_motion.bias_test import bias_test
from hil.estimation.free_motion.choice import without_choice
from hil.estimation.free_motion.description import (
    axis_friction,
    coupled_friction,
    dead_zone,
    driving_axes,
    remarks,
    residuals,
    torque_lags,
)
from hil.estimation.free_motion.gains import effect_of_gains
from hil.estimation.free_motion.gathering import gather
from hil.estimation.free_motion.positive import least_inertia
from hil.estimation.free_motion.result import FreeMotionFit
from hil.estimation.free_motion.solution import solve
from hil.estimation.free_motion.survey import configurations
from hil.estimation.free_motion.unknown_gains import found_gains
from hil.estimation.free_motion.variants import DEFAULT, VARIANTS
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from hil.estimation.free_motion.gathering import Gathered
    from hil.estimation.free_motion.solution import Solution, Solver
    from hil.estimation.free_motion.survey import Survey
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]


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
        Base parameters that the motions do not excite, or that unknown gains leave open.
    Mismatch
        The gain of an axis is known in some motions and unknown in others.
    """
    variant = VARIANTS[name]
    return estimate_from(robot, name, variant.solver, gather(robot, recorded, variant))


def estimate_from(robot: Robot, name: str, solver: Solver, gathered: Gathered) -> Estimate:
    """Solve for base parameters and friction of recordings that are gathered.

    Raises
    ------
    NotIdentifiable
        Base parameters that the motions do not excite, or gains that they hardly fix.
    """
    found, scaling, choice = gathered.found, gathered.scaling, gathered.choice
    processing, products = gathered.processing, gathered.products
    visited = configurations(found)
    solution = solve(robot, products, choice, solver, visited)
    plain = solve(
        robot, products, without_choice(products, weighted=True), "least squares", visited
    )
    left = residuals(products, solution)
    n = len(base_parameters(robot))
    fit = FreeMotionFit(
        cut_off=processing.cut_off,
        band=processing.band,
        cut_off_reason=gathered.reasons.cut_off,
        dead_zone=dead_zone(choice),
        recorded_velocity=tuple(int(k) + 1 for k in np.flatnonzero(processing.recorded_velocity)),
        velocity_reasons=gathered.reasons.velocities,
        axes=axis_friction(solution, plain, gathered, products, n),
        coupled=coupled_friction(robot, solution),
        relative_residual=_shares(left.relative),
        overall_residual=left.overall,
        naive_residual=_shares(left.naive),
        blocks=len(products.pieces),
        still=tuple(axis + 1 for axis in found.still),
        driving=driving_axes(solution, products.n_shared, robot.n_joints),
        unusual=tuple(axis + 1 for axis in solution.unusual),
        bias_test=bias_test(robot, found, processing, scaling, choice, gathered.first),
        least_inertia=least_inertia(robot, solution.x[:n], visited),
        remarks=remarks(robot, products, solution, found, plain.condition),
        gains=found_gains(robot, scaling, solution),
        lag=torque_lags(gathered),
    )
    gains = effect_of_gains(robot, gathered.recorded, scaling, choice, n)
    return _estimate(name, solution, found, left.rms, fit, gains, plain.condition)


def _shares(x: Array) -> tuple[float | None, ...]:
    return tuple(None if np.isnan(each) else float(each) for each in x)


def _estimate(
    name: str,
    solution: Solution,
    found: Survey,
    rms: Array,
    fit: FreeMotionFit,
    gains: Array,
    condition: float,
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
        condition={"all": condition},
        local=(),
        left_out=tuple(LeftOut(each, "too few samples") for each in found.too_short),
        n_measurements=found.n_recordings,
        free=fit,
    )
