"""Checks against an axis's limits before anything is commanded: set-points, and where it stands."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from drivers.drive_bus import LimitExceeded

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from drivers.axis import Axis
    from drivers.drive_bus import Move


def check_move(move: Move, axis: Axis) -> None:
    """Refuse a set-point outside the limits of an axis.

    Parameters
    ----------
    move : Move
        The set-point.
    axis : Axis
        Which; its place is named from 1.

    Raises
    ------
    LimitExceeded
        With value, bound and remedy.
    """
    unit, own, scale = axis.drive.unit, axis.own, axis.scale
    limits, place = axis.drive.limits, joint_of(axis)
    if not limits.q_min <= move.target <= limits.q_max:
        side = "q_min" if move.target < limits.q_min else "q_max"
        raise LimitExceeded(
            f"{place}: target {move.target:g} {unit} must be in [{limits.q_min:g}, "
            f"{limits.q_max:g}] {unit}; choose another target or {where_to_widen(own, side)}"
        )
    for key, value, bound, least, per in (
        ("velocity", move.velocity, limits.velocity, scale.velocity, "/s"),
        ("acceleration", move.acceleration, limits.acceleration, scale.acceleration, "/s^2"),
    ):
        if not 0 < value <= bound * (1 + 1e-12) or math.isnan(value):
            raise LimitExceeded(
                f"{place}: {key} {value:g} {unit}{per} must be above 0 and at most {bound:g} "
                f"{unit}{per}; slow the move down or {where_to_widen(own, key)}"
            )
        if value < least:
            raise LimitExceeded(
                f"{place}: {key} {value:g} {unit}{per} is below the drive's resolution of "
                f"{least:g} {unit}{per}; choose a faster move"
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


def joint_of(axis: Axis) -> str:
    """Return how messages name the joint that an axis turns."""
    return f"joint {axis.index + 1} ({axis.drive.name})"


def where_to_widen(own: Mapping[str, str], key: str) -> str:
    """Say whose limit it is: the drives file's, or the drive's own and in which object."""
    if key in own:
        return f"widen the drive's own limit {own[key]} with the maker's commissioning tool"
    return "correct the limits of the drives file"
