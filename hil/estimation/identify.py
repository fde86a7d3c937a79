"""Select the identification method by name, or by the kinds of the recordings.

Two-step methods take measurements (`two_step_methods`), the others imported motions
(`free_motion_methods`, and for recordings back and forth `back_and_forth`).

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
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.errors import Mismatch, NotEnoughData, NotIdentifiable, UnknownName
from hil.estimation.back_and_forth import NAME, goes_back_and_forth
from hil.estimation.back_and_forth import NAME as BACK_AND_FORTH
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
from hil.estimation.free_motion.gathering import gather_rates, rate_regressions
from hil.estimation.free_motion.scaling import found_gains
from hil.estimation.free_motion.variants import DEFAULT, VARIANTS
from hil.estimation.intervals import MANY
from hil.estimation.options import COVARIANCES, DEFAULTS, NUISANCES
from hil.estimation.two_step_methods import (
    fill_reached_limits,
    fit_improved,
    fit_published,
    joint,
    measured,
    prepare,
)
from hil.friction.law import FrictionLaw
from hil.friction.terms import LAWS
from hil.least_squares.balance import Kind, balance
from hil.model.base_parameters import base_parameters
from hil.planning.free_motion import FreeMotion

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.estimation.options import Options
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.runs.recording import Recorded

    Identify = Callable[[Robot, Recorded, Options], Estimate]
    from hil.estimation.back_and_forth.halves import Halves
    from hil.least_squares.regression import Covariance


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


def _free_motion(name: str) -> Identify:
    def identify(robot: Robot, recorded: Recorded, options: Options) -> Estimate:
        # spectra and filters take half a second to import, and measurements do not use them
        from hil.estimation.free_motion_methods import fit_free_motions  # noqa: PLC0415

        return fit_free_motions(robot, recorded, name, options)

    return identify


def _joint(robot: Robot, recorded: Recorded, options: Options) -> Estimate:
    from hil.estimation.identify import fit_joint  # noqa: PLC0415 - slow import

    return fit_joint(robot, recorded, options)


def _back_and_forth(robot: Robot, recorded: Recorded, options: Options) -> Estimate:
    from hil.estimation.identify import fit_back_and_forth  # noqa: PLC0415 - slow import

    # friction is estimated without a law, and gears are rigid
    return fit_back_and_forth(robot, recorded, options.covariance)


JOINT = "joint"
"""Name of the method for recordings of several kinds."""
METHODS: dict[str, Identify] = {
    "improved": fit_improved,
    "published": fit_published,
    JOINT: _joint,
    BACK_AND_FORTH: _back_and_forth,
    **{name: _free_motion(name) for name in VARIANTS},
}
"""Methods by name: two-step methods, the method for recordings of several kinds, and methods for
imported motions."""


class Effective(NamedTuple):
    """Option values with an effect on a method; names as in `Options`."""

    friction: tuple[str, ...] = ("auto",)
    nuisance: tuple[str, ...] = ()
    covariance: tuple[str, ...] = ("jackknife",)


EFFECTIVE = {
    "improved": Effective(nuisance=("lag", "compliance"), covariance=COVARIANCES),
    JOINT: Effective(("auto", *LAWS), NUISANCES, COVARIANCES),
    BACK_AND_FORTH: Effective(covariance=COVARIANCES),
    DEFAULT: Effective(("auto", *LAWS), NUISANCES, COVARIANCES),
}
"""Effective option values by method; the default for methods not listed is that of `Effective`."""
RIVALS = (
    "methods for comparison run from the repository: python -m benchmarks.rivals RUN --method NAME"
)
"""Hint to methods of earlier versions, kept for comparison only."""


def default_method(motions: Sequence[RecordedMotion]) -> tuple[str, str]:
    """Return the default method for measurements or recorded motions, with the reason."""
    free = sum(isinstance(motion, FreeMotion) for motion in motions)
    alone = sum(map(goes_back_and_forth, motions))
    unknown = any(isinstance(each, FreeMotion) and each.unknown_gains for each in motions)
    if motions and alone == len(motions) and not unknown:
        return BACK_AND_FORTH, "all recordings are strokes of a single axis"
    if motions and free == len(motions):
        reason = "all recordings are imported"
        if alone and not unknown:
            reason += (
                f"; for {alone} recordings with strokes of a single axis, --method "
                f"'{BACK_AND_FORTH}' estimates friction without a friction law"
            )
        return DEFAULT, reason
    if free:
        return JOINT, (
            f"{len(motions) - free} of {len(motions)} recordings were measured by hil run"
        )
    return "improved", "all recordings were measured by hil run"


def estimate(
    robot: Robot, recorded: Recorded, method: str = "improved", options: Options = DEFAULTS
) -> Estimate:
    """Identify the base parameters of `robot`.

    Parameters
    ----------
    robot : Robot
    recorded : iterable of (RecordedMotion, Recording)
    method : str
        One of `METHODS`.
    options : Options

    Raises
    ------
    UnknownName
        The method does not exist.
    NotIdentifiable
        Base parameters are not excited by the measurements.
    NotEnoughData
        A method for free motions without free motions.
    Mismatch
        See `refuse_without_effect`.
    """
    refuse_without_effect(method, options)
    return METHODS[method](robot, recorded, options)


def restrict(method: str, options: Options) -> Options:
    """Return options without friction laws and nuisances that have no effect on a method."""
    friction, nuisance, _ = EFFECTIVE[method]
    return replace(
        options,
        friction=options.friction if options.friction in friction else DEFAULTS.friction,
        nuisance=tuple(name for name in options.nuisance if name in nuisance),
    )


def refuse_without_effect(method: str, options: Options) -> None:
    """Raise an error for options without effect on a method.

    Raises
    ------
    UnknownName
        The method does not exist, or accepts no prior.
    Mismatch
        Friction, nuisance or covariance without effect; the message lists effective values.
    """
    if options.prior is not None and method in (BACK_AND_FORTH, "published"):
        raise UnknownName(
            f"method {method!r}: takes no prior; omit --prior, or use --method improved, or "
            f"'{DEFAULT}' for imports"
        )
    if method not in METHODS:
        raise UnknownName(f"method {method!r} must be one of: {'; '.join(METHODS)}; {RIVALS}")
    for option, effective in EFFECTIVE.get(method, Effective())._asdict().items():
        asked = getattr(options, option)
        if asked == getattr(DEFAULTS, option):
            continue
        values = (asked,) if isinstance(asked, str) else asked
        if without := [value for value in values if value not in effective]:
            known = ", ".join(effective) or "none"
            raise Mismatch(
                f"{option} {without[0]!r} has no effect on method {method!r} (with an effect: "
                f"{known}); omit the option"
            )
