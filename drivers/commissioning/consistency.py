"""Comparison of the drives file with the statements of the drive itself.

Ratings, encoder, gear and units scale every torque and every set-point. A drive that contradicts
the file is refused; if it is silent or contradicts itself, the file is trusted, with a note.
Commissioning and `hil drives check` make the same comparisons.
"""

from __future__ import annotations

import math
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from drivers.cia402 import objects
from drivers.commissioning.position_units import (
    PositionFactors,
    format_counts,
    position_readings,
    same,
)
from drivers.commissioning.ratings import compare_ratings
from drivers.commissioning.requirements import REQUIREMENTS
from drivers.commissioning.unit_codes import acceleration_of, velocity_of
from drivers.commissioning.verdict import Grade, compare_values, unsettled
from drivers.drive_bus import DriveRefused
from drivers.rate_units import Per, acceleration_unit, motor_turns, velocity_unit

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from drivers.commissioning.verdict import Comparison
    from drivers.drives_file import AxisDrive
    from drivers.fieldbus import Entry
    from drivers.rate_units import RateUnit
    from drivers.remote_dictionary import RemoteDictionary

POSITION = "position unit (6064)"
GEAR = "gear (6091)"
SAME_GEAR = 1e-3
"""Largest relative difference of equal gear ratios: rounding in a drive."""
_COUNTS = "increments_per_revolution"
_SAME = Fraction(1, 10**6)
"""Largest relative difference of equal units."""
_SPINDLE = Fraction(1, 1000)
"""Largest relative difference if a gear ratio [rad/m] converts lengths to revolutions."""


def compare_statements(server: RemoteDictionary, axis: AxisDrive) -> None:
    """Refuse a drive that contradicts the drives file, and note statements taken on trust.

    Raises
    ------
    DriveRefused
        The drive contradicts the drives file.
    """
    for comparison in comparisons(server, axis):
        if comparison.grade is Grade.REFUSED:
            raise DriveRefused(
                f"{server.label}: {comparison.check} is {comparison.found}, the drives "
                f"file states {comparison.key}: {comparison.stated}; {comparison.remedy}"
            )
        if comparison.grade is Grade.WARNING:
            server.note(f"{comparison.found}: {comparison.remedy}", lack=True)
    if offset := _read(server, objects.HOME_OFFSET):
        server.note(
            f"{objects.HOME_OFFSET} is {offset}: positions shift by this offset at the next "
            "homing or power-up; include it in zero of the drives file"
        )


def comparisons(server: RemoteDictionary, axis: AxisDrive) -> Iterator[Comparison]:
    """Compare ratings (6075, 6076), positions and gear (608F to 60A8), velocities, accelerations.

    Raises
    ------
    DriveRefused, NodeSilent
        An object cannot be read.
    """
    yield from compare_ratings(server.find, axis)
    factors = PositionFactors.read(partial(_read, server))
    yield compare_positions(factors, axis)
    yield from another_gear(factors, axis)
    gear = factors.gear or Fraction(1)
    units = factors.unit, factors.stated.resolution
    stated = _Rate("velocity_unit", axis.velocity_unit, velocity_unit)
    if word := _read(server, objects.VELOCITY_UNIT):
        said = velocity_of(word, *units)
        yield _compare_rate(objects.VELOCITY_UNIT, word, said, stated, gear, axis)
    else:
        yield from _factor(server, objects.VELOCITY_FACTOR, objects.VELOCITY_DIVISOR, stated)
    stated = _Rate("acceleration_unit", axis.acceleration_unit, acceleration_unit)
    if word := _read(server, objects.ACCELERATION_UNIT):
        said = acceleration_of(word, *units)
        yield _compare_rate(objects.ACCELERATION_UNIT, word, said, stated, gear, axis)
    else:
        factor, divisor = objects.ACCELERATION_FACTOR, objects.ACCELERATION_DIVISOR
        yield from _factor(server, factor, divisor, stated)


def _read(server: RemoteDictionary, entry: Entry) -> int | None:
    """Read an object for comparison only; note an object of a non-standard type."""
    try:
        return server.find(entry)
    except DriveRefused:
        server.note(f"object {entry} cannot be read as {entry.type}: it is left out of comparisons")
        return None


