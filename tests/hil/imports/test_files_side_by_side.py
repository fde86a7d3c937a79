"""Stamps of files side by side are compared row by row."""

import pytest
from small_recording import a_map, table, write_csv, write_map

from hil.imports.importing import import_recordings

COLUMNS = table(20.0, 100.0)
TORQUES = {name: COLUMNS[name] for name in ("m1", "m2")}


@pytest.mark.parametrize(
    ("name", "change", "says"),
    [
        ("t", lambda t: t, None),
        ("t", lambda t: 1e3 * t, None),
        ("time", lambda t: t + 0.004, None),
        ("t", lambda t: t + 0.25, "are 0.25 later than those of the first file in equal rows"),
        ("time", lambda t: 1e6 * (t - 3), "are 3 earlier than those of the first file"),
        ("t", lambda t: 1.005 * t, "run 0.5 % faster than those of the first file"),
        ("t", lambda t: 990.0 * t, "run 1 % slower than those of the first file"),
    ],
)
def test_stamps_of_torques_that_contradict_those_of_the_positions(tmp_path, name, change, says):
    write_csv(tmp_path / "data.csv", COLUMNS)
    write_csv(tmp_path / "torques.csv", {name: change(COLUMNS["t"])} | TORQUES)
    content = a_map()
    for joint in content["joints"]:
        column = joint["torque"]["column"]
        joint["torque"]["column"] = {"file": "torques.csv", "column": column}
    stated = []
    the_map = write_map(tmp_path, content)
    import_recordings([the_map], tmp_path / "run", lambda s: stated.extend(s.lines()))
    found = [line for line in stated if "torques.csv: stamps in column" in line]
    assert len(found) == (says is not None)
    if says:
        assert f"torques.csv: stamps in column {name} {says}" in found[0]
