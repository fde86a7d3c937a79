"""Validation of a model on another recording, axis by axis, with a judgement.

This test works on a real machine, without known truth: the motion was not used for the model. The
scores are compared with the naive prediction, the axis's mean torque, which needs no model, and
with the intervals of the model. Each rule checks the worst axis by its own criterion.
"""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field
from scipy import special

from checked_files.yaml_file import FileModel
from hil.estimation.friction.points import history
from hil.estimation.intervals import SIGNIFICANT
from hil.estimation.options import ACCURACY
from hil.friction.law import level_at
from hil.least_squares.standstill import LEVEL, share_at_top
from hil.least_squares.uncertainty import OUTSIDE, TWICE
from hil.results.band_residual import band_residual
from hil.results.judgement import (
    HALF,
    INSIDE,
    NOTABLE,
    TOLERANCE,
    WORSE,
    Judgement,
    Reservation,
    When,
    doubtful,
    failed,
    good,
    reservations,
)
from hil.results.model import Model, loaded
from hil.results.predicted_torques import predicted_torques
from hil.results.provenance import recordings_in_common
from hil.results.residual import BandResidual, unexplained
from hil.results.verdict import OF_DATA
from hil.runs.pooling import Pooled
from hil.runs.run import opened

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from pathlib import Path

    from hil.arrays import Array
    from hil.friction.warmth import History
    from hil.results.judgement import Rule
    from hil.results.recorded_torque import PredictedTorque
    from hil.runs.run import Run

    Scores = Sequence["AxisScore"]

SURE = special.ndtri(1.0 - SIGNIFICANT / 2.0)
"""Smallest significant difference of a gain from 1 [standard errors]."""


class AxisScore(FileModel):
    """Score of the prediction for an axis.

    Attributes
    ----------
    axis : int
        Number from 1.
    unit : str
        Unit of torques: N m or N.
    torque, residual : float
        Root mean squares. Residual and all other figures, except the gain and `refitted`, refer to
        the model's prediction with its friction law.
    relative : float
        Residual over torque.
    naive : float
        Residual over torque, for the mean torque as prediction.
    uncertain : float
        Standard error of the prediction by the model's parameters, over the torque.
    inside : float
        Share of samples inside the predicted intervals of 95 %.
    gain, gain_error : float
        Best factor of the model's part of the prediction, with its standard error for white
        residuals and the largest one by the model's parameters; with friction fitted in the
        recording, if possible.
    asymmetry : float
        Half the difference of the mean residuals forward and back, over the residual.
    limited : float
        Share of samples at the greatest torque, if this is a limit.
    identified : float, optional
        Residual of the identification.
    refitted, refitted_inside : float, optional
        `relative` and `inside` for the bodies' torque with friction fitted in the recording; None
        without a fit.
    own_friction : bool
        True if the model states friction of this axis; otherwise all figures have friction fitted
        in the recording.
    uncovered : str
        Difference of the motion from the recordings of the model's friction law; empty for a
        covered motion.
    """

    axis: int = Field(ge=1)
    unit: str
    samples: int
    torque: float
    residual: float
    relative: float
    naive: float
    uncertain: float = 0.0
    inside: float
    gain: float
    gain_error: float
    asymmetry: float
    limited: float
    identified: float | None
    refitted: float | None = None
    refitted_inside: float | None = None
    own_friction: bool = True
    uncovered: str = ""

    @property
    def rigid_error(self) -> float:
        """Relative error without the error of friction, as far as friction was fitted."""
        return self.relative if self.refitted is None else self.refitted

    @property
    def shown(self) -> float:
        """Relative error of the bodies beyond the residual of the identification.

        Noise and effects missing in the kind of model are in both residuals; the excess comes from
        errors of parameters.
        """
        left = (self.identified or 0.0) / self.torque if self.torque else 0.0
        return float(np.sqrt(max(self.rigid_error**2 - left**2, 0.0)))

    @property
    def worse(self) -> float:
        """Ratio of the bodies' residual to that of the identification; 0 if unknown."""
        return self.rigid_error * self.torque / self.identified if self.identified else 0.0


class Validation(Judgement):
    """Judgement of a model by another recording.

    Attributes
    ----------
    axes : tuple of AxisScore
        Scores of the axes; empty for an unsuitable recording.
    residual : BandResidual, optional
        Residual of the recordings, over the band common to all models; None if the model states no
        friction, and in files of earlier versions.
    """

    axes: tuple[AxisScore, ...] = ()
    residual: BandResidual | None = None

    @property
    def relative(self) -> float | None:
        """Residual over the torque, as root mean square of the relative residuals of the axes."""
        squares = [each.relative**2 for each in self.axes]
        return float(np.sqrt(np.mean(squares))) if squares else None


