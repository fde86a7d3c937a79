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
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from drivers.commissioning.measures import measures

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from drivers.commissioning.requirement import Requirement
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import Entry

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

    def accepts(written: int, kept: int, drives: DrivesFile) -> bool:
        del drives
        return kept > 0 and -less * written <= kept - written <= more * written

    return Kept(words, accepts)


def _inwards(direction: int) -> Kept:
    """Accept what lies in a direction (+1, -1), and one increment in the other."""

    def accepts(written: int, kept: int, drives: DrivesFile) -> bool:
        del drives
        return (kept - written) * direction >= -1

    words = "any value further inside, or one increment further outside; any range, if it is fixed"
    return Kept(words, accepts)


EXACT = Kept("the value written", lambda written, kept, _: kept == written)
LESS = _share(f"any smaller value above 0, or up to {100 * ROUNDING:g} % more", math.inf, ROUNDING)
ROUNDED = _share(f"{100 * ROUNDING:g} % less or more", ROUNDING, ROUNDING)
LOWER_END, UPPER_END = _inwards(1), _inwards(-1)


class Readback:
    """Judges by the table what the drive of one axis keeps, and shows it in SI.

    Parameters
    ----------
    axis, drives : AxisDrive, DrivesFile
        What the drives file states.
    requirements : mapping of Entry to Requirement
        Of the bus.
    """

    def __init__(
        self, axis: AxisDrive, drives: DrivesFile, requirements: Mapping[Entry, Requirement]
    ) -> None:
        self._requirements = requirements
        self._drives = drives
        self._measures = measures(axis)

    def accepts(self, entry: Entry, written: int, kept: int) -> bool:
        """Whether a drive serves that keeps `kept` after `written` was written to an object.

        An object that is not in the table must read back exactly.
        """
        need = self._requirement(entry)
        return need is not None and need.kept.accepts(written, kept, self._drives)

    def compared(self, entry: Entry, written: int, kept: int) -> str:
        """Return what is kept and what was written in SI, for what is counted in units."""
        need = self._requirement(entry)
        if need is None or need.quantity is None:
            return ""
        measure = self._measures[need.quantity]
        held, wanted = (f"{measure.value(count):.5g} {measure.unit}" for count in (kept, written))
        return f" ({held} instead of {wanted})"

    def _requirement(self, entry: Entry) -> Requirement | None:
        """Return the row of an object; that of an array's first entry counts for all of it."""
        first = replace(entry, subindex=1)
        return self._requirements.get(entry) or self._requirements.get(first)
