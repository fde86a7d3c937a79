"""Names that strangers give to robots, links, columns, drives and files change no file of ours.

Harmless input: each name holds ends of lines and a key that the file may have; the key must not
appear among those of the file that is written.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from xml.sax.saxutils import quoteattr

import pytest
import yaml
from data_sheets import sheet
from hypothesis import example, given
from hypothesis import strategies as st
from urdf_robots import ROBOTS, urdf

from checked_files.yaml_file import UNSTATED
from drivers.canopen.eds_file import parse_eds
from drivers.canopen.rules import RULES
from drivers.dictionary.review import review
from drivers.found_settings.settings_file import FoundSettings, dump_found_settings
from drivers.operator_tools.draft import DraftedAxis, draft_drives
from hil.imports.draft import SeenColumn, described
from hil.model.readers.dh_table import read_dh
from hil.model.readers.robot_draft import draft_robot, robot_as_stated
from hil.model.readers.urdf import read_urdf
from hil.model.robot import parse_robot
from sim_plant.switch_on import load_machine
from sim_plant.twin.files import plant_text

GRAVITY = (0.0, 0.0, -9.81)
ENDS = ("\n", "\r", "\x85", "\u2028", "\u2029")
NAMES = st.text(st.characters(exclude_categories=("Cs",)), max_size=30) | st.sampled_from(
    [f"arm{end}injected: 1{end}#" for end in ENDS]
)


class _Marked(yaml.SafeLoader):
    """A loader that takes marks as text."""


_Marked.add_constructor(UNSTATED, lambda loader, node: loader.construct_scalar(node))


def keys(text: str) -> object:
    """Keys of a file and how they are nested, without the values."""
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
        drive["name"] = drive["objects"][0]["name"] = each or "axis"
        text = dump_found_settings(FoundSettings(bitrate=1_000_000, drives=(drive,)))
        assert set(yaml.safe_load(text)) <= set(FoundSettings.model_fields)
        assert len(yaml.safe_load(text)["drives"]) == 1


@pytest.mark.parametrize("end", ENDS)
def test_a_twin_names_its_source_in_a_comment(end):
    file = load_machine("manutec-r15").file
    text = plant_text(file, f"arm{end}injected: 1{end}#")
    assert keys(text) == keys(plant_text(file, "arm.yaml"))
