"""Joints at rest cannot be checked, and cause no complaints."""

import re

import numpy as np
import pytest
from small_recording import a_map, motion, table, write_csv, write_map

from checked_files.yaml_file import FileError
from hil.imports.importing import import_recordings

COLUMNS = table(20.0, rate=100.0)
T = COLUMNS["t"]
Q, QD, TAU = motion(T)
RNG = np.random.default_rng(7)
TREMBLE = 3e-4 * np.sin(2 * np.pi * 0.4 * T)
COUNT = 4e-4


def suspicions(folder, velocity=True, **columns):
    write_csv(folder / "data.csv", COLUMNS | columns)
    stated = []
    the_map = write_map(folder, a_map(velocity=velocity))
    import_recordings([the_map], folder / "run", stated.append)
    return [
        s for s in stated[0].suspicions if "cannot be identified, and its torque" not in s.message
    ]


def flicker(size, at):
    """Return a constant with deviations of `size` in a few rows."""
    x = np.full(len(T), 0.3)
    x[at] += size
    return x


HOLDING = 8 + 0.2 * RNG.standard_normal(len(T))
AT_REST = {
    "a velocity of a coarse increment": {
        "q2": TREMBLE, "v2": 0.04 * np.round(RNG.standard_normal(len(T)) / 3)},
    "a velocity below its increment": {"q2": TREMBLE, "v2": 0 * T},
    "a velocity with a dead band": {
        "q2": TREMBLE, "v2": 5e-4 * np.round(np.gradient(TREMBLE, T) / 5e-4)},
    "a motor that holds against its elastic gear": {
        "q2": TREMBLE, "v2": TREMBLE, "v1": QD[:, 0] + 0.01 * RNG.standard_normal(len(T))},
    "noise as velocity": {"q2": 0 * T, "v2": 0.02 * RNG.standard_normal(len(T))},
    "one count of the encoder in one sample": {"q2": flicker(COUNT, [500]), "v2": 0 * T},
    "an encoder between two counts": {
        "q2": COUNT * np.round(1.3 + np.sin(40 * T) > T % 2), "v2": 0 * T},
    "counts of a velocity here and there": {
        "q2": flicker(0, []), "v2": flicker(0.0049, [100, 500, 503, 900]) - 0.3},
    "three counts of a velocity": {"q2": 0 * T, "v2": flicker(0.0147, [100, 500, 900]) - 0.3},
    "rounding of a constant": {"q2": 0.3 + 1e-17 * np.arange(len(T)), "v2": 0 * T},
}  # fmt: skip


@pytest.mark.parametrize("case", AT_REST)
def test_a_joint_at_rest_refuses_no_recording(tmp_path, case):
    assert suspicions(tmp_path, m2=HOLDING, **AT_REST[case]) == []


def test_counts_of_a_torque_at_rest_are_no_spikes(tmp_path):
    torque = 8 + 0.1 * np.isin(np.arange(len(T)), [100, 500, 503, 900])
    assert suspicions(tmp_path, velocity=False, q2=0 * T, m2=torque) == []


MOVING = {
    "noise in place of a velocity": {"v2": RNG.standard_normal(len(T))},
    "zeros in place of a velocity": {"v2": 0 * T},
    "a noisy torque in place of a velocity": {"v2": TAU[:, 1] + 2 * RNG.standard_normal(len(T))},
}  # fmt: skip


@pytest.mark.parametrize("case", MOVING)
def test_a_joint_that_moves_is_compared_all_the_same(tmp_path, case):
    with pytest.raises(
        FileError, match=r"joints\.1\.velocity: does not follow the position of joint"
    ):
        suspicions(tmp_path, **MOVING[case])


def test_a_spike_of_a_joint_at_rest_that_outweighs_all_motion_is_refused(tmp_path):
    with pytest.raises(FileError, match=r"joints\.1\.position: 1 sample differs"):
        suspicions(tmp_path, velocity=False, q2=flicker(30.0, [500]), m2=HOLDING)


def test_joints_that_move_one_after_the_other_all_move(tmp_path):
    """Excerpts from the middle of a recording of 40 s show the second joint only."""
    columns = table(40.0, rate=100.0)
    t = columns["t"]
    q, _, tau = motion(t)
    first = t < 15.0
    stop = np.argmax(t >= 15.0)
    columns |= {"q1": np.where(first, q[:, 0], q[stop, 0]), "m1": np.where(first, tau[:, 0], 5.0)}
    columns |= {"q2": np.where(first, q[stop, 1], q[:, 1])}
    write_csv(tmp_path / "data.csv", columns)
    stated = []
    the_map = write_map(tmp_path, a_map(velocity=False, accept=["shape"]))
    import_recordings([the_map], tmp_path / "run", stated.append)
    assert not [s for s in stated[0].suspicions if s.check == "still"]


def motion_by_turns(t):
    """Return columns of a motion of two joints in turn, each at rest most of the time elsewhere."""
    first = (t < 20) | ((t > 40) & (t < 80)) | (t > 100)
    clocks = [np.cumsum(own) * (t[1] - t[0]) for own in (first, ~first)]
    each = [motion(clock) for clock in clocks]
    q, tau = (np.stack([each[k][i][:, k] for k in (0, 1)], axis=1) for i in (0, 2))
    return q + 1e-5 * RNG.standard_normal(q.shape), tau


def stated_of(folder, t, q, tau):
    columns = dict(zip(["t", "q1", "q2", "m1", "m2"], [t, *q.T, *tau.T], strict=True))
    write_csv(folder / "data.csv", columns)
    stated = []
    the_map = write_map(folder, a_map(velocity=False, accept=["shape"]))
    import_recordings([the_map], folder / "run", stated.append)
    return stated[0]


def test_motion_is_described_where_a_joint_moves(tmp_path):
    """The first joint rests in the middle of both minutes, at two positions."""
    t = np.arange(12000) / 100
    found = stated_of(tmp_path, t, *motion_by_turns(t))
    assert not [s.message for s in found.suspicions if "noise" in s.message]
    speed = float(re.search(r"up to (\S+) rad/s", found.explanation[0])[1])
    assert speed > 1.0
    shares = found.explanation[-1].split("accelerations ")[1]
    assert max(map(float, shares.split(", "))) < 0.2


def test_a_range_reached_outside_the_excerpts_is_not_small(tmp_path):
    t = np.arange(4000) / 100
    q, _, tau = motion(t)
    q = 0.03 * q + np.outer(t, [0.004, 0.0])
    found = stated_of(tmp_path, t, q, tau)
    assert not [s.message for s in found.suspicions if "the largest share" in s.message]
