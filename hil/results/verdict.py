"""Rules for judging an identification by its model alone.

Rules are applied in order. Causes found in the recordings (`hil.estimation.excluded`) come before
the parameters' uncertainty, which is valid only for a correct model.
"""

from __future__ import annotations

import itertools
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.excluded.causes import CAUSES
from hil.estimation.free_motion.offsets import ASYMMETRY
from hil.estimation.free_motion.result import FEW_BLOCKS, POOR, FreeMotionFit
from hil.estimation.options import ACCURACY
from hil.model.base_parameters import base_parameters
from hil.model.frames import ROUNDED_OFF
from hil.results.judgement import (
    FEWEST,
    HALF,
    LARGE,
    TOLERANCE,
    WORDS,
    Judgement,
    Reservation,
    When,
    doubtful,
    failed,
    good,
    reservations,
)
from hil.results.possible import impossible_inertias, impossible_links
from hil.results.prediction import free_torques, uncertainty
from hil.results.residual import unexplained
from hil.runs.journal import FIRST, LAST
from hil.show.rounding import above, significant, uncertain, unit

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from hil.arrays import Array
    from hil.estimation.excluded.result import Limit
    from hil.estimation.intervals import Edge
    from hil.model.robot import Robot
    from hil.results.judgement import Rule
    from hil.results.model import Model
    from hil.results.possible import Impossible


def verdict(model: Model, accuracy: float = ACCURACY) -> Judgement:
    """Judge a model alone: return the worst objection, found causes first.

    Parameters
    ----------
    accuracy : float
        Largest residual of a good model, as a share of the torque of a loaded axis.
    """
    left, limit = model.band_residual, model.robot.torque_limit
    own = isinstance(model.details, FreeMotionFit)
    large = tuple(unexplained(left, limit, accuracy, own_friction=own))
    late = tuple(_late(model, large))
    doubts = (
        *reservations(OF_MISTAKES, model), *_judge_edges(model), *(late if large else ()), *large,
        *reservations(OF_MODELS, model), *_judge_edges(model, excited=False),
    )  # fmt: skip
    doubts = *_first(model, doubts, large), *doubts
    found = doubts or tuple(_good(model))
    remains = *(() if large else late), *(() if left is None else (good(left.describe(limit)),))
    return Judgement.judge((*found, *remains), lambda: found[0])


def _found(model: Model) -> Iterator[Reservation]:
    """Yield objections due to found causes, except causes with a negligible effect on torques."""
    causes = model.excluded.found if model.excluded else ()
    free, relative = (free_torques(model), uncertainty(model)) if causes else (None, None)
    for cause in causes:
        # relative torque change of the worst axis by the correction; harmless below the torque's
        # standard error on all axes
        moved, harmless = 0.0, False
        if free is not None and cause.change is not None and relative is not None:
            by_axis = free.relative(free.rms(np.array(cause.change)), model.values)
            moved, harmless = float(by_axis.max()), bool((by_axis <= relative).all())
        unknown = cause.change is None and cause.left < HALF
        # torque ripple is not an error in a file: base parameters describe the remaining torque
        stated = cause.cause != "torque ripple"
        spoilt = CAUSES[cause.cause].whole or (stated and (unknown or moved > TOLERANCE))
        if CAUSES[cause.cause].accounted:  # part of the estimate and its covariance, where visible
            yield good(str(cause), cause.remedy)
        elif spoilt or not harmless:
            yield (failed if spoilt else doubtful)(str(cause), cause.remedy)


