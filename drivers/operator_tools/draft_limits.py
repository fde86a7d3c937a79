"""Gear, limits and following error in a draft of a drives file, from a live drive.

A drive states its limits on the motor side or in counts; they give values of the joint once its
gear (6091) and the counts of a revolution are certain. No drive knows the direction and the zero of
a joint, so a range (607D) is only mentioned. The values hold for a revolute joint.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.commissioning.consistency import gear_is_electronic
from drivers.commissioning.position_units import PositionFactors
from drivers.commissioning.requirements import is_set
from drivers.operator_tools.draft_hints import Drafted, increments
from drivers.operator_tools.draft_ratings import draft_ratings
from drivers.rate_units import ratio

if TYPE_CHECKING:
    from drivers.dictionary.dictionary import Dictionary
    from drivers.fieldbus import Entry

_RPM = 2 * math.pi / 60
"""One revolution per minute [rad/s], the unit of 6080."""
_HINTS = {
    "gear_ratio": "motor angle over joint coordinate, positive [-, or rad/m if prismatic]",
    "q_min": "lowest position [rad, or m if prismatic], well inside the mechanical stop",
    "q_max": "highest position [rad or m], well inside the mechanical stop",
    "velocity": "highest speed [rad/s or m/s]",
    "acceleration": "highest acceleration [rad/s^2 or m/s^2]",
    "torque": "highest torque [N m, or N if prismatic]",
    "following_error_window": "largest following error [rad or m], such as 0.05",
    "following_error_time": "how long it may be exceeded [s], such as 0.05",
    "position_window": ("how near to its target an axis counts as there [rad or m], such as 0.002"),
    "position_window_time": "and for how long [s], such as 0.02",
}
"""Hints by key of the drives file."""


def draft_limits(dictionary: Dictionary) -> dict[str, Drafted]:
    """Return gear ratio, limits and windows, with values or hints."""
    found = {key: Drafted(None, "", hint) for key, hint in _HINTS.items()}
    if milliseconds := _held(dictionary, objects.FOLLOWING_ERROR_TIME):
        found["following_error_time"] = Drafted(f"{milliseconds / 1000:g}", "s, 6066", "")
    # 6091 is the gear of the joint, unless 1 or within the drive
    factors = PositionFactors.read(dictionary.value)
    gear = factors.gear
    if gear is None or gear == 1 or gear_is_electronic(factors):
        return found
    found["gear_ratio"] = Drafted(f"{float(gear):.10g}", "6091, if the joint is revolute", "")
    if speed := _held(dictionary, objects.MAX_MOTOR_SPEED):
        why = f"rad/s, 6080 = {speed} rpm of the motor"
        found["velocity"] = Drafted(f"{speed * _RPM / float(gear):.4g}", why, "")
    rated = draft_ratings(dictionary)["rated_torque"].value
    if (share := _held(dictionary, objects.MAX_TORQUE)) and rated:
        why = f"N m, 6072 = {share} per mille of rated_torque"
        found["torque"] = Drafted(f"{share / 1000 * float(rated) * float(gear):.4g}", why, "")
    counts = increments(dictionary).value
    if counts is not None:
        found |= _positions(dictionary, 2 * math.pi / float(ratio(counts) * gear))
    return found


def _positions(dictionary: Dictionary, per_count: float) -> dict[str, Drafted]:
    """Return the following error window, and the range as a remark; `per_count` in [rad]."""
    found = {}
    if counts := _held(dictionary, objects.FOLLOWING_ERROR_WINDOW):
        window = Drafted(f"{counts * per_count:.4g}", f"rad, 6065 = {counts}", "")
        found["following_error_window"] = window
    ends = [dictionary.value(e) for e in (objects.SOFTWARE_LIMIT_MIN, objects.SOFTWARE_LIMIT_MAX)]
    low, high = ends
    if low is not None and high is not None and low < high:
        said = (
            f"; 607D is [{low}, {high}], {low * per_count:.4g} to {high * per_count:.4g} rad from"
            " position 0 of the drive, with its sign and zero"
        )
        found |= {key: Drafted(None, "", _HINTS[key] + said) for key in ("q_min", "q_max")}
    return found


def _held(dictionary: Dictionary, entry: Entry) -> int | None:
    """Return a limit set in the drive, None if there is none."""
    value = dictionary.value(entry)
    return value if value is not None and is_set(value, entry) else None
