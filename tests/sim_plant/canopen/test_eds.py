"""EDS of the drive: complete, consistent, and without unsupported objects."""

from __future__ import annotations

import configparser
import re
from typing import TYPE_CHECKING

import canopen
import pytest
from canopen.objectdictionary import ODArray, ODRecord, ODVariable

from sim_plant.canopen.eds import EDS_PATH, drive_entries

if TYPE_CHECKING:
    from desk import Desk

MASTERS_NEED = """
1000 1001 1003 1005 1006 1008 1009 100A 1014 1016 1017 1018 1200
1400 1401 1402 1403 1600 1601 1602 1603 1800 1801 1802 1803 1A00 1A01 1A02 1A03
6007 603F 6040 6041 605A 605B 605C 605D 605E 6060 6061 6062 6064 6065 6066 6067 6068 606C
6072 6073 6075 6076 6077 6078 607A 607D 607F 6080 6081 6083 6084 6085 6086 608F 6091 6092
60C2 60C5 60C6 60F4 6502
"""


@pytest.fixture(scope="module")
def eds() -> configparser.RawConfigParser:
    parser = configparser.RawConfigParser(strict=True)
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read_string(EDS_PATH.read_text(encoding="ascii"))
    return parser


@pytest.fixture(scope="module")
def dictionary() -> canopen.ObjectDictionary:
    return canopen.import_od(str(EDS_PATH), node_id=5)


@pytest.mark.parametrize("index", MASTERS_NEED.split())
def test_declares_every_object_that_masters_need(
    dictionary: canopen.ObjectDictionary, index: str
) -> None:
    assert int(index, 16) in dictionary


def test_lists_every_object_once_in_its_own_list(eds: configparser.RawConfigParser) -> None:
    listed = []
    for name, first, last in (
        ("MandatoryObjects", 0x1000, 0x1018),
        ("OptionalObjects", 0x1000, 0x9FFF),
        ("ManufacturerObjects", 0x2000, 0x5FFF),
    ):
        count = int(eds[name]["SupportedObjects"])
        indices = [int(eds[name][str(n)], 16) for n in range(1, count + 1)]
        assert all(first <= index <= last for index in indices)
        listed += indices
    objects = [int(name, 16) for name in eds.sections() if re.fullmatch("[0-9A-F]{4}", name)]
    assert sorted(listed) == sorted(objects)


def test_counts_the_sub_indices_of_every_array_and_record(
    eds: configparser.RawConfigParser,
) -> None:
    for name in eds.sections():
        if re.fullmatch("[0-9A-F]{4}", name) and eds[name]["ObjectType"] in ("0x8", "0x9"):
            subs = [s for s in eds.sections() if s.startswith(name + "sub")]
            assert int(eds[name]["SubNumber"]) == len(subs), name


def test_pdo_parameters_are_records_so_that_masters_find_their_entries(
    dictionary: canopen.ObjectDictionary,
) -> None:
    for base in (0x1400, 0x1600, 0x1800, 0x1A00):
        assert all(isinstance(dictionary[base + n], ODRecord) for n in range(4))


def test_defaults_lie_in_range_and_signed_ones_are_decimal(
    eds: configparser.RawConfigParser, dictionary: canopen.ObjectDictionary
) -> None:
    for thing in dictionary.values():
        for variable in [thing] if isinstance(thing, ODVariable) else thing.values():
            if variable.min is not None and variable.default is not None:
                assert variable.min <= variable.default <= variable.max
    for name in eds.sections():
        if eds[name].get("DataType") in ("0x0002", "0x0003", "0x0004"):
            for field in ("DefaultValue", "LowLimit", "HighLimit"):
                assert not eds[name].get(field, "0").startswith("0x")


def test_arrays_are_arrays(dictionary: canopen.ObjectDictionary) -> None:
    for index in (0x1003, 0x1016, 0x607D, 0x608F, 0x6091, 0x6092):
        assert isinstance(dictionary[index], ODArray)


def test_every_readable_entry_can_be_uploaded_in_its_declared_size(desk: Desk) -> None:
    dictionary = desk.network.nodes[0].dictionary
    for entry in drive_entries().values():
        if entry.index == 0x1003 and entry.subindex:
            continue  # an empty history returns nothing
        data = dictionary.upload(entry.index, entry.subindex)
        assert not entry.code or len(data) == entry.size


def test_every_node_hands_out_its_own_eds(master: canopen.Network) -> None:
    del master[2]
    node = master.add_node(2, upload_eds=True)
    assert node.object_dictionary[0x6041].name == "Statusword"
    assert node.sdo["Identity object"]["Serial number"].raw == 101
