"""The description (ESI) of a drive matches the slave's services, in the form required by tools."""

from __future__ import annotations

import os
from pathlib import Path
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

from sim_plant.__main__ import app
from sim_plant.ethercat.objects import coe_entries, drive_objects, strip_can
from sim_plant.personality import load_personality, packaged_personalities

SCHEMA = "ETHERCAT_SCHEMA"
"""Variable that names the folder of EtherCATInfo.xsd, which may not be redistributed."""


def written(path: Path, *options: str) -> ElementTree.Element:
    done = CliRunner().invoke(app, ["esi", "--axis", "1", "-o", str(path), *options])
    assert done.exit_code == 0, done.output
    return ElementTree.parse(path).getroot()  # noqa: S314 - our own


def number(element: ElementTree.Element | None) -> int:
    assert element is not None
    return int((element.text or "").replace("#x", "0x"), 0)


def test_it_states_identity_objects_and_process_data_of_the_slave(tmp_path: Path) -> None:
    root = written(tmp_path / "slave.xml")
    device = root.find(".//Device")
    assert device is not None
    assert number(root.find("Vendor/Id")) == 0x4D2
    assert {number(o.find("Index")) for o in device.iter("Object")} == {
        entry.index for entry in coe_entries().values()
    }
    assert [sm.get("DefaultSize") for sm in device.iter("Sm")] == ["512", "512", "12", "12"]
    for tag, base in (("RxPdo", 0x1600), ("TxPdo", 0x1A00)):
        pdos = device.findall(tag)
        assert [number(pdo.find("Index")) for pdo in pdos] == [base + n for n in range(4)]
        assert [pdo.get("Sm") is not None for pdo in pdos] == [True, False, False, False]
        for pdo in pdos:
            mapped = drive_objects().pdo(number(pdo.find("Index"))).entries
            assert [number(entry.find("Index")) for entry in pdo.findall("Entry")] == [
                entry.index for entry in mapped
            ]


@pytest.mark.parametrize("name", packaged_personalities())
def test_every_personality_has_one(name: str, tmp_path: Path) -> None:
    root = written(tmp_path / "slave.xml", "--personality", name)
    objects = drive_objects(strip_can(load_personality(name))).objects
    assert len(list(root.iter("Object"))) == len(objects)


def test_an_axis_that_there_is_not_is_refused(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["esi", "--axis", "7", "-o", str(tmp_path / "slave.xml")])
    assert done.exit_code == 1
    assert "--axis 7: must be at most 6" in done.output


@pytest.mark.skipif(SCHEMA not in os.environ, reason=f"{SCHEMA} names no folder of schemas")
@pytest.mark.parametrize("name", [None, *packaged_personalities()])
def test_it_fits_the_schema(name: str | None, tmp_path: Path) -> None:
    etree = pytest.importorskip("lxml.etree", reason="lxml is not installed: pip install lxml")
    schema = etree.XMLSchema(etree.parse(str(Path(os.environ[SCHEMA]) / "EtherCATInfo.xsd")))
    path = tmp_path / "slave.xml"
    written(path, *(["--personality", name] if name else []))
    assert schema.validate(etree.parse(str(path))), schema.error_log
