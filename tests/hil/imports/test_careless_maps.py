"""Typical errors in maps and files: each gives one message with a place, or is harmless."""

import os

import h5py
import numpy as np
import pytest
from small_recording import a_map, motion, table, write_csv, write_map

from checked_files.foreign_text import printable
from checked_files.yaml_file import FileError
from hil.imports.importing import import_recordings

COLUMNS = table(4.0, rate=100.0)
Q = motion(COLUMNS["t"])[0]


def imported(folder, content):
    """Import a map; return the printed statement."""
    lines = []
    the_map = write_map(folder, content)
    import_recordings([the_map], folder / "run", lambda s: lines.extend(s.lines()))
    return "\n".join(lines)


def refusal(folder, content):
    """Import a wrong map; return its one message after checking that nothing was written."""
    the_map = write_map(folder, content)
    before = sorted(folder.rglob("*"))
    with pytest.raises(FileError) as refused:
        import_recordings([the_map], folder / "run")
    assert sorted(folder.rglob("*")) == before
    message = str(refused.value).replace(f"{folder}{os.sep}", "")
    assert len(message.splitlines()) == 1, message
    return message


def changed(joint, key, velocity=False, **changes):
    content = a_map(velocity=velocity)
    content["joints"][joint][key] |= changes
    return content


USED_TWICE = {
    "positions of two joints": changed(1, "position", column="q1"),
    "torques of two joints": changed(1, "torque", column="m1"),
    "velocities of two joints": changed(1, "velocity", velocity=True, column="v1"),
    "a torque that is a position": changed(0, "torque", column="q1"),
    "a position that is time": changed(0, "position", column="t"),
    "by name and by number": changed(1, "position", column=2),
}


@pytest.mark.parametrize("case", USED_TWICE)
def test_a_column_is_one_thing_only(tmp_path, case):
    write_csv(tmp_path / "data.csv", COLUMNS)
    assert "is used twice in this map" in refusal(tmp_path, USED_TWICE[case])


TIMES = {
    "seconds that are milliseconds": (
        {"t": 1e3 * COLUMNS["t"]}, {"column": "t"}, "map.yaml:4: time: sampling period 10 s"),
    "minutes for seconds": ({}, {"column": "t", "unit": "min"}, "time: sampling period 0.6 s"),
    "time that runs backwards": ({"t": COLUMNS["t"][::-1]}, {"column": "t"}, "runs backwards; cho"),
    "time that stands": ({"t": 0 * COLUMNS["t"]}, {"column": "t"}, "time stamps do not increase"),
}  # fmt: skip


@pytest.mark.parametrize("case", TIMES)
def test_times_that_no_recording_has(tmp_path, case):
    columns, time, message = TIMES[case]
    write_csv(tmp_path / "data.csv", COLUMNS | columns)
    assert message in refusal(tmp_path, a_map(time=time))


def rewritten(folder, change):
    write_csv(folder / "data.csv", COLUMNS)
    text = (folder / "data.csv").read_text()
    (folder / "data.csv").write_bytes(change(text).encode())


TEXTS = {
    "a separator of thousands": (
        lambda s: s.replace("\n1.0,", "\n1,000.0,", 1),
        "data.csv:102: has 8 cells, the first row 7; a decimal comma or a separator of thousands"),
    "line ends of CR alone": (
        lambda s: s.replace("\n", "\r"), "data.csv: has lines that end in only CR; convert them"),
}  # fmt: skip


@pytest.mark.parametrize("case", TEXTS)
def test_text_that_would_be_misread(tmp_path, case):
    change, message = TEXTS[case]
    rewritten(tmp_path, change)
    assert message in refusal(tmp_path, a_map())


HARMLESS = {
    "a row of units below the header": lambda s: s.replace("\n", "\ns,rad,rad,rad/s,°/s,Nm,\n", 1),
    "units in brackets, blank lines": lambda s: "\n" + s.replace(
        "\n", "\n\n[s],[rad],[rad],(rad/s),[],[Nm],[N m]\n\n", 1),
    "delimiters at the ends": lambda s: s.replace("\n", ",\n"),
    "delimiters at the ends of rows": lambda s: s.replace("\n", ",\n").replace(",\n", "\n", 1),
    "a comment with commas at the end": lambda s: f"{s}# a,b,c,d,e,f,g,h,i,j\n",
    "line ends of Windows, and a mark": lambda s: "\ufeff" + s.replace("\n", "\r\n"),
}  # fmt: skip


@pytest.mark.parametrize("case", HARMLESS)
def test_text_that_is_read_all_the_same(tmp_path, case):
    rewritten(tmp_path, HARMLESS[case])
    assert "401 rows at 100 Hz" in imported(tmp_path, a_map())


def parquet(path):
    import pyarrow as pa
    from pyarrow.parquet import write_table

    write_table(pa.table(COLUMNS), path)


