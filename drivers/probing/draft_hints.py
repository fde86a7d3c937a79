"""What a dictionary says of units and ratings: a fact where it is certain, else a hint.

CiA 402 has objects for units (60A8 and on): a byte for the power of ten, then the codes of
numerator and denominator (CiA 303-2). Few drives have them, and only a configured or fixed value
counts.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from drivers import objects
from drivers.drives_file import AccelerationUnit, Basis, VelocityUnit
from drivers.probing.needs import UNITS

if TYPE_CHECKING:
    from drivers.probing.current_candidates import CurrentCandidate
    from drivers.probing.dictionary import Declared, Dictionary
    from drivers.sdo import Entry

POSITION_UNIT, VELOCITY_UNIT, ACCELERATION_UNIT = UNITS
INCREMENTS = 0x00B50000

VELOCITIES = {
    0x00B50300: VelocityUnit.INCREMENTS,
    0x00B44700: VelocityUnit.RPM,
    0xFFB44700: VelocityUnit.TENTH_RPM,
}
ACCELERATIONS = {
    0x00B55700: AccelerationUnit.INCREMENTS,
    0x00C00300: AccelerationUnit.RPM,
    0xFFC00300: AccelerationUnit.TENTH_RPM,
}

_NAMES = {
    "rated_current": re.compile(r"(rated|nominal|nenn).*(current|strom)", re.I),
    "rated_torque": re.compile(r"(rated|nominal|nenn).*(torque|moment)", re.I),
    "torque_constant": re.compile(r"torque const|drehmomentkonst", re.I),
}


def velocity_unit(dictionary: Dictionary) -> tuple[str | None, str]:
    """Return the unit of velocities if it is certain, and what to state otherwise."""
    found = VELOCITIES.get(dictionary.value(VELOCITY_UNIT) or 0)
    choice = "unit of velocities in the drive (6081): inc/s, rpm or 0.1 rpm"
    default = VELOCITIES.get(_default(dictionary, VELOCITY_UNIT) or 0)
    hint = f"{choice}; by default {default.value} (60A9)" if default else choice
    return (found.value if found else None), hint


def acceleration_unit(dictionary: Dictionary) -> tuple[str | None, str]:
    """Return the unit of accelerations if it is certain, and what to state otherwise."""
    found = ACCELERATIONS.get(dictionary.value(ACCELERATION_UNIT) or 0)
    choice = "unit of accelerations in the drive (6083): inc/s^2, rpm/s or 0.1 rpm/s"
    default = ACCELERATIONS.get(_default(dictionary, ACCELERATION_UNIT) or 0)
    hint = f"{choice}; by default {default.value} (60AA)" if default else choice
    return (found.value if found else None), hint


def increments(dictionary: Dictionary) -> tuple[int | None, str]:
    """Return the encoder's increments per motor revolution if certain, and what to state."""
    hint = "counts of 6064 per revolution of the motor (encoder lines times 4)"
    unit = dictionary.value(POSITION_UNIT)
    if unit not in {None, 0, INCREMENTS}:
        return None, f"{hint}; 60A8 = {unit:08X}h says that positions are no increments"
    number = dictionary.value(objects.ENCODER_INCREMENTS)
    revolutions = dictionary.value(objects.ENCODER_REVOLUTIONS)
    if number and revolutions and number > revolutions and not number % revolutions:
        return number // revolutions, hint
    return None, hint + default_of(dictionary, objects.ENCODER_INCREMENTS)


def default_of(dictionary: Dictionary, entry: Entry) -> str:
    """Return a remark on a data sheet's default, empty where there is none worth telling."""
    default = _default(dictionary, entry)
    return f"; the data sheet's default of {entry.index:04X} is {default}" if default else ""


def also_named(dictionary: Dictionary, key: str) -> str:
    """Return a remark on a maker's object that may hold a rating, by its name."""
    for (index, _), declared in sorted(dictionary.entries.items()):
        if 0x2000 <= index < 0x6000 and _NAMES[key].search(declared.name):
            return f"; {declared.place} ({declared.name}) may hold it{_shown(declared)}"
    return ""


def meaning_of(chosen: CurrentCandidate | None, dictionary: Dictionary) -> str:
    """Return what to state of the current object's unit."""
    choice = ", ".join(basis.value for basis in Basis)
    if chosen is None:
        return f"what one count is: {choice}"
    place = chosen.declared.place
    if chosen.basis is None:
        rated = also_named(dictionary, "rated_current").replace("may hold it", "may be in its unit")
        return f"what one count of {place} is: {choice}; see its manual{rated}"
    return (
        f"what one count of {place} is: {choice}; by the standard {chosen.basis.value}, see the "
        "drive's manual"
    )


def _default(dictionary: Dictionary, entry: Entry) -> int | None:
    declared = dictionary.entry(entry)
    return None if declared is None or declared.value is not None else declared.default


def _shown(declared: Declared) -> str:
    return f", {declared.default} by default" if declared.default else ""
