"""Slave descriptions (ESI): files written by the plant are read back, or refused with a reason."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from checked_files.yaml_file import FileError
from drivers.cia402 import objects
from drivers.dictionary.review import review
from drivers.ethercat.esi_file import read_esi
from drivers.ethercat.rules import RULES
from drivers.operator_tools.draft_values import acceleration_unit, velocity_unit
from hil.cli import app
from sim_plant.__main__ import app as plant

if TYPE_CHECKING:
    from pathlib import Path

ARRAY = """
<EtherCATInfo><Vendor><Id>#x29C</Id><Name>Maker</Name></Vendor><Descriptions><Devices><Device>
<Type ProductCode="#x10" RevisionNo="2">Drive</Type><Profile><ProfileNo>402</ProfileNo><Dictionary>
<DataTypes>
 <DataType><Name>DT1C12ARR</Name><BaseType>UINT</BaseType><BitSize>48</BitSize>
  <ArrayInfo><LBound>1</LBound><Elements>3</Elements></ArrayInfo></DataType>
 <DataType><Name>DT1C12</Name><BitSize>64</BitSize>
  <SubItem><SubIdx>0</SubIdx><Name>Count</Name><Type>USINT</Type></SubItem>
  <SubItem><Name>Elements</Name><Type>DT1C12ARR</Type><Flags><Access>rw</Access></Flags></SubItem>
 </DataType>
</DataTypes>
<Objects>
 <Object><Index>#x1C12</Index><Name>Assignment</Name><Type>DT1C12</Type>
  <Info><SubItem><Name>Count</Name><Info><DefaultData>02</DefaultData></Info></SubItem>
   <SubItem><Name>1</Name><Info><DefaultData>0016</DefaultData></Info></SubItem></Info></Object>
 <Object><Index>24577</Index><Name>Number</Name><Type>INT</Type>
  <Info><DefaultValue>-3</DefaultValue></Info>
  <Flags><Access>ro</Access><PdoMapping>t</PdoMapping></Flags></Object>
</Objects></Dictionary></Profile></Device></Devices></Descriptions></EtherCATInfo>
"""


def described(folder: Path, *options: str) -> Path:
    path = folder / "slave.xml"
    done = CliRunner().invoke(plant, ["esi", "--axis", "1", "-o", str(path), *options])
    assert done.exit_code == 0, done.output
    return path


@pytest.mark.parametrize("personality", ["plain", "bare", "int32-current", "fixed-pdos"])
def test_a_drive_that_serves_is_read_as_one(tmp_path: Path, personality: str) -> None:
    options = () if personality == "plain" else ("--personality", personality)
    found = read_esi(described(tmp_path, *options), 3)
    assert (found.vendor, found.product, found.revision) == (0x4D2, 0x402, 0x10000)
    seen = review(found, RULES)
    assert seen.profile == 402
    assert seen.current is not None
    assert found.node == 3


def test_arrays_are_expanded(tmp_path: Path) -> None:
    path = tmp_path / "drive.xml"
    path.write_text(ARRAY)
    found = read_esi(path)
    members = {
        each.subindex: (each.type, each.access, each.default) for each in found.members(0x1C12)
    }
    assert members == {
        0: ("u8", None, 2),
        1: ("u16", "rw", 0x1600),
        2: ("u16", "rw", None),
        3: ("u16", "rw", None),
    }
    number = found.find(0x6001)
    assert number is not None
    assert (number.type, number.access, number.mappable, number.default) == ("i16", "ro", True, -3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<EtherCATConfig/>", "not <EtherCATInfo>"),
        ("<EtherCATInfo/>", "none of its 0 devices has an object dictionary"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><EtherCATInfo/>", "declares an entity"),
        ("no xml", "invalid XML"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "drive.xml"
    path.write_text(text)
    with pytest.raises(FileError, match=message):
        read_esi(path)


@given(
    changes=st.lists(
        st.tuples(st.integers(0, len(ARRAY) - 1), st.sampled_from('<>/#x0 "A')), max_size=5
    )
)
def test_damaged_files_are_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, changes: list[tuple[int, str]]
) -> None:
    text = list(ARRAY)
    for place, letter in changes:
        text[place] = letter
    path = tmp_path_factory.getbasetemp() / "damaged.xml"
    path.write_text("".join(text))
    try:
        assert read_esi(path).entries is not None
    except FileError:
        return


def test_a_drives_file_is_drafted(tmp_path: Path) -> None:
    output = tmp_path / "drives.yaml"
    arguments = ["drives", "new", "--esi", str(described(tmp_path)), "--nodes", "1-2"]
    done = CliRunner().invoke(app, [*arguments, "-o", str(output)])
    assert done.exit_code == 0, done.output
    text = output.read_text()
    assert text.count("product: 0x402") == 2
    assert "bitrate: 1000000" in text


UNITS = """
<EtherCATInfo><Vendor><Id>#x29C</Id></Vendor><Descriptions><Devices><Device>
<Type ProductCode="#x10" RevisionNo="2">Drive</Type><Profile><ProfileNo>402</ProfileNo><Dictionary>
<DataTypes/><Objects>
 <Object><Index>#x6064</Index><Name>Position</Name><Type>DINT</Type>
  <Info><Unit>#x00B50000</Unit></Info><Flags><Access>ro</Access></Flags></Object>
 <Object><Index>#x6081</Index><Name>Velocity</Name><Type>UDINT</Type>
  <Info><Unit>#xFFB44700</Unit></Info><Flags><Access>rw</Access></Flags></Object>
 <Object><Index>#x6083</Index><Name>Acceleration</Name><Type>UDINT</Type>
  <Info><Unit>#x00B55700</Unit></Info><Flags><Access>rw</Access></Flags></Object>
</Objects></Dictionary></Profile>
<RxPdo><Index>#x1600</Index><Entry><Index>#x6040</Index><SubIndex>0</SubIndex><BitLen>16</BitLen>
 <Name>Controlword</Name><DataType>UINT</DataType></Entry><Entry><Index>0</Index><BitLen>8</BitLen>
 </Entry></RxPdo>
<TxPdo><Index>#x1A00</Index><Entry><Index>#x6041</Index><SubIndex>0</SubIndex><BitLen>16</BitLen>
 <Name>Statusword</Name><DataType>UINT</DataType></Entry></TxPdo>
</Device></Devices></Descriptions></EtherCATInfo>
"""


def test_units_of_objects_fill_the_draft_and_what_default_pdos_carry_is_there(
    tmp_path: Path,
) -> None:
    path = tmp_path / "units.xml"
    path.write_text(UNITS)
    found = read_esi(path)
    assert velocity_unit(found).value == "0.1 rpm"
    assert acceleration_unit(found).value == "inc/s^2"
    assert found.value(objects.POSITION_UNIT) == 0x00B50000
    assert "states the unit of 6081 as FFB44700h: taken as 60A9" in found.notes
    control, status = found.find(0x6040), found.find(0x6041)
    assert control is not None
    assert status is not None
    assert (control.type, control.writable, control.mappable) == ("u16", True, True)
    assert (status.type, status.writable, status.mappable) == ("u16", False, True)
    assert found.find(0) is None
