"""Reader of EtherCAT slave information (ESI, ETG.2000) as a data sheet.

A file may describe several devices and revisions. The reader selects a device with an object
dictionary of profile 402, of the latest revision. A file without a dictionary is useless for a
draft: the drive itself must be read.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from checked_files.foreign_text import one_line
from checked_files.xml_file import XmlFile
from checked_files.yaml_file import FileError
from drivers.cia402 import objects
from drivers.dictionary.dictionary import Declared, Dictionary, mark_mapped

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from xml.etree.ElementTree import Element

    from drivers.dictionary.dictionary import Key
    from drivers.fieldbus import Entry

_TYPES = {
    "SINT": "i8", "INT": "i16", "DINT": "i32", "LINT": "i64", "USINT": "u8", "UINT": "u16",
    "UDINT": "u32", "ULINT": "u64", "REAL": "f32", "BYTE": "u8", "WORD": "u16", "DWORD": "u32",
    "BITARR8": "u8", "BITARR16": "u16", "BITARR32": "u32",
}  # fmt: skip
"""Type codes of the types of ETG.2000; texts and bits have none."""
_ACCESS = {"ro", "wo", "rw"}
ELEMENTS = 255
"""Largest number of sub-indices of an object."""
_PROFILE = 402
_UNITS = {
    objects.POSITION_UNIT: (0x6064, 0x607A),
    objects.VELOCITY_UNIT: (0x6081, 0x607F, 0x606C),
    objects.ACCELERATION_UNIT: (0x6083, 0x6084, 0x60C5),
}
"""Objects whose unit (ETG.1004) replaces 60A8 to 60AA."""


def read_esi(path: Path | str, node: int | None = None) -> Dictionary:
    """Read the description of a drive.

    Parameters
    ----------
    path : path
        The file.
    node : int, optional
        Position on the line.

    Raises
    ------
    FileError
        The file cannot be read, or describes no drive of CiA 402 with its objects.
    """
    file = XmlFile(Path(path))
    if file.root.tag != "EtherCATInfo":
        raise FileError(
            f"{path}: begins with <{file.root.tag}>, not <EtherCATInfo>; give the ESI file of the"
            " drive's maker (an ENI file describes a network)"
        )
    devices = file.root.findall("Descriptions/Devices/Device")
    described = [each for each in devices if each.find("Profile/Dictionary/Objects") is not None]
    # a device states the profile itself or by its first channel
    profiles = ("Profile/ProfileNo", "Profile/Channel/ProfileNo")
    drives = [
        each
        for each in described
        if _number(next(filter(None, map(each.findtext, profiles)), None)) == _PROFILE
    ] or described
    if not drives:
        raise FileError(
            f"{path}: none of its {len(devices)} devices has an object dictionary; read the drive"
            " itself: hil drives new --interface ethercat --channel eth0"
        )
    device = max(drives, key=lambda each: _number(_attribute(each, "RevisionNo")) or 0)
    reading = _Reading(device)
    entries = reading.entries()
    notes = [f"{len(drives)} devices; the latest revision is read"] if len(drives) > 1 else []
    units = {entry: unit for entry, unit in reading.units().items() if entry.key not in entries}
    for entry, (unit, index) in units.items():
        entries[entry.key] = Declared(*entry.key, entry.name, "u32", access="const", default=unit)
        notes.append(f"states the unit of {index:04X} as {unit:08X}h: taken as {entry.index:04X}")
    entries = {**_mapped(device), **entries}
    return Dictionary(
        str(path),
        live=False,
        entries=mark_mapped(entries),
        node=node,
        vendor=_number(file.root.findtext("Vendor/Id")),
        product=_number(_attribute(device, "ProductCode")),
        revision=_number(_attribute(device, "RevisionNo")),
        maker=_text(file.root, "Vendor/Name"),
        model=_text(device, "Name") or _text(device, "Type"),
        notes=tuple(notes),
    )


def _attribute(device: Element, key: str) -> str | None:
    kind = device.find("Type")
    return None if kind is None else kind.get(key)


@dataclass(frozen=True)
class _Member:
    """Number of an object, as defined by its type."""

    subindex: int
    name: str
    type: str
    flags: Element | None


class _Reading:
    """Intermediate state of reading a device's dictionary."""

    def __init__(self, device: Element) -> None:
        dictionary = device.find("Profile/Dictionary")
        assert dictionary is not None  # noqa: S101 - by the caller
        self._types: Mapping[str, Element] = {
            _text(each, "Name"): each for each in dictionary.findall("DataTypes/DataType")
        }
        self._objects = dictionary.findall("Objects/Object")

    def entries(self) -> dict[Key, Declared]:
        """Return the numbers by index and sub-index; objects without an index are left out."""
        found: dict[Key, Declared] = {}
        for each in self._objects:
            index = _number(each.findtext("Index"))
            if index is None or not 0x1000 <= index <= 0xFFFF:
                continue
            given = each.findall("Info/SubItem")
            for number, member in enumerate(self._members(each)):
                information = each.find("Info")
                if given:
                    information = given[number].find("Info") if number < len(given) else None
                key = (index, member.subindex)
                found[key] = _declared(key, each, member, information)
        return found

    def units(self) -> dict[Entry, tuple[int, int]]:
        """Return unit codes of positions and rates (`_UNITS`), with the object of each."""
        by_index = {_number(each.findtext("Index")): each for each in reversed(self._objects)}
        found: dict[Entry, tuple[int, int]] = {}
        for entry, indices in _UNITS.items():
            for index in (index for index in indices if index in by_index):
                unit = _number(by_index[index].findtext("Info/Unit"))
                if unit:
                    found.setdefault(entry, (unit, index))
        return found

    def _members(self, each: Element) -> Iterator[_Member]:
        kind = self._types.get(_text(each, "Type"))
        items = [] if kind is None else kind.findall("SubItem")
        if not items:
            yield _Member(0, "", _text(each, "Type"), each.find("Flags"))
        for item in items:
            subindex, name = _number(item.findtext("SubIdx")), _text(item, "Name")
            flags = item.find("Flags")
            array = self._types.get(_text(item, "Type"))
            if array is not None and array.find("ArrayInfo") is not None:
                first = _number(array.findtext("ArrayInfo/LBound")) or 1
                count = min(_number(array.findtext("ArrayInfo/Elements")) or 0, ELEMENTS)
                for number in range(first, first + count):
                    yield _Member(number, name, _text(array, "BaseType"), flags)
            elif subindex is not None:
                yield _Member(subindex, name, _text(item, "Type"), flags)


