"""What a bus has of its own in the object dictionaries of drives on it, open or not."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Protocol

from drivers.found_settings.restoring import RestoringOrder

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from drivers.commissioning.requirement import Requirement
    from drivers.dictionary.current_candidates import CurrentCandidate
    from drivers.dictionary.dictionary import Dictionary
    from drivers.fieldbus import Entry

Obstacle = tuple[str, str, str, bool]
"""About what, the problem, its consequence, whether it is fatal."""


class ProcessDataReview(NamedTuple):
    """What process data can carry.

    Attributes
    ----------
    current : CurrentCandidate or None
        The first current object that fits, or where none does the first of all.
    words : tuple of tuple of int or None
        What `tpdos` of the drives file is to state; None where that is what we would have.
    obstacles : tuple of Obstacle
        What keeps process data from carrying what we need.
    """

    current: CurrentCandidate | None
    words: tuple[tuple[int, ...], ...] | None
    obstacles: tuple[Obstacle, ...]


class BusRules(RestoringOrder, Protocol):
    """What is a bus's own, by which dictionaries are read, judged and drafted from.

    Attributes
    ----------
    requirements : mapping of Entry to Requirement
        What a run needs of a drive's dictionary, in the order in which a drive is asked for it.
    asked : tuple of Entry
        What a live drive is asked for beside that, and `mappings`, whose objects are asked for too.
    """

    @property
    def requirements(self) -> Mapping[Entry, Requirement]: ...  # noqa: D102 - an attribute

    @property
    def asked(self) -> tuple[Entry, ...]: ...  # noqa: D102 - an attribute

    @property
    def mappings(self) -> tuple[int, ...]: ...  # noqa: D102 - an attribute

    def review_process_data(
        self, dictionary: Dictionary, usable: Sequence[CurrentCandidate]
    ) -> ProcessDataReview:
        """Find out what process data can carry."""

    def remarks(self, dictionary: Dictionary) -> Iterable[Obstacle]:
        """State what else of the bus's own objects is to be known."""

    def unwatched(self, dictionary: Dictionary) -> str | None:
        """State why a drive cannot watch us; None where it can, or where that is not known."""
