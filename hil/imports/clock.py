"""Sample times checked by recorded velocities.

A change of position divided by the recorded velocity measures time, so each joint with a recorded
velocity is a clock. Joints differ in unit and gain, never in time. A factor common to all joints is
an error of the rate. A time between two samples on which the velocities of all joints agree is
uneven sampling by the recorder.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from hil.imports.evidence import Suspicion, half_width
from hil.imports.instants import EVEN
from hil.imports.misread import FITS, OTHER, compared, other_units
from hil.least_squares.standstill import SPAN

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Mask
    from hil.imports.evidence import Evidence, Excerpt
    from hil.model.robot import Robot

LEAST = 0.01
"""Minimum relative error of a reported rate.

Accelerations are then off by 0.02, the usual error of inertias in a good identification.
"""
CHANCE = 5.0
"""Significance threshold [standard errors], exceeded by chance once in two million."""
FORETOLD = 0.5
"""Maximum share of the scatter of a joint's steps that the other joints' velocities leave
unexplained.

An uneven recorder is below this share; velocities without information leave 1 or more.
"""
TAIL = 0.01
"""Share of rows at either end of the sampling periods that is not stated as uneven.

A row in a hundred changes an estimate as little as one that is held (`stamps`).
"""
RIPPLE = (2.0 / np.pi - 4.0 / 12.0) / 16.0
"""Error of the trapezoidal rule as a share of the fourth difference.

At half the sampling rate a speed of amplitude 1 has the mean 2 / pi over half a period, where the
rule finds 0, the second difference 4 and the fourth 16.
"""
TAPS = 5
"""Number of velocities on either side of a step that describe a lag or a low-pass.

They are as far apart as a fifth of `evidence.HALF_WIDTH`: velocities change little in between.
"""


def clock_suspicions(
    excerpts: Sequence[Excerpt], evidence: Evidence, robot: Robot, rate: float | None
) -> Iterator[Suspicion]:
    """Yield suspicions of a wrong rate or unit of time, or of uneven samples, by velocities.

    `rate` is the rate stated by the map [Hz], None for time stamps.
    """
    shown = clocks(evidence)
    if not shown.any():
        return
    ratio, error = _ratios(excerpts, evidence, shown)
    common = _common(ratio, error)
    agreeing = np.all(np.abs(np.log(ratio / common)) <= error)
    period = excerpts[0].period
    joints = ", ".join(str(joint + 1) for joint in np.flatnonzero(shown))
    units = [
        factor
        for joint in np.flatnonzero(shown).tolist()
        for each in other_units(robot, joint).values()
        for factor in (each, 1.0 / each)
    ]
    # a factor explained by a unit is attributed to the unit
    explained = any(abs(common / factor - 1.0) < LEAST for factor in units)
    if agreeing and not explained and abs(np.log(common)) > max(LEAST, float(error.min())):
        has = f"the map states {rate:.5g}" if rate else f"samples are stamped at {1 / period:.5g}"
        alone = len(ratio) == 1  # its velocity may have another unit as well
        yield Suspicion(
            "velocity",
            ("time",),
            f"{has} Hz, but recorded velocities of {'joint' if alone else 'joints'} {joints} are "
            f"{common:.4g} times the derivatives of the positions: at "
            f"{common * (rate or 1 / period):.5g} Hz {'they' if alone else 'all of them'} fit; "
            f"correct the {'rate' if rate else 'stamps'} or the unit of time, or "
            f"{'unit or column of this velocity' if alone else 'the common unit of velocities'}",
            certain=len(ratio) > 1 and abs(np.log(common)) > np.log(OTHER),
            first=True,
        )
    elif explained or abs(np.log(common)) > np.log(OTHER) or shown.sum() < 2:
        return
    elif (steps := _uneven(excerpts, shown, common)) is not None:
        low, high = steps
        remedy = (
            "record a time stamp with each row, and name its column in place of the rate"
            if rate
            else "the stamps are not the instants of the samples: record the drive's own stamps, "
            "or at a rate that divides the drive's"
        )
        yield Suspicion(
            "velocity",
            ("time",),
            f"samples are not equidistant: by the recorded velocities of joints {joints}, "
            f"sampling periods reach from {1e3 * low * period:.3g} to {1e3 * high * period:.3g} "
            f"ms, mean {1e3 * period:.3g} ms; {remedy}",
            certain=False,
            first=True,
        )


def clocks(evidence: Evidence) -> Mask:
    """Return a mask of joints that measure time: their recorded velocity follows the position."""
    product = np.sum(evidence.qd * evidence.recorded_qd, axis=0)
    size = np.linalg.norm(evidence.qd, axis=0) * np.linalg.norm(evidence.recorded_qd, axis=0)
    follows = np.nan_to_num(product) >= FITS * np.nan_to_num(size)
    return np.asarray(compared(evidence) & (np.nan_to_num(size) > 0) & follows)


def common_ratio(
    excerpts: Sequence[Excerpt], evidence: Evidence, shown: Mask
) -> tuple[float, float]:
    """Return the ratio of the rate by velocities to the map's rate, and its relative error."""
    ratio, error = _ratios(excerpts, evidence, shown)
    return _common(ratio, error), float(error.min())


