"""YAML text of many small parts is refused before it takes many times its size in memory.

Harmless input: the bounds are lowered, so that files of some kilobytes exceed them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from checked_files import budget, yaml_file
from checked_files.xml_file import XmlFile
from checked_files.yaml_file import FileError, FileModel, parse_yaml
from drivers.canopen.eds_file import read_eds
from hil.imports.map_file import Format
from hil.imports.readers import open_table
from hil.model.readers.dh_table import convert_table
from hil.model.readers.mjcf_text import MjcfText
from hil.model.robot_file import MOST_JOINTS

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
KEYS = [f'{{"k{k}":1}}' for k in range(300)]


def open_rows(path: Path) -> object:
    pytest.importorskip("pyarrow")
    return open_table(path, Format())


@pytest.mark.parametrize(
    ("name", "content", "read"),
    [
        ("a.urdf", f"<robot>{'<a/>' * 1000}</robot>", XmlFile),
        ("a.urdf", "<robot " + " ".join(f"a{k}=''" for k in range(1000)) + "/>", XmlFile),
        ("a.eds", "".join(f"[{k:X}]\n" for k in range(1000)), read_eds),
        ("a.eds", "[1000]\n" + "".join(f"k{k}=1\n" for k in range(1000)), read_eds),
        ("a.jsonl", "\n".join(KEYS), open_rows),
        ("a.jsonl", '{"a":{"b":1,"c":1,"d":1}}' + "{}" * 2000, open_rows),
        ("a.jsonl", '{"a":[{"b":1,"c":1,"d":1}' + ",{}" * 2000 + "]}", open_rows),
        ("a.json", "[" + ",".join(KEYS) + "]", open_rows),
        ("a.xml", "".join(f"<r k{k}='1'/>" for k in range(300)), open_rows),
        (
            "a.xml",
            "<r " + " ".join(f"k{k}='1'" for k in range(40)) + "/>" + "<r/>" * 2000,
            open_rows,
        ),
    ],
    ids=[
        "elements",
        "attributes",
        "sections",
        "keys",
        "lines",
        "structures",
        "lists of structures",
        "a list",
        "rows of XML",
        "short rows of XML",
    ],
)
def test_many_small_parts_are_refused_with_the_remedy(
    name: str,
    content: str,
    read: Callable[[Path], object],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(budget, "BASE", 100_000)
    (tmp_path / name).write_text(content)
    with pytest.raises(FileError, match=r"MB, at most .* set HIL_READ_LIMIT=\d+"):
        read(tmp_path / name)


def test_values_of_yaml_are_counted_while_they_are_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(yaml_file, "VALUES_MAX", 100)
    # parsing stops before the invalid YAML after the hundredth value
    with pytest.raises(FileError, match=r"a.yaml:\d+: holds more than \d+ values"):
        parse_yaml("- a\n" * 200 + "]", FileModel, "a.yaml")


def test_a_list_of_json_without_objects_is_refused_at_its_first_item(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    (tmp_path / "a.json").write_text("[[],[],")
    with pytest.raises(FileError, match=r"a\.json: is neither .*holds list"):
        open_table(tmp_path / "a.json", Format())


def test_rows_of_a_table_of_joints_are_counted_before_they_are_converted() -> None:
    rows = "0,0,0,0\n" * (MOST_JOINTS + 1)
    with pytest.raises(FileError, match=rf"a.csv:{MOST_JOINTS + 2}: {MOST_JOINTS + 1} rows"):
        convert_table(f"alpha,a,theta,d\n{rows}", "a.csv")


def test_nesting_is_counted_over_the_files_that_an_mjcf_includes(tmp_path: Path) -> None:
    deep = 150
    for name, inner in (("a.xml", '<include file="b.xml"/>'), ("b.xml", "")):
        (tmp_path / name).write_text(f"<mujoco>{'<a>' * deep}{inner}{'</a>' * deep}</mujoco>")
    with pytest.raises(FileError, match=r"b.xml:1: <a> is nested more than 200 deep"):
        MjcfText(tmp_path / "a.xml")