def validate(
    model: Model | Path | str, run: Run | Path | str, accuracy: float = ACCURACY
) -> Validation:
    """Validate a model on a run not used for the identification; nothing is written.

    Parameters
    ----------
    model : Model or path
        Model, its file, or the folder of its run.
    run : Run or path
        Held-out recordings of the same robot.
    accuracy : float
        Largest residual of a good model, as a share of the torque of a loaded axis.

    Returns
    -------
    Validation
        Judgement: `word` is good, doubtful or failed, with `reason` and the scores in `axes`.

    Raises
    ------
    Mismatch
        Another robot.
    FileError
        A damaged file.

    Examples
    --------
    >>> judged = hil.validate("runs/head", "runs/other")
    >>> judged.word, len(judged.axes)
    ('good', 2)
    """
    model, run = loaded(model), opened(run)
    model.refuse_other_robot(run.robot, str(run.path))
    if own := score_own_recordings(model, run):
        return own
    recorded = Pooled([run])
    left = band_residual(model, recorded, accuracy)
    # laws of friction from free motions do not depend on the motion history
    past = None if model.details.with_law else history(model.robot, recorded)
    return scored(model, predicted_torques(model, recorded, past), left, accuracy, past)


def scored(
    model: Model,
    predicted: Iterable[PredictedTorque],
    residual: BandResidual | None = None,
    accuracy: float = ACCURACY,
    past: History | None = None,
) -> Validation:
    """Score a model's prediction and judge it.

    Parameters
    ----------
    predicted : iterable of PredictedTorque
        Torques by `hil.results.predicted_torques`.
    residual : BandResidual, optional
        Residual of the same recordings.
    accuracy : float
        Largest residual of a good model, as a share of the torque of a loaded axis.
    past : History, optional
        Motion history of the axes.
    """
    parts: dict[int, list[PredictedTorque]] = defaultdict(list)
    for each in predicted:
        parts[each.axis].append(each)
    scores = tuple(
        _score(own, model, past)
        for axis, own in sorted(parts.items())
        if sum(len(each.measured) for each in own) * OUTSIDE >= 1.0
    )
    spoilt = [failed(f"the model's identification {model.verdict}")] if model.failed else []
    last = *unexplained(residual, model.robot.torque_limit, accuracy), *reservations(OF_DATA, model)
    limit = model.robot.torque_limit
    return judged(scores, model.robot.n_joints, spoilt, last, residual, limit)


def judged(
    scores: Scores,
    n_joints: int,
    first: Iterable[Reservation] = (),
    last: Iterable[Reservation] = (),
    residual: BandResidual | None = None,
    limit: Array | None = None,
) -> Validation:
    """Judge scores: return the worst objection to a model, or the quality of the prediction.

    Parameters
    ----------
    first, last : iterable of Reservation
        Objections by the identification, placed before and after equally bad ones of the scores.
    residual : BandResidual, optional
        Residual to be stated with the judgement.
    limit : ndarray, shape (n_joints,), optional
        Torque limits [N m or N]; NaN if unknown, the default.
    """
    missing = [k for k in range(1, n_joints + 1) if k not in [s.axis for s in scores]]
    own = [*reservations(RULES, scores)] if scores else [failed(*NO_SAMPLES)]
    if scores and missing:
        axes = ", ".join(map(str, missing))
        own.append(doubtful(f"axes {axes} do not move in this recording"))
    found = (*first, *own, *last)
    if not found:
        shares, band = {each.axis: each.relative for each in scores}, ""
        if residual is not None and np.isfinite(residual.relative_without_noise).any():
            shown = enumerate(residual.relative_without_noise.tolist(), start=1)
            shares = {axis: x for axis, x in shown if np.isfinite(x)}
            band = f" up to {residual.band:g} Hz"
        worst = max(shares, key=shares.__getitem__)
        within = f"torque predicted within {100 * shares[worst]:.2g} % (rms{band})"
        found = (good(f"{within}, worst axis {worst}"),)
    limit = np.full(n_joints, np.nan) if limit is None else limit
    notes = [] if residual is None else [good(residual.describe(limit))]
    unlike: dict[str, list[int]] = defaultdict(list)
    for each in scores:
        if each.uncovered:
            unlike[each.uncovered].append(each.axis)
    if unlike:
        said = (f"axis {', '.join(map(str, axes))}: {why}" for why, axes in unlike.items())
        notes.append(good(f"not covered by the model's recordings: {'. '.join(said)}"))
    return Validation.judge((*found, *notes), lambda: found[0], axes=scores, residual=residual)


