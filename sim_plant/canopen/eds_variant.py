"""EDS of a drive with a personality: the plant's EDS with the deviations applied.

The drive is built from the resulting text and hands it out as 1021h, so a drive always agrees with
its EDS.
"""

from __future__ import annotations

import configparser
import io
import re
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError
from sim_plant.personality import ObjectChange

if TYPE_CHECKING:
    from collections.abc import Iterable

    from sim_plant.personality import Personality

VELOCITIES = (0x6081, 0x607F)
ACCELERATIONS = (0x6083, 0x6084, 0x6085, 0x60C5, 0x60C6)
PER_RPM = {"inc/s": None, "rpm": 1, "0.1 rpm": 10, "inc/s^2": None, "rpm/s": 1, "0.1 rpm/s": 10}
"""Number of a drive's units in one revolution per minute; None for units in increments."""

_MAPPINGS = tuple(base + number for base in (0x1600, 0x1A00) for number in range(4))
_CURRENT = 0x6078
_NO_LIMIT = 0xFFFF_FFFF
_TYPES = ("i8", "i16", "i32", "u8", "u16", "u32")
_DATA_TYPES = {name: f"0x{code:04X}" for code, name in enumerate((*_TYPES, "f32"), start=2)}
_KEYS = {"access": "AccessType", "default": "DefaultValue", "low": "LowLimit", "high": "HighLimit"}


def variant(base: str, personality: Personality) -> str:
    """Apply a personality to the text of an EDS.

    Raises
    ------
    FileError
        The personality changes an object that neither exists nor is declared completely.
    """
    eds = configparser.RawConfigParser()
    eds.optionxform = str  # type: ignore[assignment,method-assign]
    eds.read_string(base)
    eds["FileInfo"]["FileName"] = f"{personality.name}.eds"
    eds["Comments"]["Line1"] = (
        f"Position unit: {_position_unit(personality)}; velocity: "
        f"{personality.velocity_unit}; acceleration: {personality.acceleration_unit}."
    )
    _convert_units(eds, personality)
    _place_current(eds, personality)
    for subindex, end in enumerate(personality.position_range or (), start=1):
        _change(eds, _range_end(subindex, end), personality.name)
    for change in personality.objects:
        _change(eds, change, personality.name)
    for index in personality.missing:
        _remove(eds, index)
    _shape_mappings(eds, personality)
    list_objects(eds)
    text = io.StringIO()
    eds.write(text, space_around_delimiters=False)
    return text.getvalue()


def _range_end(subindex: int, end: int) -> ObjectChange:
    return ObjectChange(index=0x607B, subindex=subindex, type="i32", default=end)


def _position_unit(personality: Personality) -> str:
    if personality.counts_per_turn is None:
        return "one increment of the motor encoder"
    return f"1/{personality.counts_per_turn} revolution of the gear's output"


