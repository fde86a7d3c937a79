"""Unit of 6064 from a drive's statements on encoder, gear, feed and units.

CiA 402 converts encoder increments to positions by three ratios::

    position = increments * feed / (encoder resolution * gear ratio)        6092, 608F, 6091

so that a revolution of the motor, with as many increments as the encoder resolution states, has
feed / gear ratio counts. A drive may also state the unit itself (60A8), as a power of ten of a
degree or a revolution at the gear's output. Feed and gear of 1, the factory setting, mean that
nothing was configured: then a count is an increment.

From these follow the admissible readings, each with its reason; a unit coarser than a motor
revolution is not admissible. A single reading is a fact. Several different ones leave the choice to
the drives file: the drive contradicts itself, or states a gear and no feed, which may be counted
before or after the gear. A ratio whose divisor is missing or 0 is uncertain too: the divisor may be
meant to be 1, or the ratio may be meaningless. Without readings the file is trusted. Draft, check
and commissioning use this module.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.commissioning import unit_codes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from drivers.fieldbus import Entry

RATIOS = {
    "encoder": (objects.ENCODER_INCREMENTS, objects.ENCODER_REVOLUTIONS),
    "gear": (objects.GEAR_MOTOR, objects.GEAR_SHAFT),
    "feed": (objects.FEED, objects.FEED_SHAFT),
    "factor": (objects.POSITION_FACTOR, objects.POSITION_DIVISOR),
}
"""Numerator and divisor of the fields of `PositionFactors`."""
ROUNDED = Fraction(1, 10**9)
"""Largest relative difference of equal readings, since radians have no exact ratio."""


@dataclass(frozen=True, slots=True)
class Reading:
    """Admissible number of counts per motor revolution.

    Attributes
    ----------
    per_revolution : Fraction
        Counts of 6064 per motor revolution.
    reason : str
        Objects from which the number follows.
    """

    per_revolution: Fraction
    reason: str

    def __str__(self) -> str:
        return f"{format_counts(self.per_revolution)} counts per motor revolution ({self.reason})"


@dataclass(frozen=True, slots=True)
class PositionFactors:
    """Statements of a drive on its positions; None where it is silent.

    Attributes
    ----------
    encoder, gear, feed, factor : Fraction or None
        608F, 6091, 6092, and 6093 of the profile's older edition.
    unit : int or None
        60A8.
    assumed : mapping of str to Entry
        Divisors assumed to be 1, by name of the ratio.
    """

    encoder: Fraction | None = None
    gear: Fraction | None = None
    feed: Fraction | None = None
    factor: Fraction | None = None
    unit: int | None = None
    assumed: Mapping[str, Entry] = field(default_factory=dict)

    @classmethod
    def read(cls, read: Callable[[Entry], int | None]) -> PositionFactors:
        """Read a live drive (`RemoteDictionary.find`) or a dictionary (`Dictionary.value`)."""
        assumed: dict[str, Entry] = {}

        def ratio(name: str) -> Fraction | None:
            over, under = RATIOS[name]
            numerator, denominator = read(over), read(under)
            if not numerator or not (denominator or numerator > 1):
                return None
            if not denominator:
                assumed[name] = under
            return Fraction(numerator, denominator or 1)

        ratios = {name: ratio(name) for name in RATIOS}
        return cls(**ratios, unit=read(objects.POSITION_UNIT), assumed=assumed)

    @property
    def stated(self) -> PositionFactors:
        """Factors except ratios with an assumed divisor, which become None."""
        return replace(self, **dict.fromkeys(self.assumed), assumed={})

    @property
    def caveat(self) -> str:
        """Assumed divisors as the end of a sentence; empty if there are none."""
        return "".join(
            f"; {entry.place} is 0 or not stated, 1 is assumed" for entry in self.assumed.values()
        )

    @property
    def resolution(self) -> Fraction | None:
        """Increments per motor revolution; None for an unconfigured encoder (1)."""
        return None if self.encoder is None or self.encoder <= 1 else self.encoder

    @property
    def unit_in_words(self) -> str:
        """Unit of 60A8 in words; 0 is the default of a drive without a statement."""
        if not self.unit:
            return "nothing"
        return unit_codes.position_of(self.unit) or f"{self.unit:08X}h, an unknown unit"


def position_readings(factors: PositionFactors) -> tuple[Reading, ...]:
    """Return the admissible readings, each value once, the strongest first."""
    distinct: list[Reading] = []
    for reading in (*_readings(factors), *_readings(factors.stated)):
        for place, other in enumerate(distinct):
            if same(other.per_revolution, reading.per_revolution):
                if reading.reason not in other.reason:
                    merged = f"{other.reason}; {reading.reason}"
                    distinct[place] = Reading(other.per_revolution, merged)
                break
        else:
            distinct.append(reading)
    return tuple(distinct)


def same(one: Fraction, other: Fraction) -> bool:
    """Return True if two numbers of counts are equal."""
    return abs(one - other) <= ROUNDED * one


def format_counts(counts: Fraction) -> str:
    """Format a number of counts, exactly if it is a ratio of short numbers."""
    return str(counts) if counts.denominator < 10**6 else f"{float(counts):.10g}"


def _readings(factors: PositionFactors) -> Iterator[Reading]:
    gear, feed = factors.gear or Fraction(1), factors.feed
    # counts per revolution of the gear's output, if the unit is an angle
    angle, unit = None, factors.unit
    if unit and unit_codes.position_of(unit) is not None:
        turn = unit_codes.ANGLES.get(unit_codes.codes_of(unit)[0])
        angle = None if turn is None else turn / Fraction(10) ** unit_codes.power_of(unit)
    if feed is not None and feed != 1 and feed > gear:
        yield Reading(feed / gear, f"feed 6092 = {feed} over gear 6091 = {gear}")
    if angle is not None and angle > gear:
        behind = f" at the output of gear 6091 = {gear}" if gear != 1 else ""
        yield Reading(angle / gear, f"60A8 says {factors.unit_in_words}{behind}")
    if factors.resolution is not None:
        yield from _increments(factors, factors.resolution, gear)


def _increments(
    factors: PositionFactors, resolution: Fraction, gear: Fraction
) -> Iterator[Reading]:
    encoder = f"608F = {factors.encoder}"
    # increments by 60A8, or for lack of any other configuration
    default = factors.feed in {None, 1}
    if factors.factor is not None and factors.factor != 1:
        by_factor = f"{encoder} over position factor 6093 = {factors.factor}"
        yield Reading(resolution / factors.factor, by_factor)
    elif factors.unit_in_words == "inc" if factors.unit else default:
        yield Reading(resolution, f"{encoder}, in increments")
        if gear != 1 and default:  # some makers use 6091 for an electronic gear
            yield Reading(resolution / gear, f"{encoder} over gear 6091 = {gear}")
