"""Predicted torque of a recording and its parts, for comparison with the measured torque.

Both sides pass the low-pass of the identification, which makes them comparable. An interval
contains the uncertainty of the base parameters and of the law of friction, with its wandering over
the recordings, and the residual of the identification.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special

from hil.errors import Mismatch, NotEnoughData
from hil.estimation.free_motion.columns import soft_gears
from hil.estimation.free_motion.motion import Processing, filtered_motion
from hil.estimation.free_motion.result import FreeMotionFit
from hil.estimation.nuisances import STEP
from hil.estimation.signals import signals
from hil.friction.law import friction_torque, friction_variance, law_columns
from hil.least_squares.solving import orthonormal, project_out
from hil.least_squares.uncertainty import TWICE
from hil.least_squares.window import HALF_WIDTH, smooth_at
from hil.model.dynamics import gravity_torque, inverse_dynamics, regressor
from hil.model.motors import motor_torque
from hil.planning.free_motion import FreeMotion

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from hil.arrays import Array, Mask
    from hil.friction.direction import Direction
    from hil.planning.measurement import RecordedMotion
    from hil.results.model import Model
    from hil.runs.recording import Recording


OF_SAMPLES = ("qd", "measured", "predicted", "standard_error", "parameter_error", "stated")
"""Attributes of a `PredictedTorque` with a value per sample, with or without fitted friction."""


@dataclass(frozen=True, slots=True, eq=False)
class PredictedTorque:
    """Measured and predicted torque of a stretch of a recording, of a single axis or of all.

    Arrays have shape (n,) for one axis, (n, n_joints) for all, with n usable samples.

    Attributes
    ----------
    measurement : str
        Id of the measurement, if any.
    axes : tuple of int
        Axes from 0.
    time : ndarray, shape (n,)
        Time [s].
    qd : ndarray
        Velocities [rad/s or m/s].
    measured, predicted : ndarray
        Torques after the low-pass [N m or N].
    standard_error : ndarray
        Standard error of a predicted sample: by parameters and by the residual of the
        identification [N m or N].
    parameter_error : ndarray
        Part of `standard_error` due to parameters and wandering friction [N m or N].
    stated : ndarray
        Part of the prediction that a fit of friction in the recording cannot represent [N m or N].
    refitted, refitted_error : ndarray, or None
        Torque of the bodies with friction fitted in the recording, and its standard error [N m or
        N]; None without a fit.
    information : ndarray, or None
        Information on the base parameters in each axis's torque [per second], with a level and a
        slope of friction fitted as well; shape (n_joints, n_base, n_base), or (n_base, n_base) for
        one axis.
    own_friction : bool
        True if `predicted` contains the model's friction; otherwise the model states none for this
        axis, and `predicted` is `refitted`.
    """

    measurement: str
    axes: tuple[int, ...]
    time: Array
    qd: Array
    measured: Array
    predicted: Array
    standard_error: Array
    parameter_error: Array
    stated: Array
    refitted: Array | None = None
    refitted_error: Array | None = None
    information: Array | None = None
    own_friction: bool = True

    @property
    def axis(self) -> int:
        """Index of the single axis."""
        (axis,) = self.axes
        return axis

    def select_axis(self, axis: int, rows: Mask | slice = slice(None)) -> PredictedTorque:
        """Return the torque of a single axis, for a prediction without fitted friction."""
        own = {name: getattr(self, name)[rows, axis] for name in OF_SAMPLES}
        shown = None if self.information is None else self.information[axis]
        return replace(self, axes=(axis,), time=self.time[rows], information=shown, **own)

    def part(self, begin: float, end: float, most: int) -> PredictedTorque:
        """Return the samples from `begin` to `end` [s], for a prediction without fitted friction.

        About `most` samples are kept, with the extremes of torque and residual.
        """
        kept = np.flatnonzero((begin <= self.time) & (self.time <= end))
        drawn = np.column_stack([self.measured, np.nan_to_num(self.residual)])[kept]
        kept = kept[thin_rows(drawn, round(len(kept) / most))]
        return replace(self, **{name: getattr(self, name)[kept] for name in ("time", *OF_SAMPLES)})

    @property
    def residual(self) -> Array:
        """Measured less predicted torque, shape of `predicted`."""
        return self.measured - self.predicted

    @property
    def half(self) -> Array:
        """Half-widths of the 95 % intervals, shape of `predicted` [N m or N]."""
        return TWICE * self.standard_error

    @property
    def relative(self) -> Array:
        """Residual relative to the measured torque, root mean squares by axis, shape (n_axes,)."""
        return np.asarray(_rms(self.residual) / np.maximum(_rms(self.measured), 1e-300))

    @property
    def overall(self) -> float:
        """Residual relative to the measured torque, root mean squares over all axes."""
        total = max(float(np.linalg.norm(self.measured)), 1e-300)
        return float(np.linalg.norm(self.residual)) / total

    def interval(self, level: float = 0.95) -> Array:
        """Return intervals of the torque, shape (..., 2): lower and upper ends."""
        half = special.ndtri(0.5 + level / 2) * self.standard_error
        return np.stack([self.predicted - half, self.predicted + half], axis=-1)

    def inside(self, level: float = 0.95) -> Array:
        """Share of the samples inside their interval, shape (n_joints,)."""
        low, high = np.moveaxis(self.interval(level), -1, 0)
        return np.asarray(np.mean((low <= self.measured) & (self.measured <= high), axis=0))


class Along(NamedTuple):
    """Processed recording for a model: torque at n usable samples, motion at all m samples.

    `used` and `passed` convert columns from shape (m, ...) to (n, ...), without and with the
    low-pass. Friction acts in `directions`, by default those of the axes' velocities. `gears` is
    the torque of elastic gears, shape (m, n_joints).
    """

    time: Array
    q: Array
    qd: Array
    qdd: Array
    measured: Array
    used: Callable[[Array], Array]
    passed: Callable[[Array], Array]
    gears: Array
    directions: tuple[Direction, ...] | None = None


def filter_recording(model: Model, recording: Recording) -> Along:
    """Return a recording processed for a model, by the low-pass of the identification."""
    if not model.details.with_law:
        s = signals(recording)
        valid = s.valid
        return Along(
            s.time[valid], s.q, s.qd, s.qdd, s.smoothed(s.tau)[valid],
            lambda x: x[valid], lambda x: np.asarray(s.smoothed(x)[valid]), np.zeros_like(s.q),
        )  # fmt: skip
    motion = filtered_motion(recording, processing_of(model))
    rates, used = motion.rates, motion.used
    if not used.any():
        raise NotEnoughData(
            f"{recording.n_samples} samples in {recording.n_samples * recording.period:.3g} s "
            f"are too few for the low-pass at {motion.processing.cut_off:.3g} Hz; give a longer "
            "recording"
        )

    def coarse(x: Array) -> Array:
        return np.asarray(x[:: rates.coarse][: len(used)][used])

    added = np.zeros_like(motion.q)
    if compliance := model.details.compliance:
        columns = soft_gears(model.robot, motion, model.values, motion.processing.soft)
        added = columns @ np.array([each.value / STEP for each in compliance.values()])
    return Along(
        coarse(recording.time[:: rates.fine]), motion.q, motion.qd, motion.qdd, motion.tau[used],
        coarse, lambda x: motion.passed(x)[: len(used)][used], added, motion.directions,
    )  # fmt: skip


def _thinned(recording: Recording) -> Along:
    """Return a recording processed for a model from strokes: smoothed and decimated.

    The samples are as far apart as half the window: a chart of 20 s has a point every 29 ms.
    """
    s = signals(recording)
    kept = np.flatnonzero(s.valid)[:: max(1, round(HALF_WIDTH / s.period))]
    columns = smooth_at(kept, np.hstack([s.q, s.qd, s.qdd, s.tau]), s.period)
    q, qd, qdd, tau = np.split(columns, 4, axis=1)
    return Along(s.time[kept], q, qd, qdd, tau, np.asarray, np.asarray, np.zeros_like(q))


def thin_rows(x: Array, every: int) -> NDArray[np.intp]:
    """Choose a row in `every` rows, and each column's extremes in blocks of 8 `every` rows."""
    rows, every = np.arange(len(x)), max(every, 1)
    if every == 1 or not len(x):
        return rows
    columns = x.reshape(len(x), -1)
    blocks = np.pad(columns, ((0, -len(x) % (8 * every)), (0, 0)), mode="edge")
    blocks = blocks.reshape(-1, 8 * every, columns.shape[1])
    begins = rows[:: 8 * every, np.newaxis]
    extreme = [(begins + of(blocks, axis=1)).ravel() for of in (np.argmin, np.argmax)]
    return np.unique(np.concatenate([rows[::every], *extreme]))


