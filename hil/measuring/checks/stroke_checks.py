"""Checks of the axes' motion against the plan, and of steady friction.

Velocities are differences of position over a lag, also for the ideal profile, so that no filter is
involved.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from hil.planning.strokes import MARGIN, SHORTEST_WINDOW
from hil.runs.recording import Finding

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.arrays import Array, Indices
    from hil.model.robot import Robot
    from hil.planning.strokes import Partner, Strokes
    from hil.planning.trapezoid import Trapezoid
    from hil.runs.recording import Recording

VELOCITY_TOLERANCE = 0.05
"""Maximum relative deviation of the mean velocity in a window."""
SIGNIFICANT = 4.0
"""Minimum of negative friction in standard errors for a wrong sign."""
UNITS = "check the drive's velocity and acceleration units and limits"
PACING = (
    "the velocity is correct with the nominal SYNC period, so late SYNCs are the cause: use "
    "--pacing lock-step for a virtual plant; on a real bus stop other programs, or use --realtime"
)
LAG = 0.02
"""Time for averaging the highest velocity [s]."""
RUNNING = 3
"""Number of successive mean velocities in a median."""


def constant_velocity(recording: Recording, measurement: Strokes, stroke: int) -> Indices:
    """Return indices of the samples of `stroke` beyond the axis's ramps, by position."""
    profile = measurement.profile(stroke)
    span = recording.span(stroke)
    away = profile.ramp + MARGIN * profile.peak
    low, high = sorted((profile.start, profile.end))
    q = recording.q[span, measurement.index]
    inside = (q > low + away) & (q < high - profile.ramp)
    if stroke % 2:
        inside = (q > low + profile.ramp) & (q < high - away)
    return np.flatnonzero(inside) + int(span.start)


def windows(recording: Recording, measurement: Strokes, robot: Robot) -> Iterator[Finding]:
    """Yield findings of strokes with constant velocity too short or of a wrong value."""
    unit = _unit(robot, measurement.index)
    for stroke in range(measurement.n_strokes):
        window = constant_velocity(recording, measurement, stroke)
        length = len(window) * recording.period
        if length < SHORTEST_WINDOW:
            yield Finding(
                "window",
                f"{_name(stroke)}: constant velocity for {length:.3g} s, must be at least"
                f" {SHORTEST_WINDOW} s; plan a longer stroke or a lower velocity",
                length,
                SHORTEST_WINDOW,
            )
            continue
        reached = _mean_velocity(recording, measurement, window)
        profile = measurement.profile(stroke)
        wanted = float(profile.motion(profile.duration / 2)[1])
        bound = VELOCITY_TOLERANCE * abs(wanted)
        if abs(reached - wanted) > bound:
            even = _mean_velocity(_evenly(recording), measurement, window)
            paced = abs(even - wanted) <= bound
            yield Finding(
                "velocity",
                f"{_name(stroke)}: mean velocity {reached:.4g} {unit}, must be {wanted:.4g} {unit}"
                f" within {VELOCITY_TOLERANCE:.0%};"
                f" {PACING if paced else UNITS}",
                reached,
                wanted,
            )


def peaks(recording: Recording, measurement: Strokes, robot: Robot) -> Iterator[Finding]:
    """Yield findings of accelerating strokes that did not reach the speed of their profile."""
    unit = _unit(robot, measurement.index)
    for stroke in range(measurement.n_strokes):
        span, profile = recording.span(stroke), measurement.profile(stroke)
        yield from _peak(
            recording, span, measurement.index, profile, "velocity", _name(stroke), unit
        )


def half_sums(recording: Recording, measurement: Strokes, robot: Robot) -> Iterator[Finding]:
    """Yield a finding of unsteady friction: half-sums of successive strokes differ."""
    found = _torques(recording, measurement)
    if found is None or len(found[0]) < 3:
        return
    means, _, noise = found
    half_sums = (means[1:] + means[:-1]) / 2
    friction = float(np.abs(np.diff(means)).mean() / 2)
    spread = float(np.ptp(half_sums))
    # half-sums may differ by a twentieth of the friction level, and by chance
    bound = 0.05 * friction + 4 * noise
    if spread > bound:
        unit = robot.torque_unit(measurement.index)
        yield Finding(
            "half-sums",
            f"half-sums of successive strokes differ by {spread:.3g} {unit}, at most {bound:.3g} "
            f"{unit} allowed; friction is not stationary: warm up longer, or plan more cycles",
            spread,
            bound,
        )


def opposed(recording: Recording, measurement: Strokes, robot: Robot) -> Iterator[Finding]:
    """Yield a finding of torques against the motion: friction dissipates power.

    Half the difference of two successive strokes is friction, since both pass the same positions.
    """
    found = _torques(recording, measurement)
    if found is None or len(found[0]) < 2:
        return
    means, directions, noise = found
    frictions = (means * directions)[1:] / 2 + (means * directions)[:-1] / 2
    if frictions.max() < -SIGNIFICANT * noise:
        unit, friction = robot.torque_unit(measurement.index), float(frictions.mean())
        yield Finding(
            "sign",
            f"the torque of axis {measurement.axis} has the wrong sign: friction {friction:.3g} "
            f"{unit}, must be positive; reverse current.sign of this axis in the drives file, "
            "confirm with hil drives check, and measure anew",
            friction,
            0.0,
        )


