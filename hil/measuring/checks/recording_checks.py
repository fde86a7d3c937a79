"""Checks of a recording while the measurement can still be repeated.

Each check compares a figure of the recording with its bound and states failures as a `Finding` with
value, bound and remedy: of telegrams, currents, motion against the plan, and steady friction.

A current sensor is alive if successive readings differ by noise. If a share r of the readings
equals the previous reading, a run of k equal readings somewhere among n has a probability of about
n r^(k-1). A run too long for chance is no measurement of a current.

Velocities are differences of position over a lag, also for the ideal profile, so that no filter is
involved.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from drivers.drive_bus import LATE_FOR, SampleFlag
from hil.measuring.checks.encoder_jumps import longest_run, median_of_three
from hil.measuring.travel import astray
from hil.planning.strokes import MARGIN, SHORTEST_WINDOW
from hil.runs.recording import CHANCE, Finding

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.runs.recording import Recording

    Check = Callable[[Recording, Any, Robot], Iterable[Finding]]
    from hil.arrays import Indices
    from hil.planning.strokes import Strokes
    from hil.planning.trapezoid import Trapezoid


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
            numbers = recording.partner_stroke[recording.span(stroke)]
            strokes = np.unique(numbers[numbers >= 0])
            if len(strokes) < 2:
                yield Finding(
                    "partner",
                    f"{_name(stroke)}: {len(strokes)} strokes of the partner axis meanwhile, must "
                    "be at least 2; plan a longer stroke of the creeping axis",
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
    """Return the highest median of three successive mean velocities over `LAG` [rad/s or m/s].

    The median ignores a wrong time stamp, which ends one mean and begins another.
    """
    known = np.isfinite(q) & (np.diff(time, prepend=-np.inf) > 0)
    time, q = time[known], q[known]
    lag = max(1, round(LAG / period))
    speeds = np.abs(q[lag:] - q[:-lag]) / (time[lag:] - time[:-lag])
    if len(speeds) < 3:
        return float(np.max(speeds, initial=0.0))
    return float(median_of_three(speeds).max())


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
    return f"{robot.position_unit(index)}/s"


def _name(stroke: int) -> str:
    return f"stroke {stroke + 1} ({'back' if stroke % 2 else 'forward'})"


__all__ = ["Finding", "check"]

TOLERATED = 0.01
"""Maximum share of SYNCs that were skipped or have no telegram, and of doubled or late telegrams.

