"""The range that a drive itself keeps its axis in: software limits (607D).

What is to stand there follows from the drive's own and the drives file's (`effective_limits`). Some
drives have fixed ones. Those that lie inside ours stay; those that lie outside do not hinder, but
then it is the driver alone that keeps the range, which is noted. Limits that are off and stay off
keep the axis from nothing, as in a drive that has none: refused.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.axis import AxisScale
from drivers.cia402 import objects
from drivers.drive_bus import DriveRefused

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from drivers.drives_file import AxisDrive
    from drivers.fieldbus import Entry
    from drivers.remote_dictionary import RemoteDictionary


def write_range(server: RemoteDictionary, axis: AxisDrive, values: Mapping[Entry, int]) -> None:
    """Write the software limits; where they are fixed, take and note them.

    Parameters
    ----------
    server : RemoteDictionary
        The drive.
    axis : AxisDrive
        What the drives file states.
    values : mapping of Entry to int
        What must stand in the drive [increments].

    Raises
    ------
    DriveRefused
        Fixed limits that are off.
    """
    scale, limits = AxisScale.of(axis), axis.limits
    entries = (objects.SOFTWARE_LIMIT_MIN, objects.SOFTWARE_LIMIT_MAX)
    ends = [values[entry] for entry in entries]
    if [server.find(entry) for entry in entries] == ends:
        return
    taken = [server.set_unless_fixed(entry, end) for entry, end in zip(entries, ends, strict=True)]
    kept = [server.kept[entry] for entry in entries]
    if all(taken) or kept == ends:
        return
    unit = axis.unit
    low, high = sorted(scale.position_from_counts(float(end)) for end in kept)
    own, ours = f"[{low:.5g}, {high:.5g}] {unit}", f"[{limits.q_min:g}, {limits.q_max:g}] {unit}"
    if kept[0] >= kept[1]:
        raise DriveRefused(
            f"{server.label}: software limits (607D) are fixed at {kept[0]} and {kept[1]}, which "
            "switches them off: the drive itself would take any target; set them with the maker's "
            "commissioning tool"
        )
    server.note(
        f"software limits (607D) are fixed at {own}, those of the drives file are "
        f"{ours}: {_consequence(kept, ends)}"
    )


def _consequence(kept: Sequence[int], ends: Sequence[int]) -> str:
    found = []
    if kept[0] < ends[0] - 1 or kept[1] > ends[1] + 1:
        found.append("the driver alone keeps the axis's range")
    if kept[0] > ends[0] or kept[1] < ends[1]:
        found.append("it takes no target beyond its own")
    return " and ".join(found) or "they agree to an increment"