def _torques(recording: Recording, measurement: Strokes) -> tuple[Array, Array, float] | None:
    """Return mean torques at constant velocity, directions, and the largest noise of a mean.

    Return None if a stroke has too few samples.
    """
    profiles = [measurement.profile(stroke) for stroke in range(measurement.n_strokes)]
    torque = [
        recording.tau[constant_velocity(recording, measurement, stroke), measurement.index]
        for stroke in range(measurement.n_strokes)
    ]
    torque = [values[np.isfinite(values)] for values in torque]
    if any(len(values) < 2 for values in torque):
        return None
    means = np.array([values.mean() for values in torque])
    directions = np.array([1.0 if each.end > each.start else -1.0 for each in profiles])
    return means, directions, max(float(v.std() / np.sqrt(len(v))) for v in torque)


def stuck(recording: Recording, measurement: Strokes, robot: Robot) -> Iterator[Finding]:
    """Yield findings of a creeping axis that stood still."""
    lag, unit = max(1, round(0.2 / recording.period)), _unit(robot, measurement.index)
    for stroke in range(measurement.n_strokes):
        window = constant_velocity(recording, measurement, stroke)
        if len(window) <= lag:
            continue
        q = recording.q[window, measurement.index]
        slowest = float(np.nanmin(np.abs(q[lag:] - q[:-lag]))) / (lag * recording.period)
        # an axis counts as stuck below a quarter of the creep velocity
        bound = 0.25 * measurement.velocity
        if slowest < bound:
            yield Finding(
                "stuck",
                f"{_name(stroke)}: the creeping axis slows to {slowest:.3g} {unit}, must stay "
                f"above {bound:.3g} {unit}; creep faster or let the partner accelerate less",
                slowest,
                bound,
            )


def partners(recording: Recording, measurement: Strokes, robot: Robot) -> Iterator[Finding]:
    """Yield findings of a partner without strokes forth and back in a creep stroke, or too slow."""
    for stroke in range(measurement.n_strokes):
        for partner in measurement.partners:
            yield from _partner(recording, measurement, stroke, partner, robot)


def _partner(
    recording: Recording, measurement: Strokes, stroke: int, partner: Partner, robot: Robot
) -> Iterator[Finding]:
    numbers = recording.partner_stroke[recording.span(stroke)]
    strokes = np.unique(numbers[numbers >= 0])
    if len(strokes) < 2:
        yield Finding(
            "partner",
            f"{_name(stroke)}: {len(strokes)} strokes of the partner axis meanwhile, must be at "
            "least 2; plan a longer stroke of the creeping axis",
            len(strokes),
            2,
        )
    for number in strokes:
        span, name = recording.partner_span(int(number)), f"partner's {_name(int(number))}"
        profile = partner.profile(measurement.q, int(number))
        unit = _unit(robot, partner.index)
        yield from _peak(recording, span, partner.index, profile, "partner", name, unit)


def _peak(
    recording: Recording,
    span: slice,
    axis: int,
    profile: Trapezoid,
    check: str,
    name: str,
    unit: str,
) -> Iterator[Finding]:
    reached = _highest_velocity(recording.time[span], recording.q[span, axis], recording.period)
    # an accelerating stroke must reach nine tenths of its profile's highest speed
    wanted = 0.9 * _ideal_velocity(profile, round(recording.period, 9))
    if reached < wanted:
        even = _evenly(recording).time[span]
        paced = _highest_velocity(even, recording.q[span, axis], recording.period) >= wanted
        yield Finding(
            check,
            f"{name}: highest velocity {reached:.3g} {unit}, must be at least {wanted:.3g} {unit};"
            f" {PACING if paced else UNITS}",
            reached,
            wanted,
        )


@lru_cache(maxsize=8)
def _ideal_velocity(profile: Trapezoid, period: float) -> float:
    t = np.arange(0.0, profile.duration, period)
    return _highest_velocity(t, profile.q(t), period)


def _highest_velocity(time: Array, q: Array, period: float) -> float:
    """Return the highest median of `RUNNING` successive mean velocities over `LAG` [rad/s or m/s].

    The median ignores a wrong time stamp, which ends one mean and begins another.
    """
    known = np.isfinite(q) & (np.diff(time, prepend=-np.inf) > 0)
    time, q = time[known], q[known]
    lag = max(1, round(LAG / period))
    speeds = np.abs(q[lag:] - q[:-lag]) / (time[lag:] - time[:-lag])
    if len(speeds) < RUNNING:
        return float(np.max(speeds, initial=0.0))
    return float(np.median(sliding_window_view(speeds, RUNNING), axis=1).max())


def _evenly(recording: Recording) -> Recording:
    """Return a recording with evenly spaced time stamps, as in lock-step."""
    period = float(np.median(np.diff(recording.time)))
    time: Array = period * np.arange(recording.n_samples, dtype=np.float64)
    return replace(recording, time=time)


def _mean_velocity(recording: Recording, measurement: Strokes, window: Indices) -> float:
    """Return the slope of a line fitted to the positions of `window` [rad/s or m/s]."""
    t = recording.time[window]
    q = recording.q[window, measurement.index]
    t = t - t.mean()
    return float(t @ q / (t @ t))


def _unit(robot: Robot, index: int) -> str:
    """Return the unit of velocities of an axis."""
    return f"{robot.position_unit(index)}/s"


def _name(stroke: int) -> str:
    return f"stroke {stroke + 1} ({'back' if stroke % 2 else 'forward'})"
