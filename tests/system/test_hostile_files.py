"""Malicious files give an error with a place, or a valid object, and nothing else.

Each loader is given text of any kind, and copies of a valid file with values exchanged, keys
doubled, parts moved, aliases and tags put in.
"""

from __future__ import annotations

import json
import re
from contextlib import contextmanager
from copy import deepcopy
from datetime import date
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_run import write_run

from checked_files.yaml_file import FileError, FileModel, load_yaml, parse_yaml
from drivers.drives_file import DrivesFile, load_drives
from drivers.found_settings.settings_file import load_found_settings
from hil.imports.map_file import load_map
from hil.model.robot import ROBOTS, Robot, parse_robot
from hil.planning.plan import load_plan, load_workspace
from hil.results.model_file import ModelFile
from hil.runs.journal import read_journal
from hil.runs.recording_file import read_measured
from sim_plant.faults.fault_plan import load_fault_plan
from sim_plant.personality import FOLDER, load_personality
from sim_plant.plant_file import load_plant_file

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

ROBOT = Robot.load("manutec-r15")
PLANT = Path(__file__).parents[2] / "sim_plant" / "plants" / "manutec-r15.yaml"

FAULTS = """
faults:
  - {what: tpdo-lost, axis: 2, at: {set_point: 3, after: 0.2}, lasts: {syncs: 1}}
  - {what: fault, axis: 1, code: 0x2310, at: {time: 12.5}}
"""
WORKSPACE = """
margin: 0.02
ranges: {1: [-1.5, 1.5], 2: [-1.0, 1.0]}
boxes: [{name: table, low: [-1, -1, -1], high: [1, 1, -0.8]}]
"""
PLAN = """
format: 1
robot: {name: manutec-r15, digest: abc}
sample_period: 0.004
warm_up: {duration: 10, fraction: 0.5}
measurements:
- {id: g1, kind: gravity, axis: 2, q: [0, 0, 0, 0, 0, 0], stroke: 0.5, velocity: 0.3,
   acceleration: 2.0}
- {id: c1, kind: coupling, axis: 1, q: [0, 0, 0, 0, 0, 0], stroke: 0.5, velocity: 0.1,
   acceleration: 2.0, cycles: 2,
   partner: {axis: 3, stroke: 0.5, velocity: 1.0, acceleration: 4.0}}
"""
MODEL = """
format: 1
provenance: {robot: r, robot_digest: a, plan_digest: b, measured: c, bus: d, measurements: 3,
  left_out: [], identified: e, method: improved, version: f}
parameters:
- {name: p1, expression: Izz1, group: gravity, unit: kg m, value: 1.0, standard_error: 0.1,
   interval_95: [0.8, 1.2]}
covariance: [[0.01]]
residual: [0.5, null]
condition: {gravity: 3.0}
"""
JOURNAL = """
{"format": 1, "plan_digest": "a", "robot_digest": "b", "sessions": [{"started": "x", "bus": "y",
 "axes": [{"name": "1", "identity": "z", "torque_resolution": 0.1, "position_resolution": 1e-5}]}]}
"""

MAP = """
robot: {urdf: arm.urdf, from: base, to: tool, gravity: [0, 0, -9.81]}
files: [a.csv, b.csv]
format: {header: true, delimiter: ",", skip: 2}
rows: [[1, 500], [600, 900]]
time: {column: t, unit: ms}
joints:
  - position: {column: 2, unit: counts, per_unit: 1.0e-4, sign: -1, offset: 0.1}
    velocity: {column: v, unit: rpm}
    torque: {column: {file: c.csv, column: 1}, unit: A, gain: 2.5, gain_uncertainty: 0.1}
torque_side: motor
cut_off: 8
kind: {back_and_forth: 1}
accept: [shape]
"""
FOUND = """
format: 1
restored: false
bitrate: 1000000
drives:
- {name: joint 1, node: 1, identity: {vendor: 0x4D2, product: 0x402, revision: null, serial: 7},
   restored: true, objects: []}
- name: joint 2
  node: 2
  identity: {vendor: 0x4D2}
  objects:
  - {index: 0x607D, subindex: 1, type: i32, value: -197120, name: min position limit}
  - {index: 0x1A00, subindex: 0, type: u8, value: 3, name: number of objects in TPDO 1}
"""


