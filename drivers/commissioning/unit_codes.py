"""Units as the objects 60A8 to 60AA code them (CiA 303-2), in words and as numbers.

A word holds a power of ten, then a byte each for numerator and denominator::

    FFB44700h    10^-1 revolutions per minute
    FD410000h    10^-3 degrees
    00B55700h    increments per second squared

Some makers write revolutions per minute as one unit of its own (C0h), and a second unit of time
into the last byte. A code that is not listed here is unknown, and nothing is concluded from it.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import TYPE_CHECKING, TypeVar

from drivers.rate_units import DEGREE, INCREMENT, METRE, RADIAN, RATES, REVOLUTION, SECOND

if TYPE_CHECKING:
    from collections.abc import Mapping

Code = TypeVar("Code", int, tuple[int, int, int])

MINUTE_OF_ARC, SECOND_OF_ARC = 0x42, 0x43
POWERS = range(-12, 7)
"""Powers of ten that a unit may have; others are taken for unknown codes."""

_SECOND_SQUARED, _RPM = 0x57, 0xC0

POSITIONS = {
    INCREMENT: "inc",
    REVOLUTION: "rev",
    DEGREE: "deg",
    MINUTE_OF_ARC: "arcmin",
    SECOND_OF_ARC: "arcsec",
    RADIAN: "rad",
    METRE: "m",
}
ANGLES = {
    REVOLUTION: Fraction(1),
    DEGREE: Fraction(360),
    MINUTE_OF_ARC: Fraction(360 * 60),
    SECOND_OF_ARC: Fraction(360 * 3600),
    RADIAN: Fraction(math.tau),
}
"""Units in one revolution; that of the radian is rounded to a double."""

VELOCITIES = {(*rate.code, 0): rate.velocity for rate in RATES if rate.code}
ACCELERATIONS = {
    **{(*rate.code, SECOND): rate.acceleration for rate in RATES if rate.code},
    **{
        (rate.code[0], _SECOND_SQUARED, 0): rate.acceleration
        for rate in RATES
        if rate.code and rate.code[1] == SECOND
    },
    (_RPM, SECOND, 0): "rpm/s",
}
"""Per second twice, as two units of time or as one squared."""


def power_of(word: int) -> int:
    """Return the power of ten of a code."""
    prefix = word >> 24 & 0xFF
    return prefix - 256 if prefix > 127 else prefix


def codes_of(word: int) -> tuple[int, int, int]:
    """Return numerator, denominator and last byte of a code."""
    return word >> 16 & 0xFF, word >> 8 & 0xFF, word & 0xFF


def velocity_of(
    word: int, position: int | None = None, resolution: Fraction | None = None
) -> str | None:
    """Return a unit of velocity (60A9) as the drives file names it; None where it is unknown.

    One that is made of the unit of positions (60A8, `position`) is named after counts, since both
    are of the same shaft: 0.1 deg/s beside 0.1 deg is ``inc/s``. Increments beside another unit of
    positions are the encoder's, of which a motor revolution has `resolution` (608F).
    """
    return _rate(word, position, resolution, VELOCITIES)


def acceleration_of(
    word: int, position: int | None = None, resolution: Fraction | None = None
) -> str | None:
    """Return a unit of acceleration (60AA) as `velocity_of` does one of velocity."""
    return _rate(word, position, resolution, ACCELERATIONS)


def position_of(word: int) -> str | None:
    """Return a unit of position (60A8) in words; None where it is unknown."""
    numerator, *rest = codes_of(word)
    return None if any(rest) else _named(power_of(word), numerator, POSITIONS)


def _of_the_encoder(word: int, position: int | None) -> bool:
    """Whether a unit (60A9, 60AA) is made of increments, and that of positions is another."""
    others = position and codes_of(position) != (INCREMENT, 0, 0)
    return bool(others) and codes_of(word)[0] == INCREMENT


def _rate(
    word: int,
    position: int | None,
    resolution: Fraction | None,
    names: Mapping[tuple[int, int, int], str],
) -> str | None:
    if not _of_the_encoder(word, position):
        return _named(*_in_counts(word, position), names)
    symbol = names.get((REVOLUTION, *codes_of(word)[1:]))
    known = position and position_of(position) and power_of(word) in POWERS
    if resolution is None or symbol is None or not known:
        return None
    return f"{Fraction(10) ** power_of(word) / resolution} {symbol}"


def _in_counts(word: int, position: int | None) -> tuple[int, tuple[int, int, int]]:
    """Return power of ten and codes, of counts where the unit is made of that of positions."""
    power, codes = power_of(word), codes_of(word)
    if position and codes_of(position) == (codes[0], 0, 0) and codes[0] in POSITIONS:
        return power - power_of(position), (INCREMENT, *codes[1:])
    return power, codes


def _named(power: int, codes: Code, names: Mapping[Code, str]) -> str | None:
    symbol = names.get(codes)
    if symbol is None or power not in POWERS:
        return None
    return symbol if power == 0 else f"{10**power if power > 0 else _decimal(power)} {symbol}"


def _decimal(power: int) -> str:
    return f"{10.0**power:.{-power}f}"
