"""Putting back a drive's process data, in the order of the standard.

What is assigned is taken away first, for a mapping in use cannot be changed; then come the
mappings, each emptied first, and then what was assigned.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from drivers.commissioning.held_values import ASSIGNMENTS, MAPPINGS, mapping_count
from drivers.found_settings.restoring import differs, restore
from drivers.remote_dictionary import Aborted

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from drivers.fieldbus import Entry
    from drivers.remote_dictionary import RemoteDictionary


def restore_process_data(
    server: RemoteDictionary, values: Mapping[Entry, int]
) -> tuple[dict[Entry, int], dict[Entry, str]]:
    """Put mappings and assignments back; return what is left, and why not, by object."""
    mappings = {e: v for e, v in values.items() if any(e.index in each for each in MAPPINGS)}
    assignments = {e: v for e, v in values.items() if e.index in ASSIGNMENTS}
    others = {e: v for e, v in values.items() if e not in mappings and e not in assignments}
    ours = {**mappings, **assignments}
    if not any(differs(server, entry, value) for entry, value in ours.items()):
        return others, {}
    _empty(server, {e.index for e in assignments})
    problems: dict[Entry, str] = {}
    for index in sorted({e.index for e in ours}):
        problems |= _restore_one(server, {e: v for e, v in ours.items() if e.index == index})
    return others, problems


def _restore_one(server: RemoteDictionary, values: Mapping[Entry, int]) -> dict[Entry, str]:
    """Put back one mapping or assignment: count 0, entries, count."""
    if not any(differs(server, entry, value) for entry, value in values.items()):
        return {}
    _empty(server, {entry.index for entry in values})
    count = {e: v for e, v in values.items() if e.subindex == 0}
    active = max(count.values(), default=0)
    entries = {e: v for e, v in values.items() if e.subindex > 0}
    # Beyond its count a mapping means nothing, and not every drive takes what stood there.
    restore(server, {e: v for e, v in entries.items() if e.subindex > active})
    problems = restore(server, {e: v for e, v in entries.items() if e.subindex <= active})
    return problems | restore(server, count)


def _empty(server: RemoteDictionary, indices: Iterable[int]) -> None:
    for index in indices:
        with suppress(Aborted):  # what is fixed need not be empty
            if server.get(mapping_count(index)):
                server.put(mapping_count(index), 0)
