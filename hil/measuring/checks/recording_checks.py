"""Checks of a recording while the measurement can still be repeated.

Each check compares a figure of the recording with its bound and states failures as a `Finding` with
value, bound and remedy. Telegrams and currents are checked here, motions in
`hil.measuring.checks.stroke_checks`.

A current sensor is alive if successive readings differ by noise. If a share r of the readings
equals the previous reading, a run of k equal readings somewhere among n has a probability of about
n r^(k-1). A run too long for chance is no measurement of a current.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from drivers.drive_bus import LATE_FOR, SampleFlag
from hil.measuring.checks.encoder_jumps import longest_run
from hil.measuring.checks.stroke_checks import half_sums, opposed, partners, peaks, stuck, windows
from hil.measuring.travel import astray
from hil.runs.recording import CHANCE, Finding

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.runs.recording import Recording

    Check = Callable[[Recording, Any, Robot], Iterable[Finding]]

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
    recording : Recording
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
        yield from _frozen(recording.tau[moving, index], index + 1, robot.torque_unit(index))


def _frozen(tau: Array, axis: int, unit: str) -> Iterator[Finding]:
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
            f"the current of axis {axis} reads {tau[begin]:.4g} {unit} in {longest} consecutive "
            f"samples, at most {bound} allowed; the sensor is stuck, clipped or too coarse: "
            "check the drive's current measurement and its range",
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
