"""How much of the bus a cycle takes.

A cycle is SYNC and every TPDO that answers it, each with the worst stuffing. What
a drive answers with is seen when it is set up: where its PDOs are not as we would have them, the
load is that of the TPDOs that it has.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.canopen.pdo_mapping import fed_forward, received, transmitted

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from drivers.canopen.pdo_mapping import Pdo
    from drivers.drives_file import DrivesFile

MAX_LOAD = 0.7
"""Share of the bus beyond which identifiers of low priority starve."""


def frame_bits(n_bytes: int) -> int:
    """Length of a data frame with the worst stuffing [bits]."""
    return 47 + 8 * n_bytes + (33 + 8 * n_bytes) // 4


def cycle_time(
    drives: DrivesFile,
    sent: Sequence[Sequence[Pdo]] | None = None,
    *,
    streamed: bool = False,
    feed_forward: bool = False,
) -> float:
    """How long SYNC and all that belongs to it occupy the bus [s].

    Parameters
    ----------
    drives : DrivesFile
        Axes and bit rate.
    sent : sequence, optional
        The TPDOs of each axis; by default those that we would have.
    streamed : bool
        Whether each axis gets a set-point in every cycle too.
    feed_forward : bool
        Whether each axis gets offsets of velocity and torque too.
    """
    pdos = [transmitted(axis) for axis in drives.axes] if sent is None else sent
    sizes = [pdo.size for own in pdos for pdo in own]
    if streamed:
        sizes += [received(axis).size for axis in drives.axes]
    if feed_forward:
        sizes += [fed_forward(axis).size for axis in drives.axes]
    return time_on_bus(sizes, drives.bitrate)


def time_on_bus(sizes: Iterable[int], bitrate: int) -> float:
    """How long SYNC and frames of so many bytes each occupy the bus at worst [s]."""
    return (frame_bits(0) + sum(map(frame_bits, sizes))) / bitrate


def cycle_on_bus(
    drives: DrivesFile | None,
    n_axes: int,
    bitrate: int,
    *,
    streamed: bool,
    feed_forward: bool,
) -> tuple[float, str, float]:
    """Return how long a cycle occupies the bus [s], its frames in words, the share it may take.

    Parameters
    ----------
    drives : DrivesFile or None
        None where none is known: one full TPDO an axis is assumed, of 8 bytes.
    n_axes, bitrate : int
        Number of axes, and of bits a second.
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
