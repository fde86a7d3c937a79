"""A recording is bit-identical in all file formats."""

import gzip
import struct
import subprocess
import sys
import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest
from small_recording import a_map, table, write_csv, write_map

from checked_files.yaml_file import FileError
from hil.imports.importing import import_recordings
from hil.imports.map_file import Format
from hil.imports.readers import open_table
from hil.imports.readers.text import TextTable
from hil.imports.tables import NoColumn, column_of
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
            file[name] = values[None]  # a column of MATLAB is a row here


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


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ('"q [x]",m\n"2,758.94",-1.41\n"-4,132.5",2.5\n"1.5",1,\n',
         [[2758.94, -1.41], [-4132.5, 2.5], [1.5, 1]]),
        ('q,m\n"1,234","1,002,003.5"\n"2,345","12.5"\n', [[1234, 1002003.5], [2345, 12.5]]),
        ("q;m\n2,758.94;-1.41\n1,234;2\n", [[2758.94, -1.41], [1234, 2]]),
        ("q;m\n2.758,94;-1,41\n1.234;2\n", [[2758.94, -1.41], [1234, 2]]),
        ("q\tm\n2.758,94\t-1,41\n", [[2758.94, -1.41]]),
    ],
)  # fmt: skip
@pytest.mark.parametrize("missing", [False, True])
def test_separators_of_thousands_are_read_where_numbers_have_both_marks(
    tmp_path, text, rows, missing
):
    last = {"\t": "\t5\n", ";": ";5\n", ",": ",5\n"}[next(d for d in "\t;," if d in text)]
    (tmp_path / "a.csv").write_text(text + last * missing)
    found = np.concatenate(list(open_table(tmp_path / "a.csv", Format()).blocks([0, 1])))
    np.testing.assert_array_equal(found, rows + [[np.nan, 5]] * missing)


def test_numbers_in_quotes_that_may_have_decimal_commas_are_refused_with_the_remedy(tmp_path):
    (tmp_path / "a.csv").write_text('q,m,n\n"1,234",2,3\n"2,345",3,4\n')
    with pytest.raises(FileError, match=r"'1,234' .*a decimal comma or a separator of thousands"):
        list(open_table(tmp_path / "a.csv", Format()).blocks([0, 1]))


@pytest.mark.parametrize("names", [False, True])
@pytest.mark.parametrize("mark", [",", "\t", " ", ";"])
def test_exchanged_rows_and_columns_are_named_with_a_remedy_that_works(tmp_path, names, mark):
    pandas = pytest.importorskip("pandas")
    t = np.arange(500) / 100
    columns = {"t": t, "q 1" if mark != " " else "q1": np.sin(t), "tau": np.cos(t)}
    lines = [
        mark.join([name] * names + [f"{x!r}" for x in v.tolist()]) for name, v in columns.items()
    ]
    text = "\n".join(lines) + "\n"
    (tmp_path / "a.csv").write_text(text.replace(".", ",") if mark == ";" else text)
    with pytest.raises(FileError, match=rf"3 lines of {500 + names} cells: rows and col") as found:
        open_table(tmp_path / "a.csv", Format())
    remedy = str(found.value).partition("as by pandas: ")[2]
    for name, path in (("a.csv", "a.csv"), ("columns.csv", "b.csv")):
        remedy = remedy.replace(name, str(tmp_path / path))
    exec(remedy, {"pandas": pandas})  # noqa: S102 - the remedy is the subject
    table = open_table(tmp_path / "b.csv", Format())
    assert table.names == (tuple(columns) if names else ("", "", ""))
    values = np.concatenate(list(table.blocks([0, 1, 2])))
    np.testing.assert_array_equal(values, np.stack([*columns.values()], axis=1))


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


@pytest.mark.parametrize(
    "zone", ["", "Z", " UTC", "+00:00", " +0000", "+00", "+00:00[Europe/London]"]
)
def test_instants_may_state_their_zone(tmp_path, zone):
    rows = "".join(f"2026-01-31T12:00:0{k}.250{zone},{k}\n" for k in range(3))
    (tmp_path / "a.csv").write_text(f"t,q\n{rows}")
    t = read(tmp_path / "a.csv", "t")[:, 0]
    np.testing.assert_allclose(t - 1769860800e9, 1e9 * np.arange(3) + 0.25e9, atol=256)


