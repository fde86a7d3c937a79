"""Exports of controller scopes: traces below one another, or channels in pairs of columns."""

import numpy as np
import pytest

from checked_files.yaml_file import FileError
from hil.imports.draft import draft_map
from hil.imports.map_file import Format
from hil.imports.readers import open_table


def stacked(traces):
    """Return traces below one another, each with its own keys."""
    lines = ["[key]; [value]", "Version; 0x03050000", "Name; Plc.Trace", "Comment; "]
    for number, (name, rows) in enumerate(traces.items()):
        lines += [f"{number}.Variable; {name}", f"{number}.Class; 14", f"{number}.Data; "]
        lines += [f"; {time}; {value}" for time, value in rows]
    return "\n".join(lines) + "\n"


def table_of(folder, text, name="trace.csv"):
    (folder / name).write_text(text)
    found = open_table(folder / name, Format())
    return found.names, np.concatenate(list(found.blocks(range(len(found.names)))))


def test_traces_below_one_another_share_their_time(tmp_path):
    text = stacked({"Axis.Pos": [(2, 25), (22, 26), (42, 27)], "Axis.On": [(2, "TRUE"), (22, 0)]})
    names, values = table_of(tmp_path, text)
    assert names == ("time", "Axis.Pos", "Axis.On")
    np.testing.assert_array_equal(values, [[2, 25, 1], [22, 26, 0]])


def test_traces_of_different_times_have_one_each_and_are_never_put_into_one_row(tmp_path):
    path = tmp_path / "trace.csv"
    path.write_text(stacked({"a": [(2, 25), (22, 26)], "b": [(3, 1), (23, 2)]}))
    found = open_table(path, Format())
    assert found.names == ("a/time", "a", "b/time", "b")
    np.testing.assert_array_equal(next(found.blocks([2, 3])), [[3, 1], [23, 2]])
    with pytest.raises(FileError, match=r"row 1 has a/time 2 and b/time 3: these channels"):
        list(found.blocks([0, 1, 3]))


def test_traces_are_drafted_with_their_time(tmp_path):
    rows = [(20 * k, np.sin(k / 9)) for k in range(60)]
    (tmp_path / "t.csv").write_text(stacked({"Axis1.Pos": rows, "Axis1.Torque": rows}))
    draft = draft_map(tmp_path / "t.csv", "t.csv")
    assert 'column: "time"' in draft
    assert 'column: "Axis1.Pos"' in draft
    assert 'column: "Axis1.Torque"' in draft


@pytest.mark.parametrize(("rows", "message"), [
    ([(2, 25), (22, "off")], "'; 22; off' in trace 'a' must be a time stamp and a number"),
    ([], "holds 1 traces without rows"),
])  # fmt: skip
def test_a_trace_that_cannot_be_used_is_named_with_its_line(tmp_path, rows, message):
    with pytest.raises(FileError, match=message):
        table_of(tmp_path, stacked({"a": rows}))


PAIRS = """\
Name\tScope of a cell
File\tcell.csv
Starttime of export\t133000000000000000\tMonday, 1 May 2023\t10:00:00.000


Name\tAxis1.Pos\tName\tAxis1.Torque
SymbolComment\t\tSymbolComment\t
Data-Type\tREAL64\tData-Type\tINT16
SampleTime[ms]\t1\tSampleTime[ms]\t1
VariableSize\t8\tVariableSize\t2

0\t1.5\t0\t12
1\t1.6\t1\t14
2\t1.7\t2\t17
EOF
"""


@pytest.mark.parametrize("delimiter", ["\t", ";", ","])
def test_channels_in_pairs_have_the_names_that_the_scope_gives(tmp_path, delimiter):
    names, values = table_of(tmp_path, PAIRS.replace(", 1", " 1").replace("\t", delimiter))
    assert names == ("Axis1.Pos/time", "Axis1.Pos", "Axis1.Torque/time", "Axis1.Torque")
    np.testing.assert_array_equal(values, [[0, 1.5, 0, 12], [1, 1.6, 1, 14], [2, 1.7, 2, 17]])


GROUPS = """\
Name;Scope of a cell
Port;851


Name;q1;q2;Name;tau1;Name;slow
Data-Type;REAL64;REAL64;Data-Type;REAL64;Data-Type;REAL64
Unit;deg (Angle);deg (Angle);Unit;(None);Unit;(None)

0;1,5;2,5;0;12;0;1
1;1,6;2,6;1;14;5;2
2;1,7;2,7;2;17
 ; ; ;3;18
"""


def test_channels_that_share_their_time_are_a_group(tmp_path):
    (tmp_path / "a.csv").write_text(GROUPS)
    found = open_table(tmp_path / "a.csv", Format())
    assert found.names == (
        "q1/time", "q1 [deg]", "q2 [deg]", "tau1/time", "tau1", "slow/time", "slow",
    )  # fmt: skip
    values = np.concatenate(list(found.blocks([0, 2, 4])))
    np.testing.assert_array_equal(
        values, [[0, 2.5, 12], [1, 2.6, 14], [2, 2.7, 17], [np.nan, np.nan, 18]]
    )
    with pytest.raises(FileError, match="row 2 has q1/time 1 and slow/time 5: these channels"):
        list(found.blocks([0, 1, 6]))


def test_one_channel_alone_is_named_by_its_scope(tmp_path):
    text = "Name;Scope\n\nName;q1\nUnit;deg\nOffset;0\n\n0;1,5\n1;1,6\n"
    names, values = table_of(tmp_path, text)
    assert names == ("q1/time", "q1 [deg]")
    np.testing.assert_array_equal(values, [[0, 1.5], [1, 1.6]])
