"""Something in a recording that contradicts its map."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Suspicion:
    """A contradiction.

    Attributes
    ----------
    check : str
        Of `hil.imports.map_file.CHECKS`: what found it.
    location : tuple
        The part of the map that it is about.
    message : str
        Value, bound and remedy in a sentence that follows the place.
    certain : bool
        Whether it refuses the import; the others are stated.
    """

    check: str
    location: tuple[str | int, ...]
    message: str
    certain: bool = True
