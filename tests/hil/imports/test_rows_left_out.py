"""Rows missing without stamps: both joints jump, and the parts are separate motions."""

import numpy as np
import pytest
from small_recording import a_map, table, write_csv, write_map

from hil.imports.importing import import_recordings

COLUMNS = table(40.0, rate=100.0)
N = len(COLUMNS["t"])


def imported(folder, kept, **columns):
    """Import some rows at a stated rate; return the statement."""
    write_csv(folder / "data.csv", {name: x[kept] for name, x in (COLUMNS | columns).items()})
    stated = []
    the_map = write_map(folder, a_map(time={"rate": 100.0}, accept=["spikes"]))
    import_recordings([the_map], folder / "run", stated.append)
    return stated[0]


def test_the_parts_are_motions_and_the_first_row_is_named(tmp_path):
    rows = np.arange(N)
    kept = rows[~np.isin(rows // 30, [20, 70, 100])]
    stated = imported(tmp_path, kept)
    assert len(stated.motions) == 4
    (said,) = [s.message for s in stated.suspicions]
    assert "positions jump from row 600 to 601, and 3 times in all" in said


def test_a_single_jump_is_named_without_a_count(tmp_path):
    stated = imported(tmp_path, np.delete(np.arange(N), np.arange(600, 630)))
    (said,) = [s.message for s in stated.suspicions]
    assert "positions jump from row 600 to 601: rows are missing there" in said


def twitch(x):
    """Return positions that rest, move by less than a usual change of steps, and begin to move."""
    rest = x[0] + 1e-6 * np.random.default_rng(1).standard_normal(200)
    rest[100:] += 1e-4
    return np.concatenate([rest, x[:-200]])


def held(x):
    return np.repeat(x[::5], 5)[:N]


def slipped(x):
    return x + 0.3 * (np.arange(N) > 1500)


def rounded_to_digits(x, digits=2):
    """Round to significant digits: steps grow tenfold at 0.1, 1, 10, ..."""
    step = 10.0 ** (np.floor(np.log10(np.maximum(np.abs(x), 1e-9))) + 1 - digits)
    return np.round(x / step) * step


@pytest.mark.parametrize(
    "columns",
    [
        {},
        {f"q{k}": held(COLUMNS[f"q{k}"]) for k in (1, 2)},
        {"q1": slipped(COLUMNS["q1"])},
        {f"q{k}": rounded_to_digits(COLUMNS[f"q{k}"]) for k in (1, 2)},
        {f"{x}{k}": twitch(COLUMNS[f"{x}{k}"]) for k in (1, 2) for x in "qm"},
    ],
    ids=["nothing", "held values", "a slip of one joint", "significant digits", "a twitch"],
)
def test_nothing_else_splits_a_recording(tmp_path, columns):
    stated = imported(tmp_path, np.arange(N), **columns)
    assert not any("rows are missing" in s.message for s in stated.suspicions)
