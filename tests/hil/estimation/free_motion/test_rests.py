"""Pauses between moves: static friction holds axes at rest by torques that no model predicts."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import COULOMB, PERIOD, TRUTH, arm, classical, recorded, short_moves

from hil.estimation.free_motion.gathering import gather
from hil.estimation.free_motion.variants import DEFAULT, VARIANTS
from hil.estimation.identify import estimate
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import inverse_dynamics
from hil.model.motors import motor_torque
from hil.model.robot import Robot

if TYPE_CHECKING:
    from collections.abc import Callable

    from free_run import FreeRecorded
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Moves = Callable[[Array, np.random.Generator], Array]


def one_by_one(t: Array, rng: np.random.Generator) -> Array:
    """Return `short_moves` with pauses in place of moves of both joints."""
    found = short_moves(t, rng)
    found[1:, (t // 2.0) % 4 == 2] = 0.0
    found[0] = np.cumsum(found[1], axis=0) * PERIOD
    return found


def elbow() -> Robot:
    """Return an upright axis and a horizontal one, which products of inertia couple."""
    joint = {
        "q_min": -3.0, "q_max": 3.0, "velocity_limit": 3.0, "acceleration_limit": 20.0,
        "torque_limit": 90.0,
        "drive": {"gear_ratio": 50.0, "rotor_inertia": 1e-4, "torque_constant": 0.1},
    }  # fmt: skip
    links = ["Izz"], ["Ixx", "Iyy", "Izz", "Ixz", "Iyz", "sx", "sy"]
    joints = [
        joint | {"frame": {"alpha": alpha}, "parameters": names}
        for alpha, names in zip((0, "pi/2"), links, strict=True)
    ]
    return Robot.create("elbow", joints)


def paused(moves: Moves, seed: int, robot: Robot, p: Array, static: float = 1.0) -> FreeRecorded:
    """Return moves with pauses, in each of which friction is any below `static` times Coulomb's."""
    rng, (motion, recording) = np.random.default_rng(seed), recorded(arm(), TRUTH, duration=60.0)[0]
    q, qd, qdd = moves(recording.time, rng)
    friction = classical(qd)
    for axis, coulomb in enumerate(COULOMB):
        still = np.abs(qd[:, axis]) < 1e-6
        number = np.cumsum(still & ~np.append(False, still[:-1]))
        held = static * coulomb * rng.uniform(-1.0, 1.0, number.max() + 1)
        friction[still, axis] = held[number[still]]
    tau = inverse_dynamics(robot, p, q, qd, qdd) + motor_torque(robot, q, qd, qdd) + friction
    tau += 0.1 * rng.standard_normal(q.shape)
    shaken = q + 1e-4 * rng.standard_normal(q.shape)
    return [(motion, replace(recording, q=shaken, tau=tau))]


def moving_only(robot: Robot, data: FreeRecorded) -> bool:
    return gather(robot, data, VARIANTS[DEFAULT]).processing.rests == "left out"


@pytest.mark.parametrize("seed", range(4))
def test_static_friction_of_pauses_shifts_no_parameter(seed: int) -> None:
    data = paused(short_moves, seed, arm(), TRUTH)
    assert moving_only(arm(), data)
    found = estimate(arm(), data, "free motion")
    # the low-pass of positions shortens accelerations by 0.3 %
    assert found.values == pytest.approx(TRUTH, rel=0.003, abs=0.005)
    assert (np.sqrt(np.diag(found.covariance)) < 0.01).all()


def test_torques_at_rest_are_used_where_nothing_else_shows_couplings() -> None:
    p = np.random.default_rng(0).uniform(0.5, 1.0, len(base_parameters(elbow())))
    assert not moving_only(elbow(), paused(one_by_one, 0, elbow(), p))
    assert moving_only(elbow(), paused(short_moves, 0, elbow(), p))


def test_torques_at_rest_beyond_static_friction_show_what_the_model_lacks() -> None:
    assert moving_only(arm(), paused(short_moves, 0, arm(), TRUTH, 1.2))
    # rms of a uniform distribution: 1.15 and 1.73 times Coulomb friction
    assert moving_only(arm(), paused(short_moves, 0, arm(), TRUTH, 2.0))
    assert not moving_only(arm(), paused(short_moves, 0, arm(), TRUTH, 3.0))


def test_continuous_motion_is_used_whole() -> None:
    assert not moving_only(arm(), recorded(arm(), TRUTH))


def test_rivals_use_torques_at_rest() -> None:
    data = paused(short_moves, 0, arm(), TRUTH)
    assert gather(arm(), data, VARIANTS["weighted least squares"]).processing.rests == "used"
