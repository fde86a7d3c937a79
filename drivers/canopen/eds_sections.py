"""Sections, keys and values of an EDS, without their meaning.

Sections and keys are case-insensitive. Doubled sections are merged; where type or access differ,
the section is marked, since either may be wrong.
"""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass, field

from checked_files.foreign_text import whole_line
from checked_files.yaml_file import FileError

_HEADER = re.compile(r"\[\s*([^\]]+?)\s*\]")
_DECISIVE = {"datatype", "objecttype", "accesstype", "pdomapping"}
_SPELLINGS = {"devicecommissioning": "devicecomissioning"}


@dataclass
class Section:
    """Section of an EDS.

    Attributes
    ----------
    name : str
        Name as written.
    line : int
        Line of the header, from 1.
    values : dict of str to str
        Values by key in lower case.
    contradictions : list of str
        Keys with two different values.
    """

    name: str
    line: int
    values: dict[str, str] = field(default_factory=dict)
    contradictions: list[str] = field(default_factory=list)

    def get(self, key: str) -> str:
        """Return a value, empty if absent."""
        return self.values.get(key, "")

    def put(self, key: str, value: str) -> None:
        """Store a value; record a contradiction with an earlier one."""
        known = self.values.get(key.lower())
        if known and value and key.lower() in _DECISIVE and known.lower() != value.lower():
            self.contradictions.append(f"stands twice: {key}={known} and {key}={value}")
        if value or known is None:
            self.values[key.lower()] = value


def sections_of(raw: bytes, source: str) -> tuple[dict[str, Section], list[str]]:
    """Split a file into sections, by name in lower case; return also notes on repairs.

    Raises
    ------
    FileError
        The file is empty, binary or XML.
    """
    text, notes = _decode(raw, source)
    sections: dict[str, Section] = {}
    section = None
    doubled = set()
    for line, content in enumerate(text.splitlines(), start=1):
        content = whole_line(content.strip())  # noqa: PLW2901
        header = _HEADER.match(content)
        if header:
            name = header[1].lower()
            name = _SPELLINGS.get(name, name)
            if name in sections:
                doubled.add(header[1])
            section = sections.setdefault(name, Section(header[1], line))
        elif section is not None and "=" in content and content[0] not in ";#":
            key, _, value = content.partition("=")
            # without a trailing comment and without quotes
            plain = re.split(r"\s;|^;", value, maxsplit=1)[0].strip().strip('"')
            section.put(key.strip(), plain)
    if doubled:
        notes.append(f"stands twice and was merged: [{'], ['.join(sorted(doubled))}]")
    return sections, notes


def _decode(raw: bytes, source: str) -> tuple[str, list[str]]:
    if not raw.strip():
        raise FileError(f"{source}: is empty; give the EDS or DCF of the drive's maker")
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return raw.decode("utf-16", errors="replace"), ["is UTF-16"]
    if b"\0" in raw:
        raise FileError(f"{source}: is no text; give the EDS or DCF of the drive's maker")
    raw = raw.removeprefix(codecs.BOM_UTF8)
    if raw.lstrip().startswith(b"<"):
        raise FileError(
            f"{source}: is XML (an XDD or ESI file); give the drive's EDS, or convert it"
        )
    try:
        return raw.decode("utf-8"), []
    except UnicodeDecodeError:
        return raw.decode("latin-1"), []