def _mapped(device: Element) -> dict[Key, Declared]:
    """Return objects in the default PDOs, which exist even without a description."""
    found: dict[Key, Declared] = {}
    for tag, access in (("TxPdo", "ro"), ("RxPdo", "rw")):
        for each in device.findall(f"{tag}/Entry"):
            index, kind = _number(each.findtext("Index")), _TYPES.get(_text(each, "DataType"))
            key = (index or 0, _number(each.findtext("SubIndex")) or 0)
            if key[0] >= 0x1000:  # smaller indices fill gaps
                found[key] = Declared(*key, _text(each, "Name"), kind, access, mappable=True)
    return found


def _declared(key: Key, each: Element, member: _Member, information: Element | None) -> Declared:
    kind = _TYPES.get(member.type)
    flags = each.find("Flags") if member.flags is None else member.flags
    access = "" if flags is None else _text(flags, "Access").lower()
    mapping = "" if flags is None else _text(flags, "PdoMapping").upper()
    name = " ".join(filter(None, (_text(each, "Name"), member.name)))
    values = [_value(information, tag, kind) for tag in ("Default", "Min", "Max")]
    return Declared(
        *key,
        name,
        kind,
        access=access if access in _ACCESS else None,
        mappable=bool(mapping) and bool(set(mapping) & set("TR")),
        default=values[0],
        low=values[1],
        high=values[2],
    )


def _value(information: Element | None, tag: str, kind: str | None) -> int | None:
    """Return a value from its bytes, little endian, or as written; None if absent."""
    if information is None or kind is None or kind.startswith("f"):
        return None
    data = information.findtext(f"{tag}Data")
    if data is not None:
        try:
            raw = bytes.fromhex(data.strip())
        except ValueError:
            return None
        return int.from_bytes(raw, "little", signed=kind.startswith("i")) if raw else None
    return _number(information.findtext(f"{tag}Value"))


def _number(text: str | None) -> int | None:
    """Parse a number of ETG.2000: decimal, or hexadecimal after #x."""
    text = (text or "").strip().lower()
    hexadecimal = text.startswith(("#x", "0x"))
    try:
        return int(text[2:], 16) if hexadecimal else int(text)
    except ValueError:
        return None


def _text(element: Element, path: str) -> str:
    return one_line(element.findtext(path) or "")