def _unexplained(
    fit: FreeMotionFit, in_motion: Array | None, warnings: Sequence[str] = ()
) -> Reservation | None:
    """Return an objection to a residual of free motions close to that of a constant torque.

    Its reason is the import's, if one of its `warnings` is about a column of this joint.

    Static friction holds an axis at rest with any torque up to its limit, so a smaller residual
    `in_motion`, over the torque, counts instead; shape (n_joints,), NaN where unknown.
    """
    lefts = np.array(fit.relative_residual, dtype=float)
    lefts = (lefts if in_motion is None else np.fmin(lefts, in_motion)).tolist()
    pairs = zip(lefts, fit.naive_residual, strict=False)
    ratios = {}
    for axis, (left, naive) in enumerate(pairs, start=1):
        if np.isnan(left) or naive is None or axis in fit.still:
            continue
        if naive <= ROUNDED_OFF:
            return failed(
                f"axis {axis} moves, but its torque is constant",
                "name the column of its torque in the map",
            )
        ratios[axis] = left / naive
    worst = max(ratios, key=ratios.__getitem__, default=0)
    if not worst or ratios[worst] ** 2 <= HALF:
        return None
    reason = (
        f"axis {worst}: the model leaves {lefts[worst - 1]:.0%} of the torque "
        f"unexplained, a constant torque {fit.naive_residual[worst - 1]:.0%}"
    )
    share = fit.repeated[worst - 1] if fit.repeated else 0.0
    if lefts[worst - 1] < ACCURACY and share <= HALF:
        return doubtful(
            f"{reason}: its torque is almost constant",
            "add recordings in which the torque of this axis changes, or check its column",
        )
    of_joint = [x for x in warnings if f"joints.{worst - 1}." in x and LAST not in x]
    if of_joint and share <= HALF:
        warned = _warned(of_joint[0])
        return failed(f"{reason}; {warned.reason}", warned.remedy)
    if share <= HALF:
        return failed(
            reason, "check columns, signs and units of the recording, and the direction of gravity"
        )
    return failed(
        f"{reason}; {share:.0%} of its torques in fast motion are equal: a dead band or the "
        "resolution hides the torque",
        "record its torque without dead band and in finer steps, or motions with greater torques",
    )


def _impossible(model: Model) -> Iterator[Reservation]:
    """Return an objection to physically impossible inertias: such a model must not be used."""
    for each in impossible_inertias(model):
        if each.certain:
            yield failed(
                f"{_stated(each)}; it must be positive for every robot",
                "check signs, units, gear ratios and torque constants, in the map or the drives"
                " file, and in the robot file",
            )
        else:
            yield doubtful(
                f"{_stated(each)}: not positive definite, within its uncertainty",
                "add recordings with greater acceleration; hil export --to urdf writes the "
                "nearest physically consistent links",
            )
    for each in impossible_links(model):
        if each.certain:
            yield doubtful(
                f"{_stated(each)}, impossible for rigid links",
                "check gear ratios, rotor inertias and torque constants in the robot file, or state"
                " their uncertainty there",
            )


def _stated(each: Impossible) -> str:
    value, error = uncertain(each.value, each.error)
    of = "" if each.unit else "an eigenvalue of "
    return f"{each.what}: {of}{' '.join((f'{value} ± {error}', unit(each.unit))).strip()}"


def _doubted(model: Model) -> Iterator[Reservation]:
    """Yield unresolved warnings of imports, but for those of `_first` and of joints at rest."""
    for warning in model.provenance.warnings:
        if FIRST not in warning and LAST not in warning:
            yield _warned(warning)


def _resting(model: Model) -> Iterator[Reservation]:
    """Yield warnings of imports of joints at rest; other rules state the effect."""
    for warning in model.provenance.warnings:
        if LAST in warning:
            yield _warned(warning)


def _first(
    model: Model, others: Sequence[Reservation], large: Sequence[Reservation]
) -> Iterator[Reservation]:
    """Yield wrong times of rows and changes in time, as bad as the worst objection.

    A change explains `large` residuals and causes that leave more of the residual.
    """
    worst = max((each.word for each in others), key=WORDS.index, default="doubtful")
    for warning in model.provenance.warnings:
        if FIRST in warning:
            yield _warned(warning).model_copy(update={"word": worst})
    change = model.details.change if isinstance(model.details, FreeMotionFit) else None
    causes = model.excluded.found if model.excluded else ()
    if change and (large or causes) and all(each.left > change.left for each in causes):
        yield doubtful(
            f"the recordings change after some {change.after:.2g} s, as with a load, a tool or a "
            "setting from then on: separate fits before and after leave "
            f"{100 * change.left:.2g} % of the mean square error of axis {change.axis}",
            "import the rows before and after separately (rows in the map), or record anew",
        ).model_copy(update={"word": worst})


def _warned(warning: str) -> Reservation:
    reason, _, remedy = warning.partition("; ")
    return doubtful(f"import warned: {reason}", remedy)


