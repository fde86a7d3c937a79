"""Trajectories as recorded by ideal drives, and a run folder of one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from small_run import SIMULATED
from synthetic import TABLE_3_A

from hil.model.dynamics import inverse_dynamics
from hil.model.motors import motor_torque
from hil.planning.design.trajectories import Basis
from hil.planning.plan import Plan, PlannedRobot
from hil.planning.trajectory import REST
from hil.runs.recording import Recording
from hil.runs.recording_file import Measured
from hil.runs.run_folder import RunFolder

if TYPE_CHECKING:
    from pathlib import Path

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.trajectory import Trajectory

PERIOD = 0.004
COULOMB, VISCOUS = 0.04, 0.03
"""Friction over the torque limit: at standstill, and its growth up to full speed."""


def some_trajectory(robot: Robot) -> Trajectory:
    """Return three periods of 10 s with random amplitudes."""
    basis = Basis(robot, 10.0)
    return basis.trajectory(basis.random(np.random.default_rng(7)), 3, "t")


def recorded(
    robot: Robot,
    trajectory: Trajectory,
    noise: float = 0.0,
    root: float = 0.0,
    load: float = 0.0,
    offset: float = 0.0,
    p: Array = TABLE_3_A,
) -> list[tuple[Trajectory, Recording]]:
    """Return the recording of ideal drives.

    Parameters
    ----------
    noise, root, offset : float
        White noise, friction that grows with the cube root of speed, a constant torque, all as
        shares of the torque limit.
    load : float
        Share of the transmitted torque that is friction.
    p : ndarray, shape (n_base,)
        Base parameters.
    """
    n = len(trajectory.path(PERIOD))
    time = PERIOD * np.arange(n)
    t = np.clip(time - REST, 0.0, trajectory.cycles * trajectory.period)
    q, qd, qdd = trajectory.motion(t)
    v = qd / robot.velocity_limit
    level = COULOMB * np.sign(v) + VISCOUS * v + root * np.cbrt(v)
    links = inverse_dynamics(robot, p, q, qd, qdd)
    tau = links + load * np.abs(links) * np.sign(qd) + motor_torque(robot, q, qd, qdd)
    rng = np.random.default_rng(1)
    level = level + offset + noise * rng.standard_normal(q.shape)
    tau = tau + robot.torque_limit * level
    length = round(trajectory.period / PERIOD)
    group = (np.arange(n) - round(REST / PERIOD)) // length
    group[(group < 0) | (group >= trajectory.cycles)] = -1
    still = np.full(n, -1, np.int16)
    flags = np.zeros(q.shape, np.uint8)
    group = group.astype(np.int16)
    return [(trajectory, Recording(time, q, tau, flags, still, still, group=group))]


def write_trajectory_run(path: Path, robot: Robot) -> RunFolder:
    """Write a run of one trajectory."""
    plan = Plan(
        robot=PlannedRobot(name=robot.name, digest=robot.digest),
        measurements=(some_trajectory(robot),),
    )
    folder = RunFolder.create(path, plan, robot)
    with folder.session(SIMULATED) as session:
        for measurement, recording in recorded(robot, plan.measurements[0], noise=0.002):
            folder.write(Measured(measurement, recording, session=session))
    return folder
