"""Checks of an axis at rest and during a small move in both directions.

Friction gives the sign of the current. In both directions the axis passes the same places at the
same speed, so gravity adds the same torque to both, and half the difference of the two means is
friction::

    tau_f = (mean of tau in positive direction - mean of tau in negative direction) / 2

Friction dissipates power for any axis and load: tau_f > 0, or the current has the wrong
sign.

Gravity gives the direction of a joint, by the model of a robot. A stroke in both directions over
the same path cancels friction: half the sum of the two mean torques is gravity. A joint with a
wrong `sign` shows angle and torque with the wrong sign, so the measurement at q is the negative
prediction at -q::

    sign right    tau(q) =  g(q)
    sign wrong    tau(q) = -g(-q)

An arm hanging straight down is symmetric: both predictions agree there, and the check is undecided.
It is also undecided if they differ by less than the uncertainty due to friction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from drivers.axis import AxisScale
from drivers.commissioning.verdict import Grade, Verdict, grade_check, undecided, unknown

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from drivers.drives_file import AxisDrive
    from drivers.operator_tools.small_move import Stroke

SIGNIFICANT = 4.0
"""Smallest friction with a certain sign, in standard errors."""
VELOCITY_SAME = 0.3
"""Largest relative deviation from the commanded velocity: a short move is mostly transients, and
a wrong unit gives a larger deviation."""
NOISE_MAX = 0.01
"""Largest noise of the current, as a share of the torque limit, without loss of accuracy."""
QUANTUM_MAX = 0.005
"""Largest step of the current, as a share of the torque limit, without loss of accuracy."""
LEAST_CHANGES = 10
"""Smallest number of changes of a value from which a refresh period is computed."""
RENEWED = 0.05
"""Tolerated share of repeated readings beyond quantisation: if a drive refreshes at the rate of
SYNC by its own clock, some values are read twice."""
WINDOW_SHARE = 0.5
"""Largest following error of a slow move, as a share of the window."""


@dataclass(frozen=True, eq=False)
class Moved:
    """Observation of an axis at rest and during a small move in both directions.

    Attributes
    ----------
    place : str
        Name of the axis in messages.
    drive : AxisDrive
    number : int
        Joint index, from 0.
    pose : ndarray, shape (n_axes,)
        Rest positions of all joints [rad or m]; all but the moved joint stayed there.
    held : ndarray, shape (m,)
        Torque at rest, by the file's scale [N m or N]; NaN where TPDOs are missing.
    counts : ndarray, shape (n, 2)
        Pairs of 6077 and the current object; empty where the latter is 6077.
    strokes : sequence of Stroke
        Strokes in both directions.
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
        """Friction, positive if dissipative, and its standard error [N m].

        The variation of torque along the path counts as noise. 0 and infinity for short strokes.
        """
        return self._half_sum([math.copysign(1.0, _slope(stroke)) for stroke in self.strokes])

    @cached_property
    def gravity(self) -> tuple[float, float]:
        """Torque common to both directions, and its standard error [N m]."""
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
    """Judge samples of an axis at rest.

    Parameters
    ----------
    place : str
        Name of the axis in messages.
    drive : AxisDrive
    q, tau : ndarray, shape (n,)
        Positions [rad], torques [N m]; NaN where TPDOs are missing.
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
        "use an object of finer resolution, if the drive has one",
    )
    noise = float(np.nanstd(np.diff(tau))) / math.sqrt(2)  # without slow drift
    yield grade_check(
        noise <= NOISE_MAX * limit,
        Grade.WARNING,
        place,
        "current noise",
        f"{noise:.3g} {force} rms, {noise / limit:.2%} of the limit",
        f"at most {NOISE_MAX:.0%}",
        "set a filter for the current's actual value, check shield and grounding",
    )


def judge_strokes(seen: Moved) -> Iterator[Verdict]:
    """Judge refresh period, velocity, sign of the current and following error of both strokes."""
    scale = AxisScale.derive(seen.drive)
    yield _judge_refresh(seen, "position", abs(scale.position), "q")
    yield _judge_refresh(seen, "current", scale.torque_step, "tau")
    yield _judge_velocity(seen)
    yield _judge_sign(seen)
    yield _judge_following(seen)


def refresh_period(stretches: Sequence[NDArray[np.float64]], step: float) -> float:
    """Return the refresh period [SYNCs] of a value that changes continuously.

    Readings x rounded to steps s repeat by chance, at most a share of about s / (sigma sqrt(2 pi)),
    with sigma the standard deviation of x's changes, if normal. If more repeat, or hardly any
    change follows another immediately, the drive refreshes the value less often.

    Parameters
    ----------
    stretches : sequence of ndarray, shape (n,)
        Values of successive SYNCs.
    step : float
        Resolution of the value, in the same unit.

    Returns
    -------
    float
        1 for a refresh with each SYNC, NaN if the value changes too rarely.
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


