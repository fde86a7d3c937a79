"""Residual of a model on recordings, over the fixed band of `hil.results.residual`."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.errors import FrictionUnknown, Mismatch
from hil.estimation.free_motion.motion import low_passed
from hil.estimation.free_motion.result import FreeMotionFit
from hil.estimation.options import ACCURACY
from hil.friction.equation import SLOW
from hil.least_squares.standstill import braked, extent, limited, moving
from hil.least_squares.window import widen
from hil.planning.free_motion import FreeMotion
from hil.planning.measurement import shows_parameters
from hil.results.recorded_torque import convert_torques
from hil.results.residual import BAND, BandResidual

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Mask
    from hil.results.model import Model
    from hil.runs.recording import Recorded, Recording

EDGE = 0.4
"""Time dropped at either end of a motion [s]: the slowest pole of the filter, at 0.38 times its
angular cut-off, has decayed to 1/2000."""
SHORTEST = 2.0
"""Shortest usable motion [s]."""
GAP = 10.0
"""Gap between two samples that ends a motion, in sampling periods."""
COARSE = 0.1
"""Longest usable interval between samples, in periods of the cut-off: linear interpolation of an
oscillation at the cut-off is off by at most (pi COARSE)^2 / 2 = 5 %."""
LONGER = 1.5
"""Longest interval without a lost sample, in sampling periods; usable even if above `COARSE`."""
FINE = 32.0
"""Minimum number of samples kept per period of the cut-off, for faster recordings."""
INDEPENDENT = 2.0 * 9.0 / 25.0 * BAND
"""Independent values of differentiated noise in a second: of a spectrum that grows with the fourth
power of the frequency, 9/25 of the band count, (int S)^2 / int S^2."""


class _Samples(NamedTuple):
    """Torque of a motion, filtered and recorded, with its prediction, raw and smoothed.

    Arrays have the shape (n, n_axes), like the masks of counted samples and of axes at rest;
    `step` is the time between samples [s].
    """

    filtered: Array
    recorded: Array
    predicted: Array
    smoothed: Array
    counts: Mask
    rests: Mask
    step: float


def band_residual(
    model: Model, recorded: Recorded, accuracy: float = ACCURACY
) -> BandResidual | None:
    """Compute the residual of a model on recordings.

    Parameters
    ----------
    recorded : iterable of (RecordedMotion, Recording)
        Recordings of the same robot.
    accuracy : float
        Tolerated residual over the torque: of a larger one, the part due to noise is computed.

    Returns
    -------
    BandResidual or None
        None if the model states no friction, or no motion lasts `SHORTEST`. Axes whose torque the
        estimate does not use are not judged: their friction is not identified.
    """
    n_joints = model.robot.n_joints
    squares, counts = np.zeros((6, n_joints)), np.zeros((6, n_joints))
    noise, seconds = np.zeros((2, n_joints))
    unknown = {axis - 1 for axis in model.axes_without_friction}
    if isinstance(model.details, FreeMotionFit):  # axes held or at rest, without any friction
        shares = model.details.relative_residual
        unknown |= {axis for axis, share in enumerate(shares) if share is None}
    if len(unknown) == n_joints:
        return None
    for motion, as_recorded in recorded:
        if not shows_parameters(motion):
            continue
        try:
            recording = convert_torques(model, motion, as_recorded)
        except Mismatch:  # a gain is unknown, also to the model
            continue
        # an import is judged as a whole, including all its strokes
        whole = isinstance(motion, FreeMotion)
        used = np.ones(recording.n_samples, dtype=bool) if whole else recording.active
        axes = [axis for axis in motion.moved if axis not in unknown]
        own = np.zeros((6, len(axes)))
        samples = list(_motions(model, recording, used, axes)) if axes else []
        for each in samples:
            every = each.counts
            moved, left = every & ~each.rests, each.filtered - each.predicted
            rows = (
                (each.filtered, every), (left, every),
                (each.filtered, moved), (each.filtered - each.smoothed, moved),
                (each.recorded, every), (each.recorded - each.predicted, every),
            )  # fmt: skip
            own += [np.sum(np.where(mask, x, 0.0) ** 2, axis=0) for x, mask in rows]
            counts[:, axes] += [mask.sum(axis=0) for _, mask in rows]
        squares[:, axes] += own
        if (own[3] > accuracy**2 * own[2]).any():
            of_noise, lasting = _noise(model, recording, used, axes, samples)
            noise[axes] += of_noise
            seconds[axes] += lasting
    if not counts.any():
        return None
    # two draws of noise, the recorded and the added one, agree within this share by chance, 95 %
    chance = 2.0 * np.sqrt(2.0 * 2.0 / np.maximum(INDEPENDENT * seconds, 1.0))
    certain = noise * np.maximum(1.0 - chance, 0.0)
    squares, counts = np.vstack([squares, noise, certain]), counts[[*range(6), 3, 3]]
    roots = np.sqrt(squares / np.maximum(counts, 1.0)).tolist()
    found = [
        tuple(x if n else None for x, n in zip(*pair, strict=True))
        for pair in zip(roots, counts.tolist(), strict=True)
    ]
    names = ("torque", "left", "moving", "smoothed", "recorded", "unfiltered", "noise", "certain")
    return BandResidual(band=BAND, **dict(zip(names, found, strict=True)))


def _noise(
    model: Model,
    recording: Recording,
    used: Mask,
    axes: Sequence[int],
    samples: Sequence[_Samples],
) -> tuple[Array, Array]:
    """Return the squares of the smoothed prediction due to noise of positions, and the time [s].

    As much noise as the positions have is added to them, and changes the prediction, known from
    `samples`. The squares are summed over the samples in motion, and the time is that of these
    samples, each (n_axes,).
    """
    period = float(np.median(np.diff(recording.time)))
    drawn = np.random.default_rng(0).standard_normal(recording.q.shape)
    noisy = replace(recording, q=recording.q + extent(recording.q, period).noise * drawn)
    found, seconds = np.zeros((2, len(axes)))
    for each, other in zip(samples, _motions(model, noisy, used, axes), strict=True):
        moved = each.counts & ~each.rests
        found += np.sum(np.where(moved, other.smoothed - each.smoothed, 0.0) ** 2, axis=0)
        seconds += each.step * moved.sum(axis=0)
    return found, seconds


def _motions(
    model: Model, recording: Recording, used: Mask, axes: Sequence[int]
) -> Iterator[_Samples]:
    """Yield the motions of some axes in a recording, without gaps, with the model's prediction.

    Only the samples marked by `used`, shape (n_recorded,), count.
    """
    # friction of axes outside `axes` is not needed
    model = replace(model, friction_law=model.friction_law.restricted(axes))
    whole = np.flatnonzero(recording.fresh)
    time = recording.time[whole]
    if len(whole) < 2:
        return
    period = float(np.median(np.diff(time)))
    for part in np.split(whole, np.flatnonzero(np.diff(time) > GAP * period) + 1):
        own = recording.time[part]
        if own[-1] - own[0] < SHORTEST:
            continue
        even = np.arange(own[0], own[-1], period)
        q, tau = (
            np.column_stack([np.interp(even, own, column) for column in x[part].T])
            for x in (recording.q, recording.tau)
        )
        held = (braked(q, tau, period) | limited(q, tau, period))[:, axes]
        tau = tau[:, axes]
        every = max(1, int(1.0 / (FINE * BAND * period)))
        filtered = low_passed(tau, period, BAND, every)[0]
        motions = [low_passed(q, period, k * BAND, every, derivatives=2) for k in (1.0, 2.0)]
        with warnings.catch_warnings():
            # axes without known friction are not used
            warnings.simplefilter("ignore", FrictionUnknown)
            narrow, wide = (model.predict(*motion)[:, axes] for motion in motions)
        smoothed = low_passed(wide, every * period, BAND)[0]
        counts = np.zeros(filtered.shape, dtype=bool)
        edge = round(EDGE / (every * period))
        counts[edge : len(counts) - edge] = moving([extent(q, period)])[axes]
        nearest = np.searchsorted(recording.time, even[::every], side="right") - 1
        counts &= used[nearest][:, np.newaxis]
        long = np.diff(own, append=own[-1]) > max(COARSE / BAND, LONGER * period)
        lost = held[::every].T | long[np.searchsorted(own, even[::every], side="right") - 1]
        # a period of the cut-off, in samples
        reach = round(1.0 / (BAND * every * period))
        counts &= ~np.column_stack([widen(each, reach) for each in lost])
        speed, limit = np.abs(motions[0][1][:, axes]), model.robot.velocity_limit[axes]
        slow = speed < SLOW * np.where(np.isnan(limit), speed.max(axis=0), limit)
        rests = np.column_stack([widen(_long_runs(each, reach), reach) for each in slow.T])
        yield _Samples(filtered, tau[::every], narrow, smoothed, counts, rests, every * period)


def _long_runs(mask: Mask, least: int) -> Mask:
    """Return the mask without runs of fewer than `least` samples."""
    begin, end = np.flatnonzero(np.diff(mask, prepend=False, append=False)).reshape(-1, 2).T
    long = end - begin >= least
    change = np.zeros(len(mask) + 1, dtype=int)
    change[begin[long]], change[end[long]] = 1, -1
    return np.asarray(np.cumsum(change[:-1]) > 0)
