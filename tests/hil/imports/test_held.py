"""Repeated values, published more often than measured, are found and used once."""

import re

import numpy as np
import pytest
from small_recording import a_map, table, write_csv, write_map

from hil.imports.held import fast_steps, repeats, rows_held
from hil.imports.importing import import_recordings

RATE = 200.0


def made(folder, columns, **changes):
    write_csv(folder / "data.csv", columns)
    stated = []
    the_map = write_map(folder, a_map(**changes))
    run = import_recordings([the_map], folder / "run", lambda s: stated.extend(s.lines()))
    return run, "\n".join(stated)


def held(columns, rows, *names):
    """Return columns by name, some of which are held over this number of rows."""
    at = np.arange(len(columns["t"])) // rows * rows
    return {name: x[at] if name in names else x for name, x in columns.items()}


MEASURED = ("q1", "q2", "v1", "v2", "m1", "m2")


@pytest.mark.parametrize("rows", [2, 3, 4, 10])
def test_a_recording_published_too_often_is_that_of_its_measurements(tmp_path, rows):
    columns = table(20.0, RATE)
    run, stated = made(tmp_path, held(columns, rows, *MEASURED), velocity=True)
    assert f"each position repeats over {rows} rows; " in stated
    recording = run["map-01"].recording
    assert recording.period == pytest.approx(rows / RATE)
    taken = slice(None, recording.n_samples * rows, rows)
    np.testing.assert_array_equal(recording.q[:, 0], columns["q1"][taken])
    np.testing.assert_array_equal(recording.tau[:, 1], columns["m2"][taken])


def test_a_publisher_that_is_late_now_and_then_makes_no_difference(tmp_path):
    columns, random = table(20.0, RATE), np.random.default_rng(3)
    lengths = random.choice([3, 4, 4, 4, 4, 5], 2000)
    at = np.repeat(np.cumsum(lengths) - lengths, lengths)[: len(columns["t"])]
    late = {name: x if name == "t" else x[at] for name, x in columns.items()}
    _, stated = made(tmp_path, late)
    assert "each position repeats over 4 rows;" in stated


def test_rows_at_a_stated_rate_may_be_held_unevenly(tmp_path):
    columns, random = table(30.0, 1000.0), np.random.default_rng(3)
    lengths = random.integers(9, 12, 4000)
    at = np.repeat(np.cumsum(lengths) - lengths, lengths)[: len(columns["t"])]
    held_unevenly = {name: x[at] for name, x in columns.items()}
    run, stated = made(tmp_path, held_unevenly, time={"rate": 1000.0})
    assert "each position repeats over 10 rows;" in stated
    recording = run["map-01"].recording
    assert recording.period == pytest.approx(0.01, rel=0.01)
    q = np.interp(recording.time, columns["t"], columns["q1"])
    np.testing.assert_allclose(recording.q[:, 0], q, atol=0.02 * np.ptp(q))


def test_what_stands_still_in_between_leaves_no_gap(tmp_path):
    columns = table(30.0, RATE)
    still = np.clip(np.arange(6001), None, 2000) + np.clip(np.arange(6001) - 4000, 0, None)
    columns = {name: x if name == "t" else x[still] for name, x in columns.items()}
    run, stated = made(tmp_path, held(columns, 4, *MEASURED))
    assert "gap" not in stated
    assert len(list(run)) == 1


def test_torques_alone_that_are_held_are_stated_and_nothing_is_left_out(tmp_path):
    columns = table(20.0, RATE)
    run, stated = made(tmp_path, held(columns, 4, "m1", "m2"))
    for joint in (1, 2):
        held_torque = rf"torque: repeats the value .* joint {joint} moves: a held signal,"
        assert re.search(held_torque + " new every 4 rows", stated)
    assert "left out" not in stated
    assert run["map-01"].recording.n_samples == 4001


