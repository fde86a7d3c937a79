"""Gear, limits, following error and motor ratings in a draft of a drives file.

A drive states its limits on the motor side or in counts; they give values of the joint once its
gear (6091) and the counts of a revolution are certain. No drive knows the direction and the zero of
a joint, so a range (607D) is only mentioned. The values hold for a revolute joint.

Rated current and torque constant come from 6075 and from manufacturer objects. They also show the
unit of the rated torque in a drive: mN m by the standard, uN m with some makers. If nothing proves
the unit and the standard's reading would be an impossible motor, value and unit are left to be
stated.

Units and ratings of a dictionary: a fact if certain, otherwise a hint.

Only configured or fixed values count, and only if all statements of the drive lead to one reading;
defaults, unknown and contradictory values become part of the hint.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.cia402.objects import MAKERS
from drivers.commissioning import unit_codes
from drivers.commissioning.consistency import gear_is_electronic
from drivers.commissioning.position_units import PositionFactors, format_counts, position_readings
from drivers.commissioning.ratings import NEWTON_METRE, torque_unit
from drivers.commissioning.requirements import is_set
from drivers.drives_file import Basis, TorqueUnit
from drivers.rate_units import ACCELERATIONS, VELOCITIES, ratio

if TYPE_CHECKING:
    from collections.abc import Callable
    from fractions import Fraction

    from drivers.cia402.objects import VendorObject
    from drivers.dictionary.current_candidates import CurrentCandidate
    from drivers.dictionary.dictionary import Dictionary
    from drivers.fieldbus import Entry

_NAMES = {
    "rated_current": re.compile(r"(rated|nominal|nenn).*(current|strom)", re.I),
    "rated_torque": re.compile(r"(rated|nominal|nenn).*(torque|moment)", re.I),
    "increments": re.compile(
        r"(encoder|sensor).*(resolution|pulses)|pulse number|increments per|encoder lines", re.I
    ),
    "torque_constant": re.compile(r"torque const|drehmomentkonst", re.I),
}


@dataclass(frozen=True, slots=True)
class Drafted:
    """Value for the draft with its reason; if None, the user states it, helped by the hint."""

    value: str | None
    reason: str
    hint: str


def velocity_unit(dictionary: Dictionary) -> Drafted:
    """Return the velocity unit if certain, otherwise a hint."""
    choice = f"unit of velocities in the drive (6081), such as 0.1 rpm: {', '.join(VELOCITIES)}"
    return _unit(dictionary, objects.VELOCITY_UNIT, unit_codes.velocity_of, choice)


def acceleration_unit(dictionary: Dictionary) -> Drafted:
    """Return the acceleration unit if certain, otherwise a hint."""
    names = ", ".join(ACCELERATIONS)
    choice = f"unit of accelerations in the drive (6083), such as 0.1 rpm/s: {names}"
    return _unit(dictionary, objects.ACCELERATION_UNIT, unit_codes.acceleration_of, choice)


def _unit(
    dictionary: Dictionary,
    entry: Entry,
    decode: Callable[[int, int | None, Fraction | None], str | None],
    choice: str,
) -> Drafted:
    word, default = dictionary.value(entry), _default(dictionary, entry)
    factors = PositionFactors.read(dictionary.value)
    gear, resolution = factors.gear, factors.stated.resolution
    said = decode(word, factors.unit, resolution) if word else None
    place, hint = f"{entry.index:04X}", ""
    if said and gear not in {None, 1} and not said.endswith(("inc/s", "inc/s^2")):
        hint = f"{place} says {said}, of the motor or of the output of gear 6091 = {gear}"
        said = None
    elif word and said is None:
        hint = f"{place} is {word:08X}h, an unknown unit"
    elif default and (by_default := decode(default, None, None)):
        hint = f"by default {by_default} ({place})"
    return Drafted(said, place, f"{choice}; {hint}" if hint else choice)


def increments(dictionary: Dictionary) -> Drafted:
    """Return the counts per motor revolution if certain, with the reason, otherwise a hint.

    A default may be the drive's value, so a reading must hold with defaults too.
    """
    hint = "counts of 6064 per revolution of the motor (encoder lines times 4), or a ratio"
    factors = PositionFactors.read(dictionary.value)
    readings = position_readings(factors)

    def read(entry: Entry) -> int | None:
        value = dictionary.value(entry)
        return _default(dictionary, entry) if value is None else value

    by_default = position_readings(PositionFactors.read(read))
    counts = {reading.per_revolution for reading in (*readings, *by_default)}
    if readings and len(counts) == 1 and not factors.assumed:
        return Drafted(format_counts(readings[0].per_revolution), readings[0].reason, hint)
    if readings:
        either = " or ".join(dict.fromkeys(map(str, (*readings, *by_default))))
        return Drafted(None, "", f"{hint}; the drive leaves it open: {either}{factors.caveat}")
    if factors.unit and factors.unit_in_words != "inc":
        hint += f"; 60A8 = {factors.unit:08X}h says that positions are not increments"
    if by_default:
        hint += f"; defaults suggest {' or '.join(map(str, by_default))}"
    return Drafted(None, "", hint + also_named(dictionary, "increments"))


def default_of(dictionary: Dictionary, entry: Entry) -> str:
    """Return a remark on a data sheet's default, empty if there is none."""
    default = _default(dictionary, entry)
    return f"; the data sheet's default of {entry.index:04X} is {default}" if default else ""


