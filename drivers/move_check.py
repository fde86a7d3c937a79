"""Checks of a set-point against an axis's limits, before anything is commanded."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from drivers.drive_bus import LimitExceeded

if TYPE_CHECKING:
    from drivers.drive_bus import Move
    from drivers.drives_file import AxisDrive
    from drivers.scaling import AxisScale


def check_move(move: Move, axis: AxisDrive, scale: AxisScale, number: int) -> None:
    """Refuse a set-point outside the limits of joint `number` (from 1).

    Raises
    ------
    LimitExceeded
        With value, bound and remedy.
    """
    unit = "rad" if axis.joint == "revolute" else "m"
    limits, place = axis.limits, f"joint {number} ({axis.name})"
    if not limits.q_min <= move.target <= limits.q_max:
        raise LimitExceeded(
            f"{place}: target {move.target:g} {unit} must be in [{limits.q_min:g}, "
            f"{limits.q_max:g}] {unit}; choose another target or correct the limits of the "
            "drives file"
        )
    for key, value, bound, least, per in (
        ("velocity", move.velocity, limits.velocity, scale.velocity, "/s"),
        ("acceleration", move.acceleration, limits.acceleration, scale.acceleration, "/s^2"),
    ):
        if not 0 < value <= bound * (1 + 1e-12) or math.isnan(value):
            raise LimitExceeded(
                f"{place}: {key} {value:g} {unit}{per} must be above 0 and at most {bound:g} "
                f"{unit}{per}; slow the move down or correct the limits of the drives file"
            )
        if value < least:
            raise LimitExceeded(
                f"{place}: {key} {value:g} {unit}{per} is below the drive's resolution of "
                f"{least:g} {unit}{per}; choose a faster move"
            )