@pytest.mark.parametrize(
    "form", ["31.01.2026 12:00:{:06.3f}", "12:00:{:06.3f}", "1.1.2026 01:00:{:06.3f}"]
)
def test_days_first_and_times_of_a_day_are_instants(tmp_path, form):
    rows = [f"{form.format(0.25 * k)},{k}" for k in range(9)]
    (tmp_path / "a.csv").write_text("\n".join(["when,q", *rows]))
    found = np.concatenate(list(open_table(tmp_path / "a.csv", Format()).blocks([0])))[:, 0]
    np.testing.assert_allclose(np.diff(found), 0.25e9, atol=600)


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


Q = np.stack([COLUMNS["q1"], COLUMNS["q2"]], axis=1)


def read(path, *names):
    found = open_table(path, Format())
    return np.concatenate(list(found.blocks([column_of(found, name) for name in names])))


@pytest.mark.parametrize("kind", ["fixed", "list", "large", "structure"])
def test_lists_of_parquet_are_a_column_for_each_element(tmp_path, kind):
    pa, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    of = {"fixed": pa.list_(pa.float64(), 2), "large": pa.large_list(pa.float64())}
    values = pa.array(Q.tolist(), of.get(kind, pa.list_(pa.float64())))
    if kind == "structure":
        values = pa.array([{"state": row, "note": "so"} for row in Q.tolist()])
    parquet.write_table(pa.table({"x": values, "t": COLUMNS["t"]}), tmp_path / "a.parquet")
    begin = "x.state" if kind == "structure" else "x"
    found = read(tmp_path / "a.parquet", f"{begin}/2", "t", f"{begin}/1")
    np.testing.assert_array_equal(found, np.stack([Q[:, 1], COLUMNS["t"], Q[:, 0]], axis=1))
    assert column_of(open_table(tmp_path / "a.parquet", Format()), 2) == 1
    with pytest.raises(FileError, match=r"column x holds .*; name one of x.*/1 to x.*/2"):
        read(tmp_path / "a.parquet", "x")


def test_maps_of_parquet_are_named_with_a_remedy_that_works(tmp_path):
    pa, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    pandas = pytest.importorskip("pandas")
    kind = pa.map_(pa.string(), pa.float64())
    q = pa.array([[("j1", a), ("j2", b)] for a, b in Q.tolist()], kind)
    text = pa.array(["so"] * len(Q))
    parquet.write_table(pa.table({"t": np.arange(len(Q)), "q": q, "s": text}), tmp_path / "a.pq")
    left_out = open_table(tmp_path / "a.pq", Format()).left_out
    assert left_out["s"] == "a column of string, not of numbers; save it as numbers"
    with pytest.raises(NoColumn, match=r"no column 'q.j1': q is a column of map") as found:
        column_of(open_table(tmp_path / "a.pq", Format()), "q.j1")
    remedy = str(found.value).partition("as by pandas: ")[2]
    for name, path in (("a.pq", "a.pq"), ("keys.parquet", "b.pq")):
        remedy = remedy.replace(name, str(tmp_path / path))
    exec(remedy, {"pandas": pandas})  # noqa: S102 - the remedy is the subject
    np.testing.assert_array_equal(read(tmp_path / "b.pq", "q.j1", "q.j2"), Q)


def test_lists_of_parquet_that_end_early_or_are_missing_lack_numbers(tmp_path):
    pa, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    rows = {
        "x": [None, [1.0, 2.0], [3.0], None, [4.0, 5.0, 6.0], []],
        "one": [[k] for k in range(6)],
    }
    rows["image"] = [[0] * 1000] * 6
    parquet.write_table(pa.table(rows), tmp_path / "a.parquet")
    n = np.nan
    np.testing.assert_array_equal(
        read(tmp_path / "a.parquet", "x/1", "x/2", "one"),
        [[n, n, 0], [1, 2, 1], [3, n, 2], [n, n, 3], [4, 5, 4], [n, n, 5]],
    )
    found = open_table(tmp_path / "a.parquet", Format())
    assert found.left_out == {"image": "lists of 1000 numbers; only lists of 1 to 300 are read"}