def _common(ratio: Array, error: Array) -> float:
    return float(np.exp(np.average(np.log(ratio), weights=error**-2)))


def _ratios(excerpts: Sequence[Excerpt], evidence: Evidence, shown: Mask) -> tuple[Array, Array]:
    """Return the ratios of recorded velocities to derivatives of the positions, and their errors.

    Distances over `SPAN` are compared with integrals of the velocity. Root mean squares do not
    depend on a delay; a first-order filter with a phase lag reduces amplitude and correlation by
    the cosine of the lag.
    """
    sums, n = np.zeros((3, int(shown.sum()))), 0
    bends, powers = np.zeros((2, int(shown.sum()))), np.zeros(int(shown.sum()))
    noise = np.zeros((2, int(shown.sum())))
    for each in excerpts:
        every = max(2, round(SPAN / each.period))
        qd = each.qd[:, shown]
        way = each.period * np.cumsum((qd[1:] + qd[:-1]) / 2, axis=0)
        by_velocity = np.diff(np.vstack([0.0 * way[:1], way])[::every], axis=0)
        by_position = np.diff(each.q[::every, shown], axis=0)
        sums += [
            (by_velocity**2).sum(0),
            (by_position**2).sum(0),
            (by_velocity * by_position).sum(0),
        ]
        n += len(by_position)
        bends += [(np.diff(qd, order, axis=0) ** 2).sum(axis=0) for order in (2, 4)]
        powers += (qd**2).sum(axis=0)
        noise += len(by_position) * np.array([
            every * (each.period * evidence.noise_recorded[shown]) ** 2,
            2.0 * each.extent.noise[shown] ** 2,
        ])  # fmt: skip
    of_velocity, of_position = np.maximum(sums[:2] - noise, 0.1 * sums[:2])
    power = np.maximum(np.sqrt(sums[0] * sums[1]), np.finfo(float).tiny)
    correlation = np.clip(sums[2] / power, -1.0, 1.0)
    error = CHANCE * np.sqrt((1.0 - correlation**2) / max(n, 1)) + (1.0 - correlation)
    # the trapezoidal rule is off by a twelfth of the second difference, and by more where speeds
    # ripple from sample to sample, as under set-points held for some samples
    rough = np.sqrt(bends / np.maximum(powers, np.finfo(float).tiny))
    error += rough[0] / 12.0 + RIPPLE * rough[1]
    ratio = np.sqrt(of_velocity / np.maximum(of_position, np.finfo(float).tiny))
    return np.maximum(ratio, np.finfo(float).tiny), np.maximum(error, np.finfo(float).eps)


def _uneven(excerpts: Sequence[Excerpt], shown: Mask, common: float) -> Array | None:
    """Return the least and greatest usual time between samples by velocities, in periods.

    None if samples are even, or the joints disagree.

    The steps of each joint are predicted by the time from the velocities of the others. Velocities
    with constant gain, lag and filter are no clock: what is linear in the velocities around a step,
    with the same factors in all rows, is left out first. The times are those of the velocities
    without the factor `common` to all.
    """
    period = excerpts[0].period
    reach = half_width(period)
    every = max(1, reach // TAPS)
    steps, around, own = [], [], []
    for each in excerpts:
        qd = (each.qd[1:, shown] + each.qd[:-1, shown]) / 2 * period
        windows = sliding_window_view(qd, 2 * reach + 1, axis=0)
        around.append(windows[:, :, reach % every :: every])
        steps.append(np.diff(each.q[:, shown], axis=0)[reach : len(qd) - reach])
        own.append(qd[reach : len(qd) - reach] / common)
    step, about = np.concatenate(steps), np.concatenate(around)
    if len(step) <= about.shape[2]:
        return None
    speed = np.empty_like(step)
    for joint, windows in enumerate(about.transpose(1, 0, 2)):
        speed[:, joint] = windows @ np.linalg.lstsq(windows, step[:, joint])[0]
    scale = np.sqrt(np.mean(speed**2, axis=0))
    scale = np.where(scale > 0, scale, 1.0)
    step, speed = step / scale, speed / scale
    # a step is predicted if the other joints are fast: a third of one joint's mean square
    power = (speed**2).sum(axis=1)[:, None] - speed**2
    fast = power > 1.0 / 3.0
    others = (step * speed).sum(axis=1)[:, None] - step * speed
    foretold = others / np.where(fast, power, 1.0)
    left = np.where(fast, (step - speed * foretold) ** 2, 0.0)
    whole = np.where(fast, (step - speed) ** 2, 0.0)
    recorded = np.concatenate(own) / scale
    size = (recorded**2).sum(axis=1)
    passed = (step * recorded).sum(axis=1)[size > 1.0 / 3.0] / size[size > 1.0 / 3.0]
    off = whole.sum(axis=1)
    usual = off <= np.quantile(off, 1 - 2 * TAIL)
    if not len(passed) or not np.all(left[usual].sum(axis=0) < FORETOLD * whole[usual].sum(axis=0)):
        return None
    times = np.quantile(passed, [TAIL, 1 - TAIL])
    return times if np.ptp(times) > 2 * EVEN else None
