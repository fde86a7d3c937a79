"""What an identification is worth, by its model alone: rules, and the worst of what they find.

The reason is the first cause to look at: a likely mistake (`hil.estimation.mistakes`) before
anything that the parameters' own uncertainty shows, since that holds for the right model alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.offsets import ASYMMETRY
from hil.estimation.free_motion.result import FEW_BLOCKS, POOR
from hil.estimation.mistakes.mistake import MistakeName
from hil.model.drive_train_file import USUAL_BOUND
from hil.results.outcome import OUTCOME_WORDS, Outcome
from hil.results.prediction import free_torques, uncertainty

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from hil.estimation.mistakes.mistake import Mistake
    from hil.model.robot import Robot
    from hil.results.error_term import ErrorTerm
    from hil.results.model import Model

    Array = NDArray[np.float64]

WHOLE = frozenset(
    {
        MistakeName.DIRECTION,
        MistakeName.POSITION_SIGN,
        MistakeName.TORQUE_SIGN,
        MistakeName.EXCHANGED,
    }
)
"""Mistakes that leave nothing of the parameters; others are of any size."""
LEFT = 0.7
"""Share of the residual that remains without a mistake, below which this spoils the parameters."""
UNEXPLAINED = 0.5**0.5
"""Residual over that of the mean torque from which on under half of the variance is explained."""
SPOILT = 0.1
"""Share of an axis's torque that correcting a mistake may move: as much as `UNEXCITED` doubts."""
UNEXCITED = 0.1
"""Standard error over torque from which on an axis is not excited."""
NOTHING = 0.7
"""And from which on nothing is known of it."""
FEWEST = 2
"""Measurements for each parameter below which errors are not known well enough to be stated."""
LARGE = 0.02
"""Error of the torques from which on a cause of error is doubt enough."""


def outcome(
    model: Model, mistake: Mistake | None = None, usual_covariance: Array | None = None
) -> Outcome:
    """Judge a model by itself: the worst of what speaks against it, the likeliest mistake first.

    Parameters
    ----------
    usual_covariance : ndarray, shape (n_base, n_base), optional
        As of an `Estimate`: what usual tolerances of drives add to the model's covariance.
    """
    found = [
        *_mistaken(model, mistake), *_unexplained(model), *_biased(model), *_driving(model),
        *_unusual(model), *_unexcited(model), *data_reservations(model),
        *_causes(model.error_budget),
    ]  # fmt: skip
    # of equally bad ones the first, which Python's sort keeps in front
    worst = sorted(found, key=lambda each: -OUTCOME_WORDS.index(each.word))
    return worst[0] if worst else _good(model, usual_covariance)


def data_reservations(model: Model) -> Iterator[Outcome]:
    """What the measurements behind a model say against it, whatever it is used for."""
    yield from _few(model)
    yield from _one_way(model)
    yield from _ill_conditioned(model)


def _mistaken(model: Model, mistake: Mistake | None) -> Iterator[Outcome]:
    if mistake is not None:
        spoilt = mistake.name in WHOLE or mistake.left < LEFT or _moved(model, mistake) > SPOILT
        yield Outcome(
            word="failed" if spoilt else "doubtful", reason=str(mistake), remedy=mistake.remedy
        )


def _moved(model: Model, mistake: Mistake) -> float:
    """By which share of its torque the worst axis moves as a mistake, or its like, is corrected."""
    free, found = free_torques(model), [0.0]
    for each in (mistake, mistake.other):
        if free is not None and each is not None and each.change is not None:
            found += free.relative(free.rms(each.change), model.values).tolist()
    return max(found)


def _few(model: Model) -> Iterator[Outcome]:
    """Too little data for errors to be known."""
    n, needed = model.provenance.measurements, FEWEST * len(model.values)
    if model.friction is not None:
        if model.friction.blocks is not None and model.friction.blocks < FEW_BLOCKS:
            yield Outcome(
                word="doubtful",
                reason=f"too little was recorded to know how wrong the parameters may be:"
                f" {model.friction.blocks} independent pieces of time, {FEW_BLOCKS} are needed",
                remedy="add recordings of other motions",
            )
    elif n < needed:
        yield Outcome(
            word="doubtful",
            reason=f"{n} measurements of {len(model.values)} parameters are too few to know how"
            f" wrong these may be; {needed} are needed at least",
            remedy="measure more (hil plan)",
        )


def _unexplained(model: Model) -> Iterator[Outcome]:
    """Torques of free motions of which the model leaves about as much as their mean does."""
    fit = model.friction
    if fit is None:
        return
    pairs = zip(fit.relative_residual, fit.naive_residual, strict=False)
    shares = {
        axis: left / max(naive, np.finfo(float).tiny)
        for axis, (left, naive) in enumerate(pairs, start=1)
        if left is not None and naive is not None and axis not in fit.still
    }
    worst = max(shares, key=lambda axis: shares[axis], default=0)
    if worst and shares[worst] > UNEXPLAINED:
        yield Outcome(
            word="failed",
            reason=f"axis {worst}: the model leaves {fit.relative_residual[worst - 1]:.0%} of the"
            f" torque unexplained, the mean torque alone {fit.naive_residual[worst - 1]:.0%}",
            remedy="check the columns, signs and units of the map, and the direction of gravity",
        )


