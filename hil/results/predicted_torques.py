"""What a model says of the torques of a recording, beside what was recorded.

The prediction is the model's own, its law of friction included: whoever feeds torques forward has
no other.

Methods for strokes and trajectories fit friction anew in every measurement. Of their models the
rigid bodies are judged beside that: friction is fitted in the recording itself, motion by motion
and period by period, by the terms that the methods use (`hil.friction.equation`). Where such a
model states no friction of an axis, this is all that can be judged of it.

A model from free motions was found with its law of friction. Then nothing is fitted
(`hil.results.recorded_torque`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotEnoughData
from hil.estimation.condensed import stack
from hil.estimation.signals import signals
from hil.friction.equation import ASYMMETRIC
from hil.friction.law import friction_torque, friction_variance
from hil.least_squares.solving import orthonormal
from hil.model.dynamics import inverse_dynamics
from hil.planning.measurement import shows_parameters
from hil.results.recorded_torque import in_si, predict_recording

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from hil.arrays import Array
    from hil.estimation.condensed import Stacked
    from hil.estimation.signals import Signals
    from hil.planning.measurement import RecordedMotion
    from hil.results.model import Model
    from hil.runs.recording import Recording


@dataclass(frozen=True, slots=True, eq=False)
class PredictedTorque:
    """Torque of one axis in one stretch of a recording.

    Attributes
    ----------
    measurement : str
        Its id.
    axis : int
        Index from 0.
    time, qd, measured, predicted, standard_error : ndarray, shape (n,)
        [s], [rad/s or m/s], [N m or N]; samples that can be used.
    parameter_error : ndarray, shape (n,)
        What of the standard error comes from the base parameters [N m or N].
    stated : ndarray, shape (n,)
        What of the prediction the model states by itself, as far as nothing fitted in the recording
        can take its place [N m or N].
    refitted, refitted_error : ndarray, shape (n,), or None
        The torque of the bodies with friction fitted in the recording, and its standard error
        [N m or N]; None where nothing was fitted.
    own_friction : bool
        Whether `predicted` has the friction that the model states; it is `refitted` otherwise,
        where the model states none of this axis.
    """

    measurement: str
    axis: int
    time: Array
    qd: Array
    measured: Array
    predicted: Array
    standard_error: Array
    parameter_error: Array
    stated: Array
    refitted: Array | None = None
    refitted_error: Array | None = None
    own_friction: bool = True


def predicted_torques(
    model: Model, recorded: Iterable[tuple[RecordedMotion, Recording]]
) -> Iterator[PredictedTorque]:
    """Predict all recordings, one after the other; what is of no use is passed over.

    Raises
    ------
    Mismatch
        A torque's gain is unknown and no part of the model.
    """
    for motion, as_recorded in recorded:
        if not shows_parameters(motion):
            continue
        recording = in_si(model, motion, as_recorded)
        if model.friction is not None:
            yield from _with_friction(model, motion.id, recording)
            continue
        try:
            s = signals(recording)
        except NotEnoughData:
            continue
        law = _law_along(model, s)
        for stretch in stack(model.robot, motion, s):
            for axis in stretch:
                yield _of_axis(model, motion.id, axis, s, law)


def _with_friction(model: Model, name: str, recording: Recording) -> Iterator[PredictedTorque]:
    try:
        found = predict_recording(model, recording)
    except NotEnoughData:
        return
    for axis in range(model.robot.n_joints):
        yield PredictedTorque(
            measurement=name,
            axis=axis,
            time=found.time,
            qd=found.qd[:, axis],
            measured=found.measured[:, axis],
            predicted=found.predicted[:, axis],
            standard_error=found.standard_error[:, axis],
            parameter_error=found.parameter_error[:, axis],
            stated=found.predicted[:, axis],
        )


def _law_along(model: Model, s: Signals) -> tuple[Array, Array] | None:
    """Friction by a model's own law at all samples, and its variance; None without a law."""
    robot, law = model.robot, model.friction_law
    if law is None:
        return None
    motion = s.q, s.qd, inverse_dynamics(robot, model.values, s.q, s.qd, s.qdd)
    return friction_torque(robot, law, *motion), friction_variance(robot, law, *motion)


def _of_axis(
    model: Model, name: str, each: Stacked, s: Signals, law: tuple[Array, Array] | None
) -> PredictedTorque:
    """The rigid bodies' torque, with the model's friction and with that which fits what is left."""
    A, y = each.X[:, : each.n_base], each.torques[:, 0]
    common = each.X[:, [each.n_base + k for k in ASYMMETRIC]]
    rigid = A @ model.values
    basis, _ = orthonormal(np.hstack([each.friction, common]))
    friction = basis @ (basis.T @ (y - rigid))
    stated = rigid - basis @ (basis.T @ rigid)
    variance = np.einsum("nk,kl,nl->n", A, model.covariance, A, optimize=True).clip(0.0)
    noise = np.nan_to_num(model.residual[each.axis])
    motor, own = each.torques[:, 1], None
    if law is not None and each.axis + 1 not in model.axes_without_friction:
        own = [of_all[each.index, each.axis] for of_all in law]
    refitted, refitted_error = rigid + friction + motor, np.sqrt(variance + noise**2)
    return PredictedTorque(
        measurement=name,
        axis=each.axis,
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
