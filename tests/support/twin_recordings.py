"""Free motions of virtual twins, whose physics is independent of the identified model.

Torques are those of the plant's own rigid bodies, rotors and friction along synthetic motions;
loops and drives are omitted, so a recording takes milliseconds. Friction is Coulomb's, viscous and
degressive, wanders during a recording and has a different level in each recording.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import hil
from checked_files.yaml_file import load_yaml
from hil.model.base_parameters import base_parameters
from hil.model.robot import Robot
from hil.model.robot_file import LINK_PARAMETERS
from hil.planning.free_motion import FreeMotion
from hil.runs.recording import Recording
from sim_plant import build
from sim_plant.physics.rigid_body import WORK, bias_and_mass
from sim_plant.twin.draft import draft_twin
from sim_plant.twin.robot import RobotDescription

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    FreeRecorded = list[tuple[FreeMotion, Recording]]

ROBOTS = Path(__file__).parents[1] / "robots"
PERIOD = 0.004
_ORDER = ("m", "sx", "sy", "sz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
"""Order of the plant's bodies."""
_SHARES = {"Coulomb": 0.05, "viscous": 0.04, "root": 0.02, "wander": 0.002, "noise": 0.01}
"""Shares of the torque limit: viscous and root friction at the
velocity limit, noise of a sample.
"""


@dataclass(frozen=True, eq=False)
class Load:
    """Rigid load at the last link: parameters in the link's frame by name, zero if not stated."""

    parameters: dict[str, float]

    def body(self) -> Array:
        """Return the parameters in the order of the plant, shape (10,)."""
        return np.array([self.parameters.get(name, 0.0) for name in _ORDER])

    def phi(self) -> Array:
        """Return the parameters in the order of eq. (4), shape (10,)."""
        return np.array([self.parameters.get(name, 0.0) for name in LINK_PARAMETERS])


def brick(mass: float, centre: tuple[float, float, float], size: float) -> Load:
    """Return a cuboid of sides size, 2 size and 3 size [m] about a centre [m]."""
    c, sides = np.array(centre), size * np.array([1.0, 2.0, 3.0])
    square = mass / 12 * (np.sum(sides**2) - sides**2)
    about = np.diag(square) + mass * (c @ c * np.eye(3) - np.outer(c, c))
    named = {"m": mass} | dict(zip(("sx", "sy", "sz"), mass * c, strict=True))
    for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
        named[f"I{'xyz'[i]}{'xyz'[j]}"] = float(about[i, j])
    return Load(named)


def robot_path(name: str) -> Path:
    """Return the path of a robot file of `tests/robots`, or of a packaged robot."""
    path = ROBOTS / f"{name}.yaml"
    return path if path.exists() else Path(hil.__file__).parent / "robots" / path.name


class TwinRecorder:
    """Recorder of the twin of a robot file of `tests/robots`, or of a packaged robot."""

    def __init__(self, name: str) -> None:
        path = robot_path(name)
        self.robot: Robot = Robot.load(str(path))
        self._arm = build.arm(draft_twin(load_yaml(path, RobotDescription)).file)
        self.n = self.robot.n_joints

    @property
    def truth(self) -> Array:
        """Base parameters without a load."""
        bodies = self._arm[2]
        standard = np.concatenate(
            [[body[_ORDER.index(name)] for name in LINK_PARAMETERS] for body in bodies]
        )
        K: Array = base_parameters(self.robot).matrix
        return K[:, : len(standard)] @ standard

    def torque(self, q: Array, qd: Array, qdd: Array, load: Load | None = None) -> Array:
        """Return torque of bodies and rotors, shape (n_samples, n_joints)."""
        joints, frames, bodies, gravity, kinds = self._arm
        bodies = bodies.copy()
        bodies[-1] += 0.0 if load is None else load.body()
        bias, mass, work = np.zeros(self.n), np.zeros((self.n, self.n)), np.zeros((self.n, WORK))
        found = np.zeros_like(q)
        for k, (at, v, a) in enumerate(zip(q, qd, qdd, strict=True)):
            bias_and_mass(joints, frames, bodies, gravity, kinds, at, v, bias, mass, work)
            found[k] = bias + (np.tril(mass) + np.tril(mass, -1).T) @ a
        return found + self.robot.reflected_inertia * qdd

    def recorded(
        self,
        seed: int,
        load: Load | None = None,
        *,
        n: int = 3,
        duration: float = 20.0,
        noise: float = 1.0,
    ) -> FreeRecorded:
        """Return recordings with torques in SI; `noise` is a multiple of the noise in `_SHARES`."""
        rng, found = np.random.default_rng(seed), []
        limit = self.robot.torque_limit
        for k in range(n):
            t = PERIOD * np.arange(round(duration / PERIOD))
            q, qd, qdd = self._motion(t, rng)
            u = qd / self.robot.velocity_limit
            levels = rng.uniform(0.9, 1.1, self.n) * _SHARES["Coulomb"]
            walk = np.cumsum(rng.standard_normal(q.shape), axis=0) * np.sqrt(PERIOD / 60.0)
            friction = (levels + _SHARES["wander"] * walk) * np.sign(qd) + _SHARES["viscous"] * u
            friction += _SHARES["root"] * np.cbrt(u)
            e = noise * _SHARES["noise"] * rng.standard_normal(q.shape)
            tau = self.torque(q, qd, qdd, load) + limit * (friction + e)
            still, flags = np.full(len(t), -1, np.int16), np.zeros(q.shape, np.uint8)
            motion = FreeMotion(id=f"r{k}", q=tuple(q.mean(axis=0)), duration=duration)
            found.append((motion, Recording(t, q, tau, flags, still, still, group=0 * still)))
        return found

    def _motion(self, t: Array, rng: np.random.Generator) -> tuple[Array, Array, Array]:
        """Return sums of five sines within nine tenths of the limits."""
        w = 2 * np.pi * rng.uniform(0.05, 0.8, (5, 1, self.n))
        turn = w * t[:, np.newaxis] + rng.uniform(0, 2 * np.pi, w.shape)
        size = rng.uniform(0.5, 1.0, w.shape) / w
        waves = (
            np.sum(size * np.sin(turn), axis=0),
            np.sum(size * w * np.cos(turn), axis=0),
            np.sum(-size * w**2 * np.sin(turn), axis=0),
        )
        robot = self.robot
        bounds = (robot.q_max - robot.q_min) / 2, robot.velocity_limit, robot.acceleration_limit
        most = [np.abs(x).max(axis=0) / b for x, b in zip(waves, bounds, strict=True)]
        q, qd, qdd = (0.9 * x / np.max(most, axis=0) for x in waves)
        return (robot.q_max + robot.q_min) / 2 + q, qd, qdd


def scale_gains(data: FreeRecorded, gains: dict[int, float]) -> FreeRecorded:
    """Return recordings with torques of some axes, from 1, in unknown units of size `gains`."""
    found = []
    for motion, recording in data:
        tau = recording.tau.copy()
        for axis, gain in gains.items():
            tau[:, axis - 1] /= gain
        stated = motion.model_copy(update={"unknown_gains": tuple(sorted(gains)) or None})
        found.append((stated, replace(recording, tau=tau)))
    return found
