"""What samples at rest and of a small move back and forth say of an axis; arrays in, verdicts out.

The sign of the current follows from friction. On the way there and on the way back the axis passes
the same places at the same speed, so gravity adds the same torque to both, and half the difference
of the two means is friction::

    tau_f = (mean of tau in positive direction - mean of tau in negative direction) / 2

Friction takes power, whatever the axis and the load: tau_f > 0, or the current has the wrong sign.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from drivers.axis import AxisScale
from drivers.commissioning.verdict import Grade, Verdict, grade_check, undecided, unknown

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from drivers.drives_file import AxisDrive
    from drivers.operator_tools.small_move import Stroke

SIGNIFICANT = 4.0
"""Friction must exceed its standard error this many times for its sign to be believed."""
VELOCITY_SAME = 0.3
"""The measured velocity may differ from the commanded one by this share: a short way is mostly
transients, and units differ by more."""
NOISE_MAX = 0.01
"""Of the torque limit: noise of the current above it costs accuracy."""
QUANTUM_MAX = 0.005
"""Of the torque limit: coarser steps of the current cost accuracy."""
LEAST_CHANGES = 10
"""Changes of a value from which on the time between them means anything."""
RENEWED = 0.05
"""Share of the readings that may repeat beyond what the steps of a value explain: where a drive
renews it as often as SYNC comes, but by a clock of its own, some are read twice."""
WINDOW_SHARE = 0.5
"""Of the following error window that a slow move may take up."""


@dataclass(frozen=True, eq=False)
class Moved:
    """What was seen of an axis that rested, and then went there and back over the same way.

    Attributes
    ----------
    place : str
        The axis, for messages.
    drive : AxisDrive
        What the drives file states.
    number : int
        Its joint, from 0.
    pose : ndarray, shape (n_axes,)
        Where all joints rested [rad or m]; the others stayed there.
    held : ndarray, shape (m,)
        Its torque at rest, by the file's scale [N m or N]; NaN where TPDOs are missing.
    counts : ndarray, shape (n, 2)
        Pairs of 6077 and of the object that is measured; none where that is 6077 itself.
    strokes : sequence of Stroke
        There and back.
    """

    place: str
    drive: AxisDrive
    number: int
    pose: NDArray[np.float64]
    held: NDArray[np.float64]
    counts: NDArray[np.float64]
    strokes: Sequence[Stroke]

    @cached_property
    def friction(self) -> tuple[float, float]:
        """Friction, positive where it takes power, and its standard error [N m].

        Torque varies along the way, which counts as noise. 0 and infinity if the strokes were too
        short.
        """
        return self._half_sum([math.copysign(1.0, _slope(stroke)) for stroke in self.strokes])

    @cached_property
    def gravity(self) -> tuple[float, float]:
        """The torque that both directions have in common, and its standard error [N m]."""
        return self._half_sum([1.0 for _ in self.strokes])

    def _half_sum(self, signs: Sequence[float]) -> tuple[float, float]:
        means, variances = [], []
        for stroke, sign in zip(self.strokes, signs, strict=True):
            tau = stroke.tau[stroke.cruising]
            tau = tau[np.isfinite(tau)]
            if tau.size < 2:
                return 0.0, math.inf
            means.append(sign * float(np.mean(tau)))
            variances.append(float(np.var(tau)) / tau.size)
        return sum(means) / 2, math.sqrt(sum(variances)) / 2


def judge_rest(
    place: str, drive: AxisDrive, q: NDArray[np.float64], tau: NDArray[np.float64]
) -> Iterator[Verdict]:
    """Judge samples of an axis that holds its position.

    Parameters
    ----------
    place : str
        The axis, for messages.
    drive : AxisDrive
        What the drives file states.
    q, tau : ndarray, shape (n,)
        [rad], [N m]; NaN where TPDOs are missing.
    """
    unit, force = drive.unit, drive.effort_unit
    wander = float(np.nanmax(q) - np.nanmin(q))
    yield grade_check(
        wander <= drive.position_window,
        Grade.REFUSED,
        place,
        "holding (brake, load)",
        f"wanders by {wander:.2g} {unit}",
        f"at most {drive.position_window:g} {unit}",
        "check the brake's release, the load, and the tuning of the drive's loops",
    )
    limit, quantum = drive.limits.torque, AxisScale.derive(drive).torque_step
    yield grade_check(
        quantum <= QUANTUM_MAX * limit,
        Grade.WARNING,
        place,
        "current quantisation",
        f"{quantum:.3g} {force}, {quantum / limit:.2%} of the limit",
        f"at most {QUANTUM_MAX:.1%}",
        "use a finer object where the drive has one",
    )
    noise = float(np.nanstd(np.diff(tau))) / math.sqrt(2)  # a slow drift is no noise
    yield grade_check(
        noise <= NOISE_MAX * limit,
        Grade.WARNING,
        place,
        "current noise",
        f"{noise:.3g} {force} rms, {noise / limit:.2%} of the limit",
        f"at most {NOISE_MAX:.0%}",
        "set a filter of the current's display, check shield and grounding",
    )


def judge_strokes(seen: Moved) -> Iterator[Verdict]:
    """Judge velocity, sign of the current and following error of both strokes."""
    scale = AxisScale.derive(seen.drive)
    yield _renewal(seen, "position", abs(scale.position), "q")
    yield _renewal(seen, "current", scale.torque_step, "tau")
    yield _velocity(seen)
    yield _current_sign(seen)
    yield _following(seen)


def renewed_every(stretches: Sequence[NDArray[np.float64]], step: float) -> float:
    """Return how many SYNCs lie between two renewals of a value that changes all the time.

    Readings x that are rounded to steps s repeat by chance, at most about s / (sigma sqrt(2 pi)) of
    them, with sigma the standard deviation of x's changes, if these are normal. Where more do, or
    hardly any follows the one before without a repetition, the drive renews the value less often.

    Parameters
    ----------
    stretches : sequence of ndarray, shape (n,)
        Values of successive SYNCs.
    step : float
        Least change that the value can show, in the same unit.

    Returns
    -------
    float
        1 where it is renewed with each SYNC, NaN where it changes too rarely to tell.
    """
    steps = [np.diff(values) for values in stretches]
    intervals = np.concatenate([np.diff(np.flatnonzero(each)) for each in steps])
    if len(intervals) < LEAST_CHANGES:
        return math.nan
    changes = np.concatenate([each[each != 0] for each in steps])
    by_chance = step / max(float(np.sqrt(np.mean(changes**2))) * math.sqrt(2 * math.pi), step)
    repeated = 1.0 - 1.0 / float(np.mean(intervals))
    shortest = int(np.quantile(intervals, RENEWED, method="lower"))
    if shortest > 1:
        return float(np.mean(intervals[intervals < 1.5 * shortest]))
    return 1.0 / (1.0 - repeated) if repeated > RENEWED + 2 * by_chance else 1.0


def _renewal(seen: Moved, what: str, step: float, name: str) -> Verdict:
    """Judge how often the drive renews a value, by its readings in motion."""
    stretches = []
    for stroke in seen.strokes:
        # near the ends the axis is too slow to show another position at each SYNC
        moving = stroke.between(0.1 * abs(stroke.move.target - stroke.q[0]))
        stretches.append(getattr(stroke, name)[moving & np.isfinite(stroke.tau)])
    every, check = renewed_every(stretches, step), f"renewal of the {what}"
    if math.isnan(every):
        return undecided(seen.place, check, "it changes too rarely", "move farther")
    time = every * float(np.median(np.diff(seen.strokes[0].time)))
    return grade_check(
        every < 1.0 + RENEWED,
        Grade.REFUSED,
        seen.place,
        check,
        f"every {every:.3g} SYNCs ({1000 * time:.3g} ms)",
        "with every SYNC",
        f"set sync_period: {time:.3g} in the drives file and sample_period in the plan, or let the"
        " drive renew it faster: the readings between are old",
    )


def _velocity(seen: Moved) -> Verdict:
    wanted, unit = seen.strokes[0].move.velocity, seen.drive.unit
    found = [_slope(stroke) for stroke in seen.strokes]
    worst = max(found, key=lambda value: abs(abs(value) - wanted))
    return grade_check(
        abs(abs(worst) - wanted) <= VELOCITY_SAME * wanted,
        Grade.REFUSED,
        seen.place,
        "velocity scale",
        f"{abs(worst):.4g} {unit}/s",
        f"commanded: {wanted:.4g} {unit}/s",
        "correct velocity_unit; where the way was too short for it, move farther",
    )


def _current_sign(seen: Moved) -> Verdict:
    friction, error = seen.friction
    found = f"friction {friction:+.3g} ± {error:.2g} {seen.drive.effort_unit}"
    bound = "along the motion: positive"
    if not abs(friction) > SIGNIFICANT * error:
        remedy = "too little to decide: move farther, or make sure that this is the motor's current"
        return Verdict(Grade.WARNING, seen.place, "sign of the current", found, bound, remedy)
    return grade_check(
        friction > 0,
        Grade.REFUSED,
        seen.place,
        "sign of the current",
        found,
        bound,
        "the current counts against the position: set current.sign: "
        f"{-seen.drive.current.sign} in the drives file",
    )


def _following(seen: Moved) -> Verdict:
    largest = max(stroke.following_error for stroke in seen.strokes)
    unit, window = seen.drive.unit, seen.drive.following_error_window
    if math.isnan(largest):
        return unknown(seen.place, "following error (60F4)", "watch it in the maker's tool")
    return grade_check(
        largest <= WINDOW_SHARE * window,
        Grade.WARNING,
        seen.place,
        "following error (60F4)",
        f"{largest:.2g} {unit}",
        f"at most half of following_error_window, {window:g} {unit}",
        "widen following_error_window or tune the drive's position loop",
    )


def _slope(stroke: Stroke) -> float:
    """Velocity while cruising, by a straight line through the positions [rad/s]."""
    use = stroke.cruising & np.isfinite(stroke.q)
    if np.count_nonzero(use) < 2:
        return math.nan
    return float(np.polyfit(stroke.time[use], stroke.q[use], 1)[0])
