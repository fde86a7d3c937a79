"""Numbers and types in data sheets.

Decimal, octal and hex; hex also with a trailing h; `$NODEID + 0x180` in any order and spacing;
signed values in hex, with the sign by the width of the type (0xFFFF is -1 in 16 bits).
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from drivers.dictionary.dictionary import NUMBERS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from drivers.canopen.eds_sections import Section

_TYPES = {
    "BOOLEAN": 1, "INTEGER8": 2, "INTEGER16": 3, "INTEGER32": 4, "UNSIGNED8": 5, "UNSIGNED16": 6,
    "UNSIGNED32": 7, "REAL32": 8, "VISIBLE_STRING": 9, "OCTET_STRING": 10, "DOMAIN": 15,
}  # fmt: skip
"""Index of the data types of CiA 301, by the names written by some tools instead of the index."""
_NODE = re.compile(r"\+?\$NODEID\+?", re.I)


class NoNumber(ValueError):
    """A text is no number, or does not fit the type."""


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
        raise NoNumber(f"{whole!r} is no number; correct it") from error


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
        raise NoNumber(f"{key}: {text!r} is no number; correct it") from error


def declared_type(text: str, sections: Mapping[str, Section]) -> str | None:
    """Return the type code for a data type; None for texts and domains.

    Types of the device (40h and up) are described by their member 1, as written by CANfestival's
    editor.
    """
    named = _TYPES.get(text.strip().upper())
    if named is not None:
        raise NoNumber(f"DataType: {text!r} is no number; state 0x{named:04X}")
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
