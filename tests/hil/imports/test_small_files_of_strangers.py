"""Small files that would take gigabytes or minutes are refused, or read in bounded memory.

Harmless input: the budget is lowered, so that some kilobytes exceed it; operations with a formerly
quadratic time are counted.
"""

from __future__ import annotations

import gzip
import json
import tracemalloc
import zipfile
from typing import TYPE_CHECKING

import h5py
import numpy as np
import pytest

from checked_files import budget
from checked_files.yaml_file import FileError
from hil.imports import tables
from hil.imports.map_file import Format
from hil.imports.readers import layout, matlab, open_table, text

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(budget, "BASE", 50_000)
    monkeypatch.setattr(budget, "SHARE", 0)


def _text(content: str) -> Callable[[Path], object]:
    return lambda path: path.write_text(content)


def _gzip(content: str) -> Callable[[Path], object]:
    return lambda path: path.write_bytes(gzip.compress(content.encode()))


def _parquet(path: Path) -> None:
    """Write 2000 columns, whose description alone is large."""
    pa, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    parquet.write_table(pa.table({f"c{k}": pa.array([0.0]) for k in range(2000)}), path)


def _mcap(path: Path) -> None:
    """Write 100 chunks of a message each."""
    mcap = pytest.importorskip("mcap.writer")
    pytest.importorskip("rosbags")
    with path.open("wb") as file:
        writer = mcap.Writer(file, chunk_size=1, compression=mcap.CompressionType.NONE)
        writer.start()
        channel = writer.register_channel("/a", "cdr", writer.register_schema("a", "ros2msg", b""))
        for stamp in range(100):
            writer.add_message(channel, stamp, b"", stamp)
        writer.finish()


def _hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for k in range(5):
            file[str(k)] = np.zeros(2)