def _judge_edges(model: Model, *, excited: bool = True) -> Iterator[Reservation]:
    """Yield estimates at the edge of the search range; the true value may be beyond the edge.

    Edges of axes that the recordings do not excite come from there: they are yielded apart.
    """
    relative = uncertainty(model) if model.edges else None
    alike: dict[tuple[object, ...], list[Edge]] = {}
    for each in model.edges:
        alike.setdefault((each.what, each.value, each.bound), []).append(each)
    for edges in alike.values():
        first, axes = edges[0], [each.axis for each in edges]
        known = relative is None or bool((relative[np.subtract(axes, 1)] <= TOLERANCE).any())
        if known != excited:
            continue
        reason = f"{_axes(axes)}: {first.what} {significant(first.value, 3)} {first.unit}, "
        if abs(first.value) <= abs(first.bound):
            reason += "at the limit of the search range"
        else:
            reason += f"above {significant(first.bound, 3)} {first.unit}, the limit of the search"
        yield doubtful(
            reason,
            "check for effects missing in the model: torque and position sampled at different "
            "instants, a low-pass of the torque, a wrong unit or column, flexible links",
        )


def _late(model: Model, large: Sequence[Reservation]) -> Iterator[Reservation]:
    """Yield lags of torques, compensated by the estimate: a doubt before `large` residuals."""
    lags = model.details.lag if isinstance(model.details, FreeMotionFit) else ()
    usual = CAUSES["torque delay"].usual
    late = [
        (k, 1e3 * each.value) for k, each in enumerate(lags, 1) if abs(each.value) > usual / 1e3
    ]
    if late:
        said = ", ".join(
            f"axis {k} {abs(lag):.2g} ms {'late' if lag > 0 else 'early'}" for k, lag in late
        )
        yield (doubtful if large else good)(
            f"torques seem recorded at other instants than positions, which the estimate "
            f"compensates: {said}; or the model lacks springs or friction that act like this",
            CAUSES["torque delay"].remedy,
        )


def _axes(axes: Iterable[int]) -> str:
    """Return "axis 1" or "axes 1, 2"; nothing for no axis."""
    numbers = list(map(str, axes))
    return f"ax{'i' if len(numbers) == 1 else 'e'}s {', '.join(numbers)}" if numbers else ""


OF_FREE_MOTIONS: tuple[Rule[FreeMotionFit], ...] = (
    When(
        lambda fit: _axes(fit.driving),
        "{0}: negative friction identified, which adds power to the motion",
        "check the sign of its torque, and whether the model lacks a spring, lag or inertia",
    ),
    When(
        lambda fit: _axes(fit.unusual),
        f"{{0}}: offset above {ASYMMETRY:.0%} of friction, hardly distinguishable from "
        "rigid-body torques in these motions: a sensor offset, a spring, or wrong parameters",
        "add recordings with greater acceleration or range",
    ),
)


def _biased(model: Model, fit: FreeMotionFit) -> Iterator[Reservation]:
    """Yield a doubt about torques that noise of the positions shifts by more than `LARGE`.

    A shift within a torque's standard error is a matter of excitation.
    """
    test, free, error = fit.bias_test, free_torques(model), uncertainty(model)
    if test is None or not test.biased or not test.change or free is None or error is None:
        return
    shifts = free.relative(free.rms(np.array(test.change)), model.values)
    shifts = np.where(shifts > error, shifts, 0.0)
    worst = int(np.argmax(shifts))
    if shifts[worst] > LARGE:
        yield doubtful(
            f"axis {worst + 1}: noise of the positions shifts the torque on a free motion by "
            f"{100 * shifts[worst]:.2g} %",
            "state a lower cut_off in the map, or use --method 'instrumental variables'",
        )


NAMED = 3
"""Most parameters named in a sentence; the table of the parameters shows all."""


def _not_identified(model: Model) -> Iterator[Reservation]:
    """Yield a doubt about parameters without data: the cause of unknown torques."""
    fit = model.details
    if not isinstance(fit, FreeMotionFit):
        return
    titles = dict(zip(model.names, base_parameters(model.robot).titles, strict=True))
    listed = [titles[name] for name in fit.not_identified]
    names = ", ".join(listed[:NAMED])
    if len(listed) > NAMED:
        names += f" and {len(listed) - NAMED} more"
    cad = "take bodies from CAD (hil identify --prior cad=0.3 --urdf FILE)"
    if names and fit.still:
        yield doubtful(
            f"{_axes(fit.still)} {'does' if len(fit.still) == 1 else 'do'} not move in the "
            f"recordings: {names} not identified, and only motions with this position are "
            "predicted",
            "add recordings in which it moves; or state its rotor_inertia in the robot file, and "
            f"{cad}",
        )
    elif names:
        yield doubtful(
            f"the motions hardly excite {names}, in combination with others: not identified, and "
            "only motions like the recorded ones are predicted",
            f"add motions of other frequencies and ranges; or {cad}",
        )


