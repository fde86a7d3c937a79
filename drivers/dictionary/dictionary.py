"""What an object dictionary declares, by a data sheet (EDS, DCF) or by a live drive.

The two know different things. A data sheet knows names, access and what can be mapped, and only the
maker's defaults; a live drive knows values, and keeps silent about the rest. What is not known is
None, so that whoever judges a dictionary can distinguish "no" from "not said".
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
"""Our name of CiA 301's types of numbers, by the type's index."""


@dataclass(frozen=True, slots=True)
class Declared:
    """One number of an object dictionary; None is "not said".

    Attributes
    ----------
    name : str
        The object's name, and the member's where there is one.
    type : str or None
        u8, i16 and so on; None for texts, domains and types without a name here.
    access : str or None
        ro, wo, rw, rwr, rww or const.
    mappable : bool or None
        It may travel in a PDO.
    value : int or None
        As configured: from a DCF or read from the drive.
    default : int or None
        The maker's, in a data sheet.
    low, high : int or None
        Range that it takes.
    reals : tuple of float or None
        The same four of a real number, in this order; empty for integers.
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
        """Length as a PDO carries it."""
        return None if self.type is None else int(self.type[1:])

    @property
    def writable(self) -> bool | None:
        """Whether the bus may write it."""
        return None if self.access is None else "w" in self.access

    @property
    def readable(self) -> bool | None:
        """Whether the bus may read it."""
        return None if self.access is None else self.access != "wo"

    @property
    def stated(self) -> int | None:
        """Configured value, else the maker's default."""
        return self.default if self.value is None else self.value

    @property
    def fixed(self) -> int | None:
        """The one value that it can have, if there is only one."""
        if self.low is not None and self.low == self.high:
            return self.low
        return self.default if self.access == "const" else None

    @property
    def place(self) -> str:
        """Index and sub-index as they are written everywhere."""
        return f"{self.index:04X}:{self.subindex:02X}"


@dataclass(frozen=True)
class Dictionary:
    """All that is known of one drive's object dictionary.

    Attributes
    ----------
    source : str
        File, or node, for messages.
    live : bool
        Read from a drive: what was not asked for may be there all the same.
    entries : mapping of (index, sub-index) to Declared
        What there is.
    damaged : mapping of (index, sub-index) to str
        What is declared in a way that cannot be understood; raised when it is asked for.
    unanswered : mapping of (index, sub-index) to str
        What a live drive neither gave nor denied, and how it refused.
    node, bitrate : int or None
        Of a DCF [-, bit/s].
    bitrates : tuple of int
        That the device can do [bit/s].
    vendor, product, revision, serial : int or None
        Identity (1018).
    maker, model : str
        Names of vendor and product.
    notes : tuple of str
        What was mended when reading.
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

    def of_axis(self, within: InNode) -> Dictionary:
        """Return the dictionary as one of the drive's axes sees it."""
        if within == ALONE:
            return self
        entries = {
            (index, declared.subindex): _moved(declared, index, within)
            for declared in self.entries.values()
            if (index := within.relative(declared.index)) is not None
        }
        return replace(
            self,
            entries=entries,
            source=f"{self.source}{axis_suffix(within.axis)}",
            damaged=_relative(self.damaged, within),
            unanswered=_relative(self.unanswered, within),
        )

    def find(self, index: int, subindex: int = 0) -> Declared | None:
        """Return what is declared at a place, None where nothing is.

        Raises
        ------
        FileError
            Something is, but cannot be understood.
        """
        if (index, subindex) in self.damaged:
            raise FileError(self.damaged[index, subindex])
        return self.entries.get((index, subindex))

    def entry(self, entry: Entry) -> Declared | None:
        """Return what is declared for one of `drivers.cia402.objects` (see `find`)."""
        return self.find(*entry.key)

    def value(self, entry: Entry) -> int | None:
        """Return the configured value, or the only one that there can be; never a mere default."""
        found = self.entry(entry)
        if found is None:
            return None
        return found.fixed if found.value is None else found.value

    def members(self, index: int) -> Iterator[Declared]:
        """Yield what is declared of one object, by sub-index."""
        for key in sorted(key for key in self.entries if key[0] == index):
            yield self.entries[key]


def _moved(declared: Declared, index: int, within: InNode) -> Declared:
    if not maps(index, declared.subindex):
        return replace(declared, index=index)
    words = [word and within.word(word) for word in (declared.value, declared.default)]
    return replace(declared, index=index, value=words[0], default=words[1])


def _relative(texts: Mapping[Key, str], within: InNode) -> dict[Key, str]:
    pairs = (
        ((within.relative(index), subindex), text) for (index, subindex), text in texts.items()
    )
    return {(index, subindex): text for (index, subindex), text in pairs if index is not None}


def with_proof(entries: Mapping[Key, Declared]) -> dict[Key, Declared]:
    """Return the same; what any TPDO or RPDO carries as it stands is shown to be mappable."""
    proved = frozenset(
        (word >> 16, word >> 8 & 0xFF)
        for (index, subindex), member in entries.items()
        if subindex and any(index in mappings for mappings in MAPPINGS)
        for word in (member.default, member.value)
        if word
    )
    return {k: replace(e, mappable=True) if k in proved else e for k, e in entries.items()}