def _archive(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as file:
        for k in range(100):
            file.writestr(f"{k}.npy", b"")


def _wide(path: Path) -> None:
    """Declare 5000 columns in a file of 1400 bytes."""
    with h5py.File(path, "w") as file:
        file.create_dataset("q", (5000, 5000), "f4", chunks=(100, 100))


def _compound(path: Path) -> None:
    """Declare rows of 4 kB in a file of 1400 bytes: reading a column once read a whole block of
    rows.
    """
    with h5py.File(path, "w") as file:
        file.create_dataset("q", (1000,), np.dtype([("a", "f4", (1000,))]), chunks=(1,))


def _variables(path: Path) -> None:
    """Write two variables of MATLAB, and six without columns."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for k in range(8):
            file[f"v{k}"] = np.zeros(2 if k < 2 else 1)


TRACE = "[key]; value\n1.Variable; q\n"
LARGE: dict[str, Callable[[Path], object]] = {
    "trace.csv.gz": _gzip(TRACE + ";1;1\n" * 20_000),
    "rows.csv.gz": _gzip("1,2\n" * 20_000),
    "name.csv": _text(TRACE + f"2.Variable; {'x' * 10_000}\n"),
    "wide.h5": _wide,
    "compound.h5": _compound,
    "variables.mat": _variables,
    "traces.csv": _text("[key]; value\n" + "".join(f"{k}.Variable; q\n" for k in range(100))),
    "trace.dat": _text("DIAEXTENDED\n" + "#BEGINCHANNELHEADER\n" * 100),
    "kinds.xml": _text("".join(f"<a{k}/>" for k in range(1000))),
    "names.xml": _text(("<r>" + "<a>1</a>" * 1000 + "</r>") * 20),
    "words.xml": _text("<r><a>1</a></r>" * 20
                       + "<r>" + "".join(f"<b{k}>x</b{k}>" for k in range(500)) + "</r>"),
    "columns.parquet": _parquet,
    "entries.npz": _archive,
    "chunks.mcap": _mcap,
    "datasets.h5": _hdf5,
}  # fmt: skip


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("name", LARGE)
def test_a_file_that_becomes_larger_than_its_budget_is_refused(tmp_path: Path, name: str) -> None:
    LARGE[name](tmp_path / name)
    with pytest.raises(FileError, match=r"would take .* at most 0\.05 MB allowed"):
        for _ in open_table(tmp_path / name, Format()).blocks([0]):
            pass


@pytest.mark.usefixtures("small")
def test_text_that_is_not_kept_counts_against_a_bound_of_time_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Text of 4 times its file and 200 MB was refused, though it is read block by block."""
    path = tmp_path / "a.csv.gz"
    path.write_bytes(gzip.compress(b"t,q\n1,2\n" + b"#\n" * 100_000 + b"3,4\n"))
    assert np.concatenate(list(open_table(path, Format()).blocks([0, 1]))).tolist() == [
        [1, 2],
        [3, 4],
    ]
    path.write_bytes(gzip.compress(b"t,q\n1,2\n" + b"#\n" * 200_000))
    with pytest.raises(
        FileError, match=r"its text would take .* at most 0\.25 MB .*0 times the file.*LIMIT=1 in"
    ):
        list(open_table(path, Format()).blocks([0, 1]))
    monkeypatch.setattr(text, "BLOCK", 1000)
    path.write_bytes(gzip.compress(b"t,q\n1,2\n#" + b"x" * 5000 + b"\n"))
    with pytest.raises(FileError, match="has a line of more than 1000 bytes"):
        list(open_table(path, Format()).blocks([0, 1]))


@pytest.mark.usefixtures("small")
def test_a_large_dataset_is_refused_where_its_rows_are_read_not_before(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("q", (10**9,), "f4", chunks=(1000,))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tables, "ROWS", 1000)
        blocks = open_table(tmp_path / "a.h5", Format()).blocks([0])
        assert sum(len(next(blocks)) for _ in range(6)) == 6000
        with pytest.raises(FileError, match=r"the part read so far would take 0\.056 MB"):
            next(blocks)


def test_elements_of_xml_nest_as_deep_as_is_usual(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text("<a>" * 300 + "</a>" * 300)
    with pytest.raises(FileError, match="nests elements deeper than 200 levels; flatten"):
        open_table(tmp_path / "a.xml", Format())


def test_equal_elements_of_a_row_are_numbered_without_a_search(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(("<r>" + "<a>1</a>" * 3 + "<b><c>2</c></b></r>") * 20)
    table = open_table(tmp_path / "a.xml", Format())
    assert table.names == ("a", "a/2", "a/3", "b.c")
    assert len(next(iter(table.blocks([0, 2])))) == 20


def test_a_long_cell_costs_the_other_rows_nothing(tmp_path: Path) -> None:
    """An array of text is as wide as its longest cell: 900 kB became 4.7 GB."""
    path = tmp_path / "a.csv"
    path.write_text("t,q,r\n" + "1,2,3\n" * 50 + f"nan,2,{'x' * 5000}\n" + "1,,3\n" * 20_000)
    table = open_table(path, Format())
    tracemalloc.start()
    rows = np.concatenate(list(table.blocks([0, 1])))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert rows.shape == (20_051, 2)
    assert np.isnan(rows[50, 0])
    assert np.isnan(rows[51:, 1]).all()
    assert peak < 50_000_000
    path.write_text("t,q\n" + "1,2\n" * 50 + f"1,{'x' * 5000}\n" + "1,\n" * 20_000)
    with pytest.raises(FileError, match=r"a\.csv:52: 'x+\.\.\. \(5000 characters\)' in column 2"):
        list(open_table(path, Format()).blocks([0, 1]))


def test_pieces_of_a_text_keep_its_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text, "PIECE", 4)
    whole = b"1,2\n3,4\nlong,line\n\n5,6"
    pieces = list(text._pieces(whole))
    assert b"".join(pieces) == whole
    assert len(pieces) > 1
    assert all(piece.endswith(b"\n") for piece in pieces[:-1])


@pytest.mark.parametrize(
    ("line", "cells"),
    [('a;"b;c";d', ["a", "b;c", "d"]), ('"a";b', ["a", "b"]), ('a;b"', ["a;b"]),
     ('"x"y;z', ['x"y', "z"]), ("a;;b", ["a", "", "b"]), ('""', [""])],
)  # fmt: skip
def test_a_quoted_cell_holds_the_delimiter(line: str, cells: list[str]) -> None:
    assert layout.cells(line, ";") == cells


def test_a_line_with_a_quotation_mark_is_split_in_one_pass() -> None:
    """Each delimiter looked at the rest of its line: 60 kB took ten seconds."""

    line = 'a;"' + ";" * 200_000
    assert layout.cells(line, ";")[1:] == [""] * 200_000


def test_lists_of_parquet_are_judged_before_they_are_read(tmp_path: Path) -> None:
    pa, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    lists = pa.ListArray.from_arrays(pa.array([0, 2, 100_000], pa.int32()), pa.array([0.0] * 10**5))
    path = tmp_path / "a.parquet"
    parquet.write_table(pa.table({"t": [0.0, 1.0], "a.b": lists}), path, compression="zstd")
    assert "a.b/1" in open_table(path, Format()).names
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(budget, "BASE", 500_000)
        table = open_table(path, Format())
    assert table.names == ("t", "a.b")
    assert table.left_out["a.b"] == "lists of 100000 numbers in a group of rows"


def test_text_beside_a_number_of_parquet_is_not_read(tmp_path: Path) -> None:
    """A text stored once is repeated in every row: 800 bytes became 4.9 GB."""
    pa, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    part = {"t": 1.5, "half": np.float16(0.5), "text": "x" * 10_000}
    rows = pa.array([{**part, "parts": [part]}] * 1000)
    parquet.write_table(pa.table({"a": rows, "a.b": [2.0] * 1000}), tmp_path / "a.parquet")
    table = open_table(tmp_path / "a.parquet", Format())
    wanted = ["a.t", "a.half", "a.parts/1.t", "a.parts/1.half", "a.b"]
    before = pa.total_allocated_bytes()
    blocks = table.blocks([table.names.index(name) for name in wanted])
    block = next(blocks)
    assert pa.total_allocated_bytes() - before < 1_000_000
    assert block.shape == (1000, 5)
    assert block[-1].tolist() == [1.5, 0.5, 1.5, 0.5, 2.0]
    parquet.write_table(pa.table({"a": rows, "a.text": [2.0] * 1000}), tmp_path / "a.parquet")
    with pytest.raises(FileError, match=r"two columns are named a\.text"):
        list(open_table(tmp_path / "a.parquet", Format()).blocks([1]))


def test_a_column_of_missing_lists_is_searched_for_a_while(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pa, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    reader = pytest.importorskip("hil.imports.readers.parquet")
    monkeypatch.setattr(reader, "ROWS", 10)
    monkeypatch.setattr(reader, "LOOKED_AT", 3)
    for missing, names in ((20, {"q/1", "q/2"}), (40, set())):
        lists = pa.array([None] * missing + [[1.0, 2.0]] * 5, pa.list_(pa.float64()))
        parquet.write_table(pa.table({"q": lists}), tmp_path / "a.parquet")
        assert set(open_table(tmp_path / "a.parquet", Format()).names) == {"q", *names}


def test_an_object_of_json_is_read_as_far_as_a_sample_goes(tmp_path: Path) -> None:
    reader = pytest.importorskip("hil.imports.readers.parquet")
    pytest.importorskip("pyarrow.json")
    path = tmp_path / "a.json"
    samples = [{"t": k, "words": "x" * 5000} for k in range(20)]  # longer than the first block
    path.write_text(json.dumps(samples))
    assert len(next(iter(open_table(path, Format()).blocks([0])))) == 20
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reader, "OBJECT", 4000)
        with pytest.raises(FileError, match="of at most 4000 characters per object"):
            open_table(path, Format())


def test_groups_and_cells_of_a_mat_file_are_read_once(tmp_path: Path) -> None:
    """Two names of one group at each of 40 levels are 10^12 names."""
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        group = file.create_group("g")
        for k in range(40):
            inner = file.create_group(f"#refs#/{k}")
            group["a"] = group["b"] = inner
            group = inner
        group["q"] = np.arange(100.0)
        cell = file.create_dataset("c", (2,), h5py.ref_dtype)
        cell[:] = [cell.ref, cell.ref]
        cell.attrs["MATLAB_class"] = np.bytes_("cell")
    table = open_table(tmp_path / "a.mat", Format())
    assert table.names == ("g" + ".a" * 40 + ".q",)
    assert table.left_out["g.b"] == "a second name of the same values"
    assert "c{1}" in table.left_out


def test_the_elements_of_a_cell_are_open_one_after_another(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        kept = file.create_group("#refs#")
        cell = file.create_dataset("q", (50,), h5py.ref_dtype)
        cell[:] = [kept.create_dataset(str(k), data=[k, 2.0 * k]).ref for k in range(50)]
        cell.attrs["MATLAB_class"] = np.bytes_("cell")
    with h5py.File(tmp_path / "a.mat") as file:
        elements = matlab._Elements(tmp_path / "a.mat", "q", file["q"])
        before = h5py.h5f.get_obj_count(file.id, h5py.h5f.OBJ_DATASET)
        assert [element[1] for element in elements] == [2.0 * k for k in range(50)]
        assert h5py.h5f.get_obj_count(file.id, h5py.h5f.OBJ_DATASET) <= before + 1
    rows = next(iter(open_table(tmp_path / "a.mat", Format()).blocks([0, 1])))
    assert rows[:, 1].tolist() == [2.0 * k for k in range(50)]


def test_an_archive_has_no_two_arrays_of_one_name(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as file:
        file.writestr("q.npy", b"")
        with pytest.warns(UserWarning, match="Duplicate"):
            file.writestr("q.npy", b"")
    with pytest.raises(FileError, match="has two arrays of one name"):
        open_table(tmp_path / "a.npz", Format())


def test_a_listing_names_no_file_twice(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    (tmp_path / "a.db3").write_bytes(b"")
    (tmp_path / "metadata.yaml").write_text(
        "rosbag2_bagfile_information: {relative_file_paths: [a.db3, x/a.db3]}\n"
    )
    with pytest.raises(FileError, match=r"a\.db3: is listed twice in metadata\.yaml"):
        open_table(tmp_path, Format())


def test_layouts_of_messages_without_end_are_not_kept() -> None:
    states = pytest.importorskip("hil.imports.readers.joint_states")
    rows = states.Rows([("position", "q")], lambda _: None, cdr=True)
    values = dict.fromkeys(states.PARTS, np.zeros((1, 1))) | {"sec": np.zeros(1), "nanosec": 0}
    for k in range(2 * states.LAYOUTS):
        rows._fill(np.zeros((1, 1)), np.array([0]), (f"joint {k}",), values)
    assert len(rows._places) == states.LAYOUTS
