"""Identify base parameters and friction from imported motions, alone or with measurements.

The joint method fits measurements and imported recordings in one regression. Each kind is condensed
to blocks separately: strokes and trajectories with separate friction in each
(`hil.estimation.two_step_methods`), free motions with friction laws chosen on held-out pieces
(`hil.estimation.free_motion`). Base parameters have equal names in both, so the blocks add up to
one regression. Filters, rates and friction differ, so the torque of an axis is a separate channel
in each kind, with separate weight and friction; only the base parameters are shared. Unknown gains
of imports are estimated jointly, by Gauss-Newton from the values given by the parameters of the
strokes. The weight of a kind follows from leaving out its groups (`hil.least_squares.balance`).
Lags, compliances and drift are estimated in each kind separately.

Errors are estimated as for measurements alone (`hil.estimation.two_step_methods.measured`): from
leaving out groups, plus the further uncertainties of a kind's parameters, in proportion to the
kind's share in the joint parameters.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotEnoughData, NotIdentifiable
from hil.estimation.back_and_forth import NAME, goes_back_and_forth
from hil.estimation.back_and_forth.description import (
    combinations,
    friction_curves,
    half_sums,
    residuals,
    samples,
)
from hil.estimation.back_and_forth.description import remarks as stroke_remarks
from hil.estimation.back_and_forth.halves import halves_of
from hil.estimation.back_and_forth.result import BackAndForthFit
from hil.estimation.back_and_forth.solution import solve as solve_strokes
from hil.estimation.estimate import Estimate, LeftOut, covariance_of_drives
from hil.estimation.free_motion.accumulation import long_rests
from hil.estimation.free_motion.bias_test import bias_test, halves, noise_directions
from hil.estimation.free_motion.change import find_change
from hil.estimation.free_motion.choice import classical_choice, driving_axes
from hil.estimation.free_motion.description import (
    Residuals,
    axis_friction,
    compliances,
    coupled_friction,
    dead_zone,
    remarks,
    repeated_torques,
    silent_axes,
)
from hil.estimation.free_motion.gathering import gather, gather_rates, rate_regressions
from hil.estimation.free_motion.positive import least_inertia
from hil.estimation.free_motion.result import FreeMotionFit
from hil.estimation.free_motion.scaling import found_gains
from hil.estimation.free_motion.solution import settled, solve
from hil.estimation.free_motion.survey import configurations
from hil.estimation.free_motion.variants import DEFAULT, VARIANTS
from hil.estimation.intervals import MANY
from hil.estimation.options import DEFAULTS
from hil.estimation.two_step_methods import fill_reached_limits, joint, measured, prepare
from hil.friction.law import FrictionLaw, TermValue
from hil.least_squares.balance import Kind, balance
from hil.least_squares.layout import embedded
from hil.model.base_parameters import base_parameters
from hil.planning.free_motion import FreeMotion

if TYPE_CHECKING:
    from hil.estimation.back_and_forth.halves import Halves
    from hil.estimation.free_motion.gathering import Gathered
    from hil.estimation.free_motion.solution import FreeSolver, Solution
    from hil.estimation.options import Options
    from hil.least_squares.regression import Covariance
    from hil.model.robot import Robot
    from hil.runs.recording import Recorded

FEW = "too few samples"
NONE = (
    "no strokes of a single axis among the recordings; import some with kind: "
    "{back_and_forth: JOINT} in the map, or omit --method"
)
OTHER = "no strokes of a single axis; this method uses no other recordings"


def fit_free_motions(
    robot: Robot, recorded: Recorded, name: str = DEFAULT, options: Options = DEFAULTS
) -> Estimate:
    """Identify base parameters and friction from free motions.

    Parameters
    ----------
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
    if len(rates) == 1:
        return fastest
    # recordings of several rates together, with friction and settings of the fastest
    names = base_parameters(robot).names
    joint, n = balance(rate_regressions(rates), names).whole, len(names)
    fit = joint.regression.fit(options.covariance, joint.cells)
    beside = embedded(joint.beside, np.arange(n), len(fit.x))
    fit = replace(fit, covariance=fit.covariance + beside)
    visited = np.vstack([configurations(rate.found) for rate in rates])
    still = sorted(set.intersection(*({*rate.found.still} for rate in rates)))
    solution = settled(robot, joint.regression, fit, visited, options.prior, still)
    return replace(
        fastest,
        values=solution.fit.x[:n],
        scatter_covariance=solution.fit.covariance[:n, :n],
        drive_covariance=covariance_of_drives(robot, joint.effect),
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
    robot: Robot, name: str, solver: FreeSolver, gathered: Gathered, options: Options = DEFAULTS
) -> Estimate:
    """Estimate base parameters and friction from gathered recordings.

    Raises
    ------
    NotIdentifiable
        Base parameters are not excited, or gains not determined precisely enough.
    """
    found, scaling, choice = gathered.found, gathered.scaling, gathered.choice
    processing, products = gathered.processing, gathered.products
    visited, silent = configurations(found), silent_axes(gathered.stretches, found.still)
    both = halves(robot, gathered.stretches, scaling, choice, gathered.first)
    noise = noise_directions(both, len(gathered.first)) if both else None
    # axes that hardly move leave parameters without data, as axes at rest do
    of = visited, sorted({*found.still, *found.nearly_still}), options, noise
    try:
        solution = solve(robot, products, choice, solver, *of, silent=bool(silent))
    except NotIdentifiable as error:
        raise NotIdentifiable(". ".join([*silent, str(error)])) from error
    classical = classical_choice(products, weighted=True)
    plain = solve(robot, products, classical, "least squares", *of, silent=bool(silent)).fit
    fit, n = solution.fit, len(gathered.first)
    left = Residuals.compute(gathered, products, fit)
    lags = zip(gathered.processing.lag, gathered.lag_error, strict=True)
    details = FreeMotionFit(
        cut_off=processing.cut_off,
        band=processing.band,
        cut_off_reason=gathered.reasons.cut_off,
        dead_zone=dead_zone(choice),
        moving_only=processing.rests == "left out",
        recorded_velocity=tuple(int(k) + 1 for k in np.flatnonzero(processing.recorded_velocity)),
        velocity_reasons=gathered.reasons.velocities,
        axes=axis_friction(fit, plain, gathered, products),
        coupled=coupled_friction(robot, fit),
        relative_residual=left.relative,
        overall_residual=left.overall,
        naive_residual=left.naive,
        repeated=repeated_torques(gathered.stretches),
        blocks=products.n_pieces,
        still=tuple(axis + 1 for axis in found.still),
        rest={axis + 1: float(found.middle[axis]) for axis in found.still},
        driving=tuple(axis + 1 for axis in driving_axes(fit)),
        unusual=tuple(
            axis + 1
            for axis in solution.unusual
            # static friction of a long rest carries some of the load, like an offset
            if axis not in found.still and not any(long_rests(s, axis) for s in gathered.stretches)
        ),
        not_identified=_names(robot, solution),
        bias_test=bias_test(both, n) if both else None,
        least_inertia=least_inertia(robot, fit.x[:n], visited),
        remarks=(
            *silent,
            *remarks(
                robot, products, solution, found, plain.condition, left.torque, processing.held
            ),
        ),
        gains=found_gains(robot, scaling, fit),
        lag=tuple(TermValue(value=float(lag), standard_error=float(error)) for lag, error in lags),
        compliance=compliances(robot, processing.soft, fit),
        change=find_change(choice.fitted(products), found.duration),
    )
    return Estimate(
        robot=robot,
        method=name,
        values=fit.x[:n],
        scatter_covariance=fit.covariance[:n, :n],
        drive_covariance=covariance_of_drives(robot, gathered.effect),
        degrees_of_freedom=fit.degrees_of_freedom[:n],
        effect=gathered.effect,
        residual=left.rms,
        condition={"all": plain.condition},
        left_out=tuple(LeftOut(each, FEW) for each in found.too_short),
        n_measurements=found.n_recordings,
        prior_share=solution.prior_share,
        edges=gathered.edges,
        friction_law=details.law,
        details=details,
    )