def matlab(path):
    from scipy.io import savemat

    savemat(path, COLUMNS, do_compression=True)


def hdf5(path):
    with h5py.File(path, "w") as file:
        for name, values in COLUMNS.items():
            file.create_dataset(name, data=values, compression="gzip")


def npz(path):
    np.savez_compressed(path, **COLUMNS)


@pytest.mark.parametrize(("name", "write"), [
    ("a.parquet", parquet), ("a.mat", matlab), ("a.h5", hdf5), ("a.npz", npz),
])  # fmt: skip
def test_a_file_that_is_damaged_within(tmp_path, name, write):
    path = tmp_path / name
    write(path)
    content = bytearray(path.read_bytes())
    damaged = slice(len(content) // 8, len(content) // 2)
    content[damaged] = b"\xaa" * len(content[damaged])
    path.write_bytes(content)
    assert f"{name}: " in refusal(tmp_path, a_map(name))


@pytest.mark.parametrize("name", ["data.csv", "data.mcap", "data.h5"])
def test_a_pipe_is_not_waited_for(tmp_path, name):
    os.mkfifo(tmp_path / name)
    message = f"files.0: {name}: is a pipe or a device, not a file"
    assert message in refusal(tmp_path, a_map(name))


@pytest.mark.parametrize("name", ["robot.yaml", "robot.urdf"])
def test_nor_is_one_in_place_of_a_robot(tmp_path, name):
    write_csv(tmp_path / "data.csv", COLUMNS)
    os.mkfifo(tmp_path / name)
    assert f"map.yaml:1: robot: {name}: cannot be read: is a pipe" in refusal(
        tmp_path, a_map(robot=name)
    )


def test_a_name_that_no_file_has(tmp_path):
    assert r"a\x00b.csv: cannot be read: No such file" in refusal(tmp_path, a_map("a\0b.csv"))


@pytest.mark.parametrize("huge", [1e7, 1e200])
def test_values_of_no_robot(tmp_path, huge):
    write_csv(tmp_path / "data.csv", COLUMNS | {"q1": huge * COLUMNS["q1"]})
    assert "map.yaml:8: joints.0.position: reaches from" in refusal(tmp_path, a_map())


def test_the_range_of_a_position_is_that_of_the_whole_recording(tmp_path):
    """Plausibility is judged by excerpts, of 10 s of each motion; its words are of all samples."""
    columns = table(30.0, rate=100.0)
    columns["q1"] = 100 + columns["q1"] + 1.5 * np.tanh(columns["t"] - 3)
    write_csv(tmp_path / "data.csv", columns)
    low, high = columns["q1"].min(), columns["q1"].max()
    assert f"reaches from {low:.4g} to {high:.4g} rad, but" in refusal(tmp_path, a_map())


def test_a_gain_of_no_drive(tmp_path):
    write_csv(tmp_path / "data.csv", COLUMNS)
    content = changed(0, "torque", gain=1e300)
    assert "map.yaml:11: joints.0.torque: has up to" in refusal(tmp_path, content)


def test_radians_taken_for_degrees_in_all_joints_are_remarked(tmp_path):
    write_csv(tmp_path / "data.csv", COLUMNS)
    content = changed(0, "position", unit="deg")
    content["joints"][1]["position"]["unit"] = "deg"
    assert "of its range, the largest share of all joints; check unit" in imported(
        tmp_path, content
    )


@pytest.mark.parametrize(("limits", "doubted"), [((9000, 9000), False), ((9000, 4000), True)])
def test_one_torque_limit_of_all_joints_is_no_measure_of_units(tmp_path, limits, doubted):
    write_csv(tmp_path / "data.csv", COLUMNS)
    the_map = write_map(tmp_path, a_map())
    text = (tmp_path / "pair.yaml").read_text()
    for stated, limit in zip((90, 40), limits, strict=True):
        text = text.replace(f"torque_limit: {stated},", f"torque_limit: {limit},")
    (tmp_path / "pair.yaml").write_text(text)
    lines = []
    import_recordings([the_map], tmp_path / "run", lambda s: lines.extend(s.lines()))
    assert any("of its limit, the largest share" in line for line in lines) == doubted


def test_a_key_of_the_map_within_a_joint_is_sent_to_its_place(tmp_path):
    write_csv(tmp_path / "data.csv", COLUMNS)
    content = a_map()
    content["joints"][1]["position_side"] = "motor"
    message = refusal(tmp_path, content)
    assert "position_side: unknown key here; write it at the top level of the file" in message


def test_names_cannot_command_the_terminal():
    name = "q\x1b[31m1\x1b]0;title\x07\x9b2J"
    assert printable(name) == r"q\x1b[31m1\x1b]0;title\x07\x9b2J"
    assert printable("größe\t[rad]\n日本") == "größe\t[rad]\n日本"
