"""Bus load and highest rate of SYNC.

The bus load is that of SYNC and every TPDO in answer, with worst-case bit stuffing. The TPDOs of a
drive are known after set-up: where its PDOs are fixed, the load is that of the fixed ones. The rate
of SYNC is bounded by the bus load and, on the wall clock, by the slowest answer (`stopwatch`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.canopen.pdo_mapping import fed_forward, received, transmitted
from drivers.sync_clock import WINDOW

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from drivers.canopen.pdo_mapping import Pdo
    from drivers.drives_file import DrivesFile

MAX_LOAD = 0.7
"""Largest bus load; above, identifiers of low priority starve."""


def frame_bits(n_bytes: int) -> int:
    """Return the length of a data frame with worst-case bit stuffing [bits]."""
    return 47 + 8 * n_bytes + (33 + 8 * n_bytes) // 4


def cycle_time(
    drives: DrivesFile,
    sent: Sequence[Sequence[Pdo]] | None = None,
    *,
    streamed: bool = False,
    feed_forward: bool = False,
) -> float:
    """Return the time of SYNC and the frames of a cycle on the bus [s].

    Parameters
    ----------
    drives : DrivesFile
        Axes and bit rate.
    sent : sequence, optional
        TPDOs of each axis; by default the preferred ones.
    streamed : bool
        True if each axis also gets a set-point in every cycle.
    feed_forward : bool
        True if each axis also gets offsets of velocity and torque.
    """
    pdos = [transmitted(axis) for axis in drives.axes] if sent is None else sent
    sizes = [pdo.size for own in pdos for pdo in own]
    further = (*[received] * streamed, *[fed_forward] * feed_forward)
    sizes += [pdo_of(axis).size for pdo_of in further for axis in drives.axes]
    return time_on_bus(sizes, drives.bitrate)


def time_on_bus(sizes: Iterable[int], bitrate: int) -> float:
    """Return the time of SYNC and frames of these sizes [bytes] on the bus, at worst [s]."""
    return (frame_bits(0) + sum(map(frame_bits, sizes))) / bitrate


def cycle_on_bus(
    drives: DrivesFile | None, n_axes: int, bitrate: int, *, streamed: bool, feed_forward: bool
) -> tuple[float, str, float]:
    """Return the time of a cycle on the bus [s], its frames in words, and the largest bus load.

    Parameters
    ----------
    drives : DrivesFile or None
        None if unknown: one TPDO of 8 bytes for each axis is assumed.
    n_axes, bitrate : int
        Number of axes, and bit rate [bit/s].
    streamed, feed_forward : bool
        See `cycle_time`.
    """
    set_points = f" and {(1 + feed_forward) * n_axes} RPDOs" if streamed else ""
    if drives is None:
        sizes = [8] * n_axes * (2 if streamed else 1)
        frames = f"SYNC, {n_axes} TPDOs of 8 bytes{set_points} assumed without a drives file"
        return time_on_bus(sizes, bitrate), frames, MAX_LOAD
    drives = drives.model_copy(update={"bitrate": bitrate})
    count = sum(len(transmitted(axis)) for axis in drives.axes)
    frames = f"SYNC, {count} TPDOs{set_points} by the drives file"
    return cycle_time(drives, streamed=streamed, feed_forward=feed_forward), frames, MAX_LOAD


def achievable_rate(
    drives: DrivesFile, answer: float = 0.0, sent: Sequence[Sequence[Pdo]] | None = None
) -> float:
    """Return the highest rate of SYNC [1/s].

    Parameters
    ----------
    drives, sent
        See `cycle_time`.
    answer : float
        Response time of the slowest answer to a SYNC [s].
    """
    return 1 / max(cycle_time(drives, sent) / MAX_LOAD, answer / WINDOW)
