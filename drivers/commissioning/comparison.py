"""One statement of the drives file beside what the drive says of the same thing."""

from __future__ import annotations

import enum
from dataclasses import dataclass


class Agreement(enum.Enum):
    """How a statement of the file and one of the drive stand to each other."""

    CONFIRMED = enum.auto()
    CONTRADICTED = enum.auto()
    UNSETTLED = enum.auto()
    """The drive is silent or unclear: the file is taken on trust."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """What a drive says of a key of the drives file.

    Attributes
    ----------
    agreement : Agreement
        How the two stand to each other.
    check : str
        What was compared, with its objects.
    found : str
        What the drive says.
    key, stated : str
        Of the drives file.
    remedy : str
        What to do; empty where they agree.
    """

    agreement: Agreement
    check: str
    found: str
    key: str
    stated: str
    remedy: str = ""


def compared(
    agrees: bool, check: str, found: str, key: str, stated: str, remedy: str
) -> Comparison:
    """Return a comparison that is confirmed where `agrees`, else contradicted with the remedy."""
    if agrees:
        return Comparison(Agreement.CONFIRMED, check, found, key, stated)
    return Comparison(Agreement.CONTRADICTED, check, found, key, stated, remedy)


def unsettled(check: str, found: str, key: str, stated: str, remedy: str) -> Comparison:
    """Return a comparison that leaves the file on trust."""
    return Comparison(Agreement.UNSETTLED, check, found, key, stated, remedy)
