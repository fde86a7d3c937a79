"""Free motions of a two-joint robot with known parameters and friction, and a run of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.model.dynamics import inverse_dynamics
from hil.model.motors import motor_torque
from hil.model.robot import Robot
from hil.planning.free_motion import FreeMotion
from hil.planning.plan import PlannedRobot, RecordedMotions
from hil.runs.atomic_file import write_file
from hil.runs.journal import Journal, write_journal
from hil.runs.recording import Recording
from hil.runs.recording_file import Measured, write_measured
from hil.runs.run import MOTIONS, Run

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    FreeRecorded = list[tuple[FreeMotion, Recording]]

PERIOD = 0.004
COULOMB, VISCOUS, OFFSET = np.array([4.0, 1.5]), np.array([2.0, 0.8]), np.array([0.5, -0.2])
TRUTH = np.array([6.0, 8.0, 0.4, 1.2, 2.0, -0.3])
"""Base parameters of `arm`: inertia and first moments of each link."""


def arm(*, geared: bool = True, **drive: float) -> Robot:
    """Return two parallel revolute axes across gravity; `drive` adds keys of their drives."""
    joint = {
        "q_min": -3.0, "q_max": 3.0, "velocity_limit": 3.0, "acceleration_limit": 20.0,
        "torque_limit": 90.0,
    }  # fmt: skip
    if geared:
        stated = {"gear_ratio": 50.0, "rotor_inertia": 1e-4, "torque_constant": 0.1}
        joint["drive"] = stated | drive
    return Robot.create(
        "arm",
        [
            joint | {"frame": {"alpha": 0}, "parameters": ["Izz", "sx", "sy"]},
            joint | {"frame": {"alpha": 0, "d": "l"}, "parameters": ["Izz", "sx", "sy"]},
        ],
        gravity=(0.0, -9.81, 0.0),
        lengths={"l": 0.5},
    )


def classical(qd: Array) -> Array:
    """Return friction torque: offset, Coulomb's and viscous [N m]."""
    return OFFSET + COULOMB * np.sign(qd) + VISCOUS * qd


def some_motion(t: Array, seed: int = 0) -> tuple[Array, Array, Array]:
    """Return positions, velocities and accelerations of two joints, shape (n, 2)."""
    rng = np.random.default_rng(seed)
    w = 2 * np.pi * np.array([0.11, 0.23, 0.37, 0.61, 0.93])
    size, phase = (
        0.6 * rng.uniform(0.5, 1.0, (5, 2)) / (w[:, None] / w[1]),
        rng.uniform(0, 6, (5, 2)),
    )
    turn = w[:, None, None] * t[None, :, None] + phase[:, None, :]
    parts = size[:, None, :], w[:, None, None]
    return (
        np.sum(parts[0] * np.sin(turn), axis=0),
        np.sum(parts[0] * parts[1] * np.cos(turn), axis=0),
        np.sum(-parts[0] * parts[1] ** 2 * np.sin(turn), axis=0),
    )


def short_moves(t: Array, rng: np.random.Generator) -> Array:
    """Return q, qd, qdd of moves of 1.2 s every 2 s, of joint 1, 2, both and none, (3, n, 2)."""
    found = np.zeros((3, len(t), 2))
    for k in range(int(t[-1] / 2.0)):
        x = np.clip((t - 2.0 * k) / 1.2, 0.0, 1.0)
        way = rng.uniform(-0.8, 0.8, 2) * ([1, 0], [0, 1], [1, 1], [0, 0])[k % 4]
        found[0] += np.outer(10 * x**3 - 15 * x**4 + 6 * x**5, way)
        found[1] += np.outer(30 * (x - x**2) ** 2, way / 1.2)
        found[2] += np.outer(60 * x - 180 * x**2 + 120 * x**3, way / 1.2**2)
    return found


def recorded(
    robot: Robot,
    p: Array,
    friction: Callable[[Array], Array] = classical,
    *,
    n: int = 4,
    duration: float = 20.0,
    noise: float = 0.3,
    of_position: float = 0.0,
    velocity: float | None = None,
    pace: float = 1.0,
    seed: int = 0,
) -> FreeRecorded:
    """Return the recording of ideal drives.

    `noise` is that of the torque [N m], `of_position` that of the position [rad], `velocity` that
    of a recorded velocity [rad/s]. `pace` scales the speed of the motion.
    """
    rng, found = np.random.default_rng(seed), []
    for k in range(n):
        t = PERIOD * np.arange(round(duration / PERIOD))
        q, qd, qdd = some_motion(pace * t, seed + k)
        qd, qdd = pace * qd, pace**2 * qdd
        tau = (
            inverse_dynamics(robot, p, q, qd, qdd) + motor_torque(robot, q, qd, qdd) + friction(qd)
        )
        tau = tau + noise * rng.standard_normal(q.shape)
        still = np.full(len(t), -1, np.int16)
        group = (np.arange(len(t)) * 2 // len(t)).astype(np.int16)
        shaken = q + of_position * rng.standard_normal(q.shape)
        measured = None if velocity is None else qd + velocity * rng.standard_normal(q.shape)
        flags = np.zeros(q.shape, np.uint8)
        motion = FreeMotion(id=f"r{k}", q=(0.0, 0.0), duration=duration, cycles=2, source="made")
        found.append((motion, Recording(t, shaken, tau, flags, still, still, measured, group)))
    return found


def write_free_run(path: Path, robot: Robot, data: FreeRecorded) -> Run:
    """Write recordings as the folder of an imported run."""
    plan = RecordedMotions(
        robot=PlannedRobot(name=robot.name, digest=robot.digest),
        map_digest="0" * 64,
        measurements=tuple(motion for motion, _ in data),
    )
    (path / "recordings").mkdir(parents=True)
    write_file(path / MOTIONS, plan.text().encode())
    write_file(path / "robot.yaml", robot.text.encode())
    for motion, recording in data:
        write_measured(path / "recordings" / f"{motion.id}.h5", Measured(motion, recording), robot)
    journal = Journal(plan_digest=plan.digest, robot_digest=robot.digest, drives_digest=None)
    write_journal(path / "run.json", journal)
    return Run.open(path)
