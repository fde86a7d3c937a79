"""Predicted and recorded torques of a recording.

The prediction uses the model alone, including its law of friction, as torque feed-forward does.
With a motion history, the level of friction follows the course of warming in the measurements of
the law where these cover the motion (`hil.friction.warmth`).

Methods for strokes and trajectories fit friction anew in every measurement. For their models the
rigid bodies are judged in addition: friction is fitted in the recording itself, motion by motion
and period by period, by the terms of the methods (`hil.friction.equation`). For axes without a
friction law this is the only possible judgement.

A model from free motions was identified together with its law of friction. Then nothing is fitted
(`hil.results.recorded_torque`).
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotEnoughData
from hil.estimation.condensed import stack
from hil.estimation.free_motion.motion import COARSE, filtered_motion
from hil.estimation.free_motion.result import FreeMotionFit
from hil.estimation.signals import signals
from hil.friction.equation import ASYMMETRIC
from hil.friction.law import friction_torque, friction_variance, level_along, level_anywhere
from hil.least_squares.solving import orthonormal
from hil.least_squares.window import widen
from hil.model.dynamics import inverse_dynamics
from hil.planning.measurement import shows_parameters
from hil.results.recorded_torque import (
    PredictedTorque,
    convert_torques,
    predict_recording,
    processing_of,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from hil.arrays import Array, Mask
    from hil.estimation.condensed import Stacked
    from hil.estimation.signals import Signals
    from hil.friction.warmth import History
    from hil.planning.measurement import RecordedMotion
    from hil.results.model import Model
    from hil.runs.recording import Recording


def predicted_torques(
    model: Model, recorded: Iterable[tuple[RecordedMotion, Recording]], past: History | None = None
) -> Iterator[PredictedTorque]:
    """Predict the torques of all recordings in sequence, skipping unusable recordings.

    Parameters
    ----------
    recorded : iterable of (RecordedMotion, Recording)
    past : History, optional
        Motion history of the axes, which bounds the deviation of friction from the law; by default
        the axes may have any warmth.

    Raises
    ------
    Mismatch
        A torque's gain is unknown and not part of the model.
    """
    robot, law = model.robot, model.friction_law
    for motion, as_recorded in recorded:
        if not shows_parameters(motion):
            continue
        recording = convert_torques(model, motion, as_recorded)
        with suppress(NotEnoughData):
            if model.details.with_law:
                found = predict_recording(model, recording, motion.id)
                rows = _moving_rows(model, recording)
                yield from (found.select_axis(axis, rows[axis]) for axis in found.axes)
                continue
            s = signals(recording)
            state = s.q, s.qd, inverse_dynamics(robot, model.values, s.q, s.qd, s.qdd)
            change, level = None, level_anywhere(law)
            if past is not None:
                change, level = level_along(law, past, s.time)
            variance = friction_variance(robot, law, *state, level=level)
            own = friction_torque(robot, law, *state, change=change), variance
            for stretch in stack(robot, motion, s):
                for axis in stretch:
                    yield _predict_axis(model, motion.id, axis, s, own)


def _moving_rows(model: Model, recording: Recording) -> Sequence[Mask | slice]:
    """Return the rows of each axis that a model describes: all, or those in motion.

    Static friction holds an axis at rest by any torque, and the low-pass mixes rests into rows
    nearby.
    """
    if not (isinstance(model.details, FreeMotionFit) and model.details.moving_only):
        return [slice(None)] * model.robot.n_joints
    motion = filtered_motion(recording, replace(processing_of(model), rests="left out"))
    return [~widen(~rows, round(COARSE / 2)) for rows in motion.telling[motion.used].T]


def _predict_axis(
    model: Model, name: str, each: Stacked, s: Signals, law: tuple[Array, Array]
) -> PredictedTorque:
    """Return an axis's torque: rigid bodies with the model's friction, and with fitted friction."""
    A, y = each.X[:, : each.n_base], each.torques[:, 0]
    common = each.X[:, [each.n_base + k for k in ASYMMETRIC]]
    rigid = A @ model.values
    basis, _ = orthonormal(np.hstack([each.friction, common]))
    friction = basis @ (basis.T @ (y - rigid))
    stated = rigid - basis @ (basis.T @ rigid)
    variance = np.einsum("nk,kl,nl->n", A, model.covariance, A, optimize=True).clip(0.0)
    noise = np.nan_to_num(model.residual[each.axis])
    motor, own = each.torques[:, 1], None
    if each.axis + 1 not in model.axes_without_friction:
        own = [of_all[each.index, each.axis] for of_all in law]
    refitted, refitted_error = rigid + friction + motor, np.sqrt(variance + noise**2)
    return PredictedTorque(
        measurement=name,
        axes=(each.axis,),
        time=s.time[each.index],
        qd=s.qd[each.index, each.axis],
        measured=y + motor,
        predicted=refitted if own is None else rigid + motor + own[0],
        standard_error=refitted_error if own is None else np.hypot(refitted_error, np.sqrt(own[1])),
        parameter_error=np.sqrt(variance),
        stated=stated,
        refitted=refitted,
        refitted_error=refitted_error,
        own_friction=own is not None,
    )
