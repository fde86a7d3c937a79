"""Sample times checked by recorded velocities.

A change of position divided by the recorded velocity measures time, so each joint with a recorded
velocity is a clock. Joints differ in unit and gain, never in time. A factor common to all joints is
an error of the rate. A time between two samples on which the velocities of all joints agree is
uneven sampling by the recorder.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.imports.evidence import Suspicion
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


def clock_suspicions(
    excerpts: Sequence[Excerpt], evidence: Evidence, robot: Robot
) -> Iterator[Suspicion]:
    """Yield suspicions of a wrong rate or unit of time, or of uneven samples, by velocities."""
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
        yield Suspicion(
            "velocity",
            ("time",),
            f"the map states {1 / period:.5g} Hz, but recorded velocities of "
            f"{'joint' if len(ratio) == 1 else 'joints'} {joints} are {common:.4g} times the "
            f"derivatives of the positions: at {common / period:.5g} Hz all of them fit; correct "
            "the rate or the unit of time, or the velocities' common unit",
            certain=len(ratio) > 1 and abs(np.log(common)) > np.log(OTHER),
        )
    elif explained or abs(np.log(common)) > np.log(OTHER) or shown.sum() < 2:
        return
    elif (steps := _uneven(excerpts, shown, common)) is not None:
        low, high = np.quantile(steps, [0.1, 0.9])
        yield Suspicion(
            "velocity",
            ("time",),
            f"samples are not equidistant: by the recorded velocities of joints {joints}, a "
            f"tenth of the sampling periods are below {1e3 * low * period:.2g} ms, a tenth above "
            f"{1e3 * high * period:.2g} ms, mean {1e3 * period:.3g} ms; record a time stamp with "
            "each row, and name its column in place of the rate",
            certain=False,
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
        noise += len(by_position) * np.array([
            every * (each.period * evidence.noise_recorded[shown]) ** 2,
            2.0 * each.extent.noise[shown] ** 2,
        ])  # fmt: skip
    of_velocity, of_position = np.maximum(sums[:2] - noise, 0.1 * sums[:2])
    power = np.maximum(np.sqrt(sums[0] * sums[1]), np.finfo(float).tiny)
    correlation = np.clip(sums[2] / power, -1.0, 1.0)
    error = CHANCE * np.sqrt((1.0 - correlation**2) / max(n, 1)) + (1.0 - correlation)
    ratio = np.sqrt(of_velocity / np.maximum(of_position, np.finfo(float).tiny))
    return np.maximum(ratio, np.finfo(float).tiny), np.maximum(error, np.finfo(float).eps)


def _uneven(excerpts: Sequence[Excerpt], shown: Mask, common: float) -> Array | None:
    """Return the times between samples by velocities, in periods; None if the joints disagree.

    The steps of each joint are predicted by the time from the velocities of the others. The factor
    `common` to all velocities changes no step relative to another.
    """
    every = []
    left, whole = np.zeros(int(shown.sum())), np.zeros(int(shown.sum()))
    for each in excerpts:
        qd = (each.qd[1:, shown] + each.qd[:-1, shown]) / (2 * common)
        scale = np.sqrt(np.mean(qd**2, axis=0)) * each.period
        step, speed = np.diff(each.q[:, shown], axis=0) / scale, qd * each.period / scale
        # a step is predicted if the other joints are fast: a third of one joint's mean square
        fast = (speed**2).sum(axis=1)[:, None] - speed**2 > 1.0 / 3.0
        others = (step * speed).sum(axis=1)[:, None] - step * speed
        power = (speed**2).sum(axis=1)[:, None] - speed**2
        foretold = others / np.where(fast, power, 1.0)
        left += np.where(fast, (step - speed * foretold) ** 2, 0.0).sum(axis=0)
        whole += np.where(fast, (step - speed) ** 2, 0.0).sum(axis=0)
        some = (speed**2).sum(axis=1) > 1.0 / 3.0
        every.append(((step * speed).sum(axis=1) / (speed**2).sum(axis=1).clip(1e-300))[some])
    if not np.all(left < FORETOLD * whole):
        return None
    return np.concatenate(every)
