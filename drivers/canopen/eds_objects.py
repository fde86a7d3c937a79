"""Abbreviated and missing objects of a data sheet.

CiA 306 allows a long array as one section (CompactSubObj) with names and values of its members in
two more. Tools also drop sections of objects still listed under [OptionalObjects]; these are
supplied from the standard if defined there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.canopen import objects as cia301
from drivers.canopen.eds_numbers import NoNumber, number
from drivers.canopen.eds_sections import Section
from drivers.cia402 import objects
from drivers.dictionary.dictionary import Declared, Key
from drivers.fieldbus import Entry

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

_LISTS = ("mandatoryobjects", "optionalobjects", "manufacturerobjects")
_STANDARD = {
    entry.key: entry
    for standard in (cia301, objects)
    for entry in vars(standard).values()
    if isinstance(entry, Entry)
}
_NOTHING = Section("", 0)


def expand_compact(
    parents: Mapping[int, Section], sections: Mapping[str, Section]
) -> dict[Key, Section]:
    """Return the members of objects in the compact notation."""
    return dict(
        member
        for index, section in parents.items()
        if section.get("compactsubobj")
        for member in _members(index, section, sections)
    )


def _members(
    index: int, section: Section, sections: Mapping[str, Section]
) -> Iterator[tuple[Key, Section]]:
    try:
        count = number(section.get("compactsubobj")) or 0
    except NoNumber:
        return
    names = sections.get(f"{index:04x}name", _NOTHING)
    values = sections.get(f"{index:04x}value", _NOTHING)
    for subindex in range(1, min(count, 254) + 1):
        member = Section(section.name, section.line, dict(section.values))
        member.values["parametername"] = names.get(str(subindex))
        member.values["parametervalue"] = values.get(str(subindex))
        yield (index, subindex), member


def supply_listed(
    sections: Mapping[str, Section],
    described: Collection[int],
    entries: dict[Key, Declared],
    notes: list[str],
) -> None:
    """Add objects that are listed without a description from the standard, and note them."""
    supplied = []
    for index in sorted(set(_listed(sections)) - set(described)):
        members = [entry for key, entry in _STANDARD.items() if key[0] == index]
        for entry in members:
            entries[entry.key] = Declared(*entry.key, name=entry.name, type=entry.type)
        if members:
            supplied.append(f"{index:04X}")
    if supplied:
        notes.append(
            f"lists {', '.join(supplied)} without describing them: taken as the standard has them"
        )


def _listed(sections: Mapping[str, Section]) -> Iterator[int]:
    for name in _LISTS:
        section = sections.get(name)
        for key, text in section.values.items() if section else ():
            if key.isdigit():
                try:
                    yield number(text) or 0
                except NoNumber:
                    continue
