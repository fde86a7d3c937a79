"""What can be required of an object of a drive: the columns of the table of requirements."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, Flag, auto
from functools import partial
from typing import TYPE_CHECKING

from drivers.commissioning.kept_values import EXACT, Kept

if TYPE_CHECKING:
    from collections.abc import Collection

    from drivers.commissioning.measures import Quantity
    from drivers.fieldbus import Entry


class Use(Flag):
    """What we do with an object."""

    READ = auto()
    ASK = auto()
    """Read where it can be read: one of another type than the standard's is left out."""
    WRITE = auto()
    SET = READ | WRITE
    """Written, and read back."""
    VARY = auto()
    """Written again and again: a drive whose object is fixed at any value does not serve."""
    SEND = auto()
    """The drive must be able to send it in a PDO."""
    RECEIVE = auto()
    """The drive must be able to take it from a PDO."""


class Lack(Enum):
    """What becomes of a drive that lacks an object."""

    REFUSED = "refused"
    REFUSED_UNLESS_STATED = "refused unless `allow_no_heartbeat` states what else stops the axis"
    NOTED = "noted"
    SILENT = "not mentioned"


@dataclass(frozen=True, slots=True)
class Requirement:
    """One object that we use.

    Attributes
    ----------
    entry : Entry
        Which.
    use : Use
        What we do with it.
    without : str
        What follows where it is missing.
    lack : Lack
        What becomes of a drive without it.
    value : int or None
        What we write, where that is the same for every axis.
    serves : collection of int
        Values that serve in place of ours, even where the object cannot be written.
    kept : Kept
        What may stand there after ours was written and taken.
    quantity : Quantity or None
        What it counts.
    own_holds : bool
        It limits the axis: a tighter value of the drive's own is left as it is.
    instead : tuple of Entry
        What does in its place, if all of it is there.
    served : str
        What follows where that is so, or where it is fixed at a value that serves; empty for
        nothing.
    fixed : str
        What follows where it cannot be written and does not serve.
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
