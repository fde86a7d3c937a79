"""Foreign text stays within comments and strings of an exported file."""

from __future__ import annotations

import ast
import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET
from xml.sax.saxutils import quoteattr

import pytest
import yaml
from possible_models import model_of, possible
from stated_model import stated_model
from urdf_robots import ROBOTS, urdf

from hil.export.exported import origin
from hil.export.formats import FORMATS, SIMULATORS, export
from hil.export.urdf_file import given_urdf
from hil.model.robot import Robot
from hil.results.consistency import find_consistent_robot
from hil.results.judgement import Judgement

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.results.model import Model

GCC = shutil.which("gcc")
PIECES = (
    '"""', "'''", "*/", "**/", "/*/", "*)", "(*)", "-->", "--->", "\\", "??/", "${A}", "{name}",
    "%s", "</script>", "<![CDATA[", "]]>", "\ninjected = 1", "\rinjected = 1", "\x0binjected = 1",
    "\x85injected: 1", "\u2028injected: 1", "# ", "/", "\\\n", "*", "-",
)  # fmt: skip
TEXT = "a".join(PIECES) + "-"


def _data(text: str) -> str:
    return json.dumps({k: v for k, v in json.loads(text).items() if k != "origin"})


def _xml(text: str) -> ET.Element:
    return ET.fromstring(text)  # noqa: S314 - our own file


READERS: dict[str, Callable[[str], str]] = {
    ".py": lambda text: ast.dump(ast.parse(text)),
    ".json": _data,
    ".yaml": lambda text: repr(yaml.safe_load(text)),
    ".urdf": lambda text: ET.tostring(_xml(text)).decode(),
    ".xml": lambda text: ET.tostring(_xml(text)).decode(),
    ".txt": lambda text: re.sub(r"(?m)#.*$", "", text).strip(),
    ".st": lambda text: re.sub(r"(?s)\(\*.*?\*\)", "", text).strip(),
    ".c": lambda text: re.sub(r"(?s)/\*.*?\*/", "", text).strip(),
    ".h": lambda text: re.sub(r"(?s)/\*.*?\*/", "", text).strip(),
}
"""Readers of a file by its ending: all content but comments and origin."""


def insert_text(model: Model, text: str) -> tuple[Model, tuple[str, ...]]:
    """Return a failed model with a text in its provenance and verdict, and its origin."""
    about = {"method": text, "version": text, "identified": text, "together_with": (text,)}
    verdict = Judgement(word="failed", reason=text)
    about = model.provenance.model_copy(update=about)
    own = replace(model, provenance=about, verdict=verdict)
    return own, origin(own, Path(text))


@pytest.mark.parametrize("name", [*FORMATS, *SIMULATORS])
def test_a_text_of_origin_and_verdict_changes_nothing_but_comments(
    name: str, tmp_path: Path
) -> None:
    robot = Robot.load("tests/robots/pan-tilt.yaml")
    if name in FORMATS:
        model = stated_model(robot)
    else:
        model = find_consistent_robot(model_of(robot, *possible(robot)))
    plain, hostile = (
        export(own, name, lines).files
        for own, lines in (insert_text(model, "plain"), insert_text(model, TEXT))
    )
    assert list(plain) == list(hostile)
    assert any("injected" in text for text in hostile.values())
    for file, text in hostile.items():
        read = READERS[Path(file).suffix]
        assert read(text) == read(plain[file]), file
        if GCC and file.endswith((".c", ".h")):
            (tmp_path / file).write_text(text, encoding="utf-8")
    if GCC and "example.c" in hostile:
        check = [GCC, "-std=c99", "-trigraphs", "-Wno-comment", "-fsyntax-only", "example.c"]
        subprocess.run(check, cwd=tmp_path, check=True)  # noqa: S603 - a compiler of this machine


NAME = "a--->b\"'</script>&<c/>$D\\ e"


@pytest.mark.parametrize("name", SIMULATORS)
def test_names_of_a_urdf_stay_names(name: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    text = urdf("arm", ROBOTS["pan-tilt"])
    for own in ("link1", "link2", "joint1", "joint2", "base"):
        text = text.replace(f'"{own}"', quoteattr(f"{NAME}{own}", {'"': "&quot;"}))
    path.write_text(text, encoding="utf-8")
    robot = Robot.load(path)
    model = find_consistent_robot(model_of(robot, *possible(robot)))
    (written,) = export(model, name, (), given_urdf(path, robot)).files.values()
    if name == "ranges":
        found = set(json.loads(written)["joints"])
    else:
        found = {each.get("name") for each in _xml(written).iter("joint")}
    assert {f"{NAME}joint1", f"{NAME}joint2"} <= found
