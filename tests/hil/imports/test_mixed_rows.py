"""Rows of two sources in one recording are detected, without false alarms."""

import numpy as np
import pytest
from small_recording import a_map, motion, table, write_csv, write_map

from checked_files.yaml_file import FileError
from hil.imports.importing import import_recordings
from hil.imports.mixed_rows import source_suspicions
from hil.imports.samples import Samples


def columns_of(t, q, tau):
    return dict(zip(["t", "q1", "q2", "m1", "m2"], [t, *q.T, *tau.T], strict=True))


def refused(folder, columns, **changes):
    write_csv(folder / "data.csv", columns)
    with pytest.raises(FileError) as found:
        import_recordings([write_map(folder, a_map(**changes))], folder / "run")
    return str(found.value)


def merged(every, shift, other):
    """Insert a row of another source after each `every` rows, delayed by `shift` of a row."""
    t = np.arange(4000) / 200
    q, _, tau = motion(t)
    at = np.arange(every - 1, len(t), every) + 1
    q_other, tau_other = other(t[at - 1])
    return columns_of(
        np.insert(t, at, t[at - 1] + shift / 200),
        np.insert(q, at, q_other, axis=0),
        np.insert(tau, at, tau_other, axis=0),
    )


def zeros(t):
    return np.zeros((len(t), 2)), np.zeros((len(t), 2))


def commanded(t):
    q, qd, tau = motion(t)
    return q + 0.02 + 0.01 * qd, tau + 0.1


def another_arm(t):
    q, _, tau = motion(0.7 * t + 3.0)
    return -q, -tau


@pytest.mark.parametrize("other", [zeros, another_arm])
@pytest.mark.parametrize(("every", "shift"), [(1, 0.0), (1, 0.5), (2, 0.5), (2, 0.0), (10, 0.3)])
def test_two_publishers_on_one_topic_are_named(tmp_path, other, every, shift):
    found = refused(tmp_path, merged(every, shift, other))
    assert "map.yaml:3: files.0: rows alternate between two sources: " in found
    assert "like two publishers on one topic, commanded and measured states" in found


@pytest.mark.parametrize("shift", [0.0, 0.5])
def test_commanded_and_measured_states_in_turn_are_named(tmp_path, shift):
    assert "rows alternate between two sources" in refused(tmp_path, merged(1, shift, commanded))


def test_stamps_that_run_back_for_two_publishers_are_not_blamed_on_the_column(tmp_path):
    assert "rows alternate between two sources" in refused(tmp_path, merged(1, -3.0, zeros))


def test_a_second_publisher_that_comes_later_is_named_with_its_first_row(tmp_path):
    columns = merged(1, 0.5, zeros)
    q, _, tau = motion(np.arange(-4000, 0) / 200)
    before = columns_of(np.arange(-4000, 0) / 200, q, tau)
    joined = {name: np.concatenate([before[name], columns[name]]) for name in columns}
    assert "the first in row 4002, differ" in refused(tmp_path, joined)


def suspicions(q, time):
    values = np.hstack([q, np.zeros_like(q), np.full_like(q, np.nan)])
    samples = Samples(time, values, np.ones(len(q), dtype=bool), (0,), False)
    return list(source_suspicions(samples, [np.arange(len(q))]))


@pytest.mark.parametrize("rate", [25.0, 100.0, 1000.0])
@pytest.mark.parametrize("noise", [0.0, 1e-4, 0.01, 0.2])
def test_one_source_is_never_taken_for_two(rate, noise):
    t, random = np.arange(8000) / rate, np.random.default_rng(2)
    q = motion(t)[0]
    q = q + noise * random.standard_normal(q.shape)
    assert suspicions(q, t) == []
    assert suspicions(np.round(q, 2), t) == []
    q[:, 1] = 0.3 + 1e-4 * random.integers(0, 2, len(q))
    assert suspicions(q, t) == []


def test_joints_held_turned_round_or_uneven_in_time_are_one_source():
    even = np.arange(8000) / 200
    q = motion(even)[0]
    for rows in (2, 3, 4):
        assert suspicions(q[np.arange(8000) // rows * rows], even) == []
    turning = np.stack([(3 * even + np.pi) % (2 * np.pi) - np.pi, q[:, 1]], axis=1)
    assert suspicions(turning, even) == []
    uneven = even + np.where(np.arange(8000) % 2, 0.001, 0.0)
    assert suspicions(motion(uneven)[0], uneven) == []


@pytest.mark.parametrize("most", [1, 2])
def test_a_joint_at_rest_whose_encoder_toggles_is_one_source(most):
    t, random = np.arange(1100) / 50, np.random.default_rng(7)
    step, toggles = 2 * np.pi / 2**14, np.zeros(1100)
    at = random.choice(1090, 70, replace=False) + 5
    toggles[at] = random.integers(1, most + 1, 70)
    turning = step * np.round(motion(np.maximum(t, 16))[0][:, 0] / step)
    for rests in (np.zeros(1100), 4 * (t > 11)):
        q = np.stack([step * (rests + toggles - 92), *np.full((5, 1100), 0.1), turning], axis=1)
        assert suspicions(q, t) == []
    q = np.stack([step * (np.arange(1100) % 2), turning], axis=1)
    assert suspicions(q, t) == []


@pytest.mark.parametrize("other", [zeros, another_arm])
def test_sources_of_an_arm_with_joints_at_rest_are_named(other):
    t = np.arange(2000) / 200
    resting = np.full((2000, 4), 0.3)
    mixed = np.hstack([motion(t)[0], resting])
    mixed[1::2] = np.hstack([other(t[1::2])[0], 0 * resting[1::2]])
    assert len(suspicions(np.round(mixed, 4), t)) == 1


def test_samples_that_stand_out_here_and_there_are_spikes_not_another_source():
    t, random = np.arange(8000) / 200, np.random.default_rng(5)
    q = motion(t)[0]
    at = random.choice(len(q), 400, replace=False)
    q[at] += random.normal(0, 2, (400, 2))
    assert suspicions(q, t) == []


def test_one_source_with_velocities_is_imported(tmp_path):
    write_csv(tmp_path / "data.csv", table(5.0))
    run = import_recordings([write_map(tmp_path, a_map(velocity=True))], tmp_path / "run")
    assert len(list(run)) == 1
