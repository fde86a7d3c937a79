"""A recording is the same, to the last bit, from whatever file it comes."""

import gzip

import h5py
import numpy as np
import pytest
from small_recording import a_map, table, write_csv, write_map

from checked_files.yaml_file import FileError
from hil.imports.importing import import_recordings
from hil.imports.map_file import Format
from hil.imports.readers import open_table
from hil.imports.readers.text import TextTable
from hil.imports.tables import column_of
from hil.optional_packages import remedy

COLUMNS = table(4.0)
N = len(COLUMNS["t"])


def csv(path):
    write_csv(path, COLUMNS)


def compressed_csv(path):
    plain = path.with_suffix("")
    write_csv(plain, COLUMNS)
    path.write_bytes(gzip.compress(plain.read_bytes()))


def tsv(path):
    write_csv(path, COLUMNS, "\t")


def european(path):
    write_csv(path, COLUMNS, ";")
    path.write_text(path.read_text().replace(".", ","))


def blanks(path):
    np.savetxt(path, np.stack([*COLUMNS.values()], axis=1), fmt="%25.17g",
               header=" ".join(COLUMNS))  # fmt: skip


def quoted(path):
    write_csv(path, {"note": np.zeros(N), **COLUMNS})
    head, *rows = path.read_text().splitlines()
    rows = [f'"so, so",{",".join(f"{chr(34)}{c}{chr(34)}" for c in r.split(",")[1:])}'
            for r in rows]  # fmt: skip
    path.write_text("\n".join([head, *rows]))


def npz(path):
    np.savez(path, **COLUMNS)


def structured_npy(path):
    array = np.zeros(N, dtype=[(name, float) for name in COLUMNS])
    for name, values in COLUMNS.items():
        array[name] = values
    np.save(path, array)


def matlab(path):
    from scipy.io import savemat

    savemat(path, COLUMNS)


def matlab_7_3(path):
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in COLUMNS.items():
            file[name] = values[None]  # a column of MATLAB lies as a row


def hdf5(path):
    with h5py.File(path, "w") as file:
        for name, values in COLUMNS.items():
            file.create_dataset(name, data=values, chunks=True, compression="gzip")


def parquet(path):
    import pyarrow as pa
    from pyarrow.parquet import write_table

    write_table(pa.table(COLUMNS), path)


WRITERS = {
    "a.csv": csv, "b.csv.gz": compressed_csv, "c.tsv": tsv, "d.csv": european, "e.txt": blanks,
    "f.csv": quoted, "g.npz": npz, "h.npy": structured_npy, "i.mat": matlab, "j.mat": matlab_7_3,
    "k.h5": hdf5, "l.parquet": parquet,
}  # fmt: skip


@pytest.mark.parametrize("name", WRITERS)
def test_numbers_are_read_as_they_were_written(tmp_path, name):
    WRITERS[name](tmp_path / name)
    found = open_table(tmp_path / name, Format())
    wanted = [column_of(found, key) for key in COLUMNS]
    values = np.concatenate(list(found.blocks(wanted)))
    np.testing.assert_array_equal(values, np.stack([*COLUMNS.values()], axis=1))


@pytest.mark.parametrize("name", ["a.csv", "i.mat", "k.h5", "l.parquet"])
def test_each_becomes_the_same_run(tmp_path, name):
    WRITERS[name](tmp_path / name)
    run = import_recordings([write_map(tmp_path, a_map(name))], tmp_path / "run")
    recording = run["map-01"].recording
    np.testing.assert_array_equal(recording.q[:, 1], COLUMNS["q2"])
    np.testing.assert_array_equal(recording.tau[:, 0], COLUMNS["m1"])
    np.testing.assert_allclose(recording.time, COLUMNS["t"], atol=1e-12)


@pytest.mark.parametrize("name", ["a.npz", "b.h5", "c.mat", "d.mat"])
@pytest.mark.parametrize("turned", [False, True])
def test_columns_of_an_array_go_by_number_whichever_way_it_lies(tmp_path, name, turned):
    from scipy.io import savemat

    array = np.stack([COLUMNS["q1"], COLUMNS["q2"]], axis=1)
    lying, path = array.T if turned else array, tmp_path / name
    if name == "a.npz":
        np.savez(path, q=lying)
    elif name == "c.mat":
        savemat(path, {"data": {"q": lying}})
    else:
        with h5py.File(path, "w", userblock_size=512) as file:
            file["data/q"] = lying
    found = open_table(path, Format())
    key = {"a.npz": "q/2", "b.h5": "data/q/2"}.get(name, "data.q/2")
    values = np.concatenate(list(found.blocks([column_of(found, key)])))
    np.testing.assert_array_equal(values[:, 0], COLUMNS["q2"])


def test_a_file_without_a_header_has_numbered_columns(tmp_path):
    np.savetxt(tmp_path / "bare.csv", np.stack([*COLUMNS.values()], axis=1), delimiter=",")
    found = open_table(tmp_path / "bare.csv", Format())
    assert column_of(found, 3) == 2
    assert next(found.blocks([0])).shape == (N, 1)