@pytest.mark.parametrize("version", ["v7", "v7.3"])
@pytest.mark.parametrize("dated", [False, True])
def test_tables_and_timetables_of_matlab_are_columns(tmp_path, version, dated):
    matio, pandas = pytest.importorskip("matio"), pytest.importorskip("pandas")
    instants = pandas.to_timedelta(COLUMNS["t"] * 1e3, unit="ms")
    begin = pandas.Timestamp("2026-01-31 12:00")
    index = pandas.Index(begin + instants if dated else instants, name="Time")
    log = pandas.DataFrame({"q1": Q[:, 0], "q2": Q[:, 1], "note": ["so"] * N})
    timed = pandas.DataFrame({"m1": COLUMNS["m1"]}, index=index)
    few = pandas.DataFrame({"gear": [50.0, 20.0]})
    content = {"log": log, "timed": timed, "few": few, "t": COLUMNS["t"]}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        matio.save_to_mat(str(tmp_path / "a.mat"), content, version=version)
    np.testing.assert_array_equal(read(tmp_path / "a.mat", "log.q2", "log.q1"), Q[:, ::-1])
    found = read(tmp_path / "a.mat", "timed.Time", "timed.m1", "t")
    time = (found[:, 0] - found[0, 0]) / (1e9 if dated else 1.0)
    np.testing.assert_allclose(time, COLUMNS["t"], atol=1e-6)
    np.testing.assert_array_equal(found[:, 1:], np.stack([COLUMNS["m1"], COLUMNS["t"]], axis=1))
    left_out = open_table(tmp_path / "a.mat", Format()).left_out
    assert left_out["log.note"] == "a column of a table without numbers"
    assert left_out["few"].startswith("a table of MATLAB with 2 rows, fewer than the 20")


def structures():
    """Return a scope with two inputs, cells of columns, and structures appended by a loop."""
    signals = np.zeros((1, 2), dtype=[("values", object), ("label", object)])
    for k in range(2):
        signals[0, k] = (Q[:, k : k + 1], f"input {k}")
    cells, several = np.empty((1, 2), object), np.zeros((1, N), [("t", object), ("q", object)])
    cells[0, 0], cells[0, 1] = Q[:, 0], Q[:, 1]
    for k in range(N):
        several[0, k] = (COLUMNS["t"][k], Q[k])
    return {"scope": {"time": COLUMNS["t"], "signals": signals}, "q": cells, "log": several}


def test_structures_and_cells_of_matlab_are_columns(tmp_path):
    from scipy.io import savemat

    savemat(tmp_path / "a.mat", structures() | {"dt": 0.005, "empty": np.zeros((0, 0))})
    names = ("scope.signals(2).values", "q{2}", "log.q/2")
    np.testing.assert_array_equal(read(tmp_path / "a.mat", *names), np.tile(Q[:, 1:], 3))
    np.testing.assert_array_equal(read(tmp_path / "a.mat", "log.t")[:, 0], COLUMNS["t"])
    left_out = open_table(tmp_path / "a.mat", Format()).left_out
    assert left_out["dt"] == "a single number"
    assert left_out["scope.signals(1).label"] == "text"
    assert left_out["empty"] == "an array of 0 x 0 numbers"


def test_structures_and_cells_of_matlab_7_3_are_columns(tmp_path):
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:

        def put(name, value, kind="double"):
            file[name] = value
            file[name].attrs["MATLAB_class"] = np.bytes_(kind)
            return file[name].ref

        def refer(name, references, kind=None):
            file.create_dataset(name, data=np.array(references)[:, None], dtype=h5py.ref_dtype)
            if kind:
                file[name].attrs["MATLAB_class"] = np.bytes_(kind)

        columns = [put(f"#refs#/a{k}", Q[None, :, k]) for k in range(2)]
        refer("q", columns, "cell")
        refer("scope/values", columns)
        refer("log/q", [put(f"#refs#/b{k}", Q[k][:, None]) for k in range(N)])
        put("name", np.frombuffer(b"so", np.uint8).astype(np.uint16)[:, None], "char")
        for name, attribute in (("none", "MATLAB_empty"), ("T", "MATLAB_object_decode")):
            put(name, np.array([0, 0], np.uint64), "table" if name == "T" else "double")
            file[name].attrs[attribute] = 1
        file["outside"] = h5py.ExternalLink("other.mat", "/q")
    names = ("scope(2).values", "q{2}", "log.q/2")
    np.testing.assert_array_equal(read(tmp_path / "a.mat", *names), np.tile(Q[:, 1:], 3))
    found = open_table(tmp_path / "a.mat", Format())
    assert found.left_out["none"] == "empty, a double without values"
    assert found.left_out["name"] == "text"
    assert "writetable(T, 'FILE.csv')" in found.left_out["T"]
    assert not {"T", "none", "name"} & set(found.names)
    with pytest.raises(NoColumn, match=r"no column 'T\.q1': T is a MATLAB table, an object"):
        column_of(found, "T.q1")


