"""Columns that have numbers in different rows are named, with a remedy that joins them."""

import numpy as np
import pytest
from small_recording import a_map, motion, table, write_map

from checked_files.yaml_file import FileError
from hil.imports.importing import import_recordings

COLUMNS = table(20.0, rate=100.0)
CELLS = {name: [repr(float(x)) for x in values] for name, values in COLUMNS.items()}


def write(folder, rows):
    """Write rows of stamp and dictionary of cells; absent cells are empty."""
    names = list(COLUMNS)
    lines = [",".join([t, *(cells.get(n, "") for n in names[1:])]) for t, cells in rows]
    (folder / "data.csv").write_text("\n".join([",".join(names), *lines]) + "\n")


def topics(*groups, common=0):
    """Return rows of several topics, some of which are common."""
    rows = []
    for k in range(len(COLUMNS["t"])):
        cells = [{name: CELLS[name][k] for name in group} for group in groups]
        if common and k % common == 0:
            cells = [{name: x for each in cells for name, x in each.items()}]
        rows += [(repr(k / 100 + 1e-3 * n), each) for n, each in enumerate(cells)]
    return rows


APART = {
    "torques": topics(["q1", "q2"], ["m1", "m2"]),
    "a joint": topics(["q1", "m1"], ["q2", "m2"]),
    "chance": topics(["q1", "q2"], ["m1", "m2"], common=15),
}


@pytest.mark.parametrize("case", APART)
def test_topics_of_different_times_are_named_and_can_be_joined(tmp_path, case, monkeypatch):
    pandas = pytest.importorskip("pandas")
    write(tmp_path, APART[case])
    the_map = write_map(tmp_path, a_map())
    with pytest.raises(FileError, match="columns have numbers in different rows: of ") as refused:
        import_recordings([the_map], tmp_path / "run")
    monkeypatch.chdir(tmp_path)
    exec(str(refused.value).partition("pandas: ")[2], {"pandas": pandas})  # noqa: S102
    (run,) = import_recordings([write_map(tmp_path, a_map("joined.csv"))], tmp_path / "run")
    q, _, _ = motion(run.recording.time + 0.005)  # the first row may lack a torque
    np.testing.assert_allclose(run.recording.q, q, atol=0.05)


GOOD = {
    "rare torques": [
        (t, {n: CELLS[n][k] for n in ("q1", "q2", "m1", "m2") if n[0] == "q" or k % 10 == 0})
        for k, t in enumerate(CELLS["t"])
    ],
    "begin later": [
        (t, {n: CELLS[n][k] for n in ("q1", "q2", "m1", "m2") if (k < 1050) == (n[0] == "q")
             or 950 < k < 1060})
        for k, t in enumerate(CELLS["t"])
    ],
}  # fmt: skip


@pytest.mark.parametrize("case", GOOD)
def test_common_rows_are_a_recording_however_few(tmp_path, case):
    write(tmp_path, GOOD[case])
    assert import_recordings([write_map(tmp_path, a_map())], tmp_path / "run")