def _score(parts: Sequence[PredictedTorque], model: Model, past: History | None) -> AxisScore:
    axis = parts[0].axis
    unit, identified = model.robot.torque_unit(axis), float(model.residual[axis])

    def joined(name: str) -> Array:
        return np.concatenate([getattr(each, name) for each in parts])

    y, qd, stated = map(joined, ("measured", "qd", "stated"))
    r, fitted = y - joined("predicted"), parts[0].refitted is not None
    left = y - joined("refitted") if fitted else r
    torque, residual, square = _rms(y), _rms(r), stated @ stated
    # an error of the parameters like the torque itself shifts the gain most (Cauchy and Schwarz)
    wrong = float(np.linalg.norm(joined("parameter_error")))
    held = np.abs(left) <= TWICE * joined("refitted_error") if fitted else np.zeros(1)
    back, forward = (r[np.sign(qd) == sign] for sign in (-1.0, 1.0))
    differ = (forward.mean() if forward.size else 0.0) - (back.mean() if back.size else 0.0)
    return AxisScore(
        axis=axis + 1,
        unit=unit,
        samples=len(y),
        torque=torque,
        residual=residual,
        relative=residual / torque,
        naive=float(y.std()) / torque,
        uncertain=_rms(joined("parameter_error")) / torque,
        inside=float(np.mean(np.abs(r) <= TWICE * joined("standard_error"))),
        gain=float(1.0 + left @ stated / square) if square > 0 else 1.0,
        gain_error=float(np.hypot(_rms(left), wrong) / np.sqrt(square)) if square > 0 else 0.0,
        asymmetry=float(abs(differ)) / 2 / residual if residual > 0 else 0.0,
        limited=share_at_top(np.abs(y)),
        identified=None if np.isnan(identified) else identified,
        refitted=_rms(left) / torque if fitted else None,
        refitted_inside=float(np.mean(held)) if fitted else None,
        own_friction=all(each.own_friction for each in parts),
        uncovered=_uncovered(model, axis, qd, joined("time"), r, past),
    )


def _uncovered(
    model: Model, axis: int, qd: Array, time: Array, left: Array, past: History | None
) -> str:
    """State differences between a motion and the recordings of an axis's law of friction.

    Arrays (n,) are velocities [rad/s or m/s], instants [s] and residual torques [N m or N].
    """
    law = model.friction_law.axes[axis]
    if law is None:
        return ""
    low, high = law.speeds or (0.0, law.speed)
    speed = np.abs(qd)
    unit, said = f"{model.robot.position_unit(axis)}/s", []
    for share, which in (
        (float(np.mean(speed < low)), f"slower than {low:.2g} {unit}"),
        (float(np.mean(speed > high)), f"faster than {high:.2g} {unit}"),
    ):
        if share > OUTSIDE:
            said.append(f"{share:.0%} of the samples are {which}")
    if law.exposure is None:
        return "; ".join(said)
    if past is not None and not law.exposure.covers(past, axis):
        most = TWICE * _rms(law.exposure.level_along(past, axis, time)[1])
        said.append(f"warmer or colder: friction may differ by {most:.0%} (assumed)")
    # mean over both directions, in which gravity and asymmetric friction cancel
    level, _ = level_at(law, float(np.clip(speed.mean(), low, high)))
    off = float(np.mean(left * np.sign(qd))) / level if level > 0 else 0.0
    if abs(off) > law.wander:
        said.append(
            f"rigid bodies are confirmed, the model's friction is not: friction {abs(off):.0%} "
            f"{'above' if off > 0 else 'below'} the law, but at most {law.wander:.0%} in the "
            "model's recordings"
        )
    return "; ".join(said)


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2)))


def _worst(size: Callable[[AxisScore], float], most: float) -> Callable[[Scores], AxisScore | None]:
    """Return a function that finds the axis with the largest `size`, if above `most`."""

    def look(scores: Scores) -> AxisScore | None:
        worst = max(scores, key=size)
        return worst if size(worst) > most else None

    return look


NO_SAMPLES = (
    "no axis has enough usable samples in motion: away from reversals, faster than a few percent "
    "of its speed limit and clear of both ends of the recording",
    "record a longer or faster motion",
)
"""Reason and remedy if no axis has a score."""


