"""Rules of a bus for the object dictionaries of its drives; no open bus is needed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from drivers.found_settings.restoring import RestoringOrder

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from drivers.commissioning.requirements import Requirement
    from drivers.dictionary.current_candidates import CurrentCandidate
    from drivers.dictionary.dictionary import Dictionary
    from drivers.dictionary.review import Finding
    from drivers.fieldbus import Entry


class ProcessDataReview(NamedTuple):
    """Capacity of the process data.

    Attributes
    ----------
    current : CurrentCandidate or None
        The first current object that fits, or the first of all if none does.
    words : tuple of tuple of int or None
        Value for `tpdos` of the drives file; None for the preferred mapping.
    obstacles : tuple of Finding
        Obstacles to the needed process data.
    """

    current: CurrentCandidate | None
    words: tuple[tuple[int, ...], ...] | None
    obstacles: tuple[Finding, ...]


@dataclass(frozen=True, kw_only=True)
class BusRules(RestoringOrder):
    """Rules of a bus for reading, review and drafts of dictionaries.

    Attributes
    ----------
    requirements : mapping of Entry to Requirement
        Requirements on a drive's dictionary, in the order of reading.
    asked : tuple of Entry
        Further objects to read from a live drive, besides the objects in `mappings`.
    review_process_data : callable
        Reviews the capacity of the process data, for the usable current objects.
    remarks : callable
        Yields further findings on objects of the bus.
    unwatched : callable
        Returns why a drive cannot supervise us; None if it can, or if that is unknown.
    """

    requirements: Mapping[Entry, Requirement]
    asked: tuple[Entry, ...]
    mappings: tuple[int, ...]
    review_process_data: Callable[[Dictionary, Sequence[CurrentCandidate]], ProcessDataReview]
    remarks: Callable[[Dictionary], Iterable[Finding]] = lambda _: ()
    unwatched: Callable[[Dictionary], str | None] = lambda _: None
