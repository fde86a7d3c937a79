"""Multi-axis nodes (CiA 402): profile objects of the axes at intervals of 800h.

Every axis is a drive with its own dictionary, in which it is the first axis. On the bus the axes
are one node: one SDO server, one NMT state, one heartbeat. The profile objects of axis k are at
6000h + (k - 1) 800h. Its four PDOs in each direction follow those of axis k - 1. Objects of the
whole node (SYNC, heartbeats, emergencies) are written to every axis. PDOs after the fourth have no
identifier until the master configures one.
"""

from __future__ import annotations

import configparser
import io
from typing import TYPE_CHECKING

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort
from sim_plant.canopen.cob_id import INVALID
from sim_plant.canopen.eds_variant import list_objects

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sim_plant.canopen.eds import Entry
    from sim_plant.canopen.object_dictionary import ObjectDictionary

PROFILE, PER_AXIS = 0x6000, 0x800
"""First index of the profile, and number of indices of an axis."""
AXES = 8
PDOS = 4
"""PDOs of an axis in each direction."""
_RECORDS = range(0x1400, 0x1C00)
_MAPPINGS = (range(0x1600, 0x1800), range(0x1A00, 0x1C00))
_ONE_NODE = range(0x1000, 0x1200)
"""Indices of the communication objects of the whole node."""


def place(index: int) -> tuple[int, int]:
    """Return the axis of an object on the bus, from 0, and its index within the axis."""
    if index in _RECORDS:
        axis = index % 0x200 // PDOS
        return axis, index - axis * PDOS if axis < AXES else index
    if PROFILE <= index < PROFILE + AXES * PER_AXIS:
        axis, offset = divmod(index - PROFILE, PER_AXIS)
        return axis, PROFILE + offset
    return 0, index


def shifted(index: int, axis: int) -> int:
    """Return the index on the bus of an object of an axis, from 0."""
    if index in _RECORDS:
        return index + axis * PDOS
    return index + axis * PER_AXIS if PROFILE <= index < PROFILE + PER_AXIS else index


class NodeDictionary:
    """Dictionaries of all axes of a node, as served by SDO.

    Parameters
    ----------
    axes : sequence of ObjectDictionary
        Dictionary of each axis; the first axis serves the whole node.
    """

    def __init__(self, axes: Sequence[ObjectDictionary]) -> None:
        self._axes = axes
        for dictionary in axes[1:]:
            for base in (0x1400, 0x1800):
                for number in range(PDOS):
                    dictionary.preset(base + number, 1, INVALID)

    def upload(self, index: int, subindex: int) -> bytes:
        """Encode the present value (see `ObjectDictionary`)."""
        axis, dictionary, inner = self._found(index)
        data = dictionary.upload(inner, subindex)
        return _word(data, axis) if _maps(index, subindex) else data

    def check_download(self, index: int, subindex: int, size: int | None) -> Entry:
        """Check existence, access and announced length of a write (see `ObjectDictionary`)."""
        _, dictionary, inner = self._found(index)
        return dictionary.check_download(inner, subindex, size)

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Decode and write a value (see `ObjectDictionary`)."""
        axis, dictionary, inner = self._found(index)
        if _maps(index, subindex):
            data = _inner_word(data, axis)
        dictionary.download(inner, subindex, data)
        if index in _ONE_NODE:
            for other in self._axes[1:]:
                other.download(index, subindex, data)

    def _found(self, index: int) -> tuple[int, ObjectDictionary, int]:
        axis, inner = place(index)
        if axis >= len(self._axes):
            raise SdoAbort(AbortCode.NO_OBJECT)
        return axis, self._axes[axis], inner


def _maps(index: int, subindex: int) -> bool:
    return bool(subindex) and any(index in mapping for mapping in _MAPPINGS)


def _word(data: bytes, axis: int) -> bytes:
    """Convert a mapping entry of an axis to the indices on the bus."""
    word = int.from_bytes(data, "little")
    return (shifted(word >> 16, axis) << 16 | word & 0xFFFF).to_bytes(4, "little")


def _inner_word(data: bytes, axis: int) -> bytes:
    """Convert a mapping entry on the bus to the axis's indices; refuse objects of other axes."""
    word = int.from_bytes(data, "little")
    owner, inner = place(word >> 16)
    if word >> 16 >= PROFILE and owner != axis:
        raise SdoAbort(AbortCode.NOT_MAPPABLE)
    return (inner << 16 | word & 0xFFFF).to_bytes(4, "little")


def multi_axis_eds(sheets: Sequence[str]) -> str:
    """Return the EDS of a node, merged from the EDS texts of the axes."""
    eds = _parsed(sheets[0])
    for axis, sheet in enumerate(sheets[1:], start=1):
        for name, section in _parsed(sheet).items():
            index = _index(name)
            if index is None or shifted(index, axis) == index:
                continue
            own = f"{shifted(index, axis):04X}{name[4:]}"
            eds[own] = dict(section)
            _move(eds[own], name, index, axis)
    for direction in ("RX", "TX"):
        eds["DeviceInfo"][f"NrOf{direction}PDO"] = str(PDOS * len(sheets))
    list_objects(eds)
    text = io.StringIO()
    eds.write(text, space_around_delimiters=False)
    return text.getvalue()


def _move(section: configparser.SectionProxy, name: str, index: int, axis: int) -> None:
    """Adapt name, identifiers and mapping of a section to its axis."""
    section["ParameterName"] = f"Axis {axis + 1} {section['ParameterName']}"
    default = section.get("DefaultValue", "")
    if index in _RECORDS and index & 0x200 == 0 and name.endswith("sub1"):
        section["DefaultValue"] = f"0x{INVALID:08X}"
    elif "sub" in name and name[4:] != "sub0" and _maps(index, 1) and default:
        word = int(default, 0)
        section["DefaultValue"] = f"0x{shifted(word >> 16, axis) << 16 | word & 0xFFFF:08X}"


def _parsed(text: str) -> configparser.RawConfigParser:
    eds = configparser.RawConfigParser()
    eds.optionxform = str  # type: ignore[assignment,method-assign]
    eds.read_string(text)
    return eds


def _index(name: str) -> int | None:
    try:
        return int(name[:4], 16) if name[4:] == "" or name[4:].startswith("sub") else None
    except ValueError:
        return None