def predict_recording(model: Model, recording: Recording, name: str = "") -> PredictedTorque:
    """Predict the torques of a recording from the recorded positions.

    Parameters
    ----------
    model : Model
        Model identified from free motions.
    recording : Recording
        Recording of the model's robot, with constant sampling period and without gaps.
    name : str
        Id of the measurement.

    Raises
    ------
    NotEnoughData
        The model was not identified from free motions, or the recording is shorter than the reach
        of the low-pass.
    """
    processing_of(model)
    return predict_whole(model, recording, name)


def predict_whole(
    model: Model, recording: Recording, name: str = "", axes: Sequence[int] | None = None
) -> PredictedTorque:
    """Predict a whole recording as `predict_recording`, by a model of any method.

    For a model from strokes the prediction includes the model's friction, if known. Near reversals,
    where friction is no function of velocity, its accuracy is that of the law. Rigid bodies,
    friction, errors and information are computed for `axes` (by default all), and are 0 for other
    axes.
    """
    free = model.details.with_law
    axes = range(model.robot.n_joints) if axes is None or free else axes
    motion = filter_recording(model, recording) if free else _thinned(recording)
    A = np.zeros((*motion.q.shape, len(model.values)))
    A[:, axes] = regressor(model.robot, motion.q, motion.qd, motion.qdd, axes)
    rigid = A @ model.values
    torque = rigid + motor_torque(model.robot, motion.q, motion.qd, motion.qdd)
    torque += _friction(model, motion, rigid, axes)
    predicted = motion.passed(torque + motion.gears)
    # the standard error by base parameters and friction, shape (m, n_joints)
    robot, law, load = model.robot, model.friction_law.restricted(axes), A @ model.values
    variance = np.zeros_like(load)
    for axis in axes:
        variance[:, axis] = np.einsum("nk,nk->n", A[:, axis] @ model.covariance, A[:, axis])
    variance += friction_variance(robot, law, motion.q, motion.qd, load)
    # only laws from free motions, which have directions, correlate with base parameters
    pairs = zip(law.axes, motion.directions or (), strict=False)
    for axis, (own, direction) in enumerate(pairs):
        if own is None or not own.beside:
            continue
        columns = law_columns(robot, own, motion.q, motion.qd, load, axis, direction)
        across = A[:, axis] @ np.array(own.beside).T
        variance[:, axis] += 2.0 * np.einsum("nk,nk->n", across, columns)
    error = motion.used(np.sqrt(variance.clip(0.0)))
    return PredictedTorque(
        measurement=name,
        axes=tuple(range(model.robot.n_joints)),
        time=motion.time,
        qd=motion.used(motion.qd),
        measured=motion.measured,
        predicted=predicted,
        standard_error=np.hypot(error, np.nan_to_num(model.residual)),
        parameter_error=error,
        stated=predicted,
        information=_information(model, motion, axes, A),
    )


