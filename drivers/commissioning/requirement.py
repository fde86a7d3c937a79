"""Requirements on an object of a drive: the columns of the table of requirements.

A drive may round a written value to its resolution or clip it, without an error. That is acceptable
if the kept value protects as well: a lower speed, a smaller following error. Slower braking
lengthens a stop, and less torque lets a braking arm sink, so decelerations and torques may be
rounded but not clipped. Software limits may be further inside by any amount, and further outside by
one increment. Zero is never acceptable for another value, since it often means "off".
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, Flag, auto
from functools import partial
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    from drivers.commissioning.measures import Quantity
    from drivers.drives_file import DrivesFile
    from drivers.fieldbus import Entry

ROUNDING = 0.01
"""Largest relative rounding of a value."""


@dataclass(frozen=True, slots=True)
class Kept:
    """Rule for values that a drive may keep instead of the written one.

    Attributes
    ----------
    words : str
        The rule in words.
    accepts : callable
        ``accepts(written, kept, drives)``: True if the kept value is acceptable.
    """

    words: str
    accepts: Callable[[int, int, DrivesFile], bool]


def _accept_share(words: str, less: float, more: float) -> Kept:
    """Accept values above zero within a tolerance, as shares of the written value."""
    return Kept(
        words,
        lambda written, kept, _: kept > 0 and -less * written <= kept - written <= more * written,
    )


def _accept_inwards(direction: int) -> Kept:
    """Accept values in a direction (+1, -1), and an increment in the opposite direction."""
    words = "any value further inside, or one increment further outside; any range, if it is fixed"
    return Kept(words, lambda written, kept, _: (kept - written) * direction >= -1)


EXACT = Kept("the value written", lambda written, kept, _: kept == written)
LESS = _accept_share(
    f"any smaller value above 0, or up to {100 * ROUNDING:g} % more", math.inf, ROUNDING
)
ROUNDED = _accept_share(f"{100 * ROUNDING:g} % less or more", ROUNDING, ROUNDING)
LOWER_END, UPPER_END = _accept_inwards(1), _accept_inwards(-1)


class Use(Flag):
    """Use of an object by the driver."""

    READ = auto()
    ASK = auto()
    """Read if possible: an object of a non-standard type is left out."""
    WRITE = auto()
    SET = READ | WRITE
    """Written, and read back."""
    VARY = auto()
    """Written repeatedly: an object fixed at any value is unsuitable."""
    SEND = auto()
    """The drive must be able to send it in a PDO."""
    RECEIVE = auto()
    """The drive must be able to take it from a PDO."""


class Lack(Enum):
    """Consequence of a missing object for the drive."""

    REFUSED = "refused"
    REFUSED_UNLESS_STATED = "refused unless `allow_no_heartbeat` states what else stops the axis"
    NOTED = "noted"
    SILENT = "not mentioned"


@dataclass(frozen=True, slots=True)
class Requirement:
    """Requirement on an object.

    Attributes
    ----------
    entry : Entry
        The object.
    use : Use
        Use by the driver.
    without : str
        Consequence of a missing object.
    lack : Lack
        Treatment of a drive without the object.
    value : int or None
        Written value, if common to all axes.
    serves : collection of int
        Other acceptable values, even if the object cannot be written.
    kept : Kept
        Rule for values kept after ours was written.
    quantity : Quantity or None
        Quantity of the object.
    own_holds : bool
        True for a limit of the axis: a tighter value of the drive is kept.
    instead : tuple of Entry
        Objects that replace a missing one, if all are present.
    served : str
        Consequence of a replacement or of an acceptable fixed value; empty if none.
    fixed : str
        Consequence of an unacceptable fixed value.
    """

    entry: Entry
    use: Use
    without: str
    lack: Lack
    value: int | None = None
    serves: Collection[int] = ()
    kept: Kept = EXACT
    quantity: Quantity | None = None
    own_holds: bool = False
    instead: tuple[Entry, ...] = ()
    served: str = ""
    fixed: str = ""


refused, noted, silent = (
    partial(Requirement, lack=lack) for lack in (Lack.REFUSED, Lack.NOTED, Lack.SILENT)
)
