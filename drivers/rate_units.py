"""Units of velocity and acceleration in a drive, by their names in the drives file.

A unit is a symbol, with a factor before the symbol if required: ``0.1 rpm``, ``1/101 rpm``. One
``inc/s`` is one unit of position (a count of 6064) per second. Revolutions, degrees and radians
refer to the motor shaft, metres to a prismatic axis. Sizes are exact fractions.
"""

from __future__ import annotations

import enum
import math
import re
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Annotated, NamedTuple

from pydantic import AfterValidator

if TYPE_CHECKING:
    from collections.abc import Mapping


class Per(enum.Enum):
    """Quantity counted by a rate, per second or per second squared."""

    COUNT = "position unit"
    TURN = "motor revolution"
    RADIAN = "motor radian"
    METRE = "metre of a prismatic axis"


@dataclass(frozen=True, slots=True)
class RateUnit:
    """Unit of velocity or acceleration.

    Attributes
    ----------
    of : Per
        Quantity counted.
    size : Fraction
        Amount of the quantity per second (or per second squared).
    """

    of: Per
    size: Fraction


class NamedRate(NamedTuple):
    """Rate unit with its names as velocity and as acceleration.

    Attributes
    ----------
    velocity, acceleration : str
        Names in the drives file.
    unit : RateUnit
        Meaning of the names.
    code : tuple of int, optional
        Numerator and denominator of the velocity unit in 60A9 (CiA 303-2), if defined.
    """

    velocity: str
    acceleration: str
    unit: RateUnit
    code: tuple[int, int] | None


INCREMENT, REVOLUTION, DEGREE, RADIAN, METRE = 0xB5, 0xB4, 0x41, 0x10, 0x01
SECOND, MINUTE = 0x03, 0x47
"""Unit codes of CiA 303-2: quantity and time."""

RATES = (
    NamedRate("inc/s", "inc/s^2", RateUnit(Per.COUNT, Fraction(1)), (INCREMENT, SECOND)),
    NamedRate("rpm", "rpm/s", RateUnit(Per.TURN, Fraction(1, 60)), (REVOLUTION, MINUTE)),
    NamedRate("mrpm", "mrpm/s", RateUnit(Per.TURN, Fraction(1, 60_000)), None),
    NamedRate("rps", "rps/s", RateUnit(Per.TURN, Fraction(1)), (REVOLUTION, SECOND)),
    NamedRate("deg/s", "deg/s^2", RateUnit(Per.TURN, Fraction(1, 360)), (DEGREE, SECOND)),
    NamedRate("rad/s", "rad/s^2", RateUnit(Per.RADIAN, Fraction(1)), (RADIAN, SECOND)),
    NamedRate("m/s", "m/s^2", RateUnit(Per.METRE, Fraction(1)), (METRE, SECOND)),
    NamedRate("mm/s", "mm/s^2", RateUnit(Per.METRE, Fraction(1, 1000)), None),
)
VELOCITIES = {rate.velocity: rate.unit for rate in RATES}
ACCELERATIONS = {rate.acceleration: rate.unit for rate in RATES}

_RATIO = r"[0-9]{1,12}(?:\.[0-9]{1,12})?(?:\s*/\s*[0-9]{1,12})?"
_UNIT = re.compile(rf"(?:(?P<factor>{_RATIO})\s+)?(?P<symbol>\S+)")
_WHOLE = re.compile(_RATIO)


def velocity_unit(text: str) -> RateUnit:
    """Parse a velocity unit of the drives file.

    Raises
    ------
    ValueError
        Unknown unit.
    """
    return _unit(text, VELOCITIES, "velocities", "0.1 rpm")


def acceleration_unit(text: str) -> RateUnit:
    """Parse an acceleration unit of the drives file (errors as `velocity_unit`)."""
    return _unit(text, ACCELERATIONS, "accelerations", "0.1 rpm/s")


def ratio(text: str) -> Fraction:
    """Parse a positive number or ratio such as 4096, 0.1 or 360000/101, exactly.

    Raises
    ------
    ValueError
        Neither a positive number nor a ratio.
    """
    compact = re.sub(r"\s", "", text) if _WHOLE.fullmatch(text.strip()) else ""
    over, _, under = compact.partition("/")
    if not over or (under and not int(under)) or not Fraction(over):
        raise ValueError(f"{text[:40]!r} must be a positive number or ratio, such as 360000/101")
    return Fraction(over) / int(under or 1)


def motor_turns(unit: RateUnit, counts: Fraction, gear_ratio: float) -> Fraction:
    """Convert a unit to motor revolutions per second, or per second squared.

    Parameters
    ----------
    unit : RateUnit
        Unit to convert.
    counts : Fraction
        Counts of 6064 per motor revolution.
    gear_ratio : float
        Motor angle over joint coordinate [-, or rad/m if prismatic].
    """
    match unit.of:
        case Per.COUNT:
            return unit.size / counts
        case Per.TURN:
            return unit.size
        case Per.RADIAN:
            return unit.size / Fraction(math.tau)
        case Per.METRE:
            return unit.size * Fraction(gear_ratio) / Fraction(math.tau)


def _unit(text: str, units: Mapping[str, RateUnit], what: str, example: str) -> RateUnit:
    found = _UNIT.fullmatch(text.strip())
    unit = units.get(found["symbol"]) if found else None
    if found is None or unit is None:
        raise ValueError(
            f"{text[:40]!r} is not a unit of {what}; state one of {', '.join(units)}, with a "
            f"factor before it if it has one, such as {example} or 1/101 {example.split()[1]}"
        )
    return RateUnit(unit.of, unit.size * ratio(found["factor"] or "1"))


def _check_velocity(text: str) -> str:
    velocity_unit(text)
    return text


def _check_acceleration(text: str) -> str:
    acceleration_unit(text)
    return text


VelocityUnit = Annotated[str, AfterValidator(_check_velocity)]
"""Velocity unit of the drive (6081, 607F), by name in the drives file."""

AccelerationUnit = Annotated[str, AfterValidator(_check_acceleration)]
"""Acceleration unit of the drive (6083, 6084, 6085), by name in the drives file."""
