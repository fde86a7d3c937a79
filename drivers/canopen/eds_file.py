"""Tolerant reader of electronic data sheets (EDS) and device configuration files (DCF).

Actual files break CiA 306 in harmless ways: section names and keys in any case, Latin-1, byte order
marks, doubled sections, hex without or with a sign, no PDOMapping, objects listed without a
description. Such defects are repaired and noted. Unintelligible sections are kept as
`Dictionary.damaged` and reported with file, line and section when the object is needed, so that
a wrong section of an unused input hinders nobody. canopen's own reader stops at the first section
that it cannot read, and takes types from the file alone.

CiA 306 allows a long array as one section (CompactSubObj) with names and values of its members in
two more. Tools also drop sections of objects still listed under [OptionalObjects]; these are
supplied from the standard if defined there.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from checked_files.budget import refuse_beyond
from checked_files.yaml_file import FileError
from drivers.canopen import objects as cia301
from drivers.canopen.eds_text import (
    NoNumber,
    Section,
    declared_type,
    number,
    real,
    sections_of,
    stated,
    within,
)
from drivers.cia402 import objects
from drivers.dictionary.dictionary import Declared, Dictionary, Key, mark_mapped
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
    """Add and note objects listed without a description, as the standard defines them."""
    supplied = []
    for index in sorted(set(_listed(sections)) - set(described)):
        members = [entry for key, entry in _STANDARD.items() if key[0] == index]
        for entry in members:
            entries[entry.key] = Declared(*entry.key, name=entry.name, type=entry.type)
        if members:
            supplied.append(f"{index:04X}")
    if supplied:
        notes.append(
            f"lists {', '.join(supplied)} without a description: that of the standard is used"
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


_OBJECT = re.compile(r"(?:0x)?([0-9a-f]{4})(?:\s*sub\s*(?:0x)?([0-9a-f]{1,2}))?", re.I)
_ACCESS = {"ro", "wo", "rw", "rwr", "rww", "const"}
_RATES = (10, 20, 50, 100, 125, 250, 500, 800, 1000)
ARRAY, RECORD = 8, 9
SECTION, KEY = 600, 250
"""Assumed memory of a section and of a key [bytes]; measured means of 20 000: 474 and 221."""
FIRST_OBJECT = 0x1000
VALUES = ("ParameterValue", "DefaultValue", "LowLimit", "HighLimit")
NODES = range(1, 128)


def read_eds(path: Path | str, node: int | None = None) -> Dictionary:
    """Read an EDS or DCF.

    Parameters
    ----------
    path : path
        The file.
    node : int, optional
        Node number for $NODEID; by default that of the DCF.

    Raises
    ------
    FileError
        The file cannot be read, or is no EDS.
    """
    path = Path(path)
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror}") from error
    refuse_beyond(path, SECTION * raw.count(b"[") + KEY * raw.count(b"="), "its sections")
    return parse_eds(raw, str(path), node)


def parse_eds(raw: bytes, source: str, node: int | None = None) -> Dictionary:
    """Parse the content of an EDS or DCF; `source` is its name in messages (see `read_eds`)."""
    sections, notes = sections_of(raw, source)
    reading = _Reading(source, sections, notes)
    reading.node = node or reading.whole("devicecomissioning", "nodeid", NODES)
    parents, members = reading.objects()
    if not parents and not members:
        raise FileError(
            f"{source}: has no object section such as [1000] or [6041sub0]; give an EDS or DCF, "
            "text as the drive's maker supplies it (an XDD must be converted)"
        )
    for index, section in parents.items():
        if (index, 0) not in members and reading.is_number(section):
            reading.declare((index, 0), section, "")
    for key, section in (expand_compact(parents, sections) | members).items():
        parent = parents.get(key[0])
        reading.declare(key, section, parent.get("parametername") if parent else "")
    described = parents.keys() | {index for index, _ in members}
    supply_listed(sections, described, reading.entries, reading.notes)
    return reading.dictionary()


@dataclass
class _Reading:
    """Intermediate state of reading a file."""

    source: str
    sections: dict[str, Section]
    notes: list[str]
    node: int | None = None
    entries: dict[Key, Declared] = field(default_factory=dict)
    damaged: dict[Key, str] = field(default_factory=dict)

    def objects(self) -> tuple[dict[int, Section], dict[Key, Section]]:
        """Return the sections of objects by index, and those of members by index and sub-index."""
        parents, members = {}, {}
        for name, section in self.sections.items():
            found = _OBJECT.fullmatch(name)
            if found and int(found[1], 16) >= FIRST_OBJECT:
                if found[2] is None:
                    parents[int(found[1], 16)] = section
                else:
                    members[int(found[1], 16), int(found[2], 16)] = section
        return parents, members

    def whole(self, section: str, key: str, allowed: range) -> int | None:
        """Return an integer of a general section; note an implausible one."""
        found = self.sections.get(section)
        text = found.get(key) if found else ""
        try:
            value = number(text)
        except NoNumber:
            value = -1
        if value is None or value in allowed:
            return value
        if value:
            self.notes.append(f"[{section}] {key}={text} is invalid and was ignored")
        return None

    def is_number(self, section: Section) -> bool:
        """Return True if an object is a number, False for the head of an array or record."""
        try:
            return number(section.get("objecttype")) not in {ARRAY, RECORD}
        except NoNumber:
            return bool(section.get("datatype"))

    def declare(self, key: Key, section: Section, parent: str) -> None:
        """Store a number, a member of `parent`."""
        try:
            self.entries[key] = self._declared(key, section, parent)
        except NoNumber as error:
            self.damaged[key] = f"{self.source}:{section.line}: [{section.name}] {error}"

    def _declared(self, key: Key, section: Section, parent: str) -> Declared:
        if section.contradictions:
            raise NoNumber(section.contradictions[0])
        kind = declared_type(section.get("datatype"), self.sections)
        access = section.get("accesstype").lower() or None
        if access not in {None, *_ACCESS}:
            raise NoNumber(f"AccessType={access} is none of {', '.join(sorted(_ACCESS))}")
        mapped = section.get("pdomapping").lower()
        value, default, low, high = (
            [None] * len(VALUES)
            if kind in {None, "f32"}
            else [
                within(kind, stated(section.get(key.lower()), key, self.node), key)
                for key in VALUES
            ]
        )
        reals = [real(section.get(key.lower()), key) for key in VALUES] if kind == "f32" else ()
        return Declared(
            *key,
            name=": ".join(filter(None, (parent, section.get("parametername")))),
            type=kind,
            access=access,
            mappable=mapped not in {"0", "0x0", "0x00", "false", "no"} if mapped else None,
            value=value,
            default=default,
            low=low,
            high=high,
            reals=tuple(reals),
        )

    def dictionary(self) -> Dictionary:
        """Return the dictionary read."""
        device = self.sections.get("deviceinfo") or Section("DeviceInfo", 0)
        u32 = range(1, 1 << 32)
        rate = self.whole("devicecomissioning", "baudrate", range(10, 1_000_001))
        identity = [
            self._identity(subindex, key)
            for subindex, key in ((1, "vendornumber"), (2, "productnumber"), (3, "revisionnumber"))
        ]
        return Dictionary(
            self.source,
            live=False,
            entries=mark_mapped(self.entries),
            damaged=self.damaged,
            node=self.node,
            bitrate=None if rate is None else rate if rate >= 10_000 else 1000 * rate,
            bitrates=tuple(
                1000 * kbit for kbit in _RATES if self.whole("deviceinfo", f"baudrate_{kbit}", u32)
            ),
            vendor=identity[0],
            product=identity[1],
            revision=identity[2],
            serial=self._identity(4, ""),
            maker=device.get("vendorname"),
            model=device.get("productname"),
            notes=tuple(self.notes),
        )

    def _identity(self, subindex: int, key: str) -> int | None:
        """Return a number of 1018; None for 0, which means "not filled in" in data sheets."""
        declared = self.entries.get((0x1018, subindex))
        for found in (declared and declared.value, declared and declared.default):
            if found:
                return found
        return self.whole("deviceinfo", key, range(1, 1 << 32)) if key else None