def test_a_row_of_units_and_lines_before_the_header_are_no_rows(tmp_path):
    text = "recorded on a Monday\n% calm\ntime, angle\ns, deg\n\n0.0, 1.5\n0.1, 2.5\n"
    (tmp_path / "a.csv").write_text(text)
    found = open_table(tmp_path / "a.csv", Format(skip=1, comment="%"))
    assert np.concatenate(list(found.blocks([0, 1]))).tolist() == [[0.0, 1.5], [0.1, 2.5]]


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("q\n1\n2\n", ("q",)),
        ("1\n2\n", ("",)),
        ("# t q\n1 5\n2 6\n", ("t", "q")),
        ("% t q\n1 5\n2 6\n", ("t", "q")),
        (",t\n1,5\n2,6\n", ("", "t")),
        ("1,5,\n2,6,\n", ("", "", "")),
        ("t|q\n1|5\n2|6\n", ("t", "q")),
        ("  1   5\n  2   6\n", ("", "")),
        ("q [°];x\n1;0,5\n2;0,6\n", ("q [°]", "x")),
    ],
)
def test_small_tables_of_many_layouts(tmp_path, text, names):
    (tmp_path / "a.csv").write_bytes(text.encode("latin-1"))
    found = open_table(tmp_path / "a.csv", Format())
    assert found.names == names
    assert np.concatenate(list(found.blocks([0])))[:, 0].tolist() == [1, 2]


def test_empty_cells_and_short_rows_are_missing(tmp_path):
    (tmp_path / "a.csv").write_text("t,q\n0,1\n1,\n2\n3,NaN\n4,5\n")
    found = open_table(tmp_path / "a.csv", Format())
    np.testing.assert_array_equal(
        np.concatenate(list(found.blocks([0, 1])))[:, 1], [1, np.nan, np.nan, np.nan, 5]
    )


def test_instants_as_text_are_nanoseconds(tmp_path):
    rows = [f"2026-01-31{mark}12:00:00.{k:03}{zone},{k}" for k, (mark, zone) in
            enumerate([(" ", ""), ("T", ""), ("T", "Z")])]  # fmt: skip
    (tmp_path / "a.csv").write_text("\n".join(["when,q", *rows]))
    values = np.concatenate(list(open_table(tmp_path / "a.csv", Format()).blocks([0])))[:, 0]
    np.testing.assert_allclose(np.diff(values), 1e6, atol=300)  # doubles of 2026 hold 256 ns


def test_missing_cells_and_instants_are_read_at_once_not_cell_by_cell(tmp_path, monkeypatch):
    monkeypatch.setattr(TextTable, "_read_row_by_row", None)
    begin = "2026-01-31T12:00:00"
    (tmp_path / "a.csv").write_text(
        f"when,q,x\n{begin}.001,0.5,1\n{begin}.002Z,,2\n,NULL, none\n{begin}.004,1.5, 4\n"
    )
    values = np.concatenate(list(open_table(tmp_path / "a.csv", Format()).blocks([0, 1, 2])))
    first = float(np.datetime64(f"{begin}.001", "ns").astype(np.int64))
    np.testing.assert_allclose(values[:, 0] - first, [0, 1e6, np.nan, 3e6], atol=300)
    np.testing.assert_array_equal(values[:, 1:], [[0.5, 1], [np.nan, 2], [np.nan] * 2, [1.5, 4]])


@pytest.mark.parametrize("header", ["", "t,q\r\n"])
@pytest.mark.parametrize("cell", ["5", ""])
def test_files_of_windows_are_read(tmp_path, header, cell):
    text = f"\ufeff{header}0,1\r\n1,2\r\n2,{cell}\r\n"
    (tmp_path / "a.csv").write_bytes(text.encode())
    found = open_table(tmp_path / "a.csv", Format())
    assert found.names == (("t", "q") if header else ("", ""))
    values = np.concatenate(list(found.blocks([0, 1])))
    np.testing.assert_array_equal(values, [[0, 1], [1, 2], [2, float(cell or "nan")]])


@pytest.mark.parametrize("name", ["a.csv", "b.csv.gz"])
def test_blocks_end_anywhere(tmp_path, monkeypatch, name):
    WRITERS[name](tmp_path / name)
    monkeypatch.setattr("hil.imports.readers.text.BLOCK", 1000)
    found = open_table(tmp_path / name, Format())
    blocks = list(found.blocks([6, 0]))
    assert len(blocks) > 20
    np.testing.assert_array_equal(np.concatenate(blocks)[:, 0], COLUMNS["m2"])


@pytest.mark.parametrize(("name", "package"), [("a.parquet", "pyarrow"), ("a.mcap", "rosbags")])
def test_a_package_that_is_missing_is_named_with_its_remedy(tmp_path, monkeypatch, name, package):
    (tmp_path / name).write_bytes(b"PAR1")
    for module in (package, "pyarrow.parquet", "rosbags.highlevel", "rosbags.typesys"):
        monkeypatch.setitem(__import__("sys").modules, module, None)
    with pytest.raises(FileError) as refused:
        open_table(tmp_path / name, Format())
    assert f"needs the package {package}" in str(refused.value)
    assert remedy("recordings", package) in str(refused.value)