def compare_positions(factors: PositionFactors, axis: AxisDrive) -> Comparison:
    """Compare the counts of a motor revolution with the objects of the drive."""
    stated, readings = axis.increments_per_revolution, position_readings(factors)
    if not readings:
        silent = "no encoder resolution (608F) nor feed (6092)"
        if factors.resolution is not None:
            silent = f"608F = {factors.resolution}{factors.caveat}"
        if factors.unit:
            silent += f", and 60A8 says {factors.unit_in_words}"
        trust = REQUIREMENTS[objects.ENCODER_INCREMENTS].without
        return unsettled(POSITION, silent, _COUNTS, str(stated), trust)
    found = " or ".join(map(str, readings)) + factors.caveat
    agrees = any(same(reading.per_revolution, stated) for reading in readings)
    if agrees and (len(readings) > 1 or factors.assumed):
        remedy = f"not stated by the drive, {_COUNTS}: {format_counts(stated)} is not verified"
        return unsettled(POSITION, found, _COUNTS, format_counts(stated), remedy)
    return compare_values(
        agrees,
        POSITION,
        found,
        _COUNTS,
        format_counts(stated),
        f"correct {_COUNTS} or the drive's parameters: every angle scales with it",
    )


def gear_is_electronic(factors: PositionFactors) -> bool:
    """Return True if a gear (6091) may be electronic: no feed or unit refers to the gear."""
    return (factors.feed in {None, 1} and not factors.unit) or "gear" in factors.assumed


def another_gear(factors: PositionFactors, axis: AxisDrive) -> Iterator[Comparison]:
    """Yield a comparison for a gear whose ratio differs from the file's."""
    gear, stated = factors.gear, axis.gear_ratio
    if gear in {None, 1} or gear_is_electronic(factors):
        return
    assert gear is not None  # noqa: S101 - was tested
    if not math.isclose(float(gear), stated, rel_tol=SAME_GEAR):
        yield compare_values(
            False,
            GEAR,
            f"{float(gear):g}",
            "gear_ratio",
            f"{stated:g}",
            "correct gear_ratio or the drive's parameter: angles and torques scale with it",
        )


class _Rate(NamedTuple):
    """Unit of velocity or acceleration in the drives file, with its parser."""

    key: str
    text: str
    unit: Callable[[str], RateUnit]


def _compare_rate(
    entry: Entry, word: int, said: str | None, stated: _Rate, gear: Fraction, axis: AxisDrive
) -> Comparison:
    """Compare a unit with 60A9 or 60AA; with a gear, the unit may be that of its output."""
    check, (key, text, unit) = f"{entry.name} ({entry.index:04X})", stated
    if said is None:
        unknown = f"{entry} is {word:08X}h, an unknown unit"
        return unsettled(check, unknown, key, text, f"{key}: {text} is not verified")
    wanted, found = (
        motor_turns(unit(name), axis.increments_per_revolution, axis.gear_ratio)
        for name in (text, said)
    )
    lengths = {unit(text).of, unit(said).of} & {Per.METRE}
    slack = wanted * (_SPINDLE if lengths else _SAME)
    turning = unit(said).of in {Per.TURN, Per.RADIAN} and gear != 1
    if turning and min(abs(found - wanted), abs(found * gear - wanted)) <= slack:
        either = f"{entry} says {said} and the gear (6091) is {gear}"
        remedy = f"{key}: {text} is not verified, whether of motor or gear; check by a known move"
        return unsettled(check, either, key, text, remedy)
    return compare_values(
        abs(found - wanted) <= slack,
        check,
        f"{said} ({word:08X}h)",
        key,
        text,
        "correct whichever is wrong: velocities and accelerations scale with it",
    )


def _factor(
    server: RemoteDictionary, over: Entry, under: Entry, stated: _Rate
) -> Iterator[Comparison]:
    """Leave a factor of the profile's older edition to the file: makers differ in its use."""
    numerator, divisor = _read(server, over), _read(server, under)
    if numerator and divisor and numerator != divisor:
        found = f"{over.name} ({over.index:04X}) is {numerator}/{divisor}"
        remedy = f"{stated.key}: {stated.text} is not verified"
        yield unsettled(f"{over.name} ({over.index:04X})", found, stated.key, stated.text, remedy)
