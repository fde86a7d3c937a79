"""What must hold right before power-on: the watch on us as it was set, and every axis inside."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.axis import AxisScale
from drivers.drive_bus import DriveRefused, LimitExceeded
from drivers.found_settings.restoring import WATCHDOGS

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from drivers.canopen.sdo import RemoteDictionary
    from drivers.drives_file import AxisDrive


def refuse_unwatched(servers: Iterable[RemoteDictionary]) -> None:
    """Refuse drives whose watch on us is not as it was set: another master may be at work.

    Raises
    ------
    DriveRefused
        The first of them, with what it holds and what was written.
    """
    for server in servers:
        for entry, value in server.kept.items():
            if entry.index in WATCHDOGS and (present := server.get(entry)) != value:
                raise DriveRefused(
                    f"{server.label}: {entry} is {present} before power-on, {value} was "
                    "written; another master or a restore changed it: end that first"
                )


def refuse_outside(axes: Sequence[AxisDrive], positions: Sequence[int]) -> None:
    """Refuse axes that stand where they must never be, before any is energised.

    Parameters
    ----------
    axes : sequence of AxisDrive
        With the limits that hold.
    positions : sequence of int
        Where they stand [increments].

    Raises
    ------
    LimitExceeded
        A line for each that is outside.
    """
    outside = []
    for axis, counts in zip(axes, positions, strict=True):
        q, limits, slack = (
            AxisScale.of(axis).position_from_counts(counts),
            axis.limits,
            axis.position_window,
        )
        if not limits.q_min - slack <= q <= limits.q_max + slack:
            unit = axis.unit
            outside.append(
                f"{axis.label}: stands at {q:.4g} {unit}, must be in "
                f"[{limits.q_min:g}, {limits.q_max:g}] {unit}; bring it back without power or "
                "with the maker's tool, or correct zero, sign or limits in the drives file"
            )
    if outside:
        raise LimitExceeded("\n".join(outside))