def _free_motions(model: Model) -> Iterator[Reservation]:
    if isinstance(model.details, FreeMotionFit):
        left = model.band_residual.relative_without_noise if model.band_residual else None
        of_imports = model.provenance.warnings
        rule = partial(_unexplained, in_motion=left, warnings=of_imports)
        yield from reservations((rule,), model.details)
        yield from _biased(model, model.details)
        yield from reservations(OF_FREE_MOTIONS, model.details)


def _unexcited(model: Model) -> Iterator[Reservation]:
    relative, free = uncertainty(model), free_torques(model)
    if free is None or relative is None or not (relative > TOLERANCE).any():
        return
    if not model.details.with_law:
        worst = int(np.argmax(relative))
        yield (failed if relative[worst] ** 2 > HALF else doubtful)(
            f"axis {worst + 1} not excited: its torque on a free motion is uncertain by "
            f"{relative[worst]:.0%}",
            "measure motions that show its parameters (hil plan --refine)",
        )
        return
    # a wider range does not change a constant weight
    weighed = np.isin(np.arange(model.robot.n_joints), model.robot.weighed_slides)
    errors = [free.standard_error(model.covariance, gravity=only) for only in (True, False)]
    heavy = (errors[0] ** 2 > HALF * errors[1] ** 2) & ~weighed
    kinds = (
        (heavy, "motions through the whole range", "over a wider range"),
        (~heavy, "motions as fast as limits allow", "with greater acceleration"),
    )
    for lost, (own, motion, remedy) in itertools.product((True, False), kinds):
        axes = own & (relative > TOLERANCE) & ((relative >= 1.0) == lost)
        if axes.any():
            numbers, share = np.flatnonzero(axes) + 1, relative[axes].max()
            known = "unknown" if lost else f"known within {above(share, TOLERANCE)}% only"
            yield doubtful(
                f"{_axes(numbers)}: torque on {motion} is {known}, at most {TOLERANCE:.0%} allowed",
                f"add recordings {remedy}; close to the recorded motions the model may be valid: "
                "test it with hil validate",
            )


def _few(model: Model) -> tuple[int, int, int] | None:
    n, parameters = model.provenance.measurements, len(model.values)
    few = n < FEWEST * parameters and not model.details.with_law
    return (n, parameters, FEWEST * parameters) if few else None


def _few_blocks(model: Model) -> str:
    blocks = model.details.blocks
    return str(blocks) if blocks is not None and blocks < FEW_BLOCKS else ""


def _one_way(model: Model) -> Iterator[Reservation]:
    """Yield doubts about axes of free motions that move in one direction only."""
    for number, axis in enumerate(model.friction_law.axes, start=1):
        if axis is not None and axis.one_way is not None:
            yield doubtful(
                f"axis {number} {axis.one_way} {model.robot.torque_unit(number - 1)}",
                "add recordings of faster motion in both directions",
            )


def _ill_conditioned(model: Model) -> str:
    group, worst = max(model.condition.items(), key=lambda each: each[1], default=("", 0.0))
    which = "all parameters" if group == "all" else f"the {group.replace('_', '-')} parameters"
    return f"{worst:.3g} of {which}" if worst > POOR else ""


def _causes(model: Model) -> Iterator[Reservation]:
    for term in model.error_budget:
        if not term.accounted and term.torque > LARGE:
            axes = f"{_axes(term.axes)}: " if term.axes else ""
            yield doubtful(f"{axes}{term.cause}, {term.found}", term.remedy)