def _information(model: Model, motion: Along, axes: Sequence[int], A: Array) -> Array:
    """Return `PredictedTorque.information`, for residuals independent after a second."""
    A, qd = motion.used(A), motion.used(motion.qd)
    apart = np.ptp(motion.time) / len(qd) if len(qd) else 0.0
    noise = np.where(model.residual > 0, model.residual, 1.0)
    found = np.zeros((len(noise), A.shape[2], A.shape[2]))
    for axis in axes:
        v = qd[:, axis]
        friction, _ = orthonormal(np.column_stack([np.ones(len(v)), np.sign(v), v]))
        left = project_out(friction, A[:, axis]) / noise[axis]
        found[axis] = apart * left.T @ left
    return found


def torque_parts(model: Model, recording: Recording) -> dict[str, Array]:
    """Return the torque of a recording by parts; see `ModelFit.torque_parts`."""
    robot, p = model.robot, model.values
    motion = filter_recording(model, recording)
    q, qd, qdd, still = motion.q, motion.qd, motion.qdd, np.zeros_like(motion.q)
    rigid, gravity = inverse_dynamics(robot, p, q, qd, qdd), gravity_torque(robot, p, q)
    parts = {
        "gravity": gravity,
        "inertia": inverse_dynamics(robot, p, q, still, qdd) - gravity,
        "velocity": inverse_dynamics(robot, p, q, qd, still) - gravity,
        "rotors": motor_torque(robot, q, qd, qdd),
        "friction": _friction(model, motion, rigid, range(robot.n_joints)),
    }
    if motion.gears.any():
        parts["gears"] = motion.gears
    parts = {name: motion.passed(part) for name, part in parts.items()}
    left = motion.measured - np.sum(list(parts.values()), axis=0)
    return {"time": motion.time, **parts, "measured": motion.measured, "left": left}


