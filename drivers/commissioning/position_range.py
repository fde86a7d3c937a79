"""Positions that wrap around at the ends of a range (607B), as drives of rotary axes count them.

Where the range is wider than the way of an axis, each position is one place of it, wherever the
drive wraps around. That is known at once, and nothing that was missed can make it wrong. On both
sides of the axis's limits there must be room for an axis that leaves them until that is seen.

A target of profile position lies in the same turn, or on the shortest way, by option and maker; the
way that was checked may be neither. So where positions wrap around within the limits the driver
leads the axis by cyclic position, in which the nearest place counts. Limits of such a range are no
two numbers of the drive's (607D): the driver alone keeps it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.axis import AxisScale, Wrap
from drivers.cia402 import objects
from drivers.drive_bus import DriveRefused
from drivers.safety.trips import fastest

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.drives_file import AxisDrive
    from drivers.fieldbus import Entry

ENDS = (objects.POSITION_RANGE_MIN, objects.POSITION_RANGE_MAX)
UNSEEN = 0.1
"""Time for which an axis may go on beyond its limits before that is seen, and stops it [s]: ten
SYNCs without a telegram at 100 Hz."""
_ALL_COUNTS = 1 << 32
"""A range that is as wide as 32 bits wraps around as any counter does."""


def range_of(find: Callable[[Entry], int | None]) -> tuple[int, int] | None:
    """Return the range in which a drive's positions wrap around; None where they do not."""
    try:
        low, high = map(find, ENDS)
    except DriveRefused:  # of another type than the standard's: compared with nothing
        return None
    if low is None or high is None or not 0 < high - low < _ALL_COUNTS - 1:
        return None
    return low, high


def wrap_of(ends: tuple[int, int] | None, axis: AxisDrive, label: str) -> Wrap | None:
    """Return how positions wrap around within an axis's limits; None where they do not.

    Parameters
    ----------
    ends : tuple of int or None
        Of the drive's range (`range_of`).
    axis : AxisDrive
        What the drives file states.
    label : str
        How messages name the drive.

    Raises
    ------
    DriveRefused
        The range is too narrow for the axis.
    """
    if ends is None:
        return None
    low, high = ends
    scale, limits, slack = AxisScale.derive(axis), axis.limits, axis.position_window
    sides = (limits.q_min - slack, limits.q_max + slack)
    first, last = sorted(scale.position_to_counts(side) for side in sides)
    if low <= first <= last <= high:
        return None
    room = axis.following_error_window + UNSEEN * fastest(axis)
    size, needed = high - low + 1, last - first + 2 * round(room / abs(scale.position))
    if size < needed:
        raise DriveRefused(
            f"{label}: positions wrap around in [{low}, {high}] (607B), the limits of the drives"
            f" file are [{first}, {last}]: with {room:.3g} {axis.unit} on both sides, that an axis"
            f" may go until it is seen outside, they take {needed} of {size} positions, so the axis"
            " could stand in two places; have the drive count from another zero (homing), narrow"
            " the limits, or widen 607B with the maker's commissioning tool"
        )
    return Wrap(low, size, (first + last) // 2 - size // 2)
