"""Object dictionary as declared by a data sheet (EDS, DCF) or read from a live drive.

A data sheet contains names, access, mappability, and only default values; a live drive gives
values, and nothing else. The unknown is None, so that a review can distinguish "no" from "not
stated".
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError
from drivers.commissioning.held_values import MAPPINGS
from drivers.in_node import ALONE, InNode, find_axes, maps
from drivers.remote_dictionary import axis_suffix

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from drivers.fieldbus import Entry

Key = tuple[int, int]

NUMBERS = {2: "i8", 3: "i16", 4: "i32", 5: "u8", 6: "u16", 7: "u32", 8: "f32"}
NUMBERS |= {0x10: "i24", 0x12: "i40", 0x13: "i48", 0x14: "i56", 0x15: "i64"}
NUMBERS |= {0x16: "u24", 0x18: "u40", 0x19: "u48", 0x1A: "u56", 0x1B: "u64"}
"""Type codes of CiA 301's numeric types, by the type's index."""


@dataclass(frozen=True, slots=True)
class Declared:
    """Number of an object dictionary; None means "not stated".

    Attributes
    ----------
    name : str
        Name of the object, and of the member if there is one.
    type : str or None
        u8, i16 and so on; None for texts, domains and types without a code.
    access : str or None
        ro, wo, rw, rwr, rww or const.
    mappable : bool or None
        True if a PDO can carry the number.
    value : int or None
        Configured value: from a DCF or read from the drive.
    default : int or None
        Default of the maker, in a data sheet.
    low, high : int or None
        Accepted range.
    reals : tuple of float or None
        Value, default, low and high of a real number; empty for integers.
    """

    index: int
    subindex: int
    name: str = ""
    type: str | None = None
    access: str | None = None
    mappable: bool | None = None
    value: int | None = None
    default: int | None = None
    low: int | None = None
    high: int | None = None
    reals: tuple[float | None, ...] = ()

    @property
    def bits(self) -> int | None:
        """Length in a PDO [bits]."""
        return None if self.type is None else int(self.type[1:])

    @property
    def writable(self) -> bool | None:
        """True if writable by the bus."""
        return None if self.access is None else "w" in self.access

    @property
    def readable(self) -> bool | None:
        """True if readable by the bus."""
        return None if self.access is None else self.access != "wo"

    @property
    def stated(self) -> int | None:
        """Configured value, otherwise the default."""
        return self.default if self.value is None else self.value

    @property
    def fixed(self) -> int | None:
        """The only possible value, None if there are several."""
        if self.low is not None and self.low == self.high:
            return self.low
        return self.default if self.access == "const" else None

    @property
    def place(self) -> str:
        """Index and sub-index as text, such as 6041:00."""
        return f"{self.index:04X}:{self.subindex:02X}"


@dataclass(frozen=True)
class Dictionary:
    """Contents of a drive's object dictionary, as far as known.

    Attributes
    ----------
    source : str
        File, or node, for messages.
    live : bool
        True if read from a drive: objects not asked for may exist as well.
    entries : mapping of (index, sub-index) to Declared
        Declared numbers.
    damaged : mapping of (index, sub-index) to str
        Errors of unintelligible declarations, raised on access.
    unanswered : mapping of (index, sub-index) to str
        Failures for objects that a live drive neither returned nor denied, in words.
    node, bitrate : int or None
        Node number and bit rate of a DCF [-, bit/s].
    bitrates : tuple of int
        Supported bit rates [bit/s].
    vendor, product, revision, serial : int or None
        Identity (1018).
    maker, model : str
        Names of vendor and product.
    notes : tuple of str
        Repairs made when reading.
    """

    source: str
    live: bool
    entries: Mapping[Key, Declared]
    damaged: Mapping[Key, str] = field(default_factory=dict)
    unanswered: Mapping[Key, str] = field(default_factory=dict)
    node: int | None = None
    bitrate: int | None = None
    bitrates: tuple[int, ...] = ()
    vendor: int | None = None
    product: int | None = None
    revision: int | None = None
    serial: int | None = None
    maker: str = ""
    model: str = ""
    notes: tuple[str, ...] = ()

    def axes(self) -> Sequence[InNode]:
        """Return the axes of the drive."""
        return find_axes(lambda index, subindex: (index, subindex) in self.entries)

    def select_axis(self, within: InNode) -> Dictionary:
        """Return the dictionary of one of the drive's axes."""
        if within == ALONE:
            return self
        entries = {}
        for declared in self.entries.values():
            if (index := within.relative(declared.index)) is None:
                continue
            moved = entries[index, declared.subindex] = replace(declared, index=index)
            if maps(index, declared.subindex):  # the words of a mapping name objects of the axis
                words = [word and within.word(word) for word in (moved.value, moved.default)]
                entries[index, declared.subindex] = replace(moved, value=words[0], default=words[1])
        return replace(
            self,
            entries=entries,
            source=f"{self.source}{axis_suffix(within.axis)}",
            damaged=_relative(self.damaged, within),
            unanswered=_relative(self.unanswered, within),
        )

    def find(self, index: int, subindex: int = 0) -> Declared | None:
        """Return the declaration at a place, None if there is none.

        Raises
        ------
        FileError
            The declaration is unintelligible.
        """
        if (index, subindex) in self.damaged:
            raise FileError(self.damaged[index, subindex])
        return self.entries.get((index, subindex))

    def entry(self, entry: Entry) -> Declared | None:
        """Return the declaration of one of `drivers.cia402.objects` (see `find`)."""
        return self.find(*entry.key)

    def value(self, entry: Entry) -> int | None:
        """Return the configured or only possible value; never a mere default."""
        found = self.entry(entry)
        if found is None:
            return None
        return found.fixed if found.value is None else found.value

    def members(self, index: int) -> Iterator[Declared]:
        """Yield the declarations of an object, by sub-index."""
        for key in sorted(key for key in self.entries if key[0] == index):
            yield self.entries[key]


def _relative(texts: Mapping[Key, str], within: InNode) -> dict[Key, str]:
    pairs = (
        ((within.relative(index), subindex), text) for (index, subindex), text in texts.items()
    )
    return {(index, subindex): text for (index, subindex), text in pairs if index is not None}


def mark_mapped(entries: Mapping[Key, Declared]) -> dict[Key, Declared]:
    """Return the entries, with objects in any present TPDO or RPDO marked as mappable."""
    proved = frozenset(
        (word >> 16, word >> 8 & 0xFF)
        for (index, subindex), member in entries.items()
        if subindex and any(index in mappings for mappings in MAPPINGS)
        for word in (member.default, member.value)
        if word
    )
    return {k: replace(e, mappable=True) if k in proved else e for k, e in entries.items()}
