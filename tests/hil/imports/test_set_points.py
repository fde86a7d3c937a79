"""Torques that step with held set-points in phase with the rows are named; others are not."""

import numpy as np
import pytest
from small_recording import a_map, motion, table, write_csv, write_map

from hil.imports.importing import import_recordings

INERTIA, PULL = np.array([3.0, 0.8]), np.array([25.0, 18.0])


def followed(every, duration=15.0):
    """Return positions and torques of servos at 1 kHz, set-points new every `every` ms."""
    t = np.arange(round(1000 * duration)) * 1e-3
    wanted = motion(t)[0]
    q, v, tau = np.zeros((3, len(t), 2))
    q[0] = wanted[0]
    for k in range(len(t)):
        held = wanted[k // every * every]
        qdd = PULL**2 * (held - q[k]) - 1.6 * PULL * v[k]
        second = 8 * np.cos(q[k].sum())
        tau[k] = [30 * np.cos(q[k, 0]) + second, second] + INERTIA * qdd
        if k + 1 < len(t):
            v[k + 1] = v[k] + 1e-3 * qdd
            q[k + 1] = q[k] + 1e-3 * v[k + 1]
    return t, q, tau


def messages(folder, t, q, tau):
    columns = dict(zip(["t", "q1", "q2", "m1", "m2"], [t, *q.T, *tau.T], strict=True))
    write_csv(folder / "data.csv", columns)
    found = []
    import_recordings([write_map(folder, a_map())], folder / "run", found.append)
    return [s for s in found[0].suspicions if "set-points" in s.message]


@pytest.mark.parametrize(("every", "log"), [(40, 20), (50, 10), (20, 4)])
def test_torques_that_step_with_the_set_points_are_named(tmp_path, every, log):
    t, q, tau = followed(every)
    (one,) = messages(tmp_path, t[::log], q[::log], tau[::log])
    assert not one.certain
    assert f"steps every {every // log} rows ({1000 / every:.3g} Hz)" in one.message


def test_mean_torques_of_whole_periods_have_no_steps(tmp_path):
    t, q, tau = followed(40)
    mean = np.stack([np.convolve(x, np.ones(40) / 40, "same") for x in tau.T], axis=1)
    assert messages(tmp_path, t[::20], q[::20], mean[::20]) == []


def test_a_planned_motion_has_no_steps(tmp_path):
    columns = table(15.0)
    q, tau = (np.stack([columns[f"{x}{k}"] for k in (1, 2)], axis=1) for x in "qm")
    tau = tau + 0.05 * np.random.default_rng(1).standard_normal(tau.shape)
    assert messages(tmp_path, columns["t"], q, tau) == []