@pytest.mark.parametrize("kind", ["table", "timetable", "timeseries", "datetime"])
def test_objects_of_matlab_are_named_with_their_class_and_how_to_save_them(tmp_path, kind, capfd):
    """Two objects beside each other, as MATLAB writes them before 7.3."""

    def element(type_, data):
        return struct.pack("<II", type_, len(data)) + data.ljust(-(-len(data) // 8) * 8, b"\0")

    def opaque(name):
        number = struct.pack("<6I", 0xDD000000, 2, 1, 1, 1, 1)
        array = element(
            14,
            element(6, struct.pack("<II", 13, 0))
            + element(5, struct.pack("<ii", 6, 1))
            + element(1, b"")
            + element(6, number),
        )
        parts = [
            element(6, struct.pack("<II", 17, 0)),
            element(1, name),
            element(1, b"MCOS"),
            element(1, kind.encode()),
            array,
        ]
        return element(14, b"".join(parts))

    header = b"MATLAB 5.0 MAT-file".ljust(124, b" ") + struct.pack("<HH", 0x0100, 0x4D49)
    (tmp_path / "a.mat").write_bytes(header + opaque(b"first") + opaque(b"second"))
    with pytest.raises(FileError) as refused:
        open_table(tmp_path / "a.mat", Format())
    for name in ("first", "second"):
        assert f"{name}: a MATLAB {kind}, an object: not supported; in" in str(refused.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["a.npz", "a.npy", "a.h5", "a.mat", "b.mat"])
@pytest.mark.parametrize("axes", [(1, 2, 0), (2, 1, 0), (0, 2, 1), (2, 0, 1)])
def test_dimensions_of_one_element_do_not_count(tmp_path, name, axes):
    """As `To Workspace` of Simulink saves signals by default."""
    array = Q[:, :, None].transpose(axes)
    if name == "a.npz":
        np.savez(tmp_path / name, q=array)
    elif name == "a.npy":
        np.save(tmp_path / name, array)
    elif name == "a.mat":
        from scipy.io import savemat

        savemat(tmp_path / name, {"q": array})
    else:
        with h5py.File(tmp_path / name, "w", userblock_size=512 * (name == "b.mat")) as file:
            file["q"] = array
    columns = ("1", "2") if name == "a.npy" else ("q/1", "q/2")
    np.testing.assert_array_equal(read(tmp_path / name, *columns), Q)


@pytest.mark.parametrize("name", ["a.npz", "a.h5"])
def test_arrays_that_are_no_columns_are_left_out_by_name(tmp_path, name):
    if name == "a.npz":
        np.savez(tmp_path / name, q=Q, note=np.array("so"), image=np.zeros((9, 9, 9)),
                 thing=np.array([{}], dtype=object))  # fmt: skip
    else:
        with h5py.File(tmp_path / name, "w") as file:
            file["q"], file["note"], file["image"] = Q, "so", np.zeros((9, 9, 9))
    left_out = open_table(tmp_path / name, Format()).left_out
    assert left_out["image"] == "an array of 9 x 9 x 9 numbers"
    assert "not of numbers" in left_out["note"]
    if name == "a.npz":
        assert left_out["thing"] == "an array of Python objects (not unpickled, for safety)"


def test_an_empty_file_says_so(tmp_path):
    (tmp_path / "a.mat").write_bytes(b"")
    with pytest.raises(FileError, match=r"a.mat: is empty \(0 bytes\); copy or download it again"):
        open_table(tmp_path / "a.mat", Format())


@pytest.mark.parametrize(("name", "package"), [("a.parquet", "pyarrow"), ("a.mcap", "rosbags")])
def test_a_package_that_is_missing_is_named_with_its_remedy(tmp_path, monkeypatch, name, package):
    (tmp_path / name).write_bytes(b"PAR1")
    for module in (package, "pyarrow.parquet", "rosbags.highlevel", "rosbags.typesys"):
        monkeypatch.setitem(__import__("sys").modules, module, None)
    with pytest.raises(FileError) as refused:
        open_table(tmp_path / name, Format())
    assert f"needs the package {package}" in str(refused.value)
    assert remedy("recordings", package) in str(refused.value)


@pytest.mark.skipif(not Path("/proc/self/status").is_file(), reason="memory is bounded on Linux")
def test_the_reader_of_matlab_takes_no_more_memory_than_the_budget_of_its_file(
    tmp_path: Path,
) -> None:
    (tmp_path / "a.mat").write_bytes(b"MATLAB 5.0")
    code = """if True:
        import sys
        from pathlib import Path
        import numpy as np
        from hil.imports.readers.matlab import limit_memory
        limit_memory(Path(sys.argv[1]))
        np.ones(100_000_000 // 8)
        try:
            np.ones(300_000_000 // 8)
        except MemoryError:
            print("refused")
    """
    run = [sys.executable, "-c", code, str(tmp_path / "a.mat")]
    done = subprocess.run(  # noqa: S603 - our own program
        run, capture_output=True, text=True, check=True
    )
    assert done.stdout == "refused\n"
