"""Strict readers accept the data sheets of all virtual drives without a message.

Three independent readers were tried: canopen, which these tests use; node-canopen, which refuses a
DOMAIN with PDOMapping; dcf-tools (`dcfchk`), which these tests use where it is installed.
"""

from __future__ import annotations

import configparser
import logging
import re
import warnings
from typing import TYPE_CHECKING

import canopen
import pytest

from sim_plant.canopen.eds import drive_eds
from sim_plant.canopen.multi_axis import multi_axis_eds
from sim_plant.personality import load_personality, packaged_personalities

if TYPE_CHECKING:
    from pathlib import Path

SHEETS = {
    "plain": drive_eds,
    "three axes": lambda: multi_axis_eds([drive_eds()] * 3),
    **{
        name: lambda name=name: drive_eds(load_personality(name))
        for name in packaged_personalities()
    },
}
DOMAIN = 0x0F
BITS = {2: 8, 3: 16, 4: 32, 5: 8, 6: 16, 7: 32}
SIGNED = (2, 3, 4)
every_sheet = pytest.mark.parametrize("sheet", SHEETS)


def parsed(sheet: str) -> configparser.RawConfigParser:
    eds = configparser.RawConfigParser(strict=True)
    eds.optionxform = str  # type: ignore[assignment,method-assign]
    eds.read_string(SHEETS[sheet]())
    return eds


def numbers(eds: configparser.RawConfigParser) -> dict[str, configparser.SectionProxy]:
    named = {name: eds[name] for name in eds.sections() if re.match(r"[0-9A-F]{4}", name)}
    return {name: each for name, each in named.items() if "DataType" in each}


@every_sheet
def test_nothing_is_said_of_mapping_where_nothing_can_be_mapped(sheet: str) -> None:
    domains = [s for s in numbers(parsed(sheet)).values() if int(s["DataType"], 0) == DOMAIN]
    assert domains
    assert not any("PDOMapping" in section for section in domains)


@every_sheet
def test_defaults_are_within_limits_and_limits_within_types(sheet: str) -> None:
    checked = 0
    for name, section in numbers(parsed(sheet)).items():
        kind, default = int(section["DataType"], 0), section.get("DefaultValue", "")
        if kind not in BITS or not default or "$NODEID" in default:
            continue
        bits = BITS[kind]
        least, most = (-(1 << bits - 1), (1 << bits - 1) - 1) if kind in SIGNED else (
            0, (1 << bits) - 1
        )  # fmt: skip
        low = int(section.get("LowLimit") or str(least), 0)
        high = int(section.get("HighLimit") or str(most), 0)
        assert least <= low <= int(default, 0) <= high <= most, name
        checked += 1
    assert checked > 100


@every_sheet
def test_the_numbers_of_pdos_are_those_declared(sheet: str) -> None:
    eds = parsed(sheet)
    for direction, first, last in (("RX", "1400", "15FF"), ("TX", "1800", "19FF")):
        declared = [n for n in eds.sections() if len(n) == 4 and first <= n <= last]
        assert int(eds["DeviceInfo"][f"NrOf{direction}PDO"]) == len(declared)


@every_sheet
def test_canopen_reads_it_without_a_message(
    sheet: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "drive.eds"
    path.write_text(SHEETS[sheet]())
    with caplog.at_level(logging.WARNING):
        assert 0x1018 in canopen.import_od(str(path), node_id=5)
    assert caplog.records == []


@every_sheet
def test_dcf_tools_finds_nothing_to_say(sheet: str, tmp_path: Path) -> None:
    parse_file = pytest.importorskip("dcf.parse").parse_file
    lint, device = pytest.importorskip("dcf.lint").lint, pytest.importorskip("dcf.device")
    path = tmp_path / "drive.eds"
    path.write_text(SHEETS[sheet]())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        config = parse_file(str(path))
        assert lint(config)
        device.Device(config, {"NODEID": 5})
