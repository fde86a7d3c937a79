"""Rows written twice, and single rows missing, at a stated rate: steps of positions tell."""

import numpy as np
import pytest
from small_recording import a_map, motion, table, write_csv, write_map

from hil.imports.importing import import_recordings

COLUMNS = table(40.0, rate=100.0)
N = len(COLUMNS["t"])
ROWS = np.arange(N)


def imported(folder, kept, accept=None, **columns):
    """Import some rows at a stated rate; return run and statement."""
    write_csv(folder / "data.csv", {name: x[kept] for name, x in (COLUMNS | columns).items()})
    stated = []
    the_map = write_map(folder, a_map(time={"rate": 100.0}, accept=accept))
    return import_recordings([the_map], folder / "run", stated.append), stated[0]


def some_rows(share, seed=1):
    return np.random.default_rng(seed).random(N) < share


def deviation(run):
    """Return the greatest deviation of positions from the true motion."""
    (recording,) = [each.recording for each in run]
    return np.abs(recording.q - motion(recording.time)[0]).max()


@pytest.mark.parametrize("share", [0.004, 0.04, 0.12])
def test_rows_that_were_written_twice_are_left_out(tmp_path, share):
    twice = some_rows(share)
    run, stated = imported(tmp_path, np.repeat(ROWS, 1 + twice))
    lines = "\n".join(stated.lines())
    assert f"{twice.sum()} rows are written twice" in lines
    assert "repeat the row before" not in lines
    assert stated.timing.counts.bridged == 0
    assert deviation(run) < 1e-9


@pytest.mark.parametrize("share", [0.04, 0.12])
@pytest.mark.parametrize("held", [True, False])
def test_rows_repeated_while_one_joint_moves_are_judged_by_this_joint(tmp_path, share, held):
    """Joints are jogged one after the other: no row shows the steps of two."""
    columns = {name: COLUMNS[name].copy() for name in ("q1", "q2")}
    columns["q1"][: N // 2] = columns["q1"][N // 2]
    columns["q2"][N // 2 :] = columns["q2"][N // 2]
    twice = some_rows(share)[:-1] & ~some_rows(share)[1:]
    if held:
        kept = ROWS.copy()
        kept[1:][twice] -= 1
    else:
        kept = np.repeat(ROWS, 1 + np.append(twice, False))
    _, stated = imported(tmp_path, kept, accept=["shape"], **columns)
    lines = "\n".join(stated.lines())
    assert ("repeat the row before" in lines) == held
    assert ("are written twice" in lines) == (not held)


def test_rows_that_hold_the_values_of_the_row_before_keep_their_time(tmp_path):
    held = np.flatnonzero(some_rows(0.04)[:-1] & ~some_rows(0.04)[1:]) + 1
    kept = ROWS.copy()
    kept[held] = held - 1
    run, stated = imported(tmp_path, kept)
    assert "written twice" not in "\n".join(stated.lines())
    assert stated.timing.counts.repeating == (np.diff(kept) == 0).sum()
    assert deviation(run) < 1e-3


@pytest.mark.parametrize(("share", "digits"), [(0.005, 15), (0.02, 15), (0.04, 15), (0.02, 4)])
def test_single_missing_rows_are_found_and_interpolated(tmp_path, share, digits):
    gone = some_rows(share)
    gone[:10] = gone[-10:] = False
    _, stated = imported(tmp_path, ROWS[~gone],
                           **{q: COLUMNS[q].round(digits) for q in ("q1", "q2")})  # fmt: skip
    counts = stated.timing.counts
    assert 0.75 * gone.sum() < counts.at_rate.missing <= gone.sum()
    said = stated.suspicions[0]
    assert said.message.startswith(f"{counts.at_rate.missing} rows are missing")
    assert said.first
    assert counts.bridged > 0.7 * gone.sum()


def test_single_missing_rows_are_found_where_the_stamps_count_the_rows(tmp_path):
    gone = some_rows(0.04)
    gone[:10] = gone[-10:] = False
    rows = ROWS[~gone]
    columns = {k: x[rows] for k, x in COLUMNS.items()} | {"t": ROWS[: len(rows)] * 10.0}
    write_csv(tmp_path / "data.csv", columns)
    the_map, stated = write_map(tmp_path, a_map(time={"column": "t", "unit": "ms"})), []
    import_recordings([the_map], tmp_path / "run", stated.append)
    counts, said = stated[0].timing.counts, stated[0].suspicions[0]
    assert 0.75 * gone.sum() < counts.at_rate.missing <= gone.sum()
    assert said.message.startswith(f"{counts.at_rate.missing} rows are missing")
    assert "stamps only count the rows" in said.message
    assert said.first


RNG = np.random.default_rng(3)


@pytest.mark.parametrize(
    "columns",
    [
        {},
        {q: COLUMNS[q] + 3e-4 * RNG.standard_normal(N) for q in ("q1", "q2")},
        {q: COLUMNS[q] + 1e-2 * RNG.standard_normal(N) for q in ("q1", "q2")},
        {q: COLUMNS[q].round(3) for q in ("q1", "q2")},
        {q: COLUMNS[q].round(2) for q in ("q1", "q2")},
        {q: x + 0.3 * (np.arange(N) % 500 > 250) for q, x in COLUMNS.items() if q == "q1"},
        {q: np.abs(COLUMNS[q]) for q in ("q1", "q2")},
        {q: np.maximum(COLUMNS[q], 0.0) for q in ("q1", "q2")},
        {q: COLUMNS[q][np.where(ROWS // 50 % 2, ROWS, ROWS // 50 * 50)] for q in ("q1", "q2")},
        {q: 0.002 * np.abs(ROWS % (400 * int(q[1])) - 200) for q in ("q1", "q2")},
    ],
    ids=[
        "exact",
        "noise",
        "much noise",
        "1 mrad",
        "10 mrad",
        "slips",
        "impacts",
        "stops",
        "jumps",
        "triangles",
    ],
)
def test_nothing_is_found_in_a_sound_recording(tmp_path, columns):
    _, stated = imported(tmp_path, ROWS, accept=["shape", "spikes"], **columns)
    counts = stated.timing.counts
    assert (counts.at_rate.surplus, counts.at_rate.missing) == (0, 0)


def test_late_rows_and_hurried_ones_are_neither(tmp_path):
    late = np.flatnonzero(some_rows(0.02)[:-1]) + 1
    time = COLUMNS["t"].copy()
    time[late] += 0.009
    columns = table(time=time)
    _, stated = imported(tmp_path, ROWS, **columns)
    assert stated.timing.counts.at_rate.missing == 0