def also_named(dictionary: Dictionary, key: str) -> str:
    """Return a remark on a manufacturer object that may hold a rating, by its name."""
    for (index, _), declared in sorted(dictionary.entries.items()):
        if 0x2000 <= index < 0x6000 and _NAMES[key].search(declared.name):
            value, default = (*declared.reals, declared.value, declared.default)[:2]
            shown = f", {default:g} by default" if default else ""
            shown = shown if value is None else f", it is {value:g}"
            return f"; {declared.place} ({declared.name}) may hold it{shown}"
    return ""


def meaning_of(chosen: CurrentCandidate | None, dictionary: Dictionary) -> str:
    """Return a hint for the current object's unit."""
    choice = ", ".join(basis.value for basis in Basis)
    if chosen is None:
        return f"unit of one count: {choice}"
    place = chosen.declared.place
    if chosen.basis is None:
        rated = also_named(dictionary, "rated_current").replace("may hold it", "may be in its unit")
        return f"unit of one count of {place}: {choice}; see its manual{rated}"
    return (
        f"unit of one count of {place}: {choice}; by the standard {chosen.basis.value}, see the "
        "drive's manual"
    )


def _default(dictionary: Dictionary, entry: Entry) -> int | None:
    declared = dictionary.entry(entry)
    return None if declared is None or declared.value is not None else declared.default


CONSTANT_MAX = 20.0
"""Upper bound of torque constants of robots' motors [N m/A]."""


def draft_ratings(dictionary: Dictionary) -> dict[str, Drafted]:
    """Return the motor ratings by key of the drives file, with values or hints."""
    maker = MAKERS.get(dictionary.vendor or 0)
    present = dictionary.value(objects.RATED_CURRENT)
    hint = "rated current of the motor [A], reference of the drive's per-mille values"
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
    hint = "rated torque of the motor [N m], reference of the drive's per-mille values"
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
        choice = "unit of 6076, mN m or uN m: the one nearer to rated current times torque constant"
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
    "following_error_time": "maximum duration of a larger following error [s], such as 0.05",
    "position_window": "largest distance to a reached target [rad or m], such as 0.002",
    "position_window_time": "minimum time inside position_window [s], such as 0.02",
}
"""Hints by key of the drives file."""


def draft_limits(dictionary: Dictionary) -> dict[str, Drafted]:
    """Return gear ratio, limits and windows, with values or hints."""
    found = {key: Drafted(None, "", hint) for key, hint in _HINTS.items()}
    if milliseconds := _held(dictionary, objects.FOLLOWING_ERROR_TIME):
        found["following_error_time"] = Drafted(f"{milliseconds / 1000:g}", "s, 6066", "")
    # 6091 is the gear of the joint, unless it is 1 or may be an electronic gear
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
