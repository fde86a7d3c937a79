"""Units and ratings of a dictionary: a fact if certain, otherwise a hint.

Only configured or fixed values count, and only if all statements of the drive lead to one reading;
defaults, unknown and contradictory values become part of the hint.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.commissioning import unit_codes
from drivers.commissioning.position_units import PositionFactors, format_counts, position_readings
from drivers.drives_file import Basis
from drivers.rate_units import ACCELERATIONS, VELOCITIES

if TYPE_CHECKING:
    from collections.abc import Callable
    from fractions import Fraction

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
    """Value for the draft with its reason; None is to be stated, by the hint."""

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
        hint += f"; 60A8 = {factors.unit:08X}h says that positions are no increments"
    if by_default:
        hint += f"; by its defaults {' or '.join(map(str, by_default))}"
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
