"""Object dictionary of a drive on EtherCAT: the profile of CAN with the communication of CoE.

Profile and drive have the same objects as on CAN, with the deviations of the same personality.
Objects of CAN are removed, sync managers and their assignment added (ETG.1000.6 clause 5.6.7);
mappings may be of any length. The result is an EDS too, so that a drive serves exactly its EDS.
"""

from __future__ import annotations

import configparser
import functools
import io
from dataclasses import dataclass

import canopen
from canopen.objectdictionary import ODVariable, datatypes

from sim_plant.canopen.eds import Entry, drive_eds, key, parse_entries
from sim_plant.canopen.eds_variant import list_objects, variant
from sim_plant.personality import PLAIN, Personality

PDOS = 4
"""PDOs in each direction, as declared by the EDS."""
RECEIVED, SENT = 0x1600, 0x1A00
"""First mappings of the objects written and read by the master."""
ASSIGNED_OUT, ASSIGNED_IN = 0x1C12, 0x1C13
SYNC_OUT, SYNC_IN = 0x1C32, 0x1C33

_CAN_ONLY = frozenset(
    {0x1003, 0x1005, 0x1006, 0x1014, 0x1016, 0x1017, 0x1019, 0x1021, 0x1022, 0x1029, 0x1200}
    | {*range(0x1400, 0x1400 + PDOS), *range(0x1800, 0x1800 + PDOS)}
)
_DEFAULT_OUT = (0x6040_0010, 0x607A_0020, 0x60B1_0020, 0x60B2_0010)
_DEFAULT_IN = (0x6041_0010, 0x6064_0020, 0x606C_0020, 0x6077_0010)
_U8, _U16, _U32 = "0x0005", "0x0006", "0x0007"
_VARIABLE, _ARRAY, _RECORD = 7, 8, 9
_SYNC_TYPES = 0x0002 | 0x0004
"""1C32h:4: synchronous to the sync manager, and to SYNC0."""
BY_SYNC0 = 2
"""1C32h:1 of a drive that acts at SYNC0; 0 means free run, 1 synchronous to frames. The behaviour
is set by the clock's own registers.
"""
MIN_CYCLE = 100_000
"""1C32h:5 [ns]."""
CYCLE_MAX = 1_000_000_000
"""Maximum cycle of a drive [ns]."""
_SYNC_FIELDS = (
    ("Synchronization type", _U16, 1),
    ("Cycle time", _U32, 0),
    ("Shift time", _U32, 0),
    ("Synchronization types supported", _U16, _SYNC_TYPES),
    ("Minimum cycle time", _U32, MIN_CYCLE),
    ("Calc and copy time", _U32, 0),
)


@dataclass(frozen=True, slots=True)
class EntryDescription:
    """Entry of an object in SDO information and device descriptions."""

    entry: Entry
    name: str
    data_type: int

    @property
    def bits(self) -> int:
        """Width of the entry [bits]; of a text, the width of its default."""
        default = self.entry.default
        return 8 * (len(default) if isinstance(default, bytes) else self.entry.size)


@dataclass(frozen=True, slots=True)
class ObjectDescription:
    """Object with its entries by sub-index."""

    index: int
    name: str
    code: int
    entries: dict[int, EntryDescription]

    @property
    def data_type(self) -> int:
        """Data type of a variable or of an array's elements; 0 for a record."""
        if self.code == _RECORD:
            return 0
        return self.entries[max(self.entries) and 1].data_type


@dataclass(frozen=True, slots=True)
class PdoEntry:
    """Mapped object; without index a filler."""

    index: int
    subindex: int
    size: int
    data_type: int


@dataclass(frozen=True, slots=True)
class Pdo:
    """Mapping after power-on."""

    index: int
    name: str
    entries: tuple[PdoEntry, ...]

    @property
    def size(self) -> int:
        """Size in bytes."""
        return sum(entry.size for entry in self.entries)


@dataclass(frozen=True, slots=True)
class DriveObjects:
    """All objects visible on the bus, by index."""

    objects: dict[int, ObjectDescription]

    def assigned(self, index: int) -> list[Pdo]:
        """Return the mappings assigned by 1C12h or 1C13h after power-on."""
        return [
            self.pdo(number)
            for number in self._defaults(index)
            if number  # an assignment without mapping is a gap
        ]

    def pdo(self, index: int) -> Pdo:
        """Return a mapping after power-on."""
        mapped = tuple(self._mapped(number) for number in self._defaults(index))
        return Pdo(index, self.objects[index].name, mapped)

    def _mapped(self, number: int) -> PdoEntry:
        index, subindex = number >> 16, number >> 8 & 0xFF
        found = self.objects[index].entries[subindex]
        return PdoEntry(index, subindex, found.entry.size, found.data_type)

    def _defaults(self, index: int) -> list[int]:
        entries = self.objects[index].entries
        return [int(entries[n].entry.default) for n in range(1, int(entries[0].entry.default) + 1)]


