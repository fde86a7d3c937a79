"""Comparison of a dictionary with one row of the requirements.

An object may be missing, have a non-standard type, or refuse the value to be written. For an object
that cannot be written, its fixed value decides on the drive; if unstated or dependent on the axis,
start-up will show it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.commissioning.requirement import Lack, Use
from drivers.commissioning.requirements import STATE_WHAT_STOPS, is_set, reaction_for

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from drivers.commissioning.requirement import Requirement
    from drivers.dictionary.dictionary import Declared, Dictionary
    from drivers.drives_file import AxisDrive
    from drivers.fieldbus import Entry

    Table = Mapping[Entry, Requirement]


@dataclass(frozen=True, slots=True)
class Finding:
    """Deficiency or peculiarity of a drive.

    Attributes
    ----------
    about : str
        Object, such as "6084:00 (profile deceleration)".
    problem : str
        The deficiency.
    consequence : str
        Consequence for measurements.
    fatal : bool
        True if the drive is unsuitable.
    """

    about: str
    problem: str
    consequence: str
    fatal: bool

    def __str__(self) -> str:
        return f"{self.about} {self.problem}: {self.consequence}"


def gaps(
    dictionary: Dictionary, row: Requirement, axis: AxisDrive | None, table: Table
) -> Iterator[Finding]:
    """Yield the deficiencies of a dictionary in a row of the table.

    Raises
    ------
    FileError
        The declaration of the object is unintelligible.
    """
    if row.lack is Lack.SILENT and Use.ASK in row.use:
        return
    about, declared = str(row.entry), dictionary.entry(row.entry)
    refused = dictionary.unanswered.get(row.entry.key)
    if declared is not None:
        # a spare object is not needed if those it could replace are present
        served = [each for each in table.values() if row.entry in each.instead]
        spare = Use.WRITE in row.use and row.lack is Lack.SILENT and bool(served)
        if not spare or not all(dictionary.entry(each.entry) for each in served):
            yield from _flaws(dictionary, declared, row)
    elif row.lack is Lack.SILENT:
        pass
    elif refused is not None:
        yield Finding(about, refused, f"if it is missing, {row.without}", fatal=False)
    elif not row.instead or not all(map(dictionary.entry, row.instead)):
        yield Finding(about, "is missing", *_consequence(row, axis))
    elif row.served:
        yield Finding(about, "is missing", row.served, fatal=False)


def fixed_at(declared: Declared | None) -> int | None:
    """Return the value of a read-only object; None if writable or not stated."""
    return None if declared is None or declared.writable is not False else declared.stated


def _consequence(row: Requirement, axis: AxisDrive | None) -> tuple[str, bool]:
    """Return the consequence of a missing object, and True if the drive is refused for it."""
    if row.lack is not Lack.REFUSED_UNLESS_STATED:
        return row.without, row.lack is Lack.REFUSED
    if axis is not None and axis.allow_no_heartbeat is not None:
        return f"{row.without}; allowed because: {axis.allow_no_heartbeat}", False
    return f"{row.without}: {STATE_WHAT_STOPS}", axis is not None


def _flaws(dictionary: Dictionary, declared: Declared, row: Requirement) -> Iterator[Finding]:
    about, entry = str(row.entry), row.entry
    harmless = Use.ASK in row.use
    mistyped = declared.bits is not None and declared.bits != 8 * entry.size
    if mistyped:
        problem = f"has {declared.bits} bits, {8 * entry.size} expected ({entry.type})"
        yield Finding(about, problem, row.without, fatal=not harmless)
    if Use.WRITE in row.use:
        # the reaction to a lost connection depends on the fixed quick stop option
        quick_stop = fixed_at(dictionary.entry(objects.QUICK_STOP_OPTION)) or 0
        is_reaction = entry == objects.ABORT_CONNECTION_OPTION
        value = reaction_for(quick_stop) if is_reaction else row.value
        yield from _unwritable(declared, row, value)
    if Use.READ in row.use and declared.readable is False:
        yield Finding(about, "cannot be read (wo)", row.without, fatal=True)
    if declared.mappable is False and row.use & (Use.SEND | Use.RECEIVE):
        problem = "cannot be mapped into a PDO"
        yield Finding(about, problem, "it cannot travel with SYNC", fatal=True)


def _unwritable(declared: Declared, row: Requirement, value: int | None) -> Iterator[Finding]:
    """Yield the reason why an object refuses the value to be written."""
    about, writable = str(row.entry), declared.writable is not False
    only = declared.fixed if writable else fixed_at(declared)
    if writable and only is None:
        if value is not None and not _takes(declared, value):
            problem = f"takes no value but {declared.low} to {declared.high}"
            serves = any(_takes(declared, other) for other in row.serves)
            yield Finding(about, problem, row.without if serves else row.fixed, fatal=not serves)
    elif only is None:
        so = row.fixed or row.served or row.without
        fatal = Use.VARY in row.use or (row.lack in _NEEDED and not row.serves)
        yield Finding(about, f"cannot be written ({declared.access})", so, fatal)
    elif only != value:
        serves = _serves(row, only)
        so = (row.served if serves else row.fixed) or row.without
        fixed = f"is fixed at {only} ({declared.access})"
        problem = f"takes no value but {only}" if writable else fixed
        yield Finding(about, problem, so, fatal=not serves)


_NEEDED = (Lack.REFUSED, Lack.REFUSED_UNLESS_STATED)


def _serves(row: Requirement, only: int) -> bool:
    """Return True if an object fixed at another value than ours is acceptable."""
    if Use.VARY in row.use:
        return False
    if row.serves or row.value is not None:
        return only in row.serves
    return row.lack not in _NEEDED and is_set(only, row.entry)


def _takes(declared: Declared, value: int) -> bool:
    low = value if declared.low is None else declared.low
    high = value if declared.high is None else declared.high
    return low <= value <= high
