"""Strokes of one axis of `free_run.arm` at a time, with friction outside all assumed laws."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from free_run import PERIOD

from hil.imports.segments import pairs_of
from hil.model.dynamics import inverse_dynamics
from hil.model.motors import motor_torque
from hil.planning.free_motion import FreeMotion
from hil.runs.recording import IDLE, Recording

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from hil.model.robot import Robot

    Array = NDArray[np.float64]
    Friction = Callable[[Array, Array, Array], Array]

INCREMENT = 2e-5
"""Resolution of the encoders [rad]."""


def curved(qd: Array, time: Array, load: Array) -> Array:
    """Return degressive friction that decays within a minute and grows with the load [N m]."""
    level = (1.0 + 0.3 * np.exp(-time / 40.0))[:, np.newaxis]
    shape = 3.0 + 4.0 * np.arctan(np.abs(qd) / 0.2) + 0.5 * np.abs(qd)
    return np.asarray(np.sign(qd) * (level * shape + 0.05 * np.abs(load)))


def strokes(
    robot: Robot,
    p: Array,
    axis: int,
    q: tuple[float, float],
    *,
    way: float = 0.6,
    period: float = 3.0,
    faster_back: float = 0.0,
    pairs: int = 4,
    friction: Friction = curved,
    noise: float = 0.2,
    name: str = "s",
    seed: int = 0,
) -> tuple[FreeMotion, Recording]:
    """Return the recording of ideal drives for one axis, from 0, back and forth about `q`.

    `way` is half the stroke [rad], `period` the duration of a pair [s], `faster_back` a second
    harmonic that makes the backward stroke faster than the forward stroke, and `noise` the standard
    deviation of the torque [N m].
    """
    rng = np.random.default_rng(seed)
    t = PERIOD * np.arange(round((pairs + 0.5) * period / PERIOD))
    w = 2 * np.pi / period
    orders = np.array([1, 2])
    waves = w * orders * (t[:, np.newaxis] - 0.25 * period)
    cosine, sine = np.array([-way, 0.0]), np.array([0.0, faster_back * way])
    motion = np.zeros((3, len(t), 2))
    motion[0] = q
    motion[0, :, axis] += np.cos(waves) @ cosine + np.sin(waves) @ sine
    motion[1, :, axis] = np.cos(waves) @ (w * orders * sine) - np.sin(waves) @ (w * orders * cosine)
    motion[2, :, axis] = -np.cos(waves) @ ((w * orders) ** 2 * cosine) - np.sin(waves) @ (
        (w * orders) ** 2 * sine
    )
    load = inverse_dynamics(robot, p, *motion)
    tau = load + motor_torque(robot, *motion) + friction(motion[1], t, load)
    tau += noise * rng.standard_normal(tau.shape)
    counted = INCREMENT * np.round(motion[0] / INCREMENT)
    return recorded_strokes(t, counted, tau, axis, name)


def recorded_strokes(
    t: Array, q: Array, tau: Array, axis: int, name: str = "s"
) -> tuple[FreeMotion, Recording]:
    """Return a recording with strokes numbered as by an import."""
    stroke = np.full(len(t), IDLE, dtype=np.int16)
    found = pairs_of(q[:, axis], PERIOD)
    for number, (forth, back) in enumerate(found):
        stroke[forth[0] : forth[1]], stroke[back[0] : back[1]] = 2 * number, 2 * number + 1
    motion = FreeMotion(
        id=name,
        q=tuple(q.mean(axis=0).tolist()),
        duration=float(t[-1]),
        cycles=max(len(found), 1),
        alone=axis + 1,
        source="made",
    )
    flags = np.zeros(q.shape, np.uint8)
    still = np.full(len(t), IDLE, np.int16)
    return motion, Recording(t, q, tau, flags, stroke, still, group=stroke // 2)


def campaign(
    robot: Robot, p: Array, friction: Friction = curved, **more: float
) -> list[tuple[FreeMotion, Recording]]:
    """Return strokes of both axes at some configurations, fast and slow."""
    rng = np.random.default_rng(1)
    return [
        strokes(
            robot, p, axis, tuple(rng.uniform(-1.5, 1.5, 2)), way=0.8,
            period=float(rng.uniform(1.6, 3.2)), friction=friction, name=f"s{axis + 1}-{k}",
            seed=10 * axis + k, **more,
        )
        for axis in (0, 1)
        for k in range(6)
    ]  # fmt: skip
