"""Checks of a set-point against an axis's limits, before anything is commanded."""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import TYPE_CHECKING

from drivers.drive_bus import LimitExceeded

if TYPE_CHECKING:
    from collections.abc import Mapping

    from drivers.axis import AxisScale
    from drivers.drive_bus import Move
    from drivers.drives_file import AxisDrive


NONE: Mapping[str, str] = MappingProxyType({})


def check_move(
    move: Move,
    axis: AxisDrive,
    scale: AxisScale,
    number: int,
    own: Mapping[str, str] = NONE,
) -> None:
    """Refuse a set-point outside the limits of joint `number` (from 1).

    Parameters
    ----------
    move : Move
        The set-point.
    axis : AxisDrive
        With the limits that hold.
    scale : AxisScale
        The drive's units.
    number : int
        For messages.
    own : mapping of str to str
        See `drivers.commissioning.effective_limits.EffectiveLimits.own`.

    Raises
    ------
    LimitExceeded
        With value, bound and remedy.
    """
    unit = axis.unit
    limits, place = axis.limits, f"joint {number} ({axis.name})"
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


def where_to_widen(own: Mapping[str, str], key: str) -> str:
    """Say whose limit it is: the drives file's, or the drive's own and in which object."""
    if key in own:
        return f"widen the drive's own limit {own[key]} with the maker's commissioning tool"
    return "correct the limits of the drives file"