def _convert_units(eds: configparser.RawConfigParser, personality: Personality) -> None:
    per_revolution = int(eds["608Fsub1"]["DefaultValue"], 0)
    for indices, unit in (
        (VELOCITIES, personality.velocity_unit),
        (ACCELERATIONS, personality.acceleration_unit),
    ):
        per_rpm = PER_RPM[unit]
        if per_rpm is None:
            continue
        for index in indices:
            section = eds[f"{index:04X}"]
            value = int(section["DefaultValue"], 0)
            if value != _NO_LIMIT:
                section["DefaultValue"] = str(value * 60 * per_rpm // per_revolution)


def _place_current(eds: configparser.RawConfigParser, personality: Personality) -> None:
    current = personality.current
    if current is None or current.index != _CURRENT:
        _remove(eds, _CURRENT)
    if current is not None:
        section = _section(eds, current.index, current.subindex)
        if section not in eds:
            _declare(eds, current.index, current.subindex, "Current actual value", mappable=True)
        eds[section]["DataType"] = _DATA_TYPES[current.type]


def _change(eds: configparser.RawConfigParser, change: ObjectChange, name: str) -> None:
    section = _section(eds, change.index, change.subindex)
    if section not in eds:
        if change.type is None:
            raise FileError(
                f"personality {name}: the drive has no object "
                f"{change.index:04X}:{change.subindex:02X} to change; correct the index, or "
                "state a type to add the object"
            )
        _declare(eds, change.index, change.subindex, "Additional object", mappable=False)
    if change.type is not None:
        eds[section]["DataType"] = _DATA_TYPES[change.type]
    for key, option in _KEYS.items():
        value = getattr(change, key)
        if value is not None:
            eds[section][option] = str(value)
    if change.high is not None and change.default is None:  # a default must be within its limits
        present = eds[section].get("DefaultValue", "0")
        if present.isdecimal() and int(present) > change.high:
            eds[section]["DefaultValue"] = str(change.high)
    if change.plus_node:
        eds[section]["DefaultValue"] = f"$NODEID+0x{change.default or 0:X}"


def _section(eds: configparser.RawConfigParser, index: int, subindex: int) -> str:
    whole = f"{index:04X}"
    divided = f"{whole}sub0" in eds or (subindex and whole not in eds)
    return f"{whole}sub{subindex:X}" if divided else whole


def _declare(
    eds: configparser.RawConfigParser, index: int, subindex: int, name: str, *, mappable: bool
) -> None:
    """Add an entry, with its record if the entry has a sub-index."""
    whole = f"{index:04X}"
    entry = {"ParameterName": name, "ObjectType": "0x7", "DataType": "0x0007", "AccessType": "ro"}
    entry |= {"DefaultValue": "0", "PDOMapping": str(int(mappable))}
    if not subindex:
        eds[whole] = entry
        return
    eds[whole] = {"ParameterName": name, "ObjectType": "0x9"}
    eds[f"{whole}sub0"] = entry | {
        "ParameterName": "Highest sub-index supported",
        "DataType": "0x0005",
        "AccessType": "const",
        "DefaultValue": str(subindex),
        "PDOMapping": "0",
    }
    eds[f"{whole}sub{subindex:X}"] = entry
    subs = [section for section in eds.sections() if section.startswith(f"{whole}sub")]
    eds[whole]["SubNumber"] = str(len(subs))


def _remove(eds: configparser.RawConfigParser, index: int) -> None:
    whole = f"{index:04X}"
    for section in [name for name in eds.sections() if re.fullmatch(f"{whole}(sub.*)?", name)]:
        eds.remove_section(section)


def _shape_mappings(eds: configparser.RawConfigParser, personality: Personality) -> None:
    most = personality.mapping_entries
    for whole in (f"{index:04X}" for index in _MAPPINGS):
        if whole not in eds:
            continue
        if personality.mapping_arrays:
            eds[whole]["ObjectType"] = "0x8"
        count = eds[f"{whole}sub0"]
        number = int(count["DefaultValue"])
        mapped = [eds[f"{whole}sub{n:X}"] for n in range(1, number + 1)]
        known = all(_exists(eds, int(entry["DefaultValue"], 0)) for entry in mapped)
        if number > most or not known:
            count["DefaultValue"] = "0"
            for entry in mapped:
                entry["DefaultValue"] = "0"
        for number in range(most + 1, 9):
            eds.remove_section(f"{whole}sub{number:X}")
        eds[whole]["SubNumber"] = str(most + 1)
        count["HighLimit"] = str(most)


def _exists(eds: configparser.RawConfigParser, mapped: int) -> bool:
    index, subindex = mapped >> 16, mapped >> 8 & 0xFF
    return _section(eds, index, subindex) in eds


def list_objects(eds: configparser.RawConfigParser) -> None:
    """Rewrite the lists of objects of an EDS: mandatory, manufacturer-specific, optional."""
    indices = sorted(int(name, 16) for name in eds.sections() if re.fullmatch("[0-9A-F]{4}", name))
    mandatory = (0x1000, 0x1001, 0x1018)
    vendors = range(0x2000, 0x6000)
    _list(eds, "MandatoryObjects", (i for i in indices if i in mandatory))
    _list(eds, "ManufacturerObjects", (i for i in indices if i in vendors))
    others = (i for i in indices if i not in mandatory and i not in vendors)
    _list(eds, "OptionalObjects", others)


def _list(eds: configparser.RawConfigParser, section: str, indices: Iterable[int]) -> None:
    listed = {str(n): f"0x{index:04X}" for n, index in enumerate(indices, start=1)}
    eds[section] = {"SupportedObjects": str(len(listed)), **listed}