def shortened(path: Path) -> str:
    """Return a file with its first two axes only."""
    content = yaml.safe_load(path.read_text())
    content["axes"] = content["axes"][:2]
    return yaml.safe_dump(content, sort_keys=False)


LOADERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "robot": ((ROBOTS / "manutec-r15.yaml").read_text(), Robot.load),
    "drives": (shortened(ROBOTS / "manutec-r15.drives.yaml"), load_drives),
    "plant": (shortened(PLANT), lambda path: load_plant_file(str(path))),
    "plan": (PLAN, load_plan),
    "workspace": (WORKSPACE, lambda path: load_workspace(path, ROBOT)),
    "fault plan": (FAULTS, load_fault_plan),
    "personality": (
        (FOLDER / "tenth-rpm.yaml").read_text(),
        lambda path: load_personality(str(path)),
    ),
    "model": (MODEL, lambda path: load_yaml(path, ModelFile)),
    "journal": (JOURNAL, read_journal),
    "found settings": (FOUND, load_found_settings),
    "map of a recording": (MAP, load_map),
}

ODD = st.sampled_from(
    [None, True, "", "x", " ", "a\tb", "\u2028", "1e3", "0x10", "1_000", "-pi/2", "l1", "(a+b)*c",
     "9" * 400, 0, -1, -0.0, 1, 2**31, 2**63, -(2**64), 10**400, 1e-320, 1e308, -1e308,
     float("nan"), float("inf"), -float("inf"), [], {}, [[]], [None], {"": None}, {1: 2},
     {None: 1}, [1e308] * 3,
     b"\xff", date(2001, 1, 1)]
)  # fmt: skip
FRAGMENTS = st.sampled_from(
    ["\t", "\n\t- a\n", "&a ", "*a", "<<: *a\n", "!!binary x", "!!int x", "!!timestamp x", "!!set ",
     "!!python/object:os.system x", "!state x", "---\n", "...\n", "%YAML 9.9\n", "\x00", "\x07",
     "\ufeff", "\ud7ff", "{", "[", "}", "]", "|\n", ">-\n", "? ", ": ", "- ", "#", '"', "'", "@",
     "`", "0o9", "1:2:3", "190:20:30.15e400", "9" * 5000, "0x" + "f" * 5000, "[" * 60, "{a: " * 60]
)  # fmt: skip


def mutated(draw: Callable[..., Any], tree: Any) -> Any:
    """Exchange, remove, double or move one part of a tree, somewhere below its top."""
    if not isinstance(tree, dict | list) or not tree:
        return deepcopy(draw(ODD))
    keys = list(tree) if isinstance(tree, dict) else list(range(len(tree)))
    key = draw(st.sampled_from(keys))
    match draw(st.sampled_from(["below", "below", "below", "exchange", "remove", "copy"])):
        case "below":
            tree[key] = mutated(draw, tree[key])
        case "exchange":
            tree[key] = deepcopy(draw(ODD))
        case "remove":
            del tree[key]
        case _ if isinstance(tree, dict):
            tree[draw(st.sampled_from([*keys, "name", "axes", 7]))] = tree[key]
        case _:
            tree.append(tree[key])
    return tree


@st.composite
def spoilt(draw: Any, valid: str) -> bytes:
    """Return text similar to a valid file: as a tree, as lines, as bytes."""
    tree = yaml.safe_load(valid)
    for _ in range(draw(st.integers(0, 3))):
        tree = mutated(draw, tree)
    text = yaml.safe_dump(tree, sort_keys=False, allow_unicode=draw(st.booleans()))
    for _ in range(draw(st.integers(0, 2))):
        at = draw(st.integers(0, len(text)))
        text = text[:at] + draw(FRAGMENTS) + text[at:]
    data = text.encode()
    if draw(st.integers(0, 9)) == 0:
        at = draw(st.integers(0, len(data)))
        data = data[:at] + draw(st.binary(max_size=4)) + data[at + draw(st.integers(0, 50)) :]
    return data


