"""Cells of text tables that hold lists of numbers, as Python and NumPy print them."""

import numpy as np
import pytest
from small_recording import table

from checked_files.yaml_file import FileError
from hil.imports.map_file import Format
from hil.imports.readers import open_table, text

COLUMNS = table(4.0)
Q = np.stack([COLUMNS["q1"], COLUMNS["q2"]], axis=1)


def python_list(q):
    return f'"{q.tolist()}"'


def numpy_array(q):
    return str(q)


def wrapped(q):
    return '"[{!r}\n {!r}]"'.format(*q.tolist())


def ros_array(q):
    return f"\"array('d', {q.tolist()})\""


def read(path, stated=None):
    found = open_table(path, stated or Format())
    return found.names, np.concatenate(list(found.blocks(range(len(found.names)))))


@pytest.mark.parametrize("form", [python_list, numpy_array, wrapped, ros_array])
@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_lists_are_columns_by_number(tmp_path, form, delimiter):
    lines = [
        delimiter.join([repr(t), form(q), "run", repr(tau)])
        for t, q, tau in zip(COLUMNS["t"].tolist(), Q, COLUMNS["m1"].tolist(), strict=True)
    ]
    names = delimiter.join(["t [s]", "motor[0].q", "mode", "tau"])
    (tmp_path / "a.csv").write_text("\n".join([names, *lines, ""]))
    found = open_table(tmp_path / "a.csv", Format())
    assert found.names == ("t [s]", "motor[0].q/1", "motor[0].q/2", "mode", "tau")
    values = np.concatenate(list(found.blocks([0, 1, 2, 4])))
    rounding = 1e-8 if form is numpy_array else 0.0
    wanted = np.column_stack([COLUMNS["t"], Q, COLUMNS["m1"]])
    np.testing.assert_allclose(values, wanted, rtol=0, atol=rounding)


def test_lists_over_the_edge_of_a_block_are_whole(tmp_path, monkeypatch):
    monkeypatch.setattr(text, "BLOCK", 256)
    lines = [f'{k},"[{k}.5,\n {-k}.25]"' for k in range(1, 100)]
    (tmp_path / "a.csv").write_text("\n".join(["t,q", *lines]))
    values = read(tmp_path / "a.csv")[1]
    wanted = [[k, k + 0.5, -k - 0.25] for k in range(1, 100)]
    np.testing.assert_array_equal(values, wanted)


def test_a_longer_list_than_the_first_is_refused(tmp_path):
    lines = [f'{k},"[{k}.5, {k}.25]",{k}' for k in range(1, 20)]
    (tmp_path / "a.csv").write_text("\n".join(["t,q,tau", *lines, '20,"[1.0, 2.0, 3.0]",4']))
    with pytest.raises(FileError, match="has 5 cells, the first row 4"):
        read(tmp_path / "a.csv")


def test_a_list_without_end_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(text, "BLOCK", 1000)
    lines = [f'{k},"[{k}.5, {k}.25]"' for k in range(1, 20)]
    rest = "\n".join(f"{k}.5, {k}.5" for k in range(1000))
    (tmp_path / "a.csv").write_text("\n".join(["t,q", *lines, f'20,"[1.0\n{rest}']))
    with pytest.raises(FileError, match="a list of more than 1000 bytes: not a table"):
        read(tmp_path / "a.csv")


def test_brackets_in_names_and_units_are_no_lists(tmp_path):
    (tmp_path / "a.csv").write_text("t [s],q[0],q[1]\n[s],[rad],[rad]\n0,1,2\n1,2,3\n2,3,4\n")
    names, values = read(tmp_path / "a.csv")
    assert names == ("t [s]", "q[0]", "q[1]")
    np.testing.assert_array_equal(values, [[0, 1, 2], [1, 2, 3], [2, 3, 4]])