The estimator skips gaps.
"""
UNTIMED = 0.1
"""Maximum share of samples with an uncertain instant, left out by the estimation."""
LEAST_ANSWERS = 10
"""Minimum number of answers for a judgement of the SYNCs in between."""
RARE, OFTEN = 0.05, 0.9
"""Bounds of the share of equal neighbours, and of equal intervals."""


def check(recording: Recording, measurement: Measurement, robot: Robot) -> list[Finding]:
    """Check a recording.

    Parameters
    ----------
    measurement : Measurement
        Planned measurement.
    robot : Robot
        Robot, for the units of the axes.

    Returns
    -------
    list of Finding
        Failed checks; empty for a usable recording.
    """
    steps = (*ALWAYS, *CHECKS[measurement.kind])
    return [finding for step in steps for finding in step(recording, measurement, robot)]


def _gaps(recording: Recording, measurement: Measurement, robot: Robot) -> Iterator[Finding]:
    del measurement, robot
    missing = int(np.any(recording.flags & SampleFlag.MISSING, axis=1).sum())
    left_out = int(_left_out(recording).sum())
    bound = max(1, int(TOLERATED * (recording.n_samples + left_out)))
    if missing + left_out > bound:
        axes = _axes(recording, SampleFlag.MISSING)
        lacking = f"{missing} of {recording.n_samples} samples lack a telegram of axis {axes}"
        late = f"{left_out} SYNCs were too late and are left out"
        lost = " and ".join([lacking] * (missing > 0) + [late] * (left_out > 0))
        every = _answered(recording)
        held_back = (
            f"the drive answers only every {every} SYNCs: set the inhibit time (1800:03) to 0 "
            f"with the maker's tool, or sync_period: {every * recording.period:.3g}"
        )
        wiring = "check wiring, termination and bus load" if every == 1 else held_back
        remedies = [wiring] * (missing > 0) + ["stop other programs or sample more slowly"] * (
            left_out > 0
        )
        yield Finding(
            "gaps",
            f"{lost}, at most {bound} allowed; {', '.join(remedies)}",
            missing + left_out,
            bound,
        )
    bad = SampleFlag.DOUBLED | SampleFlag.LATE
    disturbed = float(np.any(recording.flags & bad, axis=1).mean())
    if disturbed > TOLERATED:
        yield Finding(
            "telegrams",
            f"{disturbed:.1%} of the samples have doubled or late telegrams of axis "
            f"{_axes(recording, bad)}, at most {TOLERATED:.0%} allowed; lower the bus load or "
            "sample more slowly",
            disturbed,
            TOLERATED,
        )


def _timing(recording: Recording, measurement: Measurement, robot: Robot) -> Iterator[Finding]:
    """Yield a finding if too many samples have uncertain instants."""
    del measurement, robot
    share = float(np.any(recording.flags & SampleFlag.UNTIMED, axis=1).mean())
    if share > UNTIMED:
        yield Finding(
            "timing",
            f"this computer was interrupted during {share:.1%} of the SYNCs, whose times are "
            f"uncertain, at most {UNTIMED:.0%} allowed; stop other programs, run with --realtime "
            "or sample more slowly",
            share,
            UNTIMED,
        )


def renewal(recording: Recording, measurement: Measurement, robot: Robot) -> Iterator[Finding]:
    """Yield a finding if drives renew position or current less often than SYNC comes."""
    del measurement, robot
    moving = recording.active
    old = np.any(recording.flags[moving] & SampleFlag.OLD, axis=1)
    share = float(old.mean()) if moving.any() else 0.0
    if share > TOLERATED:
        period = float(np.median(np.diff(recording.time)))
        fresh = recording.time[moving][~old]
        spans = np.diff(fresh)[np.diff(np.flatnonzero(~old)) > 1]
        every = round(float(np.median(spans)) / period) if len(spans) else 1
        yield Finding(
            "renewal",
            f"{share:.0%} of the samples in motion repeat a position or current of axis "
            f"{_axes(recording, SampleFlag.OLD)}, updated only every {every} SYNCs, at most "
            f"{TOLERATED:.0%} allowed; only fresh samples are used: set sync_period: "
            f"{every * period:.3g} in the drives file and sample_period in the plan",
            share,
            TOLERATED,
        )


def _saturation(recording: Recording, measurement: Measurement, robot: Robot) -> Iterator[Finding]:
    del measurement, robot
    at = np.any(recording.flags & SampleFlag.LIMIT, axis=1) & recording.active
    saturated = int(at.sum())
    if not saturated:
        return
    # a drive without new set-points stops at once, with its full torque
    late, t = recording.time[_left_out(recording) > 0], recording.time[at]
    after = int((np.searchsorted(late, t, "right") > np.searchsorted(late, t - LATE_FOR)).sum())
    plan = "plan a smaller acceleration or another configuration"
    when, remedy = "", plan
    if after:
        when = f", {after} of them" * (after < saturated) + " after late SYNCs"
        remedy = "stop other programs, run with --realtime or sample more slowly"
        remedy += f"; {plan}" * (after < saturated)
    yield Finding(
        "saturation",
        f"axis {_axes(recording, SampleFlag.LIMIT)} is at its internal limit in {saturated}"
        f" samples{when}, must be 0; {remedy}",
        saturated,
        0,
    )


def _left_out(recording: Recording) -> Array:
    """Return the number of SYNCs left out before each sample, shape (n,)."""
    intervals = np.diff(recording.time)
    return np.append(0.0, np.maximum(0.0, np.rint(intervals / np.median(intervals)) - 1))


def _answered(recording: Recording) -> int:
    """Return the interval of an axis's answers in SYNCs in a regular stretch; 1 for every SYNC."""
    for missing in (recording.flags & SampleFlag.MISSING).T > 0:
        apart = np.diff(np.flatnonzero(~missing))
        first, last = longest_run((apart[1:] == apart[:-1]) & (apart[1:] > 1))
        if last - first >= LEAST_ANSWERS:
            return int(apart[first])
    return 1


def _axes(recording: Recording, flag: int) -> str:
    hit = np.any(recording.flags & flag, axis=0)
    return ", ".join(str(index + 1) for index in np.flatnonzero(hit))


def frozen(recording: Recording, measurement: Measurement, robot: Robot) -> Iterator[Finding]:
    """Yield findings of measured axes with a constant torque during motion."""
    moving = recording.active
    for index in measurement.read:
        tau, unit = recording.tau[moving, index], robot.torque_unit(index)
        # start of the longest run of equal values, and its length
        changes = np.flatnonzero(np.diff(tau) != 0)
        edges = np.concatenate(([-1], changes, [len(tau) - 1]))
        lengths = np.diff(edges)
        place = int(np.argmax(lengths))
        begin, longest = int(edges[place]) + 1, int(lengths[place])
        # longest run explained by chance, estimated outside of the longest run
        equal = int(np.count_nonzero(np.diff(tau) == 0)) - (longest - 1)
        share = min(max(equal / max(1, len(tau) - longest), RARE), OFTEN)
        bound = math.ceil(1 + math.log(CHANCE / len(tau)) / math.log(share))
        if longest > bound:
            yield Finding(
                "current",
                f"the current of axis {index + 1} reads {tau[begin]:.4g} {unit} in {longest} "
                f"consecutive samples, at most {bound} allowed; the sensor is stuck, clipped or too"
                " coarse: check the drive's current measurement and its range",
                longest,
                bound,
            )


ALWAYS: tuple[Check, ...] = (_gaps, _timing, renewal, _saturation, frozen)
"""Checks of every recording."""
SIGN = "sign"
"""Name of the check whose failure ends a run: torques of the axis have the wrong sign."""
LASTING = frozenset({"renewal", SIGN})
"""Names of checks that another attempt would fail as well."""
CHECKS: dict[str, tuple[Check, ...]] = {
    "gravity": (opposed, windows, half_sums),
    "inertia": (peaks,),
    "coupling": (opposed, windows, stuck, partners),
    "friction": (opposed, windows),
    "trajectory": (astray,),
}
"""Additional checks by kind of measurement."""
