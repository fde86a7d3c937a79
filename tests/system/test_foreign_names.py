"""Foreign names of robots, links, columns, drives and files add no key to our files.

Nor do they forge a line of a message. Harmless input: each name holds ends of lines and a key that
the file may have; the key must not appear among those of the file that is written.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from xml.sax.saxutils import quoteattr

import h5py
import numpy as np
import pytest
import yaml
from data_sheets import sheet
from hypothesis import example, given
from hypothesis import strategies as st
from small_recording import a_map, write_map
from urdf_robots import ROBOTS, urdf

from checked_files.errors import HilError
from checked_files.yaml_file import UNSTATED, FileError
from drivers.canopen.eds_file import parse_eds
from drivers.canopen.rules import RULES
from drivers.dictionary import live
from drivers.dictionary.review import review
from drivers.found_settings.settings_file import FoundSettings, dump_found_settings
from drivers.operator_tools.draft import DraftedAxis, draft_drives
from hil.imports.draft import SeenColumn, described
from hil.imports.importing import import_recordings
from hil.imports.map_file import Format
from hil.imports.readers import open_table
from hil.imports.tables import NoColumn, column_of
from hil.model.readers.dh_table import read_dh
from hil.model.readers.robot_draft import draft_robot, robot_as_stated
from hil.model.readers.urdf import read_urdf
from hil.model.robot import parse_robot
from hil.runs.journal import Journal, Session, read_journal, write_journal
from sim_plant.switch_on import load_machine
from sim_plant.twin.files import plant_text

GRAVITY = (0.0, 0.0, -9.81)
ENDS = ("\n", "\r", "\x85", "\u2028", "\u2029")
NAMES = st.text(st.characters(exclude_categories=("Cs",)), max_size=30) | st.sampled_from(
    [f"arm{end}injected: 1{end}#" for end in ENDS]
)


class _Marked(yaml.SafeLoader):
    """Loader that accepts marks as text."""


_Marked.add_constructor(UNSTATED, lambda loader, node: loader.construct_scalar(node))


def keys(text: str) -> object:
    """Return keys of a file with their nesting, without the values."""
    return _keys(yaml.load(text, _Marked))  # noqa: S506 - a safe loader


def _keys(value: object) -> object:
    if isinstance(value, dict):
        return {key: _keys(each) for key, each in value.items()}
    return [_keys(each) for each in value] if isinstance(value, list) else None


@pytest.fixture(scope="module")
def chain(tmp_path_factory: pytest.TempPathFactory):
    path = tmp_path_factory.mktemp("urdf") / "scara.urdf"
    path.write_text(urdf("SCARA", ROBOTS["SCARA"]))
    return read_urdf(path)


@given(name=NAMES)
@example("1.5")
@example("null")
def test_a_drafted_robot_file_has_the_keys_of_its_kind(chain, name):
    joints = tuple(replace(joint, name=name) for joint in chain.joints)
    named = replace(chain, robot=name, base=name, tip=name, joints=joints)
    assert keys(draft_robot(named, GRAVITY)) == keys(draft_robot(chain, GRAVITY))
    stated = robot_as_stated(named, GRAVITY)
    assert keys(stated) == keys(robot_as_stated(chain, GRAVITY))
    assert parse_robot(stated, "robot.yaml").n_joints == len(joints)


def test_a_line_break_in_a_urdf_adds_no_spring_to_the_robot_that_is_fitted(tmp_path):
    text = urdf("SCARA", ROBOTS["SCARA"])
    name = quoteattr("SCARA\nunknown_key: 1", {"\n": "&#10;"})
    path = tmp_path / "arm.urdf"
    path.write_text(text.replace('name="SCARA"', f"name={name}"))
    assert "unknown_key:" in read_urdf(path).robot
    stated = robot_as_stated(read_urdf(path), GRAVITY)
    assert "unknown_key" not in yaml.safe_load(stated)
    parse_robot(stated, "robot.yaml")


@given(name=NAMES)
def test_a_robot_file_drafted_from_a_table_has_the_keys_of_its_kind(name):
    table = Path(__file__).parents[1] / "hil" / "model" / "table.csv"
    text = "alpha [rad],a [m],d,theta\n0,0,0.1,q1\n0,0.3,0,q2\n"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hil.model.readers.dh_table.read_text", lambda _: text)
        found = read_dh(table, "modified")
    joints = tuple(replace(joint, name=name) for joint in found.joints)
    assert keys(draft_robot(replace(found, name=name, joints=joints), GRAVITY)) == keys(
        draft_robot(found, GRAVITY)
    )


@given(name=NAMES)
def test_a_comment_about_a_column_is_one_line(name):
    column = SeenColumn(1, name, 0.0, 1.0, rises=False, step=0.1)
    assert yaml.safe_load(f"# {described(column)}\nend: 1") == {"end": 1}
    assert yaml.safe_load(f"column: {column.key}") == {"column": name or 1}


@given(name=NAMES)
def test_a_drafted_drives_file_has_the_keys_of_its_kind(name):
    plain = parse_eds(sheet().encode(), "drive.eds", 1)
    named = replace(plain, source=name, maker=name, model=name, notes=(name,))
    entries = {place: replace(each, name=name) for place, each in plain.entries.items()}
    named = replace(named, entries=entries)
    texts = [
        draft_drives([DraftedAxis(each, review(each, RULES), 1)], RULES) for each in (plain, named)
    ]
    assert keys(texts[1]) == keys(texts[0])


@given(name=NAMES)
def test_found_settings_have_the_keys_of_their_kind(name):
    drive = {"name": name, "node": 1, "identity": {"vendor": 1}, "objects": [
        {"index": 0x6065, "subindex": 0, "type": "u32", "value": 1, "name": name}]}  # fmt: skip
    for each in (name, "plain"):
        drive["name"] = drive["objects"][0]["name"] = each if each.strip() else "axis"
        text = dump_found_settings(FoundSettings(bitrate=1_000_000, drives=(drive,)))
        assert set(yaml.safe_load(text)) <= set(FoundSettings.model_fields)
        assert len(yaml.safe_load(text)["drives"]) == 1


FORGED = tuple(f"q{end}forged: all axes are off{end}" for end in ENDS)


def _lines_of(error: pytest.ExceptionInfo[HilError]) -> list[str]:
    lines = str(error.value).splitlines()
    assert any("forged" in line for line in lines)
    return [line for line in lines if line.lstrip().startswith("forged")]


def _csv(path: Path, name: str) -> None:
    path.write_text(f't,"{name}"\n' + "".join(f"{k},{k}\n" for k in range(9)), newline="")


def _h5(path: Path, name: str) -> None:
    with h5py.File(path, "w") as file:
        file["t"] = file[name] = np.arange(9.0)


def _npz(path: Path, name: str) -> None:
    np.savez(path, t=np.arange(9.0), **{name: np.arange(9.0)})


@pytest.mark.parametrize("forged", FORGED)
@pytest.mark.parametrize(("file", "write"), [("a.csv", _csv), ("a.h5", _h5), ("a.npz", _npz)])
def test_the_name_of_a_column_forges_no_line_of_a_message(tmp_path, file, write, forged):
    write(tmp_path / file, forged)
    with pytest.raises(NoColumn) as error:
        column_of(open_table(tmp_path / file, Format()), "other")
    assert not _lines_of(error)


NAME = '"NAME"'
MAPS = {
    key: json.dumps(a_map() | {key: value})
    for key, value in {
        "robot": "NAME", "files": ["NAME"], "format": {"topic": 3, "NAME": 1}, "accept": ["NAME"],
        "NAME": 1, "kind": "NAME",
    }.items()
} | {"twice": f"{NAME}: 1\n{NAME}: 2", "unstated": f"robot: !state {NAME}"}  # fmt: skip


@pytest.mark.parametrize("forged", FORGED)
@pytest.mark.parametrize("key", MAPS)
def test_a_map_forges_no_line_of_a_message(tmp_path, forged, key):
    the_map = write_map(tmp_path, MAPS[key].replace(NAME, json.dumps(forged)))
    with pytest.raises(HilError) as error:
        import_recordings([the_map], tmp_path / "run")
    assert not _lines_of(error)


@pytest.mark.parametrize("forged", FORGED)
def test_a_urdf_forges_no_line_of_a_message(tmp_path, forged):
    name = quoteattr(forged, {end: f"&#{ord(end)};" for end in ENDS})
    path = tmp_path / "arm.urdf"
    path.write_text(
        f"<robot name='a'><link name='base'/><link name={name}/><joint name={name}"
        f" type='revolute'><parent link='base'/><child link={name}/><axis xyz='0 0 0'/></joint>"
        "</robot>"
    )
    with pytest.raises(FileError) as error:
        read_urdf(path)
    assert not _lines_of(error)


@pytest.mark.parametrize("forged", FORGED)
def test_a_data_sheet_names_its_objects_and_drive_in_one_line(forged):
    content = sheet().replace("ParameterName=", f"ParameterName={forged}", 1)
    found = parse_eds(content.encode(), "drive.eds", 1)
    texts = [each.name for each in found.entries.values()] + [found.maker, found.model]
    assert all(len(text.splitlines()) <= 1 for text in texts)


@pytest.mark.parametrize("forged", FORGED)
def test_what_a_run_says_of_itself_is_in_one_line_each(tmp_path, forged):
    session = Session(started="2026", reason=forged, bus=forged, simulated=True, notes=(forged,))
    journal = Journal(plan_digest="a", robot_digest="b").add_session(session)
    write_journal(tmp_path / "run.json", journal)
    found = read_journal(tmp_path / "run.json").sessions[0]
    for text in (found.reason, found.bus, *found.notes):
        assert "forged" in text
        assert len(text.splitlines()) == 1


@pytest.mark.parametrize("forged", FORGED)
def test_a_drive_names_itself_in_one_line(forged):
    class Drive:
        def read(self, index: int, subindex: int) -> bytes:
            return forged.encode("utf-16-le" if ord(forged[1]) > 0xFF else "latin-1")

    reading = live._Reading(Drive())
    assert len(reading.text(live.DEVICE_NAME).splitlines()) == 1


@pytest.mark.parametrize("end", ENDS)
def test_a_twin_names_its_source_in_a_comment(end):
    file = load_machine("manutec-r15").file
    text = plant_text(file, f"arm{end}injected: 1{end}#")
    assert keys(text) == keys(plant_text(file, "arm.yaml"))
