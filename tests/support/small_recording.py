"""Recording of a two-joint robot with known physics, and its files."""

import numpy as np
import yaml

ROBOT = """
name: pair
gravity: [0, -9.81, 0]
lengths: {l: 0.5}
joints:
  - {frame: {alpha: 0}, parameters: [Izz, sx, sy], q_min: -2, q_max: 2, velocity_limit: 10,
     acceleration_limit: 90, torque_limit: 90,
     drive: {gear_ratio: 50, rotor_inertia: unknown, torque_constant: 0.1}}
  - {frame: {alpha: 0, d: l}, parameters: [Izz, sx, sy, m], q_min: -2.5, q_max: 2.5,
     velocity_limit: 10, acceleration_limit: 90, torque_limit: 40,
     drive: {gear_ratio: 20, rotor_inertia: unknown, torque_constant: 0.1}}
"""


def motion(time):
    """Return positions, velocities and torques (n, 2) of a
    free motion: gravity, inertia, friction.
    """
    w = 2 * np.pi * np.array([0.31, 0.47])
    turn = np.outer(time, w)
    q = np.array([0.9, 1.1]) * np.sin(turn) + 0.3 * np.sin(2.3 * turn + 1)
    qd = w * (np.array([0.9, 1.1]) * np.cos(turn) + 0.3 * 2.3 * np.cos(2.3 * turn + 1))
    qdd = -(w**2) * (np.array([0.9, 1.1]) * np.sin(turn) + 0.3 * 2.3**2 * np.sin(2.3 * turn + 1))
    elbow = q.sum(axis=1)
    second = 8 * np.cos(elbow)
    gravity = np.stack([30 * np.cos(q[:, 0]) + second, second], axis=1)
    return q, qd, gravity + np.array([3.0, 0.8]) * qdd + 2 * np.tanh(qd / 0.05) + 0.5 * qd


def table(duration=10.0, rate=200.0, time=None):
    """Return columns by name: t, q1, q2, v1, v2, m1, m2."""
    t = np.arange(round(duration * rate) + 1) / rate if time is None else time
    q, qd, tau = motion(t)
    return dict(zip(["t", "q1", "q2", "v1", "v2", "m1", "m2"],
                    [t, *q.T, *qd.T, *tau.T], strict=True))  # fmt: skip


def write_csv(path, columns, delimiter=",", form="{!r}"):
    """Write columns as text, with all digits."""
    rows = zip(*columns.values(), strict=True)
    lines = [delimiter.join(columns)]
    lines += [delimiter.join(form.format(float(v)) for v in row) for row in rows]
    path.write_text("\n".join(lines) + "\n")


def a_map(file="data.csv", velocity=False, **changes):
    """Return the content of a valid map; `changes` replace its keys."""
    joints = [
        {"position": {"column": f"q{j}", "unit": "rad"},
         "torque": {"column": f"m{j}", "unit": "N m"}} for j in (1, 2)
    ]  # fmt: skip
    if velocity:
        for j, joint in enumerate(joints, start=1):
            joint["velocity"] = {"column": f"v{j}", "unit": "rad/s"}
    content = {"robot": "pair.yaml", "files": [file], "time": {"column": "t", "unit": "s"},
               "joints": joints}  # fmt: skip
    return {key: value for key, value in (content | changes).items() if value is not None}


def write_map(folder, content, name="map.yaml"):
    """Write a map and its robot; return the map's path."""
    (folder / "pair.yaml").write_text(ROBOT)
    text = content if isinstance(content, str) else yaml.safe_dump(content, sort_keys=False)
    (folder / name).write_text(text)
    return folder / name
