"""What a check says of a drive: ok, a warning, or refused; with value, bound and remedy.

A verdict is one line for the operator. Refused means that nothing is to be measured or moved with
the drive as it is; a warning, that it serves, and what must be known or looked at.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from drivers.drive_bus import DriveError
    from drivers.drives_file import AxisDrive
    from drivers.remote_dictionary import RemoteDictionary

    Check = Callable[[RemoteDictionary, AxisDrive], Iterator["Verdict"]]
    """Compares the object dictionary of a drive, only reading, with what the drives file states.

    Raises `DriveRefused` and `NodeSilent` where an object cannot be read.
    """


class Grade(enum.Enum):
    """How a check ended."""

    OK = "ok"
    WARNING = "warning"
    REFUSED = "refused"


@dataclass(frozen=True, slots=True)
class Verdict:
    """One line of a check.

    Attributes
    ----------
    grade : Grade
        How it ended.
    place : str
        The axis as messages name it, or "bus".
    check : str
        What was looked at.
    found : str
        The value, with its unit.
    bound : str
        What it must be; empty where there is nothing to compare with.
    remedy : str
        What to do; empty when nothing is.
    """

    grade: Grade
    place: str
    check: str
    found: str
    bound: str = ""
    remedy: str = ""

    def __str__(self) -> str:
        bound = f" ({self.bound})" if self.bound else ""
        remedy = f"; {self.remedy}" if self.remedy else ""
        return f"{self.place}: {self.check}: {self.found}{bound}{remedy}"


@dataclass(frozen=True, slots=True)
class Comparison:
    """A statement of the drives file beside what a drive says of the same thing.

    Attributes
    ----------
    grade : Grade
        OK where they agree, refused where the drive contradicts the file, a warning where it is
        silent or unclear: then the file is taken on trust.
    check : str
        What was compared, with its objects.
    found : str
        What the drive says.
    key, stated : str
        Of the drives file.
    remedy : str
        What to do; empty where they agree.
    """

    grade: Grade
    check: str
    found: str
    key: str
    stated: str
    remedy: str = ""

    def of(self, place: str) -> Verdict:
        """Return the verdict on the drive of an axis."""
        bound = f"file: {self.stated}"
        return Verdict(self.grade, place, self.check, self.found, bound, self.remedy)


def compared(
    agrees: bool, check: str, found: str, key: str, stated: str, remedy: str
) -> Comparison:
    """Return a comparison that is confirmed where `agrees`, else contradicted with the remedy."""
    if agrees:
        return Comparison(Grade.OK, check, found, key, stated)
    return Comparison(Grade.REFUSED, check, found, key, stated, remedy)


def unsettled(check: str, found: str, key: str, stated: str, remedy: str) -> Comparison:
    """Return a comparison that leaves the file on trust."""
    return Comparison(Grade.WARNING, check, found, key, stated, remedy)


def graded(
    holds: bool,
    otherwise: Grade,
    place: str,
    check: str,
    found: str,
    bound: str,
    remedy: str,
) -> Verdict:
    """Return a verdict that is ok where `holds`, else graded and with the remedy."""
    if holds:
        return Verdict(Grade.OK, place, check, found, bound)
    return Verdict(otherwise, place, check, found, bound, remedy)


def unknown(place: str, check: str, remedy: str) -> Verdict:
    """Return the warning that a drive does not state something."""
    return Verdict(Grade.WARNING, place, check, "the drive does not state it", remedy=remedy)


def undecided(place: str, check: str, found: str, remedy: str, bound: str = "") -> Verdict:
    """Return the warning that a check found no answer, and what would give one."""
    return Verdict(Grade.WARNING, place, check, f"undecided: {found}", bound, remedy)


def refused(place: str, check: str, error: DriveError) -> Verdict:
    """Return what an error says as a refusal."""
    return Verdict(Grade.REFUSED, place, check, str(error).removeprefix(f"{place}: "))