@contextmanager
def lines_of_error() -> Iterator[list[str]]:
    """Catch a `FileError` and collect the lines of its message."""
    lines: list[str] = []
    try:
        yield lines
    except FileError as error:
        lines += str(error).splitlines()


def loads_or_states_where(load: Callable[[Path], object], path: Path, content: bytes) -> None:
    path.write_bytes(content)
    with lines_of_error() as lines:
        load(path)
    for line in lines:
        assert re.match(rf"{re.escape(str(path))}:\d+: \S", line), lines


FEW = settings(
    max_examples=25,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


@pytest.mark.parametrize("name", LOADERS)
def test_the_valid_file_is_read(name: str, tmp_path: Path) -> None:
    text, load = LOADERS[name]
    path = tmp_path / "file.yaml"
    path.write_text(text)
    load(path)


@pytest.mark.parametrize("name", LOADERS)
@FEW
@given(data=st.data())
def test_a_spoilt_file_is_valid_or_refused_with_its_line(
    name: str, tmp_path: Path, data: st.DataObject
) -> None:
    text, load = LOADERS[name]
    loads_or_states_where(load, tmp_path / "file.yaml", data.draw(spoilt(text)))


@pytest.mark.parametrize("name", LOADERS)
@FEW
@given(
    st.binary(max_size=60) | st.text(max_size=60).map(lambda text: text.encode("utf-8", "replace"))
)
def test_any_bytes_are_refused_with_their_line(name: str, tmp_path: Path, content: bytes) -> None:
    loads_or_states_where(LOADERS[name][1], tmp_path / "file.yaml", content)


ALIASES = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{b}: &{b} [{', '.join(['*' + a] * 9)}]\n" for a, b in pairwise("abcdefghijk")
)
MERGES = "a: &a {x: 1, y: 2}\n" + "".join(
    f"{b}: &{b} {{<<: [{', '.join(['*' + a] * 9)}]}}\n" for a, b in pairwise("abcdefghijk")
)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (ALIASES, r":\d+: holds more than 200000 values"),
        (MERGES, r":\d+: holds more than 200000 values"),
        ("axes: &a\n  - *a\n", r":\d+: nested deeper than 32 levels, or within itself"),
        ("&a {axes: *a}", r":1: nested deeper than 32 levels, or within itself"),
        ("\naxes: " + "[" * 5000, r":2: .*nested deeper than 32 levels"),
        ("\naxes: " + "{a: " * 900 + "}" * 900, r":2: .*nested deeper than 32 levels"),
        ("\nbitrate: " + "9" * 5000, r":2: .*'9+\.\.\. is not a number of at most 100"),
        ("\nbitrate: 0x" + "f" * 5000, r":2: .* is not a number of at most 100"),
        ("\nbitrate: !!timestamp x", r":2: .*'x' is no timestamp"),
        ("\nbitrate: 2024-13-45", r":2: .*'2024-13-45' is no timestamp"),
        ("\nbitrate: !!python/object/apply:os.getcwd []", r":2: .*could not determine"),
        ("\nbitrate: .nan", r":2: bitrate: nan"),
        ("\na:\n\t- b", r":3: .*cannot start any token"),
        ("\na: \x00", r":2: .*(?:control|special) characters are not allowed"),
        ("bitrate: 1\nbitrate: 2", r":2: bitrate: is stated twice"),
        ("", r":1: must hold keys and values, not nothing"),
        ("- a", r":1: must hold keys and values, not list"),
    ],
)
def test_what_would_never_end_or_mean_nothing_is_refused_at_its_line(
    text: str, message: str
) -> None:
    with pytest.raises(FileError, match=message):
        parse_yaml(text, DrivesFile, "drives.yaml")


