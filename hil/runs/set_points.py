"""Set-points of a recording, which follow from what was planned: none are recorded.

Those of strokes are the profiles that the drives were given, each from the sample on with which the
recording numbers its stroke; those of a trajectory are what was streamed.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from hil.planning.free_motion import FreeMotion
from hil.planning.strokes import REST, Strokes
from hil.runs.recording import IDLE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from hil.arrays import Array, Numbers
    from hil.planning.measurement import RecordedMotion
    from hil.planning.trapezoid import Trapezoid
    from hil.runs.recording import Recording


def set_points(motion: RecordedMotion, recording: Recording) -> Array | None:
    """Planned positions at the samples (n, n_joints) [rad or m]; None where nothing was planned."""
    if isinstance(motion, FreeMotion):
        return None
    if isinstance(motion, Strokes):
        return _of_strokes(motion, recording)
    return motion.motion(motion.within(path_time(recording)))[0]


def path_time(recording: Recording, delay: float = 0.0) -> Array:
    """How far along its trajectory each sample is, since the first period began, shape (n,) [s].

    That of the set-points that act from the sample's SYNC on, or did somewhat earlier. Recordings
    of earlier versions do not state it: their set-points acted as soon as they were sent, right
    after the SYNC of the sample before.

    Parameters
    ----------
    delay : float
        How much earlier [SYNC periods].
    """
    if recording.along is not None:
        period = float(np.median(np.diff(recording.time)))
        along: Array = np.interp(recording.time - delay * period, recording.time, recording.along)
        return along
    period = round(recording.period, 9)
    index: Array = np.rint((recording.time - recording.time[0]) / period)
    return (index + 1 - delay - round(REST / period)) * period


def _of_strokes(motion: Strokes, recording: Recording) -> Array:
    found: Array = np.tile(np.array(motion.start), (recording.n_samples, 1))
    moved: list[tuple[int, Numbers, Callable[[int], Trapezoid]]] = [
        (motion.index, recording.stroke, motion.profile),
        *(
            (partner.index, recording.partner_stroke, partial(partner.profile, motion.q))
            for partner in motion.partners
        ),
    ]
    for joint, numbers, profile in moved:
        strokes = [*_beginnings(numbers)]
        ends = [first for first, _ in strokes[1:]] + [recording.n_samples]
        for (first, number), end in zip(strokes, ends, strict=True):
            t = recording.time[first:end] - recording.time[first]
            found[first:end, joint] = profile(number).q(t)
    return found


def _beginnings(numbers: Numbers) -> Iterator[tuple[int, int]]:
    """First sample and number of each stroke."""
    changed = np.flatnonzero(np.diff(numbers, prepend=IDLE))
    yield from ((int(i), int(numbers[i])) for i in changed if numbers[i] != IDLE)
