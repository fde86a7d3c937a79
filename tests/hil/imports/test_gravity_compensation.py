"""Torques less gravity, as controllers with gravity compensation state them, are named as such."""

import numpy as np
import pytest
from small_recording import ROBOT, a_map, write_csv, write_map

import hil
from checked_files.yaml_file import FileError
from hil.imports.importing import import_recordings

G = 9.81


def columns(gravity, size, duration=40.0, rate=200.0):
    """Return a recording of a planar arm, with the weight of its links times `gravity`."""
    t = np.arange(round(duration * rate)) / rate
    w = 2 * np.pi * np.array([[0.11, 0.43, 0.79], [0.17, 0.53, 0.97]])[:, :, None] * t
    f = 2 * np.pi * np.array([[0.11, 0.43, 0.79], [0.17, 0.53, 0.97]])[:, :, None]
    a = size * np.array([[0.8, 0.3, 0.15], [1.0, 0.4, 0.2]])[:, :, None]
    phase = np.array([[0.0, 1.0, 2.0], [0.5, 1.7, 2.9]])[:, :, None]
    q, qd, qdd = ((a * f**k * np.sin(w + phase + k * np.pi / 2)).sum(axis=1) for k in range(3))
    inner, outer, coupling = 0.9, 0.15, 0.5 * 0.5  # kg m2, kg m2, length times first moment
    c, s = coupling * np.cos(q[1]), coupling * np.sin(q[1])
    second = outer * qdd.sum(axis=0) + c * qdd[0] + s * qd[0] ** 2
    first = second + inner * qdd[0] + c * qdd.sum(axis=0) - s * qd.sum(axis=0) ** 2
    weight = gravity * G * 0.5 * np.cos(q.sum(axis=0))
    tau = np.stack([first + weight + gravity * G * 2.1 * np.cos(q[0]), second + weight])
    tau += np.array([[1.0], [0.3]]) * np.tanh(qd / 0.02) + np.array([[0.5], [0.1]]) * qd
    tau += np.array([[0.05], [0.02]]) * np.random.default_rng(5).standard_normal(tau.shape)
    q = np.round(q / 1e-5) * 1e-5
    return dict(zip(["t", "q1", "q2", "m1", "m2"], [t, *q, *tau], strict=True))


def imported(folder, recorded, gravity="[0, -9.81, 0]", **changes):
    write_csv(folder / "data.csv", recorded)
    the_map = write_map(folder, a_map(**changes))
    robot = ROBOT.replace("[0, -9.81, 0]", gravity).replace("unknown", "0")
    (folder / "pair.yaml").write_text(robot)
    return import_recordings([the_map], folder / "run")


@pytest.mark.parametrize("size", [1.0, 0.7])
def test_a_map_of_torques_without_gravity_is_refused_with_the_cause(tmp_path, size):
    with pytest.raises(FileError) as refused:
        imported(tmp_path, columns(0.0, size))
    # on an arm of two parallel axes, gravity along these makes the same torques
    assert "gravity is absent from the torques" in str(refused.value)
    assert "this correction leaves only" in str(refused.value)
    assert "record torques without gravity compensation" in str(refused.value)


def test_an_accepted_one_fails_by_this_cause(tmp_path):
    model = hil.identify(imported(tmp_path, columns(0.0, 1.0), accept=["shape"]))
    assert [each.cause for each in model.excluded.found] == ["no gravity"]
    assert str(model.verdict).startswith("failed: gravity is absent from the torques")


@pytest.mark.parametrize(("weight", "gravity"), [(1.0, "[0, -9.81, 0]"), (0.0, "[0, 0, 0]")])
def test_torques_of_the_stated_gravity_are_good(tmp_path, weight, gravity):
    model = hil.identify(imported(tmp_path, columns(weight, 1.0), gravity))
    assert model.excluded.found == ()
    assert model.verdict.word == "good"
