"""Unit codes of the objects 60A8 to 60AA (CiA 303-2), in words and as numbers.

A word holds a power of ten, then a byte each for numerator and denominator::

    FFB44700h    10^-1 revolutions per minute
    FD410000h    10^-3 degrees
    00B55700h    increments per second squared

Some makers write revolutions per minute as a single unit (C0h), and a second unit of time in the
last byte. Codes not listed here are unknown, without any conclusion.
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
"""Accepted powers of ten; others mark unknown codes."""

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
"""Units per revolution; the radian is rounded to a double."""

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
"""Acceleration units: per second twice, as two units of time or as one squared."""


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
    """Return the name of a velocity unit (60A9) in the drives file; None if unknown.

    A unit derived from the position unit (60A8, `position`) is named after counts, since both refer
    to one shaft: with positions in 0.1 deg, 0.1 deg/s is ``inc/s``. Increments with another
    position unit are those of the encoder, with `resolution` (608F) per motor revolution.
    """
    return _rate(word, position, resolution, VELOCITIES)


def acceleration_of(
    word: int, position: int | None = None, resolution: Fraction | None = None
) -> str | None:
    """Return the name of an acceleration unit (60AA), as `velocity_of` for velocities."""
    return _rate(word, position, resolution, ACCELERATIONS)


def position_of(word: int) -> str | None:
    """Return a position unit (60A8) in words; None if unknown."""
    numerator, *rest = codes_of(word)
    return None if any(rest) else _named(power_of(word), numerator, POSITIONS)


def _rate(
    word: int,
    position: int | None,
    resolution: Fraction | None,
    names: Mapping[tuple[int, int, int], str],
) -> str | None:
    power, codes = power_of(word), codes_of(word)
    same_unit = bool(position) and codes_of(position or 0) == (codes[0], 0, 0)
    if codes[0] != INCREMENT or not position or same_unit:
        if position and same_unit and codes[0] in POSITIONS:  # in counts of the position unit
            power, codes = power - power_of(position), (INCREMENT, *codes[1:])
        return _named(power, codes, names)
    # increments of the encoder, with another position unit
    symbol = names.get((REVOLUTION, *codes[1:]))
    if resolution is None or symbol is None or not position_of(position) or power not in POWERS:
        return None
    return f"{Fraction(10) ** power / resolution} {symbol}"


def _named(power: int, codes: Code, names: Mapping[Code, str]) -> str | None:
    symbol = names.get(codes)
    if symbol is None or power not in POWERS:
        return None
    factor = 10**power if power > 0 else f"{10.0**power:.{-power}f}"
    return symbol if power == 0 else f"{factor} {symbol}"
