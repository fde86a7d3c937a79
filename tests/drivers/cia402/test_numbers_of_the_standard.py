"""Bits, modes and objects of the profile equal the standard's numbers, repeated here."""

from __future__ import annotations

import canopen
from canopen.objectdictionary import ODVariable, datatypes

from drivers.cia402 import objects
from drivers.cia402.states import Control, Mode, Status
from drivers.fieldbus import Entry
from sim_plant.canopen.eds import EDS_PATH

TYPES = {
    datatypes.INTEGER8: "i8",
    datatypes.INTEGER16: "i16",
    datatypes.INTEGER32: "i32",
    datatypes.UNSIGNED8: "u8",
    datatypes.UNSIGNED16: "u16",
    datatypes.UNSIGNED32: "u32",
}
ON_NO_DATA_SHEET = {
    (0x607B, 1): "i32",
    (0x607B, 2): "i32",
    (0x607E, 0): "u8",
    (0x6093, 1): "u32",
    (0x6093, 2): "u32",
    (0x6096, 1): "u32",
    (0x6096, 2): "u32",
    (0x6097, 1): "u32",
    (0x6097, 2): "u32",
    (0x60A8, 0): "u32",
    (0x60A9, 0): "u32",
    (0x60AA, 0): "u32",
}
"""Objects of CiA 402-2 that some drives have, but not the simulated one."""


def test_bits_of_the_statusword_are_those_of_the_standard() -> None:
    assert {bit.name: bit.value for bit in Status} == {
        "VOLTAGE_ENABLED": 0x0010,
        "WARNING": 0x0080,
        "REMOTE": 0x0200,
        "TARGET_REACHED": 0x0400,
        "INTERNAL_LIMIT": 0x0800,
        "SET_POINT_ACKNOWLEDGE": 0x1000,
        "FOLLOWING_ERROR": 0x2000,
    }


def test_bits_of_the_controlword_are_those_of_the_standard() -> None:
    assert {bit.name: bit.value for bit in Control} == {
        "NEW_SET_POINT": 0x0010,
        "CHANGE_IMMEDIATELY": 0x0020,
        "RELATIVE": 0x0040,
        "HALT": 0x0100,
    }


def test_modes_and_their_bits_in_the_supported_modes_are_those_of_the_standard() -> None:
    assert {mode.name: (mode.value, mode.supported_bit) for mode in Mode} == {
        "PROFILE_POSITION": (1, 0x001),
        "VELOCITY": (2, 0x002),
        "PROFILE_VELOCITY": (3, 0x004),
        "PROFILE_TORQUE": (4, 0x008),
        "HOMING": (6, 0x020),
        "INTERPOLATED_POSITION": (7, 0x040),
        "CYCLIC_POSITION": (8, 0x080),
        "CYCLIC_VELOCITY": (9, 0x100),
        "CYCLIC_TORQUE": (10, 0x200),
    }


def test_every_object_has_the_place_and_type_that_a_drive_s_data_sheet_states() -> None:
    sheet = canopen.import_od(str(EDS_PATH))
    stated = ON_NO_DATA_SHEET | {
        (variable.index, variable.subindex): TYPES[variable.data_type]
        for entry in sheet.values()
        for variable in ([entry] if isinstance(entry, ODVariable) else entry.values())
        if variable.data_type in TYPES
    }
    used = {
        (entry.index, entry.subindex): entry.type
        for entry in vars(objects).values()
        if isinstance(entry, Entry)
    }
    assert used == {place: stated.get(place) for place in used}
    assert used.keys() >= ON_NO_DATA_SHEET.keys()
