"""Something in a recording that contradicts its map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hil.imports.map_file import Check


@dataclass(frozen=True)
class Suspicion:
    """A contradiction.

    Attributes
    ----------
    check : Check
        What found it.
    location : tuple
        The part of the map that it is about.
    message : str
        Value, bound and remedy in a sentence that follows the place.
    certain : bool
        Whether it refuses the import; the others are stated.
    """

    check: Check
    location: tuple[str | int, ...]
    message: str
    certain: bool = True
