"""Survey the recordings: duration, speeds, and stretches to choose settings from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import Mismatch, NotEnoughData
from hil.least_squares.standstill import YIELDED, extent, moving

if TYPE_CHECKING:
    from collections.abc import Iterable

    from hil.arrays import Array
    from hil.planning.free_motion import FreeMotion
    from hil.runs.recording import Recording


STRETCHES = 150.0
"""Maximum total duration of the stretches [s]."""
LEAST_STRETCH = 5.0
"""Minimum stretch of a recording [s]; shorter recordings are used whole."""
SLOWEST = 1e-5
"""Lower bound of reference speeds, which speeds are divided by [rad/s or m/s]."""
SPAN = 0.05
"""Averaging time of speeds [s]."""
CONFIGURATIONS = 200
"""Number of positions representing the range of the motion."""
FEWEST = 50
"""Fewest samples of a usable recording."""


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """Summary of the recordings of a run.

    Attributes
    ----------
    stretches : tuple of Recording
        Parts of recordings, with a total duration of at most `STRETCHES`.
    speed : ndarray, shape (n_joints,)
        Reference speed of each axis, exceeded by few samples [rad/s or m/s].
    rest : ndarray, shape (n_joints,)
        Positions of the axes at rest [rad or m], NaN for the others.
    middle, reach : ndarray, shape (n_joints,)
        Middle and width of the ranges of all axes [rad or m].
    duration : float
        Total duration [s].
    longest : float
        Duration of the longest recording [s].
    cut_off : float or None
        Lowest cut-off stated by the recordings [Hz].
    too_short : tuple of str
        Ids of recordings without enough samples.
    unknown_gains : tuple of int
        Axes, from 0, with torques in units of unknown gain.
    yielding : tuple of int
        Axes, from 0, that only give way to the other axes (`hil.estimation.free_motion.choice`).
    """

    stretches: tuple[Recording, ...]
    speed: Array
    rest: Array
    middle: Array
    reach: Array
    duration: float
    longest: float
    n_recordings: int
    cut_off: float | None
    too_short: tuple[str, ...]
    unknown_gains: tuple[int, ...] = ()
    yielding: tuple[int, ...] = ()

    @property
    def still(self) -> tuple[int, ...]:
        """Axes at rest, from 0, and axes that only give way."""
        return tuple(sorted({*np.flatnonzero(np.isfinite(self.rest)).tolist(), *self.yielding}))

    @property
    def nearly_still(self) -> tuple[int, ...]:
        """Axes, from 0, that move no further than soft servos give way."""
        near = np.isnan(self.rest) & (self.reach <= YIELDED * self.reach.max())
        return tuple(np.flatnonzero(near).tolist())


class _Stretches:
    """Middle parts of recordings, shortened and then thinned out as recordings are added."""

    def __init__(self, least: float) -> None:
        self.kept: list[Recording] = []
        self._least = least
        self._length, self._every, self._seen = STRETCHES, 1, 0

    def add(self, recording: Recording) -> None:
        self._seen += 1
        if (self._seen - 1) % self._every:
            return
        self.kept.append(_middle(recording, self._length))
        while len(self.kept) > 1 and sum(map(_duration, self.kept)) > STRETCHES:
            if self._length > self._least:
                self._length = max(self._length / 2, self._least)
                self.kept = [_middle(each, self._length) for each in self.kept]
            else:
                self._every *= 2
                self.kept = self.kept[::2]


def survey(
    recorded: Iterable[tuple[FreeMotion, Recording]], least_stretch: float = LEAST_STRETCH
) -> Survey:
    """Survey the recordings, reading a single recording at a time.

    Parameters
    ----------
    recorded : iterable of (FreeMotion, Recording)
    least_stretch : float
        Minimum length of a stretch [s].

    Raises
    ------
    NotEnoughData
        No recording has enough samples.
    Mismatch
        The gain of an axis is known in some recordings and unknown in others.
    """
    unknown: dict[str, tuple[int, ...]] = {}
    stretches, speeds, extents, stated, short = _Stretches(least_stretch), [], [], [], []
    duration, longest = 0.0, 0.0
    for motion, recording in recorded:
        unknown[motion.id] = motion.unknown_gains or ()
        if recording.n_samples < FEWEST:
            short.append(motion.id)
            continue
        duration += _duration(recording)
        longest = max(longest, _duration(recording))
        stretches.add(recording)
        speeds.append(greatest_speed(recording))
        extents.append(extent(recording.q, recording.period))
        stated += [] if motion.cut_off is None else [motion.cut_off]
    if not speeds:
        raise NotEnoughData(
            f"no recording has {FEWEST} samples or more; import longer ones without gaps"
        )
    still = ~moving(extents)
    low, high = (np.array([each[k] for each in extents]) for k in (0, 1))
    middle = ((low + high) / 2).mean(axis=0)
    # the axes of unknown gain, from 0, common to the recordings
    name, axes = next(iter(unknown.items()))
    for other, its in unknown.items():
        if its != axes:
            raise Mismatch(
                f"{other}: the axes of unknown gain are {list(its)}, but those of {name} are "
                f"{list(axes)}; state the gain of an axis in all maps, or in none"
            )
    return Survey(
        stretches=tuple(stretches.kept),
        speed=np.where(still, 1.0, np.maximum(np.max(speeds, axis=0), SLOWEST)),
        rest=np.where(still, middle, np.nan),
        middle=middle,
        reach=high.max(axis=0) - low.min(axis=0),
        duration=duration,
        longest=longest,
        n_recordings=len(speeds),
        cut_off=min(stated, default=None),
        too_short=tuple(short),
        unknown_gains=tuple(axis - 1 for axis in axes),
    )


def configurations(found: Survey, n: int = CONFIGURATIONS) -> Array:
    """Return some positions of the stretches, shape (n, n_joints)."""
    q = np.vstack([each.q for each in found.stretches])
    return np.asarray(q[np.linspace(0, len(q) - 1, min(n, len(q))).astype(int)])


def _duration(recording: Recording) -> float:
    return recording.period * recording.n_samples


def greatest_speed(recording: Recording) -> Array:
    """Return a high quantile of the speed of every axis, averaged over `SPAN`, in SI."""
    every = max(1, min(round(SPAN / recording.period), recording.n_samples // 10))
    moved = np.abs(np.diff(recording.q[::every], axis=0)) / (every * recording.period)
    # share of samples below the returned speed
    return np.asarray(np.quantile(moved, 0.99, axis=0))


def _middle(recording: Recording, length: float) -> Recording:
    n = round(length / recording.period)
    first = max(0, (recording.n_samples - n) // 2)
    part = slice(first, first + n)
    return replace(recording, **{name: each[part] for name, each in recording.arrays.items()})
