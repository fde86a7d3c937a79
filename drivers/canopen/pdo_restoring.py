"""Putting back how a drive communicated, in the order of the standard.

A mapping and an identifier can be changed only while their PDO is off, and a counter in SYNC only
while there is no period.
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
    from collections.abc import Iterable, Mapping

    from drivers.fieldbus import Entry
    from drivers.remote_dictionary import RemoteDictionary

_COMMUNICATION = (range(0x1400, 0x1600), range(0x1800, 0x1A00))
_MAPPING = 0x200
_PDOS = range(0x1400, 0x1C00)


def restore_process_data(
    server: RemoteDictionary, values: Mapping[Entry, int]
) -> tuple[dict[Entry, int], dict[Entry, str]]:
    """Put PDOs and the counter in SYNC back; return what is left, and why not, by object."""
    problems: dict[Entry, str] = {}
    for pdo in _pdos(values):
        problems |= _restore_pdo(server, pdo)
    others = {e: v for e, v in values.items() if e.index not in _PDOS}
    _free_sync_counter(server, others)
    return others, problems


def _free_sync_counter(server: RemoteDictionary, values: Mapping[Entry, int]) -> None:
    """Put back the counter in SYNC first, which can be changed without a period only (1006)."""
    counters = [v for e, v in values.items() if e.index == cia301.SYNC_COUNTER.index]
    for counter in counters:  # by index: a file may name its objects otherwise
        if holds(server, {cia301.SYNC_COUNTER: counter}):
            return
        put_if_taken(server, cia301.CYCLE_PERIOD, 0)
        put_if_taken(server, cia301.SYNC_COUNTER, counter)


def _pdos(values: Mapping[Entry, int]) -> Iterable[dict[Entry, int]]:
    """Take apart what belongs to each PDO, in order of its COB-ID's index."""
    present = {entry.index for entry in values}
    for index in (index for indices in _COMMUNICATION for index in indices):
        if present & {index, index + _MAPPING}:
            yield {e: v for e, v in values.items() if e.index in {index, index + _MAPPING}}


def _restore_pdo(server: RemoteDictionary, values: Mapping[Entry, int]) -> dict[Entry, str]:
    """Off, identifier, count 0, entries, count, transmission type and the like, COB-ID."""
    if holds(server, values):
        return {}
    mapping = {e: v for e, v in values.items() if any(e.index in mappings for mappings in MAPPINGS)}
    cob = {e: v for e, v in values.items() if e not in mapping and e.subindex == 1}
    rest = {e: v for e, v in values.items() if e not in mapping and e not in cob}
    for entry, value in cob.items():
        _switch_off(server, entry, value)
    problems = {} if holds(server, mapping) else restore_mapping(server, mapping)
    return problems | restore(server, rest) | restore(server, cob)


def _switch_off(server: RemoteDictionary, cob: Entry, value: int) -> None:
    """Switch a PDO off, then give it the identifier that it had."""
    with suppress(Aborted):  # a read-only COB-ID need not be off
        for word in (server.get(cob) | OFF, value | OFF):
            if server.get(cob) != word:
                server.put(cob, word)
