"""Results of checks of a drive: ok, a warning, or refused; with value, bound and remedy.

A verdict is one line for the operator. Refused means that nothing may be measured or moved with the
drive in its present state; a warning, that the drive is usable, with something to know or check.
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
    """Comparison of a drive's object dictionary with the drives file, by reading only.

    Raises `DriveRefused` and `NodeSilent` if an object cannot be read.
    """


class Grade(enum.Enum):
    """Result of a check."""

    OK = "ok"
    WARNING = "warning"
    REFUSED = "refused"


@dataclass(frozen=True, slots=True)
class Verdict:
    """One line of a check.

    Attributes
    ----------
    grade : Grade
        Result.
    place : str
        Name of the axis in messages, or "bus".
    check : str
        Subject of the check.
    found : str
        Value, with its unit.
    bound : str
        Required value; empty if there is none.
    remedy : str
        Remedy; empty if none is needed.
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
    """Comparison of an entry of the drives file with the drive's value.

    Attributes
    ----------
    grade : Grade
        OK on agreement, refused if the drive contradicts the file, a warning if the drive is silent
        or unclear: then the file is trusted.
    check : str
        Subject of the comparison, with its objects.
    found : str
        Value in the drive.
    key, stated : str
        Key and value in the drives file.
    remedy : str
        Remedy; empty on agreement.
    """

    grade: Grade
    check: str
    found: str
    key: str
    stated: str
    remedy: str = ""

    def make_verdict(self, place: str) -> Verdict:
        """Return the verdict for the drive of an axis."""
        bound = f"file: {self.stated}"
        return Verdict(self.grade, place, self.check, self.found, bound, self.remedy)


def compare_values(
    agrees: bool, check: str, found: str, key: str, stated: str, remedy: str
) -> Comparison:
    """Return a comparison: confirmed if `agrees`, otherwise refused with the remedy."""
    if agrees:
        return Comparison(Grade.OK, check, found, key, stated)
    return Comparison(Grade.REFUSED, check, found, key, stated, remedy)


def unsettled(check: str, found: str, key: str, stated: str, remedy: str) -> Comparison:
    """Return a comparison without a decision: the file is trusted."""
    return Comparison(Grade.WARNING, check, found, key, stated, remedy)


def grade_check(
    holds: bool, otherwise: Grade, place: str, check: str, found: str, bound: str, remedy: str
) -> Verdict:
    """Return a verdict: ok if `holds`, otherwise with another grade and the remedy."""
    if holds:
        return Verdict(Grade.OK, place, check, found, bound)
    return Verdict(otherwise, place, check, found, bound, remedy)


def unknown(place: str, check: str, remedy: str) -> Verdict:
    """Return a warning about a missing statement of the drive."""
    return Verdict(Grade.WARNING, place, check, "the drive does not state it", remedy=remedy)


def undecided(place: str, check: str, found: str, remedy: str, bound: str = "") -> Verdict:
    """Return a warning about an undecided check, with a remedy."""
    return Verdict(Grade.WARNING, place, check, f"undecided: {found}", bound, remedy)


def refused(place: str, check: str, error: DriveError) -> Verdict:
    """Return a refusal with the message of an error."""
    return Verdict(Grade.REFUSED, place, check, str(error).removeprefix(f"{place}: "))
