"""Rules of CANopen for object dictionaries (`drivers.dictionary.bus_rules.BusRules`)."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from drivers.canopen import objects as cia301
from drivers.canopen.mapping_review import review_mapping
from drivers.canopen.objects import OFF
from drivers.canopen.requirements import GUARDING, REQUIREMENTS, WATCHDOGS
from drivers.commissioning.held_values import MAPPINGS, mapping_count
from drivers.dictionary.bus_rules import BusRules
from drivers.dictionary.missing_objects import Finding
from drivers.fieldbus import Entry
from drivers.found_settings.restoring import holds, put_if_taken, restore, restore_mapping
from drivers.remote_dictionary import Aborted

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from drivers.dictionary.dictionary import Dictionary
    from drivers.remote_dictionary import RemoteDictionary

_COMMUNICATION = (range(0x1400, 0x1600), range(0x1800, 0x1A00))
_MAPPING = 0x200
_PDOS = range(0x1400, 0x1C00)


def restore_process_data(
    server: RemoteDictionary, values: Mapping[Entry, int]
) -> tuple[dict[Entry, int], dict[Entry, str]]:
    """Restore PDOs and SYNC counter; return the remaining values, and failures by object."""
    present = {entry.index for entry in values}
    problems: dict[Entry, str] = {}
    for index in (index for indices in _COMMUNICATION for index in indices):
        records = {index, index + _MAPPING}
        if present & records:
            pdo = {e: v for e, v in values.items() if e.index in records}
            problems |= _restore_pdo(server, pdo)
    others = {e: v for e, v in values.items() if e.index not in _PDOS}
    # the counter is found by index, since a file may name its objects otherwise
    counters = [v for e, v in others.items() if e.index == cia301.SYNC_COUNTER.index]
    for counter in counters:
        if not holds(server, {cia301.SYNC_COUNTER: counter}):
            put_if_taken(server, cia301.CYCLE_PERIOD, 0)
            put_if_taken(server, cia301.SYNC_COUNTER, counter)
    return others, problems


def _restore_pdo(server: RemoteDictionary, values: Mapping[Entry, int]) -> dict[Entry, str]:
    """Restore a PDO: off, identifier, mapping, transmission type and the like, COB-ID."""
    if holds(server, values):
        return {}
    mapping = {e: v for e, v in values.items() if any(e.index in mappings for mappings in MAPPINGS)}
    cob = {e: v for e, v in values.items() if e not in mapping and e.subindex == 1}
    rest = {e: v for e, v in values.items() if e not in mapping and e not in cob}
    for entry, value in cob.items():
        with suppress(Aborted):  # a read-only COB-ID need not be off
            for word in (server.get(entry) | OFF, value | OFF):
                if server.get(entry) != word:
                    server.put(entry, word)
    problems = {} if holds(server, mapping) else restore_mapping(server, mapping)
    return problems | restore(server, rest) | restore(server, cob)


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
