"""Text of many small parts is refused before it becomes many times its size in memory.

Harmless input: the bounds are lowered, so that files of some kilobytes exceed them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from checked_files import budget, yaml_file
from checked_files.xml_file import XmlFile
from checked_files.yaml_file import FileError, FileModel, parse_yaml
from drivers.canopen.eds_file import read_eds

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


@pytest.mark.parametrize(
    ("name", "content", "read"),
    [
        ("a.urdf", f"<robot>{'<a/>' * 1000}</robot>", XmlFile),
        ("a.urdf", "<robot " + " ".join(f"a{k}=''" for k in range(1000)) + "/>", XmlFile),
        ("a.eds", "".join(f"[{k:X}]\n" for k in range(1000)), read_eds),
        ("a.eds", "[1000]\n" + "".join(f"k{k}=1\n" for k in range(1000)), read_eds),
    ],
    ids=["elements", "attributes", "sections", "keys"],
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
    # what follows the hundredth value would be no YAML: it is not reached
    with pytest.raises(FileError, match=r"a.yaml:\d+: .*holds more than \d+ values"):
        parse_yaml("- a\n" * 200 + "]", FileModel, "a.yaml")
