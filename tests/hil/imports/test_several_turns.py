"""Several turns of a joint, and torques that hardly change, are said as what they are."""

import numpy as np
import pytest
from small_recording import ROBOT, a_map, motion, table, write_csv, write_map

from checked_files.yaml_file import FileError
from hil.imports.importing import import_recordings

PENDULUM = """
name: pendulum
gravity: [0, -9.81, 0]
joints:
  - {frame: {alpha: 0}, parameters: [Izz, sx, sy], q_min: -3.1416, q_max: 3.1416,
     velocity_limit: 8, acceleration_limit: unknown, torque_limit: unknown}
"""
TURNS = 4 * 2 * np.pi


def turning(duration=40.0, rate=200.0, turns=TURNS):
    """Return a pendulum that turns over `turns` / (2 pi) times, with its torque."""
    t = np.arange(round(duration * rate)) / rate
    u, w = np.pi * t / duration, 2 * np.pi * 0.35
    q = turns * (1 - np.cos(u)) / 2 + 0.9 * np.sin(w * t)
    qd, qdd = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    tau = 0.6 * qdd + 9.81 * 0.8 * np.cos(q) + 0.3 * np.tanh(qd / 0.02) + 0.1 * qd
    return t, q, tau + 0.02 * np.random.default_rng(4).standard_normal(len(t))


def suspicions(folder, t, q, tau, robot=PENDULUM, unit="rad"):
    write_csv(folder / "data.csv", {"t": t, "q1": q, "m1": tau})
    content = a_map(joints=a_map()["joints"][:1])
    content["joints"][0]["position"]["unit"] = unit
    the_map = write_map(folder, content)
    (folder / "pair.yaml").write_text(robot)
    stated = []
    import_recordings([the_map], folder / "run", stated.append)
    return [each.message for each in stated[0].suspicions]


def test_several_turns_are_stated_as_turns_and_not_refused(tmp_path):
    (message,) = suspicions(tmp_path, *turning())
    assert "a joint whose range is a whole turn may turn over: state a wider range" in message
    assert "look like" not in message


def test_a_joint_without_range_may_turn_farther_than_its_bounds(tmp_path):
    endless = PENDULUM.replace("3.1416", "12.566")
    assert suspicions(tmp_path, *turning(), endless) == []


def test_a_register_of_no_whole_turns_is_unwrapped_by_its_range(tmp_path):
    t, q, tau = turning(turns=8.0 * np.pi)
    counts = np.round(q / 25.0 * 65536) % 65536
    write_csv(tmp_path / "data.csv", {"t": t, "q1": counts * 25.0 / 65536 - 12.5, "m1": tau})
    the_map = write_map(tmp_path, a_map(joints=a_map()["joints"][:1], accept=["range", "shape"]))
    (tmp_path / "pair.yaml").write_text(PENDULUM)
    stated = []
    run = import_recordings([the_map], tmp_path / "run", lambda s: stated.extend(s.lines()))
    assert "unwrapped by 25 of their unit, the range of a register" in "\n".join(stated)
    (recording,) = [each.recording for each in run]
    moved = recording.q[:, 0] - recording.q[0, 0]
    assert np.abs(moved - np.interp(recording.time, t, q - q[0])).max() < 1e-3


def test_degrees_stated_as_radians_are_still_refused_as_such(tmp_path):
    t, q, tau = turning(turns=1.0)
    with pytest.raises(FileError, match=r"they look like positions in deg;"):
        suspicions(tmp_path, t, np.degrees(q), tau)


def test_turns_beyond_the_stops_of_a_joint_are_still_refused(tmp_path):
    with pytest.raises(FileError, match=r"reaches from .* but joint 1 of pendulum has -1 to 1"):
        suspicions(tmp_path, *turning(), PENDULUM.replace("3.1416", "1"))


def refuse_torques(folder, torque):
    columns = table(20.0)
    columns |= {"m1": torque(7.0, 1), "m2": torque(-4.0, 2)}
    write_csv(folder / "data.csv", columns)
    the_map = write_map(folder, a_map())
    (folder / "pair.yaml").write_text(ROBOT)
    with pytest.raises(FileError) as refused:
        import_recordings([the_map], folder / "run")
    return str(refused.value)


N = len(motion(table(20.0)["t"])[0])


def test_torques_that_hardly_change_are_named_as_such(tmp_path):
    found = refuse_torques(
        tmp_path, lambda mean, seed: mean + 0.1 * np.random.default_rng(seed).standard_normal(N)
    )
    assert "torques hardly change (joint 1: 7, standard deviation" in found
    assert "do not match this motion" not in found


def test_noise_without_a_mean_is_a_matter_of_columns(tmp_path):
    found = refuse_torques(
        tmp_path, lambda mean, seed: mean * np.random.default_rng(seed).standard_normal(N)
    )
    assert "torques do not match this motion; name the torque columns" in found