OF_DATA: tuple[Rule[Model], ...] = (
    When(
        _few,
        "{0[0]} measurements are too few for standard errors of {0[1]} parameters; at least "
        "{0[2]} are needed",
        "measure more (hil plan)",
    ),
    When(
        _few_blocks,
        "recordings are too short for standard errors: {0} independent blocks of time, at least "
        f"{FEW_BLOCKS} are needed",
        "add recordings of other motions",
    ),
    _one_way,
    When(
        _ill_conditioned,
        "condition number {0}: some parameter combinations hardly influence the torque",
        "measure motions that vary more joints (hil plan)",
    ),
)
"""Rules on the measurements of a model, independent of its use."""
OF_MISTAKES: tuple[Rule[Model], ...] = (_found, _doubted, _free_motions)
"""Rules on what may be wrong with recordings and map, and so leave a residual."""
OF_MODELS: tuple[Rule[Model], ...] = (
    _not_identified, _unexcited, _impossible, *OF_DATA, _causes, _resting,
)  # fmt: skip


EVERY = "torques of all axes"
TOLERANCES = ("torque constant", "rotor inertia")
"""Causes with a known effect on the parameters, in the order of `Estimate.effect`."""


def _good(model: Model) -> Iterator[Reservation]:
    """Yield the accuracy of the torques, without and with invisible causes of usual size."""
    relative = uncertainty(model)
    if relative is None:
        yield good(f"no objection to the parameters{_scale(model.robot)}")
        return
    reason = f"torque of the rigid bodies predicted within {_within(relative)}"
    # invisible causes whose usual size has more effect on torques than the stated error, without
    # those that this error includes, and those in the span of the parameters that scale no torque
    constants, rotors = np.split(model.robot.usual_uncertainty > 0, 2)
    scale = not model.robot.torque_constant_uncertainty.any()
    alone = {"torque constant": constants, "rotor inertia": rotors, EVERY: np.array([scale])}
    hidden = tuple(
        each
        for each in (model.excluded.invisible if model.excluded else ())
        if each.worth > relative.max()
        and (alone[each.cause][each.axis - 1] if each.cause in alone else each.size is not None)
    )
    if not hidden:
        yield good(f"{reason}{_scale(model.robot)}")
        return
    yield good(f"{reason}, provided that effects invisible in the recordings are as stated")
    usual = dict.fromkeys((each.cause, f"±{each.usual:.3g} {each.unit}") for each in hidden)
    said = []
    for cause, size in usual:
        axes = [each.axis for each in hidden if each.cause == cause]
        which = f" ({_axes(axes)})" if any(axes) else ""
        said.append(f"{cause}{which} {size}")
    conditions = ", ".join(said)
    yield good(
        f"not shown by recordings: {conditions}; with these usual tolerances the torque is "
        f"predicted within {_within(_add_hidden(model, relative, hidden))}",
        "state smaller uncertainties of torque constants and rotor inertias in the robot file, "
        "if known",
    )


def _add_hidden(model: Model, relative: Array, hidden: Sequence[Limit]) -> Array:
    """Return the standard error of torques with usual tolerances of invisible causes, (n_joints,).

    Tolerances of torque constants and rotors count up to the detectable size. A bound of other
    causes is sqrt(3) standard deviations, as of a uniform distribution.
    """
    square, usual = relative**2, model.robot.usual_uncertainty
    carried: tuple[str, ...] = ()
    # a model of a file lacks the effects of rotor inertias
    if model.excluded is not None and model.effect.shape == (len(model.values), len(usual)):
        carried, axes = TOLERANCES, range(1, model.robot.n_joints + 1)
        unseen = [model.excluded.unseen(cause, axis) for cause in carried for axis in axes]
        effect = model.effect * usual * np.array(unseen)
        square = np.asarray(uncertainty(model, effect @ effect.T)) ** 2
    for each in hidden:
        if each.cause not in carried:
            square[each.axis - 1 if each.axis else slice(None)] += each.worth**2 / 3.0
    return np.asarray(np.sqrt(square))


def _within(relative: Array) -> str:
    worst = int(np.argmax(relative))
    return f"{100 * relative[worst]:.2g} % (1 sigma), worst axis {worst + 1}"


def _scale(robot: Robot) -> str:
    """Return the end of a sentence: the condition on the torques' scale, or ""."""
    if robot.torque_constant_uncertainty.any():
        return ", stated uncertainties of the drives included"
    return (
        "" if robot.usual_uncertainty.any() else (" if the scale of the recorded torques is right")
    )
