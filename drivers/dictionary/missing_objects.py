"""What a dictionary lacks of one object that a run needs, by its row of the requirements.

An object may be missing, have another type than the standard's, or not take what would be written.
Where it cannot be written, the value that it is fixed at decides whether the drive serves; where
that is not stated, or depends on the axis, start-up will show it.
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
    """Something that a drive lacks or does otherwise.

    Attributes
    ----------
    about : str
        Which object, such as "6084:00 (profile deceleration)".
    problem : str
        What is the matter with it.
    consequence : str
        What follows for our purpose.
    fatal : bool
        The drive cannot serve.
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
    """Yield what a dictionary lacks of the object of a row of the table.

    Raises
    ------
    FileError
        It is declared in a way that cannot be understood.
    """
    if row.lack is Lack.SILENT and Use.ASK in row.use:
        return
    about, declared = str(row.entry), dictionary.entry(row.entry)
    refused = dictionary.unanswered.get(row.entry.key)
    if declared is not None:
        if not _is_spare(dictionary, row, table):
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
    """Return the value of an object that cannot be written; None where it can or is not stated."""
    return None if declared is None or declared.writable is not False else declared.stated


def _consequence(row: Requirement, axis: AxisDrive | None) -> tuple[str, bool]:
    """Return what follows where an object is missing, and whether the drive is refused for it."""
    if row.lack is not Lack.REFUSED_UNLESS_STATED:
        return row.without, row.lack is Lack.REFUSED
    if axis is not None and axis.allow_no_heartbeat is not None:
        return f"{row.without}; allowed because: {axis.allow_no_heartbeat}", False
    return f"{row.without}: {STATE_WHAT_STOPS}", axis is not None


def _is_spare(dictionary: Dictionary, row: Requirement, table: Table) -> bool:
    """Whether it does in place of other objects alone, and these are there."""
    served = [each for each in table.values() if row.entry in each.instead]
    written = Use.WRITE in row.use and row.lack is Lack.SILENT
    return written and bool(served) and all(dictionary.entry(each.entry) for each in served)


def _flaws(dictionary: Dictionary, declared: Declared, row: Requirement) -> Iterator[Finding]:
    about, entry = str(row.entry), row.entry
    harmless = Use.ASK in row.use
    mistyped = declared.bits is not None and declared.bits != 8 * entry.size
    if mistyped:
        problem = f"has {declared.bits} bits, {8 * entry.size} expected ({entry.type})"
        yield Finding(about, problem, row.without, fatal=not harmless)
    if Use.WRITE in row.use:
        yield from _unwritable(declared, row, _written(dictionary, row))
    if Use.READ in row.use and declared.readable is False:
        yield Finding(about, "cannot be read (wo)", row.without, fatal=True)
    if declared.mappable is False and row.use & (Use.SEND | Use.RECEIVE):
        problem = "cannot be mapped into a PDO"
        yield Finding(about, problem, "it cannot travel with SYNC", fatal=True)


def _written(dictionary: Dictionary, row: Requirement) -> int | None:
    """Return what is written to an object, None where that follows from the drives file."""
    if row.entry != objects.ABORT_CONNECTION_OPTION:
        return row.value
    return reaction_for(fixed_at(dictionary.entry(objects.QUICK_STOP_OPTION)) or 0)


def _unwritable(declared: Declared, row: Requirement, value: int | None) -> Iterator[Finding]:
    """Yield why an object does not take what is written to it."""
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
    """Whether a drive may serve whose object is fixed at a value that is not ours."""
    if Use.VARY in row.use:
        return False
    if row.serves or row.value is not None:
        return only in row.serves
    return row.lack not in _NEEDED and is_set(only, row.entry)


def _takes(declared: Declared, value: int) -> bool:
    low = value if declared.low is None else declared.low
    high = value if declared.high is None else declared.high
    return low <= value <= high
