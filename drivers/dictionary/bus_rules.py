"""What a bus has of its own in the object dictionaries of drives on it, open or not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from drivers.found_settings.restoring import RestoringOrder

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from drivers.commissioning.requirement import Requirement
    from drivers.dictionary.current_candidates import CurrentCandidate
    from drivers.dictionary.dictionary import Dictionary
    from drivers.dictionary.missing_objects import Finding
    from drivers.fieldbus import Entry


class ProcessDataReview(NamedTuple):
    """What process data can carry.

    Attributes
    ----------
    current : CurrentCandidate or None
        The first current object that fits, or where none does the first of all.
    words : tuple of tuple of int or None
        What `tpdos` of the drives file is to state; None where that is what we would have.
    obstacles : tuple of Finding
        What keeps process data from carrying what we need.
    """

    current: CurrentCandidate | None
    words: tuple[tuple[int, ...], ...] | None
    obstacles: tuple[Finding, ...]


@dataclass(frozen=True, kw_only=True)
class BusRules(RestoringOrder):
    """What is a bus's own, by which dictionaries are read, judged and drafted from.

    Attributes
    ----------
    requirements : mapping of Entry to Requirement
        What a run needs of a drive's dictionary, in the order in which a drive is asked for it.
    asked : tuple of Entry
        What a live drive is asked for beside that, and `mappings`, whose objects are asked for too.
    review_process_data : callable
        Finds out what process data can carry, by the current objects that are usable.
    remarks : callable
        States what else of the bus's own objects is to be known.
    unwatched : callable
        States why a drive cannot watch us; None where it can, or where that is not known.
    """

    requirements: Mapping[Entry, Requirement]
    asked: tuple[Entry, ...]
    mappings: tuple[int, ...]
    review_process_data: Callable[[Dictionary, Sequence[CurrentCandidate]], ProcessDataReview]
    remarks: Callable[[Dictionary], Iterable[Finding]] = lambda _: ()
    unwatched: Callable[[Dictionary], str | None] = lambda _: None
