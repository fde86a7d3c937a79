"""Electronic data sheet (EDS) of a drive, read into the entries of the object dictionary."""

from __future__ import annotations

import functools
import io
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import canopen
from canopen.objectdictionary import ODVariable, datatypes

from sim_plant.canopen.eds_variant import variant
from sim_plant.personality import PLAIN, Personality

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

EDS_PATH = Path(__file__).with_name("cia402_drive.eds")

STORE_EDS = 0x1021
"""Store EDS: object with the text of the EDS, readable in every node."""

_FORMATS = {
    datatypes.INTEGER8: "b",
    datatypes.INTEGER16: "h",
    datatypes.INTEGER32: "i",
    datatypes.UNSIGNED8: "B",
    datatypes.UNSIGNED16: "H",
    datatypes.UNSIGNED32: "I",
    datatypes.REAL32: "I",
}


def key(index: int, subindex: int = 0) -> int:
    """Return index and sub-index as a single number."""
    return index << 8 | subindex


@dataclass(frozen=True, slots=True)
class Entry:
    """Entry of the object dictionary, as declared in the EDS.

    Attributes
    ----------
    access : str
        ro, wo, rw, rwr, rww or const.
    code : str
        struct format of an integer; empty for text and domains.
    low, high : int
        Range of an integer, both included.
    default : int or bytes
        Value after reset, without the node id.
    relative : bool
        The node id is added to the default.
    """

    index: int
    subindex: int
    access: str
    mappable: bool
    code: str
    low: int
    high: int
    default: int | bytes
    relative: bool

    @property
    def readable(self) -> bool:
        """True if the bus may read the object."""
        return self.access != "wo"

    @property
    def writable(self) -> bool:
        """True if the bus may write the object."""
        return "w" in self.access

    @property
    def size(self) -> int:
        """Size of an integer in bytes; 0 for text and domains."""
        return struct.calcsize("<" + self.code)


@functools.cache
def drive_eds(personality: Personality = PLAIN) -> str:
    """Return the text of a drive's EDS."""
    base = EDS_PATH.read_text(encoding="ascii")
    return base if personality == PLAIN else variant(base, personality)


@functools.cache
def drive_entries(personality: Personality = PLAIN) -> dict[int, Entry]:
    """Return all entries of a drive's EDS, visible on the bus, by `key`."""
    return parse_entries(drive_eds(personality))


def parse_entries(text: str) -> dict[int, Entry]:
    """Parse all entries of an EDS, by `key`."""
    return {key(entry.index, entry.subindex): entry for entry in _entries(text)}


def inner_entries(
    personality: Personality, visible: Callable[[Personality], Mapping[int, Entry]] = drive_entries
) -> dict[int, Entry]:
    """Return the entries used by the firmware, including those hidden from the bus."""
    whole = personality.model_copy(update={"missing": (), "mapping_entries": 8})
    return {**drive_entries(whole), **visible(personality)}


def _entries(text: str) -> Iterator[Entry]:
    file = io.StringIO(text)
    file.name = EDS_PATH.name
    dictionary = canopen.import_od(file)
    for index, thing in dictionary.items():
        if index < 0x1000:
            continue  # dummies can be mapped, not accessed
        for variable in [thing] if isinstance(thing, ODVariable) else thing.values():
            yield _entry(variable, text)


def _entry(variable: ODVariable, text: str) -> Entry:
    code = _FORMATS.get(variable.data_type or 0, "")
    values = 1 << 8 * struct.calcsize("<" + code)
    low = -values // 2 if code.islower() else 0
    return Entry(
        index=variable.index,
        subindex=variable.subindex,
        access=variable.access_type,
        mappable=variable.pdo_mappable,
        code=code,
        low=low if variable.min is None else variable.min,
        high=low + values - 1 if variable.max is None else variable.max,
        default=_default(variable, code, text),
        relative=variable.relative,
    )


def _default(variable: ODVariable, code: str, eds: str) -> int | bytes:
    if variable.index == STORE_EDS:
        return eds.encode("ascii")
    if not code:
        return str(variable.default or "").encode("ascii")
    if variable.relative:
        text: str = vars(variable)["default_raw"]
        return int(text.replace("$NODEID", "").strip("+"), 0)
    return int(variable.default or 0)
