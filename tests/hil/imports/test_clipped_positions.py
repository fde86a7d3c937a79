"""Positions that a register clips are named; rests, stops and coarse encoders are not."""

import numpy as np
import pytest
from small_recording import a_map, motion, table, write_csv, write_map

from checked_files.yaml_file import FileError
from hil.imports.importing import import_recordings

COLUMNS = table(40.0)
Q = motion(COLUMNS["t"])[0]


def suspicions(folder, q2):
    write_csv(folder / "data.csv", COLUMNS | {"q2": q2})
    stated = []
    the_map = write_map(folder, a_map(accept=["range", "shape", "velocity", "spikes"]))
    import_recordings([the_map], folder / "run", stated.append)
    return [each.message for each in stated[0].suspicions if "clipped" in each.message]


@pytest.mark.parametrize(("low", "high"), [(-0.9, 0.9), (-9.0, 0.7), (-1.1, 9.0)])
def test_clipped_positions_refuse_the_import_and_are_named(tmp_path, low, high):
    write_csv(tmp_path / "data.csv", COLUMNS | {"q2": np.clip(Q[:, 1], low, high)})
    with pytest.raises(FileError) as refused:
        import_recordings([write_map(tmp_path, a_map())], tmp_path / "run")
    found = str(refused.value)
    bounds = " and ".join(f"{bound:g}" for bound in (low, high) if abs(bound) < 2)
    share = np.mean((Q[:, 1] <= low) | (Q[:, 1] >= high))
    assert f"joints.1.position: is clipped at {bounds} rad in {share:.0%} of the rows" in found
    assert "joints.0.position: is clipped" not in found


@pytest.mark.parametrize("backwards", [False, True])
def test_a_clip_may_go_on_at_the_end_of_the_recording(tmp_path, backwards):
    turn = 2 * np.pi * COLUMNS["t"] / 8.0
    clipped = np.minimum(np.sin(turn) + 0.3 * np.sin(2 * turn), 1.02)  # arrives fast, leaves slowly
    last = np.flatnonzero((clipped[:-1] < 1.02) & (clipped[1:] == 1.02))[-1] + 10
    kept = clipped[: last + 1][::-1] if backwards else clipped[: last + 1]
    columns = {name: x[: last + 1] for name, x in COLUMNS.items()}
    write_csv(tmp_path / "data.csv", columns | {"q2": kept})
    with pytest.raises(FileError, match=r"is clipped at 1\.02 rad"):
        import_recordings([write_map(tmp_path, a_map())], tmp_path / "run")


def test_a_clip_of_a_coarse_encoder_is_named(tmp_path):
    step = 1e-3
    assert suspicions(tmp_path, np.clip(step * np.round(Q[:, 1] / step), -0.9, 0.9))


SMOOTH = {
    "the motion as it is": Q[:, 1],
    "a coarse encoder": 0.02 * np.round(Q[:, 1] / 0.02),
    "a very coarse encoder": 0.2 * np.round(Q[:, 1] / 0.2),
    "positions held over five samples": Q[::5, 1].repeat(5)[: len(Q)],
}


def rests():
    """Return a motion between two positions, with rests and profiles of constant acceleration."""
    t = COLUMNS["t"] % 8.0
    up = np.interp(t, [0, 1, 2, 4, 5, 6, 8], [0, 1, 0, 0, -1, 0, 0])
    return np.cumsum(up) * (COLUMNS["t"][1] - COLUMNS["t"][0])


@pytest.mark.parametrize("case", SMOOTH)
def test_no_smooth_or_coarse_motion_is_clipped(tmp_path, case):
    assert suspicions(tmp_path, SMOOTH[case]) == []


def test_rests_at_programmed_positions_are_not_clipped(tmp_path):
    assert suspicions(tmp_path, np.round(rests(), 6)) == []


@pytest.mark.parametrize("count", [1e-6, 1e-3])
def test_straight_strokes_with_rests_are_not_clipped(tmp_path, count):
    stroke = np.interp(COLUMNS["t"] % 3.0, [0.0, 1.0, 1.4, 2.4, 3.0], [-0.5, 0.5, 0.5, -0.5, -0.5])
    assert suspicions(tmp_path, count * np.round(stroke / count)) == []


def test_impacts_on_a_stop_are_not_clipped(tmp_path):
    q = Q[:, 1].copy()
    begins = np.flatnonzero((q[:-1] < 0.8) & (q[1:] >= 0.8))
    for begin in begins:  # after the impact the joint leaves the stop from rest
        end = begin + 1 + int(np.argmax(q[begin + 1 :] < 0.8))
        q[begin + 1 : end] = 0.8
        n = min(60, len(q) - end)
        u = np.arange(n) / 60
        q[end : end + n] = 0.8 + (q[end : end + n] - 0.8) * u**2 * (3 - 2 * u)
    assert suspicions(tmp_path, q) == []
