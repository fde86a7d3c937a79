"""Identify base parameters and friction from free motions, by method name."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.estimate import Estimate, LeftOut
from hil.estimation.free_motion.bias_test import bias_test
from hil.estimation.free_motion.choice import classical_choice
from hil.estimation.free_motion.description import (
    Residuals,
    axis_friction,
    compliances,
    coupled_friction,
    dead_zone,
    driving_axes,
    remarks,
    repeated_torques,
    torque_lags,
)
from hil.estimation.free_motion.gathering import gather, gather_rates, rate_regressions
from hil.estimation.free_motion.positive import least_inertia
from hil.estimation.free_motion.result import FreeMotionFit
from hil.estimation.free_motion.scaling import found_gains
from hil.estimation.free_motion.solution import settled, solve
from hil.estimation.free_motion.survey import configurations
from hil.estimation.free_motion.variants import DEFAULT, VARIANTS
from hil.estimation.options import DEFAULTS
from hil.least_squares.balance import balance
from hil.least_squares.layout import embedded
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.estimation.free_motion.gathering import Gathered
    from hil.estimation.free_motion.solution import FreeSolver, Solution
    from hil.estimation.options import Options
    from hil.model.robot import Robot
    from hil.runs.recording import Recorded

FEW = "too few samples"


def fit_free_motions(
    robot: Robot,
    recorded: Recorded,
    name: str = DEFAULT,
    options: Options = DEFAULTS,
) -> Estimate:
    """Identify base parameters and friction from free motions.

    Parameters
    ----------
    robot : Robot
    recorded : iterable of (RecordedMotion, Recording)
        Recordings; only free motions are used. An iterator is read into memory; anything else is
        iterated several times.
    name : str
        One of `VARIANTS`.
    options : Options
        Friction law, and nuisances to be estimated.

    Raises
    ------
    NotEnoughData
        No free motions, or too short ones.
    NotIdentifiable
        Base parameters are not excited, or not determined with unknown gains.
    Mismatch
        The gain of an axis is known in some motions and unknown in others.
    """
    variant = VARIANTS[name]
    if name != DEFAULT:
        gathered = gather(robot, recorded, variant, options)
        return estimate_from(robot, name, variant.solver, gathered, options)
    rates = gather_rates(robot, recorded, variant, options)
    fastest = estimate_from(robot, name, variant.solver, rates[0], options)
    return fastest if len(rates) == 1 else _combine_rates(robot, fastest, rates, options)


def _combine_rates(
    robot: Robot, fastest: Estimate, rates: Sequence[Gathered], options: Options
) -> Estimate:
    """Estimate from recordings of several rates, with friction and settings of the fastest."""
    names = base_parameters(robot).names
    joint, n = balance(rate_regressions(rates), names).whole, len(names)
    fit = joint.regression.fit(options.covariance, joint.cells)
    beside = embedded(joint.beside, np.arange(n), len(fit.x))
    fit = replace(fit, covariance=fit.covariance + beside)
    visited = np.vstack([configurations(rate.found) for rate in rates])
    solution = settled(robot, joint.regression, fit, visited, options.prior)
    return replace(
        fastest,
        p=solution.fit.x[:n],
        covariance=solution.fit.covariance[:n, :n],
        degrees_of_freedom=fit.degrees_of_freedom[:n],
        effect=joint.effect,
        prior_share=solution.prior_share,
        details=fastest.details.model_copy(update={"not_identified": _names(robot, solution)}),
        left_out=tuple(LeftOut(each, FEW) for rate in rates for each in rate.found.too_short),
        n_measurements=sum(rate.found.n_recordings for rate in rates),
    )


def _names(robot: Robot, solution: Solution) -> tuple[str, ...]:
    return tuple(base_parameters(robot).names[k] for k in solution.lost)


def estimate_from(
    robot: Robot,
    name: str,
    solver: FreeSolver,
    gathered: Gathered,
    options: Options = DEFAULTS,
) -> Estimate:
    """Estimate base parameters and friction from gathered recordings.

    Raises
    ------
    NotIdentifiable
        Base parameters are not excited, or gains not determined precisely enough.
    """
    found, scaling, choice = gathered.found, gathered.scaling, gathered.choice
    processing, products = gathered.processing, gathered.products
    visited = configurations(found)
    solution = solve(robot, products, choice, solver, visited, found.still, options)
    classical = classical_choice(products, weighted=True)
    plain = solve(robot, products, classical, "least squares", visited, found.still, options).fit
    fit, n = solution.fit, len(gathered.first)
    left = Residuals.compute(gathered, products, fit)
    details = FreeMotionFit(
        cut_off=processing.cut_off,
        band=processing.band,
        cut_off_reason=gathered.reasons.cut_off,
        dead_zone=dead_zone(choice),
        recorded_velocity=tuple(int(k) + 1 for k in np.flatnonzero(processing.recorded_velocity)),
        velocity_reasons=gathered.reasons.velocities,
        axes=axis_friction(fit, plain, gathered, products),
        coupled=coupled_friction(robot, fit),
        relative_residual=left.relative,
        overall_residual=left.overall,
        naive_residual=left.naive,
        repeated=repeated_torques(found.stretches),
        blocks=products.n_pieces,
        still=tuple(axis + 1 for axis in found.still),
        rest={axis + 1: float(found.rest[axis]) for axis in found.still},
        driving=driving_axes(fit),
        unusual=tuple(axis + 1 for axis in solution.unusual),
        not_identified=_names(robot, solution),
        bias_test=bias_test(robot, gathered.stretches, scaling, choice, gathered.first),
        least_inertia=least_inertia(robot, fit.x[:n], visited),
        remarks=remarks(
            robot, products, solution, found, plain.condition, left.torque, processing.held
        ),
        gains=found_gains(robot, scaling, fit),
        lag=torque_lags(gathered),
        compliance=compliances(robot, processing.soft, fit),
    )
    return Estimate(
        method=name,
        p=fit.x[:n],
        covariance=fit.covariance[:n, :n],
        degrees_of_freedom=fit.degrees_of_freedom[:n],
        effect=gathered.effect,
        stated=robot.stated_uncertainty,
        residual=left.rms,
        condition={"all": plain.condition},
        local=(),
        left_out=tuple(LeftOut(each, FEW) for each in found.too_short),
        n_measurements=found.n_recordings,
        prior_share=solution.prior_share,
        edges=gathered.edges,
        friction_law=details.law,
        details=details,
    )
