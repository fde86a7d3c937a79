"""Putting back a drive's process data, in the order of the standard.

What is assigned is taken away first, for a mapping in use cannot be changed; then come the
mappings, each emptied first, and then what was assigned.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.commissioning.held_values import ASSIGNMENTS, MAPPINGS
from drivers.found_settings.restoring import holds, put_if_taken, restore_mapping

if TYPE_CHECKING:
    from collections.abc import Mapping

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
