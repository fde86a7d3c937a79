"""The regressor of 100 000 samples, against Pinocchio called from Python for the same arm.

Pinocchio is timed in a plain Python loop, with and without storing each regressor; those of `hil`
are stored. Pinocchio computes all sixty columns, `hil` only those of the base parameters.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from figures import Figure, keep
from rich.console import Console
from rich.table import Table

from hil import Robot, regressor

if TYPE_CHECKING:
    from collections.abc import Callable

N_SAMPLES = 100_000
REPEATS = 5


def pinocchio_arm(robot: Robot) -> pin.Model:
    """Return an arm with the same frames in Pinocchio."""
    model = pin.Model()
    model.gravity.linear = robot.gravity
    for k in range(robot.n_joints):
        about_x = pin.SE3(pin.utils.rotate("x", robot.alpha[k]), np.array([robot.d[k], 0, 0]))
        about_z = pin.SE3(pin.utils.rotate("z", robot.theta[k]), np.array([0, 0, robot.r[k]]))
        model.addJoint(k, pin.JointModelRZ(), about_x * about_z, f"joint {k + 1}")
    return model


def costs(task: Callable[[], object]) -> np.ndarray:
    """Return the times of several runs, per sample [us]."""
    times = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        task()
        times.append(time.perf_counter() - begin)
    return np.array(times) / N_SAMPLES * 1e6


def main() -> None:
    """Time everything in one process, print the table and keep it; the best run counts."""
    robot = Robot.load("manutec-r15")
    model = pinocchio_arm(robot)
    data = model.createData()
    q, qd, qdd = np.random.default_rng(0).uniform(-2.0, 2.0, (3, N_SAMPLES, robot.n_joints))
    kept = np.empty((N_SAMPLES, robot.n_joints, 10 * robot.n_joints))

    def loop() -> None:
        for k in range(N_SAMPLES):
            pin.computeJointTorqueRegressor(model, data, q[k], qd[k], qdd[k])

    def loop_keeping() -> None:
        for k in range(N_SAMPLES):
            kept[k] = pin.computeJointTorqueRegressor(model, data, q[k], qd[k], qdd[k])

    regressor(robot, q[:1], qd[:1], qdd[:1])  # the first call compiles, or loads compiled code
    ours = costs(lambda: regressor(robot, q, qd, qdd))
    figures: dict[str, Figure] = {}
    table = Table("", "us per sample", "times ours", title=f"Regressor, {N_SAMPLES} samples")
    for key, name, found in (
        ("ours", "hil.regressor, all joints", ours),
        ("row", "hil.regressor, row of joint 3", costs(lambda: regressor(robot, q, qd, qdd, [2]))),
        ("pinocchio", "Pinocchio in a loop", costs(loop)),
        ("pinocchio-kept", "Pinocchio in a loop, results kept", costs(loop_keeping)),
    ):
        cost, ratio = found.min(), found.min() / ours.min()
        table.add_row(name, f"{cost:.2f}", f"{ratio:.1f}")
        if found is not ours:
            figures[f"{key}-over-ours"] = Figure(ratio)
        figures[key] = Figure(cost, "us", scatter=Figure.median(found).scatter)
    Console().print(table)
    keep("regressor", figures, depends=("hil/model",), command="python benchmarks/regressor.py")


if __name__ == "__main__":
    main()
