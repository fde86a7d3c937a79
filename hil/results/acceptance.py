"""Acceptance of a machine: what a run found, against limits that somebody stated.

A check is a value and what it may be. Values come from the model of the run (parameters, friction,
torque that the fit leaves, what the identification is worth) and from its journal and recordings
(what is missing, flagged, or kept with findings). A value that was not identified does not pass.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from hil.errors import Mismatch
from hil.results.acceptance_file import Check, Limits, QuantityLimits
from hil.results.outcome import OUTCOME_WORDS
from hil.results.quantities import Quantity, quantities, reading

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.results.model import Model
    from hil.results.quantities import Kind
    from hil.runs.run import Run

FACTOR = 3.0
"""By what a draft widens intervals where nothing else is stated."""


def judge(run: Run, model: Model, limits: Limits) -> tuple[Check, ...]:
    """Judge a run and its model by limits.

    Raises
    ------
    FileError
        A damaged recording.
    Mismatch
        Limits of another robot, or a model of another state of the run.
    """
    _refuse_foreign(run, model, limits)
    return (
        _outcome(model, limits),
        *_of_recordings(run, model, limits),
        *(_residual(model, axis, most) for axis, most in sorted(limits.residual.items())),
        *(_quantity(model, each) for each in limits.quantities),
    )


def draft(run: Run, model: Model, factor: float = FACTOR) -> Limits:
    """Limits around what a good run found: its intervals of 95 %, widened by a factor.

    Raises
    ------
    FileError
        A damaged recording.
    Mismatch
        A model of another state of the run.
    """
    limits = Limits(robot=model.robot.name, drafted_from=run.path.name, factor=factor)
    _refuse_foreign(run, model, limits)
    return limits.model_copy(
        update={
            "residual": {
                axis: float(f"{factor * left:.4g}")
                for axis, left in enumerate(model.residual.tolist(), start=1)
                if np.isfinite(left)
            },
            "quantities": tuple(_drafted(model, factor)),
        }
    )


def _drafted(model: Model, factor: float) -> Iterator[QuantityLimits]:
    intervals = model.interval()
    for each in quantities([model]):
        found = reading(model, each)
        if found is None:
            continue
        if each.axis is None:
            low, high = intervals[model.names.index(each.name)]
            half = (high - low) / 2
        else:
            half = stats.t.ppf(0.975, found.degrees) * found.standard_error + found.allowance
        least, most = (float(f"{found.value + k * factor * half:.6g}") for k in (-1, 1))
        yield QuantityLimits(
            name=each.name, unit=each.unit, axis=each.axis, speed=each.speed, least=least, most=most
        )


def _refuse_foreign(run: Run, model: Model, limits: Limits) -> None:
    sessions = run.journal.sessions
    measured = sessions[-1].started if sessions else ""
    made_from = model.provenance
    if (made_from.plan_digest, made_from.measured) != (run.plan.digest, measured) or (
        made_from.together_with
    ):
        raise Mismatch(
            f"{run.path}: its model was made from other recordings than this run's as it is now;"
            f" identify it anew with: hil identify {run.path}"
        )
    if limits.robot != run.robot.name:
        raise Mismatch(
            f"{run.path}: is a run of {run.robot.name}, and the limits are for {limits.robot};"
            " name the limits of this robot with --limits"
        )


def _outcome(model: Model, limits: Limits) -> Check:
    word = "doubtful" if model.outcome is None else model.outcome.word
    passed = OUTCOME_WORDS.index(word) <= OUTCOME_WORDS.index(limits.outcome)
    return Check("identification", "", word, limits.outcome, None, passed)


def _of_recordings(run: Run, model: Model, limits: Limits) -> Iterator[Check]:
    timings = [session.sync for session in run.journal.sessions]
    samples = sum(timing.samples for timing in timings)
    flagged = sum(timing.flagged for timing in timings) / samples if samples else 0.0
    yield _at_most("measurements missing", "", len(run.missing), limits.missing)
    yield _at_most("measurements left out", "", len(model.provenance.without), limits.missing)
    kept = sum(bool(each.findings) for each in run.without(model.provenance.without))
    yield _at_most("recordings with findings", "", kept, limits.with_findings)
    yield _at_most("samples flagged", "%", 100 * flagged, 100 * limits.flagged)


def _residual(model: Model, axis: int, most: float) -> Check:
    unit = "N m" if axis > len(model.residual) or model.robot.revolute[axis - 1] else "N"
    left = float(model.residual[axis - 1]) if axis <= len(model.residual) else None
    return _at_most(f"torque left by the fit, axis {axis}", unit, left, most)


def _at_most(name: str, unit: str, value: float | None, most: float) -> Check:
    passed = value is not None and value <= most
    return Check(name, unit, value, None, most, passed)


def _quantity(model: Model, limits: QuantityLimits) -> Check:
    value = _value(model, limits)
    passed = value is not None and limits.least <= value <= limits.most
    return Check(limits.name, limits.unit, value, limits.least, limits.most, passed)


def _value(model: Model, limits: QuantityLimits) -> float | None:
    kind: Kind = "inertia parameter" if limits.axis is None else "friction level"
    if limits.axis is None and limits.name not in model.names:
        return None
    if limits.axis is not None and limits.axis > model.robot.n_joints:
        return None
    wanted = Quantity(limits.name, kind, limits.unit, axis=limits.axis, speed=limits.speed)
    found = reading(model, wanted)
    return None if found is None else found.value
