"""Gear, limits, following error and motor ratings in a draft of a drives file.

A drive states its limits on the motor side or in counts; they give values of the joint once its
gear (6091) and the counts of a revolution are certain. No drive knows the direction and the zero of
a joint, so a range (607D) is only mentioned. The values hold for a revolute joint.

Rated current and torque constant come from 6075 and from manufacturer objects. They also show the
unit of the rated torque in a drive: mN m by the standard, uN m with some makers. If nothing proves
the unit and the standard's reading would be an impossible motor, value and unit are left to be
stated.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.cia402.objects import MAKERS
from drivers.commissioning.consistency import gear_is_electronic
from drivers.commissioning.position_units import PositionFactors
from drivers.commissioning.ratings import NEWTON_METRE, torque_unit
from drivers.commissioning.requirements import is_set
from drivers.drives_file import TorqueUnit
from drivers.operator_tools.draft_hints import Drafted, also_named, default_of, increments
from drivers.rate_units import ratio

if TYPE_CHECKING:
    from drivers.cia402.objects import VendorObject
    from drivers.dictionary.dictionary import Dictionary
    from drivers.fieldbus import Entry

CONSTANT_MAX = 20.0
"""Upper bound of torque constants of robots' motors [N m/A]."""


def draft_ratings(dictionary: Dictionary) -> dict[str, Drafted]:
    """Return the motor ratings by key of the drives file, with values or hints."""
    maker = MAKERS.get(dictionary.vendor or 0)
    present = dictionary.value(objects.RATED_CURRENT)
    hint = "rated current of the motor [A], which the drive's per mille refer to"
    hint += default_of(dictionary, objects.RATED_CURRENT)
    if present:
        current = Drafted(f"{present / 1000:g}", "A, 6075", hint)
    else:
        own = _read_own(dictionary, maker.rated_current if maker else None, "A")
        current = own or Drafted(None, "", hint + also_named(dictionary, "rated_current"))
    hint = "motor torque over current [N m/A], from the motor's data sheet"
    hint += also_named(dictionary, "torque_constant")
    own = _read_own(dictionary, maker.torque_constant if maker else None, "N m/A")
    constant = own or Drafted(None, "", hint)
    torque, unit = _rated_torque(dictionary, current, constant)
    return {
        "rated_current": current,
        "rated_torque": torque,
        "rated_torque_unit": unit,
        "torque_constant": constant,
    }


def _read_own(dictionary: Dictionary, own: VendorObject | None, unit: str) -> Drafted | None:
    """Return the configured value of a manufacturer object."""
    counts = dictionary.value(own.entry) if own else None
    if own is None or not counts:
        return None
    return Drafted(f"{own.value(counts):.10g}", f"{unit}, {own.entry.place}", "")


def _rated_torque(
    dictionary: Dictionary, current: Drafted, constant: Drafted
) -> tuple[Drafted, Drafted]:
    present = dictionary.value(objects.RATED_TORQUE)
    hint = "rated torque of the motor [N m], which the drive's per mille refer to"
    standard = Drafted(TorqueUnit.MILLI.value, "6076", "")
    if not present:
        hint += default_of(dictionary, objects.RATED_TORQUE)
        return Drafted(None, "", hint + also_named(dictionary, "rated_torque")), standard
    if current.value and constant.value:
        unit = torque_unit(present, float(current.value), float(constant.value))
    elif dictionary.vendor in MAKERS or (
        current.value and present / 1000 / float(current.value) > CONSTANT_MAX
    ):
        unit = None
    else:
        unit = TorqueUnit.MILLI
    if unit is None:
        # value and unit are left to be stated
        readings = ", ".join(
            f"{present * newton_metre:.4g} N m if it is in {unit.value}"
            for unit, newton_metre in NEWTON_METRE.items()
        )
        hint += f"; 6076 is {present}: {readings}{also_named(dictionary, 'torque_constant')}"
        choice = (
            "unit of 6076 in the drive, mN m or uN m: rated current times torque constant decides"
        )
        return Drafted(None, "", hint), Drafted(None, "", choice)
    value = f"{present * NEWTON_METRE[unit]:.10g}"
    if unit is TorqueUnit.MILLI:
        return Drafted(value, "N m, 6076", ""), standard
    product = float(current.value or 0) * float(constant.value or 0)
    proof = (
        f"of 6076 = {present}: {current.value} {current.reason}, times {constant.value}"
        f" {constant.reason}, is {product:.4g} N m"
    )
    return Drafted(value, "N m, 6076", ""), Drafted(unit.value, proof, "")


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