def _judge_refresh(seen: Moved, what: str, step: float, name: str) -> Verdict:
    """Judge the refresh period of a value, by its readings in motion."""
    stretches = []
    for stroke in seen.strokes:
        # near the ends the axis is too slow for a new position at each SYNC
        moving = stroke.between(0.1 * abs(stroke.move.target - stroke.q[0]))
        stretches.append(getattr(stroke, name)[moving & np.isfinite(stroke.tau)])
    every, check = refresh_period(stretches, step), f"refresh of the {what}"
    if math.isnan(every):
        return undecided(seen.place, check, "too few changes", "raise --angle")
    time = every * float(np.median(np.diff(seen.strokes[0].time)))
    return grade_check(
        every < 1.0 + RENEWED,
        Grade.REFUSED,
        seen.place,
        check,
        f"every {f'{every:.3g} SYNCs' if every > 1 else 'SYNC'} ({1000 * time:.3g} ms)",
        "with every SYNC",
        f"set sync_period: {time:.3g} in the drives file and sample_period in the plan, or let "
        "the drive update it faster",
    )


def _judge_velocity(seen: Moved) -> Verdict:
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
        "correct velocity_unit; if the distance was too short, raise --angle",
    )


def _judge_sign(seen: Moved) -> Verdict:
    friction, error = seen.friction
    found = f"friction {friction:+.3g} ± {error:.2g} {seen.drive.effort_unit}"
    bound = "along the motion: positive"
    if not abs(friction) > SIGNIFICANT * error:
        remedy = "too little to decide: raise --angle, or check that this is the motor's current"
        return Verdict(Grade.WARNING, seen.place, "sign of the current", found, bound, remedy)
    return grade_check(
        friction > 0,
        Grade.REFUSED,
        seen.place,
        "sign of the current",
        found,
        bound,
        f"current and position have opposite signs: set current.sign: {-seen.drive.current.sign} "
        "in the drives file",
    )


def _judge_following(seen: Moved) -> Verdict:
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
    """Return the velocity while cruising, by a straight line through the positions [rad/s]."""
    use = stroke.cruising & np.isfinite(stroke.q)
    if np.count_nonzero(use) < 2:
        return math.nan
    return float(np.polyfit(stroke.time[use], stroke.q[use], 1)[0])


Gravity: TypeAlias = "Callable[[NDArray[np.float64]], NDArray[np.float64]]"
"""Holding torques of an arm [N m], shape (n,), at joint coordinates, shape (n,)."""

DIRECTION = "direction of the joint"
SEPARATION = 4.0
"""Smallest difference of the two predictions, in standard errors."""
LEFT_OVER = 0.2
"""Share of friction that may differ between the directions and appear as gravity."""
CLOSE = 0.3
"""Largest deviation of the torque from one prediction, as a share of their difference."""


def judge_direction(seen: Moved, gravity: Gravity | None) -> Verdict:
    """Judge the sign of a joint.

    Parameters
    ----------
    seen : Moved
        Observation of the axis.
    gravity : callable or None
        Holding torques by a robot's model; None without a model.
    """
    place, drive, strokes = seen.place, seen.drive, seen.strokes
    if gravity is None:
        remedy = "watch a jog, or give a run with --model"
        return undecided(place, DIRECTION, "no model of the robot", remedy)
    measured, error = seen.gravity
    if not math.isfinite(error):
        return undecided(place, DIRECTION, "too few samples at constant speed", "raise --angle")
    passed = np.linspace(strokes[0].q[0], strokes[0].move.target, 11)
    right = float(np.mean([_torque(gravity, seen, q) for q in passed]))
    wrong = -float(np.mean([_torque(gravity, seen, -q) for q in passed]))
    unit = drive.effort_unit
    found = f"gravity {measured:+.3g} {unit}"
    bound = f"model: {right:+.3g} {unit}, reversed {wrong:+.3g} {unit}"
    apart = abs(right - wrong)
    if apart < SEPARATION * error + LEFT_OVER * abs(seen.friction[0]):
        remedy = "gravity of both signs is too similar: move the arm out of the upright position"
        return undecided(place, DIRECTION, found, remedy, bound)
    if abs(measured - right) < CLOSE * apart:
        return Verdict(Grade.OK, place, DIRECTION, f"confirmed, {found}", bound)
    if abs(measured - wrong) < CLOSE * apart:
        remedy = f"set sign: {-drive.sign} in the drives file, and determine zero anew"
        return Verdict(Grade.REFUSED, place, DIRECTION, f"contradicts, {found}", bound, remedy)
    remedy = "fits neither sign: check gear_ratio, zero, the unit of the current, and the payload"
    return undecided(place, DIRECTION, found, remedy, bound)


def _torque(gravity: Gravity, seen: Moved, q: float) -> float:
    at = seen.pose.copy()
    at[seen.number] = q
    return float(gravity(at)[seen.number])