def _biased(model: Model) -> Iterator[Outcome]:
    """Parameters that noise of the positions shifts."""
    fit = model.friction
    if fit is not None and fit.bias_test is not None and fit.bias_test.biased:
        yield Outcome(
            word="doubtful",
            reason="noise of the positions shifts the parameters by up to"
            f" {fit.bias_test.shift:.2g} standard errors",
            remedy="state a lower cut_off in the map, or take --method 'instrumental variables'",
        )


def _driving(model: Model) -> Iterator[Outcome]:
    """Friction that is none."""
    fit = model.friction
    if fit is not None and fit.driving:
        yield Outcome(
            word="doubtful",
            reason=f"axis {', '.join(map(str, fit.driving))}: the friction found gives power to the"
            " motion, which no friction does",
            remedy="check the sign of its torque, and whether a spring, a lag or an inertia is"
            " missing",
        )


def _unusual(model: Model) -> Iterator[Outcome]:
    """Offsets that friction does not have, and that the motion hardly tells from rigid bodies."""
    fit = model.friction
    if fit is not None and fit.unusual:
        yield Outcome(
            word="doubtful",
            reason=f"axis {', '.join(map(str, fit.unusual))}: an offset of more than"
            f" {ASYMMETRY:.0%} of friction, which these motions hardly distinguish from torques of"
            " the rigid bodies: a sensor's zero, a spring, or wrong parameters",
            remedy="add recordings with greater acceleration, or that reach further",
        )


def _unexcited(model: Model) -> Iterator[Outcome]:
    relative = uncertainty(model)
    if relative is None or not (relative > UNEXCITED).any():
        return
    worst = int(np.argmax(relative))
    if model.friction is not None:
        yield Outcome(
            word="doubtful",
            reason=f"axis {worst + 1} not excited by what was recorded: its torque on a motion"
            f" through its whole range is {_uncertain(relative[worst])}",
            remedy="add recordings that reach further; near these the model may hold, hil validate"
            " shows where",
        )
        return
    yield Outcome(
        word="failed" if relative[worst] > NOTHING else "doubtful",
        reason=f"axis {worst + 1} not excited: its torque on a free motion is uncertain by"
        f" {relative[worst]:.0%}",
        remedy="measure motions that show its parameters (hil plan --refine)",
    )


def _uncertain(relative: float) -> str:
    return f"uncertain by {relative:.0%}" if relative < 1.0 else "not known: less than its error"


def _one_way(model: Model) -> Iterator[Outcome]:
    """Axes of free motions that move in one direction only."""
    for number, axis in enumerate(model.friction.axes if model.friction else (), start=1):
        if axis.one_way is not None:
            yield Outcome(
                word="doubtful",
                reason=f"axis {number} {axis.one_way} {model.robot.torque_unit(number - 1)}",
                remedy="add recordings in both directions",
            )


def _ill_conditioned(model: Model) -> Iterator[Outcome]:
    group, worst = max(model.condition.items(), key=lambda each: each[1], default=("", 0.0))
    if worst > POOR:
        which = "all parameters" if group == "all" else f"the {group.replace('_', '-')} parameters"
        yield Outcome(
            word="doubtful",
            reason=f"condition number {worst:.3g} of {which}: some combinations of them hardly"
            " show in the torque",
            remedy="measure motions that vary more joints (hil plan)",
        )


def _causes(budget: Sequence[ErrorTerm]) -> Iterator[Outcome]:
    for term in budget:
        if not term.accounted and term.torque > LARGE:
            axes = f"axes {', '.join(map(str, term.axes))}: " if term.axes else ""
            yield Outcome(
                word="doubtful",
                reason=f"{axes}{term.cause}, {term.found}",
                remedy=term.remedy,
            )


def _good(model: Model, usual_covariance: Array | None) -> Outcome:
    """State the precision: as recordings show it, and as far as stated constants are known."""
    condition, relative = _condition(model.robot), uncertainty(model)
    if relative is None:
        return Outcome(word="good", reason=f"nothing speaks against the parameters{condition}")
    reason = (
        "torques of the rigid bodies on a free motion are known within"
        f" {_within(relative)}{condition} (one standard error)"
    )
    whole = None if usual_covariance is None else uncertainty(model, usual_covariance)
    if whole is None or not model.robot.usual_uncertainty.any():
        return Outcome(word="good", reason=reason)
    return Outcome(
        word="good",
        reason=f"{reason}, within {_within(whole)} with usual tolerances of ±{USUAL_BOUND:.0%}",
        remedy="state the uncertainty of these in the robot file, where it is known better",
    )


def _within(relative: Array) -> str:
    worst = int(np.argmax(relative))
    return f"{100 * relative[worst]:.2g} % on every axis (worst: axis {worst + 1})"


def _condition(robot: Robot) -> str:
    """Under which condition recordings alone show how well torques are known, a clause."""
    constants, rotors = np.split(robot.usual_uncertainty > 0, 2)
    named = (("torque constants", constants), ("rotor inertias", rotors))
    if exact := " and ".join(what for what, alone in named if alone.any()):
        return f" if {exact} are exactly as stated"
    if robot.torque_constant_uncertainty.any():
        return ", stated uncertainties of the drives included"
    return " if recorded torques are to scale"