def test_text_that_is_not_utf_8_is_refused_at_its_line(tmp_path: Path) -> None:
    path = tmp_path / "drives.yaml"
    path.write_bytes(b"# fine\n# \xff\n")
    with pytest.raises(FileError, match=r"drives\.yaml:2: .*not UTF-8"):
        load_drives(path)


def test_honest_aliases_are_followed() -> None:
    class Pair(FileModel):
        a: tuple[int, ...]
        b: tuple[int, ...]

    assert parse_yaml("a: &x [1, 2]\nb: *x\n", Pair, "pair.yaml").b == (1, 2)


@pytest.mark.parametrize(
    "expression",
    [
        "*".join(f"(a{n}+b{n})" for n in range(40)),
        "1" + "0" * 400,
        "1e999*l1",
        "(" * 300,
        "1if 0else 2",
    ],
)
def test_an_expression_without_end_is_refused(expression: str) -> None:
    text = LOADERS["robot"][0].replace("d: l1", f"d: {json.dumps(expression)}", 1)
    assert expression in text
    with pytest.raises(FileError, match=r"robot\.yaml:\d+: joints\.\d\.frame\.d"):
        parse_robot(text, "robot.yaml")


# Recordings


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Valid measurement file."""
    folder = write_run(tmp_path_factory.mktemp("run") / "run", ROBOT)
    return folder.recording_path(folder.plan.measurements[0])


@FEW
@given(data=st.data())
def test_a_spoilt_recording_is_never_read_as_another(
    recording: Path, tmp_path: Path, data: st.DataObject
) -> None:
    honest, path = recording.read_bytes(), tmp_path / "spoilt.h5"
    at = data.draw(st.integers(0, len(honest) - 1))
    match data.draw(st.sampled_from(["cut", "flip", "overwrite", "noise"])):
        case "cut":
            content = honest[:at]
        case "flip":
            content = honest[:at] + bytes([honest[at] ^ 1 << at % 8]) + honest[at + 1 :]
        case "overwrite":
            other = data.draw(st.binary(min_size=1, max_size=64))
            content = honest[:at] + other + honest[at + len(other) :]
        case _:
            content = data.draw(st.binary(max_size=200))
    path.write_bytes(content)
    read = None
    with lines_of_error() as lines:
        read = read_measured(path)
    assert all(line.startswith(f"{path}: ") for line in lines)
    if read is not None:
        known = read_measured(recording)
        assert read.measurement == known.measurement
        for name in ("time", "q", "tau", "flags", "stroke", "partner_stroke"):
            np.testing.assert_array_equal(
                getattr(read.recording, name), getattr(known.recording, name)
            )


@pytest.mark.parametrize(
    "spoil",
    [
        lambda file: file.attrs.__setitem__("checksum", 3),
        lambda file: file.attrs.__setitem__("format", [1, 2]),
        lambda file: file.attrs.__setitem__("session", "x"),
        lambda file: file.attrs.__setitem__("findings", "{"),
        lambda file: file.attrs.__setitem__("measurement", b"\xff"),
        lambda file: file.attrs.__delitem__("attempts"),
        lambda file: file.__delitem__("q"),
        lambda file: file.move("q", "p"),
        lambda file: (file.__delitem__("q"), file.create_group("q")),
        lambda file: (file.__delitem__("q"), file.create_dataset("q", data=["text"])),
        lambda file: (file.__delitem__("q"), file.__setitem__("q", h5py.SoftLink("/q"))),
        lambda file: (file.__delitem__("q"), file.__setitem__("q", h5py.ExternalLink("/x", "q"))),
    ],
)
def test_a_recording_with_foreign_content_is_refused_as_damaged(
    recording: Path, tmp_path: Path, spoil: Callable[[h5py.File], object]
) -> None:
    path = tmp_path / "foreign.h5"
    path.write_bytes(recording.read_bytes())
    with h5py.File(path, "r+") as file:
        spoil(file)
    with pytest.raises(FileError, match=r"foreign\.h5: (is damaged|content does not match|format)"):
        read_measured(path)
