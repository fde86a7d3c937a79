"""CANopen rules for the object dictionaries of drives (`drivers.dictionary.bus_rules.BusRules`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.canopen import objects as cia301
from drivers.canopen.mapping_review import review_mapping
from drivers.canopen.pdo_restoring import restore_process_data
from drivers.canopen.requirements import GUARDING, REQUIREMENTS, WATCHDOGS
from drivers.commissioning.held_values import mapping_count
from drivers.dictionary.bus_rules import BusRules
from drivers.dictionary.missing_objects import Finding
from drivers.fieldbus import Entry

if TYPE_CHECKING:
    from collections.abc import Iterator

    from drivers.dictionary.dictionary import Dictionary


def _remarks(dictionary: Dictionary) -> Iterator[Finding]:
    """Yield a finding for a drive that expects a counter in SYNC; a live drive only."""
    declared = dictionary.entry(cia301.SYNC_COUNTER)
    if declared is not None and declared.writable is None and declared.value:
        so = "it expects a counter in SYNC, and ours has none: start-up sets it to 0"
        yield Finding(str(cia301.SYNC_COUNTER), f"is {declared.value}", so, fatal=False)


def _find_unwatched(dictionary: Dictionary) -> str | None:
    """Return why a drive can neither supervise our heartbeat nor be guarded, None if it can."""
    watch = cia301.CONSUMER_HEARTBEAT
    known = dictionary.entry(watch) is not None or watch.key in dictionary.unanswered
    return None if known or all(map(dictionary.entry, GUARDING)) else "the drive has no 1016"


RULES = BusRules(
    requirements=REQUIREMENTS,
    asked=tuple(
        entry
        for record in (0x1400, 0x1800, 0x1801)
        for entry in (
            Entry(record, 1, "u32", "COB-ID"),
            Entry(record, 2, "u8", "transmission type"),
            mapping_count(record + 0x200),
        )
    ),
    mappings=(0x1600, 0x1A00, 0x1A01),
    # it may make the drive produce SYNC, which must not happen with our period
    late=frozenset({cia301.SYNC_COB_ID.index}),
    watchdogs=WATCHDOGS,
    restore_process_data=restore_process_data,
    review_process_data=review_mapping,
    remarks=_remarks,
    unwatched=_find_unwatched,
)