def _friction(model: Model, motion: Along, rigid: Array, axes: Sequence[int]) -> Array:
    law, directions = model.friction_law.restricted(axes), motion.directions
    return friction_torque(model.robot, law, motion.q, motion.qd, rigid, directions)


def convert_torques(model: Model, motion: RecordedMotion, recording: Recording) -> Recording:
    """Return a recording with torques in SI, with unknown gains taken from the model.

    Raises
    ------
    Mismatch
        A gain is unknown and not part of the model.
    """
    unknown = isinstance(motion, FreeMotion) and motion.unknown_gains
    if not unknown:
        return recording
    found = {each.axis: each.value for each in model.details.gains}
    missing = [axis for axis in unknown if axis not in found]
    if missing:
        raise Mismatch(
            f"{motion.id}: the gain of axis {', '.join(map(str, missing))} is unknown, and the"
            " model holds none; state it in the map and import the recording anew"
        )
    gains = np.ones(recording.tau.shape[1])
    gains[[axis - 1 for axis in unknown]] = [found[axis] for axis in unknown]
    return replace(recording, tau=recording.tau * gains)


def processing_of(model: Model) -> Processing:
    """Return the signal processing of a model's recordings.

    Raises
    ------
    NotEnoughData
        The model was not identified from free motions.
    """
    fit = model.details
    if not isinstance(fit, FreeMotionFit):
        raise NotEnoughData(
            f"the model ({model.method} method) holds no filter settings for free motions; use "
            "model.torque, or identify imported recordings"
        )
    taken = np.zeros(model.robot.n_joints, dtype=bool)
    taken[[axis - 1 for axis in fit.recorded_velocity]] = True
    speed = np.array([law.speed for law in fit.axes])
    presliding = np.array([law.presliding for law in fit.axes])
    lag = np.array([each.value for each in fit.lag] or [0.0] * len(speed))
    soft = tuple(axis - 1 for axis in fit.compliance)
    return Processing(fit.cut_off, fit.band, speed, taken, presliding, lag, soft)


def _rms(x: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(x**2, axis=0)))