def fit_back_and_forth(
    robot: Robot, recorded: Recorded, covariance: Covariance = DEFAULTS.covariance
) -> Estimate:
    """Identify base parameters and friction curves, without a friction law.

    Parameters
    ----------
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
    solution = solve_strokes(robot, recordings, covariance)
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
        robot=robot,
        method=NAME,
        values=fit.x[:n],
        scatter_covariance=fit.covariance[:n, :n],
        drive_covariance=covariance_of_drives(robot, solution.effect[:n]),
        degrees_of_freedom=np.where(
            np.isin(np.arange(n), fit.kept), fit.degrees_of_freedom[:n], MANY
        ),
        effect=solution.effect[:n],
        residual=np.where(left.torque > 0, left.rms, np.nan),
        condition={"all": fit.condition},
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
            remarks=tuple(stroke_remarks(robot, recordings, whole, solution, left)),
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


def fit_joint(robot: Robot, recorded: Recorded, options: Options = DEFAULTS) -> Estimate:
    """Identify base parameters jointly from recordings of several kinds.

    Raises
    ------
    NotEnoughData, NotIdentifiable
        See the methods of each kind.
    """
    own = (each for each in recorded if not isinstance(each[0], FreeMotion))
    raw, unusable = prepare(own)
    robot = fill_reached_limits(robot, raw)
    found, names = joint(robot, raw, options.nuisance), base_parameters(robot).names
    p = found.solver.solve()
    imported = gather_rates(robot, recorded, VARIANTS[DEFAULT], options, p)
    unknown = any(each.scaling.unknown for each in imported)
    # two Gauss-Newton rounds for unknown gains: first gains, from the parameters of strokes, have
    # errors of a few percent, and a round squares the error
    for _ in range(2 if unknown else 0):
        kinds = [Kind(found.solver.regression), *rate_regressions(imported)]
        fit = balance(kinds, names).whole.regression.fit("white")
        imported = [each.rescaled(fit) for each in imported]
    estimate, fit = measured(robot, raw, unusable, found, options, rate_regressions(imported))
    return replace(
        estimate,
        gains=tuple(gain for each in imported for gain in found_gains(robot, each.scaling, fit)),
        n_measurements=len(raw) + sum(each.found.n_recordings for each in imported),
        edges=(*estimate.edges, *(edge for each in imported for edge in each.edges)),
    )
