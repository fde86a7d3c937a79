"""Whether an encoder jumped while the robot moved: positions bend no more than accelerations can.

A jump shifts the position reference for good, and the drive's loop moves the axis by as much, so
whatever is measured afterwards is measured at wrong angles: a jump ends the campaign. Large ones
trip the driver at once; here the small ones are found, in every motion as soon as it is over.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from drivers.drive_bus import Tripped
from hil.runs.journal import EXACT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.drive_bus import DriveBus
    from hil.arrays import Array
    from hil.runs.recording import Recorder, Recording


def finished(bus: DriveBus, recorder: Recorder, acceleration: float) -> Recording:
    """Turn what was recorded of a motion into arrays; see `refuse_jumps`."""
    recording = recorder.finish()
    resolution, units = [a.position_resolution for a in bus.axes], [a.unit for a in bus.axes]
    refuse_jumps(recording, acceleration, resolution, units)
    return recording


def refuse_jumps(
    recording: Recording,
    acceleration: float,
    resolution: Sequence[float] | float = 0.0,
    units: Sequence[str] = (),
) -> None:
    """Raise when a position jumped.

    Parameters
    ----------
    recording : Recording
    acceleration : float
        Highest of the motion [rad/s^2 or m/s^2].
    resolution : sequence (n_joints,) or float
        Steps of the encoders: in a creep positions rest for many samples between two steps
        [rad or m].
    units : sequence of str
        Of the axes' positions; rad where none are stated.

    Raises
    ------
    Tripped
        With axis, size and instant of the first jump.
    """
    if recording.n_samples < 3:
        return
    steps = np.diff(recording.q, axis=0)
    intervals = np.diff(recording.time)
    period = float(np.median(intervals))
    speeds = steps / intervals[:, None]
    bends = np.abs(np.diff(speeds, axis=0)) * period
    least = np.maximum(resolution, acceleration * period**2)
    # a jump is 5 times what acceleration, and what is usual in this motion, account for
    bounds = 5.0 * np.maximum(_usual(bends), least)
    allowed = bounds + np.zeros_like(bends)
    if np.ptp(intervals) > EXACT:  # else speed cannot look like a bend
        allowed += period * np.maximum(np.abs(speeds[1:]), np.abs(speeds[:-1]))
    jumps = np.argwhere(bends > allowed)
    if len(jumps):
        sample, axis = jumps[0]
        unit = units[axis] if units else "rad"
        raise Tripped(
            f"axis {axis + 1}: its position jumps by {bends[sample, axis]:.2g} {unit} at"
            f" {recording.time[sample + 1]:.3f} s, at most {allowed[sample, axis]:.2g} {unit} can"
            " be motion; check encoder and cable, and reference the axis anew before measuring"
            " again"
        )


def _usual(bends: Array) -> Array:
    """Return what bends of each axis are usual, missing samples left out."""
    filled = np.nan_to_num(bends)
    # the percentile of bends that counts as usual is 99
    place = min(len(filled) - 1, int(len(filled) * 99.0 / 100))
    usual: Array = np.partition(filled, place, axis=0)[place]
    return usual