@pytest.mark.parametrize("count", [1e-4, 1e-3, 1e-2, 0.05])
@pytest.mark.parametrize("speed", [0.1, 1.0, 5.0])
def test_no_encoder_is_so_coarse_that_its_positions_count_as_held(count, speed):
    q = np.sin(speed * np.arange(20_000) / 1000)
    assert rows_held(np.round(q / count) * count) == 1
    noisy = q + 0.5 * count * np.random.default_rng(1).standard_normal(len(q))
    assert rows_held(np.round(noisy / count) * count) == 1


def test_joints_at_rest_and_motions_with_stops_are_not_held():
    t = np.arange(20_000) / 1000
    assert rows_held(np.full(20_000, 0.3)) == 1
    assert rows_held(np.round(np.clip(np.sin(t), -0.3, 0.3), 4)) == 1
    assert rows_held(np.where(t % 2 < 1, 0.0, np.sin(9 * t))) == 1


def test_repetitions_by_noise_at_rest_are_not_held():
    t, rng = np.arange(20_000) / 1000, np.random.default_rng(1)
    q = np.where(t > 18, np.cos(t - 18), 1.0) + 4e-6 * rng.standard_normal(len(t))
    q = np.round(q, 5)
    q[-1] += 1e-7  # rounding of a converted value: increments do not explain repetitions
    assert np.mean(np.diff(q) == 0) > 0.5
    assert repeats([q], fast_steps([q])) == 0


def test_torques_in_coarse_steps_are_named_with_the_step_and_its_share(tmp_path):
    columns = table(20.0, RATE)
    rms = float(np.sqrt(np.mean(columns["m2"] ** 2)))
    _, fine = made(tmp_path, columns | {"m2": 0.2 * rms * np.round(columns["m2"] / rms / 0.2)})
    assert "coarse" not in fine
    step = 0.5 * rms
    own = tmp_path / "own"
    own.mkdir()
    _, stated = made(own, columns | {"m2": step * np.round(columns["m2"] / step)})
    assert re.search(
        rf"joints\.1\.torque: torques are recorded in coarse steps: joint 2 {step:.3g} \(SI\), "
        r"(49|50|51)% of the rms",
        stated,
    )


@pytest.mark.parametrize("least", [-18.0, -90.0])
def test_a_torque_at_its_limit_is_saturated_and_not_held(tmp_path, least):
    columns = table(20.0, RATE)
    limited = columns | {"m1": np.clip(columns["m1"], least, 18.0)}
    _, stated = made(tmp_path, limited, accept=["shape"])
    assert re.search(r"joints.0.torque: is exactly (-18 or )?18 in", stated)
    assert "saturated by a limit" in stated
    assert "held signal" not in stated


@pytest.mark.parametrize("increment", [1e-9, 0.5, 5.0])
def test_a_coarse_torque_is_not_saturated(tmp_path, increment):
    columns = table(20.0, RATE)
    coarse = {m: increment * np.round(columns[m] / increment) for m in ("m1", "m2")}
    _, stated = made(tmp_path, columns | coarse, accept=["shape"])
    assert "saturated" not in stated


def test_a_torque_of_three_values_is_coarse_and_not_saturated(tmp_path):
    columns = table(20.0, RATE)
    v = columns["v1"]
    coarse = np.where(np.abs(v) > 0.1, 0.06 * np.sign(v), 0.0)
    _, stated = made(tmp_path, columns | {"m1": coarse}, accept=["shape", "range"])
    assert "saturated" not in stated


@pytest.mark.parametrize("least", [-40.0, -np.inf])
def test_a_torque_in_steps_at_its_limit_is_saturated(tmp_path, least):
    """The torque changes by less than a step from row to row, so most rows repeat their value."""
    columns = table(20.0, RATE)
    limited = columns | {"m1": np.round(np.clip(columns["m1"], least, 18.0))}
    _, stated = made(tmp_path, limited, accept=["shape"])
    assert re.search(r"joints.0.torque: is exactly (-40 or )?18 in", stated)
