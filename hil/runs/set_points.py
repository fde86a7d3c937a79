"""Set-points of a recording, reconstructed from the plan since none are recorded.

Set-points of strokes are the profiles of the drives, from the first sample of a stroke's number on;
set-points of a trajectory are the streamed ones.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from hil.planning.free_motion import FreeMotion
from hil.planning.strokes import REST, Strokes
from hil.runs.recording import IDLE

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.arrays import Array, Numbers
    from hil.planning.measurement import RecordedMotion
    from hil.planning.trapezoid import Trapezoid
    from hil.runs.recording import Recording


def set_points(motion: RecordedMotion, recording: Recording) -> Array | None:
    """Return the planned positions at the samples (n, n_joints) [rad or m]; None without a plan."""
    if isinstance(motion, FreeMotion):
        return None
    if isinstance(motion, Strokes):
        found: Array = np.tile(np.array(motion.start), (recording.n_samples, 1))
        moved: list[tuple[int, Numbers, Callable[[int], Trapezoid]]] = [
            (motion.index, recording.stroke, motion.profile),
            *(
                (partner.index, recording.partner_stroke, partial(partner.profile, motion.q))
                for partner in motion.partners
            ),
        ]
        for joint, numbers, profile in moved:
            # first sample and number of the strokes
            changed = np.flatnonzero(np.diff(numbers, prepend=IDLE)).tolist()
            strokes = [(k, int(numbers[k])) for k in changed if numbers[k] != IDLE]
            ends = [first for first, _ in strokes[1:]] + [recording.n_samples]
            for (first, number), end in zip(strokes, ends, strict=True):
                t = recording.time[first:end] - recording.time[first]
                found[first:end, joint] = profile(number).q(t)
        return found
    return motion.motion(motion.within(path_time(recording)))[0]


def path_time(recording: Recording, delay: float = 0.0) -> Array:
    """Return the time along the trajectory since the start of the first period, shape (n,) [s].

    The time is that of the set-points active from the sample's SYNC on, or earlier by `delay`.
    Recordings of earlier versions do not store this time: their set-points acted immediately, right
    after the SYNC of the previous sample.

    Parameters
    ----------
    delay : float
        Time shift towards earlier set-points [SYNC periods].
    """
    if recording.along is not None:
        period = float(np.median(np.diff(recording.time)))
        along: Array = np.interp(recording.time - delay * period, recording.time, recording.along)
        return along
    period = round(recording.period, 9)
    index: Array = np.rint((recording.time - recording.time[0]) / period)
    return (index + 1 - delay - round(REST / period)) * period