def _naive(scores: Scores) -> Reservation | None:
    """Return an objection to predictions not clearly better than the mean torque."""
    most = HALF**0.5
    worst = max(scores, key=lambda s: s.relative / max(s.naive, 1e-12))
    if worst.relative <= max(most * worst.naive, TOLERANCE):
        return None
    why = "the model does not hold for this motion"
    if worst.uncertain > TOLERANCE:
        why = (
            "the model's recordings do not excite the parameters of this motion: standard errors "
            f"are {worst.uncertain:.0%} of the torque"
        )
    if worst.rigid_error < min(most * worst.naive, worst.relative):
        why = (
            f"with friction fitted to this recording the error is {worst.rigid_error:.0%}: rigid "
            "bodies are confirmed, the model's friction is not; identify friction anew"
        )
    return failed(
        f"axis {worst.axis}: the prediction has an error of {worst.relative:.0%} of the torque, "
        f"a constant torque {worst.naive:.0%}; {why}"
    )


def _narrow(scores: Scores) -> Reservation | None:
    """Return a doubt and its likely reason if intervals are too narrow for the samples, or None."""
    # an error below a notable share of the torque is in no interval of interest
    narrow = [each for each in scores if each.inside < INSIDE and each.relative > NOTABLE]
    if not narrow:
        return None
    # axes with covered motions first: for the others the uncovered motion is the reason
    s = min(narrow, key=lambda each: (bool(each.uncovered), each.inside))
    held, remedy = f"{s.inside:.0%} of the samples are inside the predicted 95 % intervals", ""
    if s.uncovered:
        return doubtful(
            f"axis {s.axis}: not covered by the model's recordings, {s.uncovered}; {held}",
            "identify friction from motions like this one",
        )
    if s.relative <= TOLERANCE:
        why = (
            f"{held}, at least {INSIDE:.0%} needed; the intervals are too narrow for this motion "
            f"(torque predicted within {s.relative:.1%})"
        )
    elif s.own_friction and s.relative > WORSE * s.rigid_error:
        why = (
            f"rigid bodies are confirmed, the model's friction is not: error {s.relative:.0%} of "
            f"the torque, and {held}; the temperature, load or speeds may have changed"
        )
        remedy = "identify friction anew before torques are fed forward"
    elif s.asymmetry**2 > HALF:
        why = (
            f"friction asymmetric, {s.asymmetry:.0%} of the residual changes its sign with the "
            f"direction, and {held}; friction differs from the identification"
        )
        remedy = "identify friction anew"
    elif s.worse > WORSE:
        why = (
            f"the residual is {s.worse:.1f} times that of the identification, and {held}; the model"
            " does not hold for the speeds and positions of this motion"
        )
        remedy = "identify the model from motions like this one"
    else:
        why = (
            f"{held}, at least {INSIDE:.0%} needed; error of the prediction {s.relative:.0%} "
            "of the torque"
        )
    return doubtful(f"axis {s.axis}: {why}", remedy)


RULES: tuple[Rule[Scores], ...] = (
    _naive,
    When(
        _worst(lambda s: s.limited, LEVEL),
        "axis {0.axis}: saturated, {0.limited:.0%} of the samples are at the same largest "
        "torque; the drive was at its limit",
        "record a slower motion",
    ),
    When(
        _worst(lambda s: min(s.uncertain, s.shown), TOLERANCE),
        "axis {0.axis}: not excited, standard errors of the prediction are {0.uncertain:.0%} of "
        f"this motion's torque ({{0.shown:.0%}} seen in the residual); at most {TOLERANCE:.0%} "
        "allowed",
        "measure motions that show these parameters (hil plan --refine)",
    ),
    When(
        _worst(lambda s: abs(s.gain - 1.0) - SURE * s.gain_error, TOLERANCE),
        "axis {0.axis}: gains inconsistent, measured torques are {0.gain:.2f} times those "
        f"predicted, at most {TOLERANCE:.0%} deviation allowed",
        "compare torque constant, gain and motor temperature with those of the identification",
    ),
    _narrow,
    When(
        lambda scores: ", ".join(str(s.axis) for s in scores if not s.own_friction),
        "axis {0}: the model has no friction and cannot predict the drive's torque; judged with "
        "friction fitted to this recording",
    ),
)
"""Rules in order: faults of the recording come before errors of the parameters."""


def score_own_recordings(model: Model, run: Run) -> Validation | None:
    """Judge a run used for the model as failed; return None for another run."""
    common, every = recordings_in_common(model.provenance, run), len(run)
    if not common:
        return None
    which = "its recordings are" if common == every else f"{common} of its {every} recordings are"
    return Validation(
        word="failed",
        reason=f"{which} those used for identification: no test on held-out data",
        remedy="judge the model by another recording",
    )
