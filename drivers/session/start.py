"""What must hold right before power-on: the watch on us as it was set, all axes within limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.drive_bus import DriveRefused, LimitExceeded

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from drivers.axis import Axis
    from drivers.remote_dictionary import RemoteDictionary


def refuse_unwatched(servers: Iterable[RemoteDictionary], watchdogs: Collection[int]) -> None:
    """Refuse drives whose watch on us is not as it was set: another master may be at work.

    Raises
    ------
    DriveRefused
        The first of them, with what it holds and what was written.
    """
    for server in servers:
        for entry, value in server.kept.items():
            if entry.index in watchdogs and (present := server.get(entry)) != value:
                raise DriveRefused(
                    f"{server.label}: {entry} is {present} before power-on, {value} was "
                    "written; another master or a restore changed it: end that first"
                )


def refuse_outside(axes: Sequence[Axis], positions: Sequence[int]) -> None:
    """Refuse axes that stand where they must never be, before any is energised.

    Parameters
    ----------
    axes : sequence of Axis
        In joint order.
    positions : sequence of int
        Where they stand [increments].

    Raises
    ------
    LimitExceeded
        A line for each that is outside.
    """
    outside = []
    for axis in axes:
        q, limits = axis.scale.position_from_counts(positions[axis.index]), axis.drive.limits
        slack, unit = axis.drive.position_window, axis.drive.unit
        if not limits.q_min - slack <= q <= limits.q_max + slack:
            outside.append(
                f"{axis.label}: stands at {q:.4g} {unit}, must be in "
                f"[{limits.q_min:g}, {limits.q_max:g}] {unit}; bring it back without power or "
                "with the maker's tool, or correct zero, sign or limits in the drives file"
            )
    if outside:
        raise LimitExceeded("\n".join(outside))