def strip_can(personality: Personality) -> Personality:
    """Return a personality without the deviations of CAN objects."""
    objects = tuple(change for change in personality.objects if change.index not in _CAN_ONLY)
    missing = tuple(index for index in personality.missing if index not in _CAN_ONLY)
    return personality.model_copy(update={"objects": objects, "missing": missing})


@functools.cache
def coe_eds(personality: Personality = PLAIN) -> str:
    """Return a drive's EDS on EtherCAT, for a personality from `strip_can`."""
    text = _convert_eds(drive_eds())
    return text if personality == PLAIN else variant(text, personality)


@functools.cache
def coe_entries(personality: Personality = PLAIN) -> dict[int, Entry]:
    """Return all entries visible on the bus of a drive on EtherCAT, by `key`."""
    return parse_entries(coe_eds(personality))


@functools.cache
def drive_objects(personality: Personality = PLAIN) -> DriveObjects:
    """Return a drive's objects with their names."""
    file = io.StringIO(coe_eds(personality))
    file.name = "drive.eds"
    entries = coe_entries(personality)
    found = {}
    for index, thing in canopen.import_od(file).items():
        if index < 0x1000:
            continue
        members = [thing] if isinstance(thing, ODVariable) else list(thing.values())
        described = {
            member.subindex: EntryDescription(
                entries[key(index, member.subindex)],
                member.name if member is thing else member.name.rsplit(".", 1)[-1],
                member.data_type or datatypes.UNSIGNED32,
            )
            for member in members
        }
        found[index] = ObjectDescription(index, thing.name, _code(thing), described)
    return DriveObjects(found)


def _code(thing: object) -> int:
    if isinstance(thing, ODVariable):
        return _VARIABLE
    return _ARRAY if isinstance(thing, canopen.objectdictionary.ODArray) else _RECORD


def _convert_eds(text: str) -> str:
    eds = configparser.RawConfigParser()
    eds.optionxform = str  # type: ignore[assignment,method-assign]
    eds.read_string(text)
    for section in eds.sections():
        whole = section.split("sub")[0]
        if len(whole) == 4 and int(whole, 16) in _CAN_ONLY:
            eds.remove_section(section)
    for base, mapped in ((RECEIVED, _DEFAULT_OUT), (SENT, _DEFAULT_IN)):
        eds[f"{base:04X}sub0"]["DefaultValue"] = str(len(mapped))
        for subindex, number in enumerate(mapped, start=1):
            eds[f"{base:04X}sub{subindex:X}"]["DefaultValue"] = f"0x{number:08X}"
    _add(
        eds,
        0x1C00,
        "Sync manager type",
        _ARRAY,
        "ro",
        [(f"Sync manager {n - 1}", _U8, n) for n in (1, 2, 3, 4)],
    )
    for index, base, name in ((ASSIGNED_OUT, RECEIVED, "RxPDO"), (ASSIGNED_IN, SENT, "TxPDO")):
        numbers = [(f"{name} {n + 1}", _U16, 0 if n else base) for n in range(PDOS)]
        _add(eds, index, f"{name} assign", _ARRAY, "rw", numbers)
        eds[f"{index:04X}sub0"].update(AccessType="rw", DefaultValue="1", HighLimit=str(PDOS))
    for index, name in ((SYNC_OUT, "Output"), (SYNC_IN, "Input")):
        fields = list(_SYNC_FIELDS)
        _add(eds, index, f"{name} sync manager parameter", _RECORD, "ro", fields)
        for written in (1, 2):
            eds[f"{index:04X}sub{written}"]["AccessType"] = "rw"
    return _written(eds)


def _add(
    eds: configparser.RawConfigParser,
    index: int,
    name: str,
    kind: int,
    access: str,
    fields: list[tuple[str, str, int]],
) -> None:
    """Add an object with sub-indices, given by name, data type and default."""
    whole = f"{index:04X}"
    eds[whole] = {
        "ParameterName": name,
        "ObjectType": f"0x{kind:X}",
        "SubNumber": str(len(fields) + 1),
    }
    count = ("Highest sub-index supported", _U8, len(fields))
    for subindex, (label, data_type, default) in enumerate([count, *fields]):
        eds[f"{whole}sub{subindex:X}"] = {
            "ParameterName": label,
            "ObjectType": f"0x{_VARIABLE:X}",
            "DataType": data_type,
            "AccessType": access if subindex else "ro",
            "DefaultValue": str(default),
            "PDOMapping": "0",
        }


def _written(eds: configparser.RawConfigParser) -> str:
    list_objects(eds)
    text = io.StringIO()
    eds.write(text, space_around_delimiters=False)
    return text.getvalue()
