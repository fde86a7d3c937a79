"""Data sheets of makers: harmless defects are accepted, others are refused with their place."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from data_sheets import GENERAL, sheet
from hypothesis import given
from hypothesis import strategies as st

from checked_files.yaml_file import FileError
from drivers.canopen.eds_file import parse_eds, read_eds
from drivers.canopen.rules import RULES
from drivers.dictionary.review import review
from drivers.operator_tools.draft_values import also_named

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from drivers.dictionary.dictionary import Dictionary


def parsed(text: str, node: int | None = None) -> Dictionary:
    return parse_eds(text.encode(), "drive.eds", node)


def test_types_access_limits_and_identity_are_read() -> None:
    found = parsed(sheet({(0x6083, 0): {"LowLimit": 1, "HighLimit": "0xFFFFFFFF"}}))
    acceleration = found.find(0x6083)
    assert acceleration is not None
    assert (acceleration.type, acceleration.access) == ("u32", "rw")
    assert (acceleration.low, acceleration.high) == (1, 0xFFFFFFFF)
    assert (found.vendor, found.product, found.revision) == (0x4D2, 0x402, None)
    assert (found.maker, found.model) == ("Nobody & Co", "Drive of nowhere")
    assert found.bitrates == (500_000, 1_000_000)
    assert found.notes == ()


def test_a_configuration_file_tells_node_bit_rate_and_values() -> None:
    found = parsed(sheet({(0x6075, 0): {"ParameterValue": 2583}}, node=0x11))
    current = found.find(0x6075)
    assert current is not None
    assert (found.node, found.bitrate) == (17, 500_000)
    assert (current.value, current.default) == (2583, 5000)


@pytest.mark.parametrize(
    ("written", "read"),
    [
        ("$NODEID+0x180", 0x183),
        ("0x180+$NODEID", 0x183),
        ("$NodeID + 0x180", 0x183),
        ("0x40000180 + $nodeid", 0x40000183),
        ("$NODEID", 3),
        ("384", 384),
        ("0x180", 0x180),
        ("180h", 0x180),
        ("0600", 0o600),
        ("0x180 ; of TPDO 1", 0x180),
        ('"384"', 384),
        ("0x180U", 0x180),
        ("", None),
    ],
)
def test_numbers_are_read_in_every_notation(written: str, read: int | None) -> None:
    entry = parsed(sheet({(0x1800, 1): {"DefaultValue": written}}), node=3).find(0x1800, 1)
    assert entry is not None
    assert entry.default == read


def test_the_node_is_left_open_where_nobody_knows_it() -> None:
    entry = parsed(sheet()).find(0x1800, 1)
    assert entry is not None
    assert entry.default is None


@pytest.mark.parametrize(
    ("written", "read"), [("0xFFFF", -1), ("-1", -1), ("0x8000", -32768), ("5", 5), ("65535", -1)]
)
def test_hex_numbers_take_their_sign_from_the_type(written: str, read: int) -> None:
    entry = parsed(sheet({(0x605A, 0): {"DefaultValue": written}})).find(0x605A)
    assert entry is not None
    assert entry.default == read


def lower(text: str) -> str:
    return "\n".join(
        line.lower() if line.startswith("[") else line for line in text.splitlines()
    ).replace("PDOMapping", "pdomapping")


@pytest.mark.parametrize(
    "habit",
    [
        lambda text: text.encode(),
        lambda text: lower(text).encode(),
        lambda text: text.upper().replace("$NODEID", "$NodeId").encode(),
        lambda text: text.replace("\n", "\r\n").encode(),
        lambda text: b"\xef\xbb\xbf" + text.encode(),
        lambda text: text.encode("utf-16"),
        lambda text: text.replace("Nobody & Co", "Müller GmbH").encode("latin-1"),
        lambda text: text.replace("sub", "Sub").replace("=", " = ").encode(),
        lambda text: ("; made by hand\n\n" + text + "\nnonsense\n").encode(),
        lambda text: text.replace("ObjectType=0x9", "ObjectType=0x8").encode(),
        lambda text: text.replace("ObjectType=0x7\n", "").encode(),
        lambda text: (text + "\n[6041]\nParameterName=Status\nDataType=0x0006\n").encode(),
        lambda text: text.replace("AccessType=rw\n", "AccessType=RW\n").encode(),
        lambda text: text.replace("[FileInfo]\nFileName=drive.eds\n", "").encode(),
    ],
)
def test_harmless_habits_change_nothing(habit: Callable[[str], bytes]) -> None:
    plain = review(parsed(sheet()), RULES)
    found = review(parse_eds(habit(sheet()), "drive.eds"), RULES)
    assert found.serves
    assert found.modes == plain.modes
    assert found.findings == plain.findings
    assert found.current is not None
    assert found.current.declared.index == 0x6078


def test_default_and_limits_of_a_real_number_are_kept() -> None:
    text = sheet() + (
        "\n[2345]\nParameterName=Torque constant\nDataType=0x0008\nAccessType=rw\n"
        "DefaultValue=0.0365\nLowLimit=0\nHighLimit=1.5e1\n"
    )
    found = parsed(text).find(0x2345)
    assert found is not None
    assert (found.type, found.reals) == ("f32", (None, 0.0365, 0.0, 15.0))
    assert "0.0365 by default" in also_named(parsed(text), "torque_constant")


def test_a_section_that_stands_twice_is_merged_and_noted() -> None:
    found = parsed(sheet() + "\n[6041]\nDataType=0x0006\nDefaultValue=64\n")
    assert found.notes == ("stated twice and merged: [6041]",)


def test_a_section_that_contradicts_itself_is_refused_when_it_is_needed() -> None:
    found = parsed(sheet() + "\n[6041]\nDataType=0x0007\n")
    with pytest.raises(FileError, match=r"drive\.eds:\d+: \[6041\] stated twice: DataType=0x0006"):
        review(found, RULES)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("DataType", "0xZZ", "DataType: '0xZZ' is not a number"),
        ("DataType", "UNSIGNED32", "DataType: 'UNSIGNED32' is not a number; state 0x0007"),
        ("AccessType", "sometimes", "AccessType=sometimes is none of const, ro"),
        ("DefaultValue", "many", "DefaultValue: 'many' is not a number"),
        ("DefaultValue", "0x1FFFFFFFF", "does not fit 32 bits"),
    ],
)
def test_what_cannot_be_understood_is_told_with_file_line_and_section(
    key: str, value: str, message: str
) -> None:
    text = sheet({(0x6081, 0): {key: value}})
    line = text.splitlines().index("[6081]") + 1
    with pytest.raises(FileError) as stated:
        review(parsed(text), RULES)
    assert str(stated.value).startswith(f"drive.eds:{line}: [6081] ")
    assert message in str(stated.value)


def test_nonsense_about_an_object_that_nobody_needs_harms_nobody() -> None:
    assert review(parsed(sheet({(0x2345, 0): {"DataType": "real"}})), RULES).serves


def test_listed_objects_without_a_section_are_taken_as_the_standard_has_them() -> None:
    text = sheet({(0x6084, 0): None}) + "\n[OptionalObjects]\nSupportedObjects=1\n1=0x6084\n"
    found = parsed(text)
    assert found.find(0x6084) is not None
    assert found.notes == ("lists 6084 without a description: that of the standard is used",)


def test_arrays_may_be_written_in_short() -> None:
    text = sheet({(0x1016, 1): None}) + (
        "\n[1016]\nParameterName=Consumer heartbeat\nObjectType=8\nDataType=7\nAccessType=rw\n"
        "CompactSubObj=3\n\n[1016Name]\nNrOfEntries=1\n2=second\n\n[1016Value]\n1=0x7F01F4\n"
    )
    found = parsed(text)
    first, second = found.find(0x1016, 1), found.find(0x1016, 2)
    assert first is not None
    assert second is not None
    assert (first.type, first.value) == ("u32", 0x7F01F4)
    assert second.name == "Consumer heartbeat: second"


def test_types_of_the_device_s_own_are_looked_up() -> None:
    text = sheet({(0x6081, 0): {"DataType": "0x00A0"}}) + "\n[A0sub1]\nDefaultValue=0x07\n"
    entry = parsed(text).find(0x6081)
    assert entry is not None
    assert entry.type == "u32"


def test_an_object_that_a_pdo_carries_can_be_mapped_whatever_the_sheet_says() -> None:
    mapped = {"DefaultValue": "0x60640020"}
    found = parsed(sheet({(0x6064, 0): {"PDOMapping": 0}, (0x1A00, 1): mapped}))
    entry = found.find(0x6064)
    assert entry is not None
    assert entry.mappable


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        (b"", "is empty"),
        (b"\x7fELF\0\0", "is not text"),
        (b"<?xml version='1.0'?>", "is XML (an XDD or ESI file)"),
        (GENERAL.encode(), "has no object section such as [1000]"),
        (b"bitrate: 1000000\n", "has no object section"),
    ],
)
def test_files_that_are_no_data_sheet_are_refused(raw: bytes, message: str) -> None:
    with pytest.raises(FileError) as stated:
        parse_eds(raw, "drive.eds")
    assert str(stated.value).startswith("drive.eds: ")
    assert message in str(stated.value)


def test_a_file_that_is_not_there_is_told_by_name(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"none\.eds: cannot be read: No such file"):
        read_eds(tmp_path / "none.eds")


def outcome(raw: bytes) -> str:
    """Return the result of a file: a review, or a problem."""
    try:
        return review(parse_eds(raw, "drive.eds"), RULES).source
    except FileError as error:
        return str(error)


@given(st.binary(max_size=300))
def test_any_bytes_give_a_review_or_an_error_with_the_file(raw: bytes) -> None:
    assert outcome(raw).startswith("drive.eds")


LINES = sheet().splitlines()
Edit = tuple[int, str]


@given(st.lists(st.tuples(st.integers(0, len(LINES) - 1), st.text(max_size=30)), max_size=6))
def test_any_damage_to_a_sheet_gives_a_review_or_an_error_with_the_file(edits: list[Edit]) -> None:
    lines = list(LINES)
    for line, text in edits:
        key = lines[line].partition("=")[0]
        lines[line] = f"{key}={text}" if len(text) % 2 else text
    assert outcome("\n".join(lines).encode()).startswith("drive.eds")
