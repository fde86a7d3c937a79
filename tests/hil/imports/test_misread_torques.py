"""Columns with wrong meaning in the map are named before any estimation."""

import re

import numpy as np
import pytest
from small_recording import ROBOT, a_map, motion, table, write_csv, write_map

from checked_files.yaml_file import FileError
from hil.imports.evidence import Evidence, Excerpt
from hil.imports.importing import import_recordings
from hil.imports.misread import misread_torques
from hil.imports.plausibility import suspicions
from hil.model.robot import parse_robot

PAIR = parse_robot(ROBOT, "pair.yaml")
T = 0.004
TIME = np.arange(0, 60, T)
Q, QD, _ = motion(TIME)


def found(tau):
    excerpts = [Excerpt(T, Q, tau, np.full_like(Q, np.nan), 3000)]
    return list(misread_torques(excerpts, Evidence.join(excerpts), PAIR))


def sines(seed):
    """Return torques of two joints with noise of 1 N m."""
    noise = np.random.default_rng(seed).standard_normal((len(TIME), 2))
    return 12 * np.sin(np.outer(TIME, [2.1, 3.3])) + noise


@pytest.mark.parametrize("seed", range(5))
def test_torques_that_lost_their_signs_are_named(seed):
    (suspicion,) = found(np.abs(sines(seed)))
    assert suspicion.message.startswith("torques of joints 1, 2 reach zero")
    assert found(sines(seed)) == []


@pytest.mark.parametrize("seed", range(5))
def test_few_crossings_show_lost_signs_too_as_sharp_minima(seed):
    few = len(TIME) // 6
    noise = 0.1 * np.random.default_rng(seed).standard_normal((few, 2))
    slow = 12 * np.sin(np.outer(TIME[:few], [1.1, 1.7])) + noise
    later = np.vstack([slow, np.tile(slow[-1], (len(TIME) - few, 1))])
    (suspicion,) = found(np.abs(later))
    assert "never change sign, like absolute values" in suspicion.message
    assert found(later) == []


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.1])
def test_torques_that_touch_zero_without_a_bend_have_their_signs(noise):
    wave = 6 + 6 * np.sin(np.outer(TIME, [1.1, 1.7]))
    assert found(wave + noise * np.abs(np.random.default_rng(1).standard_normal(wave.shape))) == []


@pytest.mark.parametrize("above", [2.5, 3, 4, 5, 8])
def test_torques_that_stay_on_one_side_of_zero_are_not(above):
    for seed in range(20):
        noise = np.random.default_rng(seed).standard_normal((len(TIME), 2))
        assert found(above + 3 + 3 * np.sin(np.outer(TIME, [2.1, 3.3])) + noise) == []


def test_torques_of_one_sign_that_rest_close_to_zero_are_not():
    noise = 1e-4 * np.abs(np.random.default_rng(1).standard_normal((len(TIME), 2)))
    assert found(12 * np.maximum(np.sin(np.outer(TIME, [2.1, 3.3])), 0) ** 2 + noise) == []


@pytest.mark.parametrize(("factor", "unit"), [(1, "in SI"), (180 / np.pi, "in deg")])
def test_velocities_are_no_torques(factor, unit):
    first, second = found(factor * QD)
    assert f"is the velocity of joint 1 {unit}" in first.message
    assert second.certain


def test_one_column_of_two_joints_is_named():
    (suspicion,) = found(sines(1)[:, [0, 0]])
    assert suspicion.message.startswith("is the same as that of joint 1 in all samples")


def test_torques_of_motors_taken_for_those_of_joints_are_remarked():
    excerpts = [Excerpt(T, Q, sines(1) / 50, np.full_like(Q, np.nan), 3000)]
    every = suspicions(excerpts, Evidence.join(excerpts), PAIR, None, ())
    said = [each for each in every if "check unit, gain and torque_side" in each.message]
    assert said
    assert not any(each.certain for each in said)


def refusal(folder, columns, **changes):
    write_csv(folder / "data.csv", columns)
    with pytest.raises(FileError) as refused:
        import_recordings([write_map(folder, a_map(**changes))], folder / "run")
    return str(refused.value)


def test_noise_is_no_torque(tmp_path):
    columns = table(20.0, rate=100.0)
    rng = np.random.default_rng(1)
    noise = {name: 10 * rng.standard_normal(len(columns["t"])) for name in ("m1", "m2")}
    message = refusal(tmp_path, columns | noise)
    assert "moving joint unexplained: torques do not match this motion" in message


@pytest.mark.parametrize("size", [1e-25, 3e-110, 1e-311])
@pytest.mark.parametrize(
    ("name", "key"), [("m2", "torque"), ("v1", "velocity"), ("q1", "position")]
)
def test_bytes_of_other_numbers_are_no_measurements(tmp_path, size, name, key):
    columns = table(20.0, rate=200.0)
    alike = [each for each in columns if each[0] == name[0]]
    tiny = {each: size * columns[each] for each in (alike if key == "position" else [name])}
    message = refusal(tmp_path, columns | tiny, velocity=True)
    assert re.search(rf"joints.{int(name[1]) - 1}.{key}: values up to \S+ are no {key}", message)


def test_rounding_of_a_resting_joint_is_no_reason_to_refuse(tmp_path):
    columns = table(20.0, rate=200.0)
    rests = {name: 1e-30 * columns[name] for name in ("q2", "v2", "m2")}
    write_csv(tmp_path / "data.csv", columns | rests)
    import_recordings([write_map(tmp_path, a_map(velocity=True))], tmp_path / "run")


def remarks(folder, columns):
    write_csv(folder / "data.csv", columns)
    stated = []
    import_recordings([write_map(folder, a_map())], folder / "run", stated.append)
    return [each.message for each in stated[0].suspicions]


def test_noise_that_biases_inertias_is_one_remark(tmp_path):
    """Motion an eighth as fast as usual, so that accelerations are small."""
    time = np.arange(0, 60, 0.02)
    q, _, tau = motion(time / 8)
    noisy = q + 0.05 * np.random.default_rng(1).standard_normal(q.shape)
    columns = dict(zip(["t", "q1", "q2", "m1", "m2"], [time, *noisy.T, *tau.T], strict=True))
    noise = [each for each in remarks(tmp_path, columns) if each.startswith("noise of positions")]
    assert len(noise) == 1
    assert re.search(r"is \d+(\.\d)? % of the accelerations up to 0.67 Hz, .* \(joints 1", noise[0])


@pytest.mark.parametrize("count", [0.003, 0.01, 0.03])
def test_noise_beyond_the_band_of_identification_is_no_remark(tmp_path, count):
    columns = table(20.0, rate=250.0)
    coarse = {name: count * np.round(columns[name] / count) for name in ("q1", "q2")}
    assert not any("nois" in each for each in remarks(tmp_path, columns | coarse))
