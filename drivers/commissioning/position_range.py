"""Positions that wrap around at the ends of a range (607B), as in drives of rotary axes.

If the range is wider than the travel of the axis, a position belongs to one place, wherever the
drive wraps around, and no missed telegram can make it wrong. On both sides of the axis's limits
there must be room for an axis that leaves them, until that is detected.

A target of profile position is in the same turn, or in the shortest direction, by option and maker;
the checked path may be neither. Hence the driver leads the axis by cyclic position, with the
nearest place as target, if positions wrap around within the limits. The limits of such a range
cannot be expressed in 607D: the driver alone keeps the range.
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
"""Longest time of an axis beyond its limits until the driver stops it [s]: ten SYNCs without a
telegram at 100 Hz."""
_ALL_COUNTS = 1 << 32
"""Number of positions of a 32-bit counter, which wraps around naturally."""


def range_of(find: Callable[[Entry], int | None]) -> tuple[int, int] | None:
    """Return the range of wrap-around positions; None without wrap-around."""
    try:
        low, high = map(find, ENDS)
    except DriveRefused:  # of a non-standard type, and not compared
        return None
    if low is None or high is None or not 0 < high - low < _ALL_COUNTS - 1:
        return None
    return low, high


def wrap_of(ends: tuple[int, int] | None, axis: AxisDrive, label: str) -> Wrap | None:
    """Return the wrap-around within an axis's limits; None if absent.

    Parameters
    ----------
    ends : tuple of int or None
        Range of the drive (`range_of`).
    axis : AxisDrive
        Axis of the drives file.
    label : str
        Name of the drive in messages.

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
