"""Device description of a drive on EtherCAT (ESI, ETG.2000), for configuration tools.

The description is made from the contents of the slave: identity, memory map, process data after
power-on, and all objects with their types and defaults.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from sim_plant.ethercat import eeprom
from sim_plant.ethercat.objects import ASSIGNED_IN, ASSIGNED_OUT, PDOS, RECEIVED, SENT

if TYPE_CHECKING:
    from sim_plant.drive_settings import DriveSettings
    from sim_plant.ethercat.objects import (
        DriveObjects,
        EntryDescription,
        ObjectDescription,
        Pdo,
    )

_TYPES = {2: "SINT", 3: "INT", 4: "DINT", 5: "USINT", 6: "UINT", 7: "UDINT", 8: "REAL"}
_ACCESS = {"const": "ro", "rwr": "rw", "rww": "rw"}
_VARIABLE = 7
_SUB_INDEX_BITS = 16
"""Sub-index 0 and its padding, before the entries of an object."""


def write_esi(objects: DriveObjects, settings: DriveSettings) -> str:
    """Return the description of a drive as XML.

    Parameters
    ----------
    objects : DriveObjects
        Objects served by the drive.
    settings : DriveSettings
        Identity and name of the drive.
    """
    root = ElementTree.Element("EtherCATInfo", {"Version": "1.6"})
    vendor = ElementTree.SubElement(root, "Vendor")
    _text(vendor, "Id", _hex(settings.vendor_id))
    _text(vendor, "Name", "sim_plant")
    descriptions = ElementTree.SubElement(root, "Descriptions")
    group = ElementTree.SubElement(ElementTree.SubElement(descriptions, "Groups"), "Group")
    _text(group, "Type", "Drives")
    _text(group, "Name", "Virtual drives", LcId="1033")
    devices = ElementTree.SubElement(descriptions, "Devices")
    device = ElementTree.SubElement(devices, "Device", {"Physics": "YY"})
    _text(
        device,
        "Type",
        settings.name,
        ProductCode=_hex(settings.product_code),
        RevisionNo=_hex(settings.revision),
    )
    _text(device, "Name", f"Virtual drive of {settings.name}", LcId="1033")
    _text(device, "GroupType", "Drives")
    _profile(device, objects)
    for name in ("Outputs", "Inputs", "MBoxState"):
        _text(device, "Fmmu", name)
    assigned = {ASSIGNED_OUT: objects.assigned(ASSIGNED_OUT)}
    assigned[ASSIGNED_IN] = objects.assigned(ASSIGNED_IN)
    _sync_managers(device, assigned)
    for tag, base, manager, assignment in (
        ("RxPdo", RECEIVED, 2, ASSIGNED_OUT),
        ("TxPdo", SENT, 3, ASSIGNED_IN),
    ):
        chosen = {pdo.index for pdo in assigned[assignment]}
        for index in range(base, base + PDOS):
            if index in objects.objects:
                _pdo(device, tag, objects.pdo(index), manager if index in chosen else None, objects)
    mailbox = ElementTree.SubElement(device, "Mailbox")
    features = ("SdoInfo", "PdoAssign", "PdoConfig", "CompleteAccess", "SegmentedSdo")
    ElementTree.SubElement(mailbox, "CoE", dict.fromkeys(features, "true"))
    _clock(device)
    content = ElementTree.SubElement(device, "Eeprom")
    _text(content, "ByteSize", str(eeprom.SIZE))
    _text(content, "ConfigData", struct.pack("<HHHH", *eeprom.CONFIGURATION, 0, 0).hex())
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ElementTree.tostring(root, "unicode") + "\n"


def _profile(device: ElementTree.Element, objects: DriveObjects) -> None:
    profile = ElementTree.SubElement(device, "Profile")
    device_type = objects.objects[0x1000].entries[0].entry.default
    _text(profile, "ProfileNo", str(int(device_type) & 0xFFFF))
    dictionary = ElementTree.SubElement(profile, "Dictionary")
    types = ElementTree.SubElement(dictionary, "DataTypes")
    named: dict[str, int] = {}
    for found in objects.objects.values():
        for member in found.entries.values():
            named[_type(member)] = member.bits
    for name, bits in sorted(named.items()):
        _data_type(types, name, bits)
    for found in objects.objects.values():
        if found.code != _VARIABLE:
            _record_type(types, found)
    listed = ElementTree.SubElement(dictionary, "Objects")
    for found in objects.objects.values():
        _object(listed, found)


def _record_type(types: ElementTree.Element, found: ObjectDescription) -> None:
    """Describe the sub-indices of a record or an array by name, place and type."""
    record = _data_type(types, f"DT{found.index:04X}", _bits(found))
    place = 0
    for subindex, member in sorted(found.entries.items()):
        item = ElementTree.SubElement(record, "SubItem")
        _text(item, "SubIdx", str(subindex))
        _text(item, "Name", _label(found, subindex))
        _text(item, "Type", _type(member))
        _text(item, "BitSize", str(member.bits))
        _text(item, "BitOffs", str(place))
        _flags(item, member)
        place += member.bits if subindex else _SUB_INDEX_BITS


def _object(listed: ElementTree.Element, found: ObjectDescription) -> None:
    thing = ElementTree.SubElement(listed, "Object")
    _text(thing, "Index", _hex(found.index))
    _text(thing, "Name", found.name)
    whole = found.code != _VARIABLE
    _text(thing, "Type", f"DT{found.index:04X}" if whole else _type(found.entries[0]))
    _text(thing, "BitSize", str(_bits(found)))
    information = ElementTree.SubElement(thing, "Info")
    if not whole:
        _text(information, "DefaultData", _data(found.entries[0]))
    for subindex, member in sorted(found.entries.items() if whole else ()):
        item = ElementTree.SubElement(information, "SubItem")
        _text(item, "Name", _label(found, subindex))
        _text(ElementTree.SubElement(item, "Info"), "DefaultData", _data(member))
    if whole:
        _text(ElementTree.SubElement(thing, "Flags"), "Access", "ro")
    else:
        _flags(thing, found.entries[0])


def _sync_managers(device: ElementTree.Element, assigned: dict[int, list[Pdo]]) -> None:
    sizes = (
        eeprom.MAILBOX_SIZE,
        eeprom.MAILBOX_SIZE,
        *(sum(pdo.size for pdo in pdos) for pdos in assigned.values()),
    )
    for name, start, size, control in zip(
        ("MBoxOut", "MBoxIn", "Outputs", "Inputs"),
        (eeprom.MAILBOX_OUT, eeprom.MAILBOX_IN, eeprom.OUTPUTS, eeprom.INPUTS),
        sizes,
        eeprom.CONTROLS,
        strict=True,
    ):
        _text(
            device,
            "Sm",
            name,
            StartAddress=_hex(start),
            ControlByte=_hex(control),
            DefaultSize=str(size),
            Enable="1",
        )


def _pdo(
    device: ElementTree.Element, tag: str, pdo: Pdo, manager: int | None, objects: DriveObjects
) -> None:
    element = ElementTree.SubElement(device, tag, {} if manager is None else {"Sm": str(manager)})
    _text(element, "Index", _hex(pdo.index))
    _text(element, "Name", pdo.name)
    for mapped in pdo.entries:
        entry = ElementTree.SubElement(element, "Entry")
        found = objects.objects[mapped.index].entries[mapped.subindex]
        _text(entry, "Index", _hex(mapped.index))
        _text(entry, "SubIndex", str(mapped.subindex))
        _text(entry, "BitLen", str(8 * mapped.size))
        _text(entry, "Name", found.name)
        _text(entry, "DataType", _type(found))


def _clock(device: ElementTree.Element) -> None:
    modes = ElementTree.SubElement(device, "Dc")
    for name, description, activate in (
        ("Synchron", "Synchronous to the sync manager", 0),
        ("DC", "Synchronous to SYNC0", eeprom.SYNC0_ACTIVATION),
    ):
        mode = ElementTree.SubElement(modes, "OpMode")
        _text(mode, "Name", name)
        _text(mode, "Desc", description)
        _text(mode, "AssignActivate", _hex(activate))


def _data_type(types: ElementTree.Element, name: str, bits: int) -> ElementTree.Element:
    data_type = ElementTree.SubElement(types, "DataType")
    _text(data_type, "Name", name)
    _text(data_type, "BitSize", str(bits))
    return data_type


def _flags(parent: ElementTree.Element, member: EntryDescription) -> None:
    entry = member.entry
    flags = ElementTree.SubElement(parent, "Flags")
    _text(flags, "Access", _ACCESS.get(entry.access, entry.access))
    if entry.mappable:
        _text(
            flags, "PdoMapping", ("R" if entry.writable else "") + ("T" if entry.readable else "")
        )


def _label(found: ObjectDescription, subindex: int) -> str:
    """Return the name of an entry, as referred to by the values of its object."""
    return f"SubIndex {subindex:03d}" if subindex == 0 else found.entries[subindex].name


def _bits(found: ObjectDescription) -> int:
    if found.code == _VARIABLE:
        return found.entries[0].bits
    return _SUB_INDEX_BITS + sum(member.bits for n, member in found.entries.items() if n)


def _type(member: EntryDescription) -> str:
    return _TYPES.get(member.data_type, f"STRING({max(1, member.bits // 8)})")


def _data(member: EntryDescription) -> str:
    default, entry = member.entry.default, member.entry
    if isinstance(default, bytes):
        return default.hex()
    return (default % (1 << 8 * entry.size)).to_bytes(entry.size, "little").hex()


def _hex(number: int) -> str:
    return f"#x{number:04X}"


def _text(parent: ElementTree.Element, tag: str, text: str, **attributes: str) -> None:
    ElementTree.SubElement(parent, tag, attributes).text = text
