"""Restoring a drive's communication, in the order required by CiA 301.

Mapping and identifier can be changed only while the PDO is off, and the SYNC counter only without a
period.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from drivers.canopen import objects as cia301
from drivers.canopen.objects import OFF
from drivers.commissioning.held_values import MAPPINGS
from drivers.found_settings.restoring import holds, put_if_taken, restore, restore_mapping
from drivers.remote_dictionary import Aborted

if TYPE_CHECKING:
    from collections.abc import Mapping

    from drivers.fieldbus import Entry
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
    """Restore one PDO: off, identifier, mapping, transmission type and the like, COB-ID."""
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
