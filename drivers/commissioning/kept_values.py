"""Which values a drive may keep in place of one that was written, as rules with their words.

A drive may round to its own resolution or clip to a bound of its own, and say nothing of it. That
is no reason to refuse the drive where what it keeps protects as well: a lower speed, a smaller
following error. Slower braking makes the way of a stop longer, and less torque makes a brake of an
arm that sinks, so decelerations and torques may be rounded but not clipped. Software limits may lie
further inside by any amount, and further outside by one increment. Zero never serves in place of
another value, since it often means "off".
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.drives_file import DrivesFile

ROUNDING = 0.01
"""Share of a value by which a drive may round it."""


@dataclass(frozen=True, slots=True)
class Kept:
    """A rule.

    Attributes
    ----------
    words : str
        It, in words.
    accepts : callable
        ``accepts(written, kept, drives)``: whether a drive serves that keeps `kept`.
    """

    words: str
    accepts: Callable[[int, int, DrivesFile], bool]


def _share(words: str, less: float, more: float) -> Kept:
    """Accept what is less or more by such shares of the value written, and above zero."""
    return Kept(
        words,
        lambda written, kept, _: kept > 0 and -less * written <= kept - written <= more * written,
    )


def _inwards(direction: int) -> Kept:
    """Accept what lies in a direction (+1, -1), and one increment in the other."""
    words = "any value further inside, or one increment further outside; any range, if it is fixed"
    return Kept(words, lambda written, kept, _: (kept - written) * direction >= -1)


EXACT = Kept("the value written", lambda written, kept, _: kept == written)
LESS = _share(f"any smaller value above 0, or up to {100 * ROUNDING:g} % more", math.inf, ROUNDING)
ROUNDED = _share(f"{100 * ROUNDING:g} % less or more", ROUNDING, ROUNDING)
LOWER_END, UPPER_END = _inwards(1), _inwards(-1)
