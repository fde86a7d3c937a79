"""What a cycle of a plan puts on the bus: by the drives file, or as most drives would have it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.canopen.bus_load import MAX_LOAD, cycle_time, time_on_bus
from drivers.canopen.pdo_mapping import transmitted
from hil.planning import BITRATE
from hil.planning.dry_run import BusCycle

if TYPE_CHECKING:
    from drivers.drives_file import DrivesFile
    from hil.planning.plan import Plan

FULL = 8
"""Bytes of the largest frame."""


def bus_cycle(
    plan: Plan,
    n_axes: int,
    drives: DrivesFile | None,
    bitrate: int | None = None,
    *,
    feeds: bool = False,
) -> BusCycle:
    """What a cycle takes of the bus while `plan` is measured.

    Parameters
    ----------
    plan : Plan
    n_axes : int
    drives : DrivesFile or None
        None where none is known: one full TPDO an axis is assumed.
    bitrate : int, optional
        Instead of the drives file's [bit/s].
    feeds : bool
        Velocity and torque are fed forward to the drives of the file.
    """
    streamed = any(measurement.streamed for measurement in plan.measurements)
    set_points = f" and {(1 + feeds) * n_axes} RPDOs" if streamed else ""
    if drives is None:
        rate = bitrate or BITRATE
        sizes = [FULL] * n_axes * (2 if streamed else 1)
        frames = f"SYNC, {n_axes} TPDOs of {FULL} bytes{set_points} assumed without a drives file"
        return BusCycle(time_on_bus(sizes, rate), rate, frames, MAX_LOAD)
    if bitrate is not None:
        drives = drives.model_copy(update={"bitrate": bitrate})
    count = sum(len(transmitted(axis)) for axis in drives.axes)
    frames = f"SYNC, {count} TPDOs{set_points} by the drives file"
    time = cycle_time(drives, streamed=streamed, feed_forward=feeds)
    return BusCycle(time, drives.bitrate, frames, MAX_LOAD)
