"""Text of an electronic data sheet (EDS): sections, keys, numbers and types.

Numbers are decimal, octal or hex; hex also with a trailing h; `$NODEID + 0x180` in any order and
spacing; signed values in hex, with the sign by the width of the type (0xFFFF is -1 in 16 bits).

Sections and keys are case-insensitive. Doubled sections are merged; where type or access differ,
the section is marked, since either may be wrong.
"""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from checked_files.foreign_text import whole_line
from checked_files.yaml_file import FileError
from drivers.dictionary.dictionary import NUMBERS

if TYPE_CHECKING:
    from collections.abc import Mapping


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
            self.contradictions.append(f"stated twice: {key}={known} and {key}={value}")
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
        notes.append(f"stated twice and merged: [{'], ['.join(sorted(doubled))}]")
    return sections, notes


def _decode(raw: bytes, source: str) -> tuple[str, list[str]]:
    if not raw.strip():
        raise FileError(f"{source}: is empty; give the EDS or DCF of the drive's maker")
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return raw.decode("utf-16", errors="replace"), ["is UTF-16"]
    if b"\0" in raw:
        raise FileError(f"{source}: is not text; give the EDS or DCF of the drive's maker")
    raw = raw.removeprefix(codecs.BOM_UTF8)
    if raw.lstrip().startswith(b"<"):
        raise FileError(
            f"{source}: is XML (an XDD or ESI file); give the drive's EDS, or convert it"
        )
    try:
        return raw.decode("utf-8"), []
    except UnicodeDecodeError:
        return raw.decode("latin-1"), []


_TYPES = {
    "BOOLEAN": 1, "INTEGER8": 2, "INTEGER16": 3, "INTEGER32": 4, "UNSIGNED8": 5, "UNSIGNED16": 6,
    "UNSIGNED32": 7, "REAL32": 8, "VISIBLE_STRING": 9, "OCTET_STRING": 10, "DOMAIN": 15,
}  # fmt: skip
"""Index of the data types of CiA 301, by the names written by some tools instead of the index."""
_NODE = re.compile(r"\+?\$NODEID\+?", re.I)


class NoNumber(ValueError):
    """A text is not a number, or does not fit the type."""


def number(text: str, node: int | None = None) -> int | None:
    """Parse a number; return None for an empty text, and for $NODEID of an unknown node.

    Raises
    ------
    NoNumber
        The text is no number.
    """
    text = re.sub(r"[\s_]", "", text)
    if not text:
        return None
    rest, formulas = _NODE.subn("", text)
    value = _plain(rest, text) if rest else 0
    if not formulas:
        return value
    return None if node is None else value + node


def _plain(text: str, whole: str) -> int:
    digits = text.lower().rstrip("ul")
    try:
        if re.fullmatch(r"[+-]?[0-9][0-9a-f]*h", digits):
            return int(digits[:-1], 16)
        if re.fullmatch(r"[+-]?0[0-7]+", digits):
            return int(digits, 8)
        return int(digits, 10) if re.fullmatch(r"[+-]?\d+", digits) else int(digits, 0)
    except ValueError as error:
        raise NoNumber(f"{whole!r} is not a number; correct it") from error


def stated(text: str, key: str, node: int | None = None) -> int | None:
    """Parse the number of a key (see `number`); errors begin with the name of the key."""
    try:
        return number(text, node)
    except NoNumber as error:
        raise NoNumber(f"{key}: {error}") from error


def real(text: str, key: str) -> float | None:
    """Parse a real number; return None for an empty text."""
    try:
        return float(text) if text.strip() else None
    except ValueError as error:
        raise NoNumber(f"{key}: {text!r} is not a number; correct it") from error


def declared_type(text: str, sections: Mapping[str, Section]) -> str | None:
    """Return the type code for a data type; None for texts and domains.

    Types of the device (40h and up) are described by their member 1, as written by CANfestival's
    editor.
    """
    named = _TYPES.get(text.strip().upper())
    if named is not None:
        raise NoNumber(f"DataType: {text!r} is not a number; state 0x{named:04X}")
    index = stated(text, "DataType")
    if index is not None and index >= 0x40:
        described = sections.get(f"{index:x}sub1")
        index = number(described.get("defaultvalue")) if described else None
    return None if index is None else NUMBERS.get(index)


def within(kind: str, value: int | None, key: str) -> int | None:
    """Return a value of a type, with the sign of hex numbers.

    Raises
    ------
    NoNumber
        The value does not fit the type.
    """
    bits = int(kind[1:])
    if value is None:
        return None
    if kind.startswith("i") and 1 << bits - 1 <= value < 1 << bits:
        return value - (1 << bits)
    if kind.startswith("u") and -(1 << bits - 1) <= value < 0:
        return value + (1 << bits)
    if not -(1 << bits - 1) <= value < 1 << bits:
        if key in {"LowLimit", "HighLimit"}:
            return None
        raise NoNumber(f"{key}={value} does not fit {bits} bits; correct it")
    return value
