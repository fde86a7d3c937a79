"""The Cramer-Rao bound agrees with the scatter of an estimator known to reach it."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import TABLE_3_A

from benchmarks.rivals.cramer_rao import cramer_rao
from hil.estimation.signals import signals
from hil.friction.equation import term_columns
from hil.model.robot import Robot
from hil.planning.measurement import Inertia
from hil.runs.recording import Recording

PERIOD, NOISE = 0.004, 2.0


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load("manutec-r15")


def recorded(robot: Robot, cycles: int) -> list[tuple[Inertia, Recording]]:
    """Return recordings of two axes that swing one after the other."""
    found = []
    for axis in (3, 4):
        n = 500 * cycles
        time = PERIOD * np.arange(n)
        q = np.tile([0.1, -0.4, 0.3, 0.2, 0.5, 0.1], (n, 1))
        q[:, axis] += 0.4 * np.sin(2 * np.pi * time / (500 * PERIOD)) * (1 + 0.2 * np.sin(time))
        measurement = Inertia(
            id=f"i{axis}", axis=axis + 1, q=tuple(q[0]), stroke=0.8, velocity=1.0, acceleration=5.0
        )
        stroke = np.zeros(n, dtype=np.int16)
        found.append(
            (
                measurement,
                Recording(
                    time=time,
                    q=q,
                    tau=np.zeros_like(q),
                    flags=np.zeros_like(q, dtype=np.uint8),
                    stroke=stroke,
                    partner_stroke=stroke - 1,
                ),
            )
        )
    return found


def variance(robot: Robot) -> np.ndarray:
    return np.full(robot.n_joints, NOISE**2)


def test_the_bound_with_friction_known_is_that_of_least_squares(robot: Robot) -> None:
    measured = recorded(robot, 3)
    rows = []
    for measurement, recording in measured:
        s = signals(recording)
        moving = np.abs(s.smoothed(s.qd[:, measurement.index])) > (
            0.005 * robot.velocity_limit[measurement.index]
        )
        rows.append(term_columns(robot, s, measurement.index)[0][moving & s.valid])
    A = np.concatenate(rows)
    bound = cramer_rao(robot, measured, variance(robot), friction_known=True)
    u = np.linalg.svd(A, full_matrices=False)
    seen = 1e-6 * u.S[0] < u.S
    torque = NOISE**2 * u.U[:, seen] @ u.U[::50, seen].T
    assert seen.sum() >= 3
    assert np.allclose(A @ bound @ A[::50].T, torque, atol=1e-6 * NOISE**2)


def test_friction_that_is_not_known_raises_the_bound(robot: Robot) -> None:
    measured = recorded(robot, 3)
    known = np.diag(cramer_rao(robot, measured, variance(robot), friction_known=True))
    unknown = np.diag(cramer_rao(robot, measured, variance(robot)))
    heavy = TABLE_3_A != 0
    assert np.all(unknown[heavy] >= (1 - 1e-6) * known[heavy])
    assert unknown.sum() > 1.01 * known.sum()


def test_twice_the_noise_doubles_every_standard_deviation(robot: Robot) -> None:
    measured = recorded(robot, 2)
    once, twice = (cramer_rao(robot, measured, k * variance(robot)) for k in (1.0, 4.0))
    assert np.allclose(twice, 4 * once)
