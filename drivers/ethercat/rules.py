"""Rules of EtherCAT for object dictionaries (`drivers.dictionary.review.BusRules`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.commissioning.held_values import ASSIGNMENTS, MAPPINGS, assignment_slot, mapping_count
from drivers.commissioning.requirements import ROUNDED, Use, add_rows, refused, silent
from drivers.dictionary.review import BusRules, ProcessDataReview
from drivers.ethercat.pdo_set_up import ASSIGNED_IN, ASSIGNED_OUT, CYCLES, MAPPING_IN, MAPPING_OUT
from drivers.found_settings.restoring import holds, put_if_taken, restore_mapping

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from drivers.dictionary.current_candidates import CurrentCandidate
    from drivers.dictionary.dictionary import Dictionary
    from drivers.fieldbus import Entry
    from drivers.remote_dictionary import RemoteDictionary

_ANY = range(1 << 32)
_MASTER = "the drive takes its cycle from the frames"

REQUIREMENTS = add_rows((
    refused(
        mapping_count(ASSIGNED_OUT), Use.SET, "the drive cannot be commanded by process data",
        serves=_ANY, served="its assignment must include controlword and target",
    ),
    refused(
        mapping_count(ASSIGNED_IN), Use.SET, "the drive sends no process data",
        serves=_ANY, served="its assignment must include statusword, position and current",
    ),
    *(
        silent(each, Use.SET, _MASTER, serves=_ANY, kept=ROUNDED, served=_MASTER)
        for each in CYCLES
    ),
))  # fmt: skip
"""Requirements by object, in the order of reading."""


def restore_process_data(
    server: RemoteDictionary, values: Mapping[Entry, int]
) -> tuple[dict[Entry, int], dict[Entry, str]]:
    """Restore mappings and assignments; return the remaining values, and failures by object.

    An assigned mapping cannot be changed, so the order is: assignments to 0, mappings, assignments.
    """
    mappings = {e: v for e, v in values.items() if any(e.index in each for each in MAPPINGS)}
    assignments = {e: v for e, v in values.items() if e.index in ASSIGNMENTS}
    others = {e: v for e, v in values.items() if e not in mappings and e not in assignments}
    ours = {**mappings, **assignments}
    if holds(server, ours):
        return others, {}
    for entry in assignments:
        if entry.subindex == 0:
            put_if_taken(server, entry, 0)
    problems: dict[Entry, str] = {}
    for index in sorted({e.index for e in ours}):
        own = {e: v for e, v in ours.items() if e.index == index}
        problems |= {} if holds(server, own) else restore_mapping(server, own)
    return others, problems


def _review(_: Dictionary, usable: Sequence[CurrentCandidate]) -> ProcessDataReview:
    """Select the first current object: process data of EtherCAT have room for any."""
    return ProcessDataReview(usable[0] if usable else None, None, ())


RULES = BusRules(
    requirements=REQUIREMENTS,
    asked=tuple(
        entry
        for index, mapping in ((ASSIGNED_OUT, MAPPING_OUT), (ASSIGNED_IN, MAPPING_IN))
        for entry in (assignment_slot(index, 1), mapping_count(mapping))
    ),
    mappings=(MAPPING_OUT, MAPPING_IN),
    restore_process_data=restore_process_data,
    review_process_data=_review,
)
"""Watchdogs are not objects here: `EthercatDrive.hand_back` restores the sync manager's."""
