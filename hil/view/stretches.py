"""Selection of recordings to draw: an axis's torque over time, measured and predicted.

The most demanding recordings are selected, not those where the model looks best.
"""

from __future__ import annotations

from collections import defaultdict
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import Mismatch, NotEnoughData
from hil.friction.equation import SLOW
from hil.least_squares.solving import inverse
from hil.results.recorded_torque import convert_torques, predict_whole

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from hil.arrays import Array
    from hil.planning.measurement import RecordedMotion
    from hil.results.model import Model
    from hil.results.recorded_torque import PredictedTorque
    from hil.runs.recording import Recording

LONGEST = 20.0
"""Maximum time drawn of a recording [s], so that reversals are distinguishable on a screen."""
DEMANDING = 0.5
"""Minimum torque scatter of a recording for an axis, as share of the maximum."""


def stretches(
    model: Model, recorded: Iterable[tuple[RecordedMotion, Recording]]
) -> dict[tuple[str, int], PredictedTorque]:
    """Predict the torques of moved axes in recordings, by recording and axis (from 0).

    Times are since the start of the recording. The prediction is NaN while the axis hardly moves;
    without a friction law for the axis, friction is fitted. Recordings too short for a low-pass, or
    with unknown gains, are skipped.
    """
    found = {}
    for motion, recording in recorded:
        with suppress(NotEnoughData, Mismatch):
            whole = predict_whole(
                model, convert_torques(model, motion, recording), motion.id, motion.moved
            )
            whole = replace(whole, time=whole.time - recording.time[0])
            for axis in motion.moved:
                found[motion.id, axis] = _select_moving(model, whole.select_axis(axis))
    return found


def _select_moving(model: Model, found: PredictedTorque) -> PredictedTorque:
    """Return one axis's prediction during motion, with fitted friction if the model has none."""
    axis, speed, predicted = found.axis, found.qd, found.predicted
    moves = np.abs(speed) > SLOW * max(float(np.abs(speed).max(initial=0.0)), 1e-300)
    own = axis + 1 not in model.axes_without_friction
    if not own:
        columns = np.column_stack([np.ones(len(speed)), np.sign(speed), speed])[moves]
        left = (found.measured - predicted)[moves]
        predicted = predicted.copy()
        predicted[moves] += columns @ np.linalg.lstsq(columns, left, rcond=None)[0]
    error = found.standard_error
    if np.isnan(model.residual[axis]) and moves.any():  # the model states no scatter of its own
        error = np.hypot(error, np.sqrt(np.mean((found.measured - predicted)[moves] ** 2)))
    predicted = np.where(moves, predicted, np.nan)
    return replace(found, predicted=predicted, standard_error=error, own_friction=own)


def carriers(
    found: Mapping[tuple[str, int], PredictedTorque], names: Sequence[str], most: int = 10
) -> dict[str, list[tuple[str, float]]]:
    """Find the recordings with the largest contributions to every base parameter.

    With the covariance C = N^-1 of the information N = sum N_r the shares (C N_r C)_kk / C_kk of
    recordings r in the certainty of parameter k add up to one.
    """
    shares: dict[str, Array] = defaultdict(lambda: np.zeros((len(names), len(names))))
    for (recording, _), each in found.items():
        if each.information is not None:
            shares[recording] += each.information
    if not shares:
        return {}
    covariance = inverse(np.sum(list(shares.values()), axis=0))
    whole = np.maximum(np.diag(covariance), np.finfo(float).tiny)
    parts = np.array([np.diag(covariance @ N @ covariance) / whole for N in shares.values()])
    recordings = list(shares)
    return {
        name: [(recordings[r], float(parts[r, k])) for r in np.argsort(-parts[:, k])[:most]]
        for k, name in enumerate(names)
    }


def most_demanding(found: Mapping[tuple[str, int], PredictedTorque]) -> list[PredictedTorque]:
    """Select a stretch per axis with large torque scatter, from as few recordings as possible.

    A stretch lasts at most `LONGEST`.
    """
    scatter = {key: float(np.std(each.measured)) for key, each in found.items()}
    left = {axis: max(s for (_, a), s in scatter.items() if a == axis) for _, axis in found}
    chosen: dict[int, PredictedTorque] = {}
    while left:
        shown: dict[str, dict[int, float]] = defaultdict(dict)
        for (name, axis), size in scatter.items():
            if axis in left and size >= DEMANDING * left[axis]:
                shown[name][axis] = size / left[axis] if left[axis] > 0 else 1.0
        name = max(shown, key=lambda each: (len(shown[each]), sum(shown[each].values())))
        own = [found[name, axis] for axis in shown[name]]
        begin = _busiest(own)
        chosen |= {each.axis: each.part(begin, begin + LONGEST, 700) for each in own}
        left = {axis: size for axis, size in left.items() if axis not in chosen}
    return [chosen[axis] for axis in sorted(chosen)]


def _busiest(own: list[PredictedTorque]) -> float:
    """Find the start of the interval `LONGEST` with the largest total torque scatter [s]."""
    first, last = min(each.time[0] for each in own), max(each.time[-1] for each in own)
    begins = np.arange(first, max(last - LONGEST, first) + 1e-9, LONGEST / 4)
    scatter = [
        sum(
            float(np.std(each.measured[within]) / max(np.std(each.measured), 1e-300))
            for each in own
            if (within := (begin <= each.time) & (each.time <= begin + LONGEST)).any()
        )
        for begin in begins
    ]
    return float(begins[int(np.argmax(scatter))])
