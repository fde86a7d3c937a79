"""Export of friction to MuJoCo: coasting and braking to rest, and inverse dynamics, by ten robots.

    python benchmarks/coasting.py [ROBOT ...]

The ten robots have one to eight axes: robots of ``hil`` and of the tests, and random chains with
slides. Each axis has Stribeck, viscous and Coulomb friction with random values. 40 s of random
motion with 1 % of noise on the torques is identified by ``hil identify``, whose choice of the
friction law is the reference, and exported by ``hil export --to mjcf``.

Each axis starts, in both directions, from its fastest identified speed, from a half and from a
quarter of it. All others are held by rotors of `HELD`, gravity is compensated. The axis coasts, or
brakes by a torque of half of its friction at rest, which friction holds afterwards. The builtin
simulator with the law is the reference. The error is the largest difference of the positions of
MuJoCo as a share of the distance to rest. The step of both is 1 ms, or 1/200 of the time to rest if
that is shorter, with `solreffriction` as the file says: MuJoCo's scheme is of first order, so that
a step of a tenth costs 10 %, and one of a hundredth 0.2 % more than this one.

Inverse dynamics: axes brake from their fastest speed within 0.1 s, in both directions, at 50
speeds. The error of `mj_inverse` against the exported bodies with the law is rms, less the rms
misfit that the export states for the axis, as a share of the torque. Beside these stand the errors
with Coulomb and viscous friction alone.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from figures import Figure, keep

import hil
from hil.export.mjcf_file import IMPEDANCE, write_mjcf
from hil.export.simple_friction import friction_of_joints
from hil.results.consistency import find_consistent_robot
from hil.simulation.arm import Arm, Start
from hil.simulation.mujoco_arm import MujocoArm
from hil.simulation.replay import possible as possible_model

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from possible_models import model_of, possible
from urdf_robots import random_tree, urdf

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ROOT = Path(__file__).parents[1]
NAMES = ("pan-tilt", "scara", "cartesian", "panda", "ur10e", "two-arms")
RANDOM = (5, 7)
"""Seeds of random chains."""
RATE, DURATION, NOISE = 250.0, 40.0, 0.01
PERIOD, HARMONICS = 10.0, 5
SHARES = (1.0, 0.5, 0.25)
"""Speeds at the start, as a share of the fastest."""
LONGEST = 6.0
"""Longest simulation [s]."""
HELD = 1e6
"""Inertia of axes that do not move [kg m^2 or kg]."""
STEP, STEPS = 0.001, 200
"""Longest step [s], and least number of steps to rest."""
BRAKING = 0.1
"""Time of hard braking [s]."""


def robots() -> Iterator[hil.Robot]:
    """Yield the ten robots."""
    yield hil.Robot.load("emps")
    yield hil.Robot.load("manutec-r15")
    for name in NAMES:
        yield hil.Robot.load(ROOT / f"tests/robots/{name}.yaml")
    for seed in RANDOM:
        joints, _ = random_tree(np.random.default_rng(seed))
        with tempfile.TemporaryDirectory() as folder:
            (path := Path(folder) / "arm.urdf").write_text(urdf(f"random-{seed}", joints))
            yield hil.Robot.load(path)


def motion(robot: hil.Robot, rng: np.random.Generator) -> tuple[Array, ...]:
    """Return time, positions, velocities and accelerations of random motion."""
    time, order = np.arange(0.0, DURATION, 1.0 / RATE), np.arange(1, HARMONICS + 1)
    w = 2 * np.pi * order / PERIOD
    a = rng.normal(size=(2, HARMONICS, robot.n_joints)) / np.sqrt(order)[:, None]
    cos, sin = np.cos(w * time[:, None]), np.sin(w * time[:, None])
    low, high = np.nan_to_num(robot.q_min, nan=-np.pi), np.nan_to_num(robot.q_max, nan=np.pi)
    q = sin @ a[0] + cos @ a[1]
    scale = np.minimum(0.4 * (high - low), 1.0) / (0.5 * np.ptp(q, axis=0))
    a *= scale
    q = scale * (q - 0.5 * (q.max(axis=0) + q.min(axis=0))) + 0.5 * (low + high)
    qd = (w * cos) @ a[0] - (w * sin) @ a[1]
    return time, q, qd, -(w**2 * sin) @ a[0] - (w**2 * cos) @ a[1]


def identified(robot: hil.Robot, seed: int) -> hil.Model:
    """Return the identified model of a robot with Stribeck friction."""
    rng, n = np.random.default_rng(seed), robot.n_joints
    truth = model_of(robot, *possible(robot, seed), friction=False)
    time, q, qd, qdd = motion(robot, rng)
    tau = truth.predict(q, qd, qdd, parts=["rigid bodies", "motors"])
    fast = np.abs(qd).max(axis=0)
    c = 0.1 * np.sqrt(np.mean(tau**2, axis=0)) * rng.uniform(0.5, 2.0, n)
    extra, knee, b = (rng.uniform(*ends, n) for ends in ((0.2, 1.0), (0.03, 0.15), (0.3, 2.0)))
    stribeck = 1.0 + extra * np.exp(-((qd / (knee * fast)) ** 2))
    tau += c * (stribeck * np.sign(qd) + b * qd / fast)
    tau += NOISE * np.sqrt(np.mean(tau**2, axis=0)) * rng.normal(size=tau.shape)
    q = q + 1e-5 * rng.normal(size=q.shape)
    run = hil.Run.import_arrays(robot, time, q, tau, accept=["friction", "range"])
    return hil.identify(run)


@dataclass(frozen=True, eq=False)
class Braked:
    """Drive that compensates gravity, with a constant torque for each lane.

    Attributes
    ----------
    model : Model
    torque : ndarray, shape (lanes, n_joints)
        Torque of the lane whose times begin at its number times `LONGEST` [N m or N].
    """

    model: hil.Model
    torque: Array

    def __post_init__(self) -> None:
        n = self.model.robot.n_joints
        for name, shape in (("wanted", (2, n)), ("kp", n), ("kd", n)):
            object.__setattr__(self, name, np.zeros(shape))

    def __call__(self, instant: Array, q: Array, _: Array) -> Array:
        """Return the torques of lanes."""
        lanes = (np.asarray(instant) / LONGEST + 1e-9).astype(int)
        return self.model.gravity(q) + self.torque[lanes]


def simulate_in_mujoco(model: hil.Model, starts: list[Start], torques: Array) -> list[Array]:
    """Return the positions of all lanes in MuJoCo, without gravity."""
    arm = MujocoArm(model)
    loaded, order, found = arm._model, arm._order, []
    loaded.opt.gravity[:] = 0.0
    armature = loaded.dof_armature[order].copy()
    for each, torque in zip(starts, torques, strict=True):
        loaded.opt.timestep = step = each.time[1] - each.time[0]
        loaded.dof_solref[:, 1] = -IMPEDANCE / step
        loaded.dof_armature[order] = armature + HELD * (each.qd == 0)
        data, positions = mujoco.MjData(loaded), np.empty((len(each.time), len(torque)))
        data.qpos[order], data.qvel[order], data.qfrc_applied[order] = each.q, each.qd, torque
        for k in range(len(positions)):
            positions[k] = data.qpos[order]
            mujoco.mj_step(loaded, data)
        found.append(positions)
    return found


def middle_of(robot: hil.Robot) -> Array:
    """Return the middle of all ranges."""
    low, high = np.nan_to_num(robot.q_min, nan=-1.0), np.nan_to_num(robot.q_max, nan=1.0)
    return 0.5 * (low + high)


def rest_errors(model: hil.Model, robot: hil.Robot) -> dict[str, Array]:
    """Return the position errors of coasting and braking, as shares of the distance to rest.

    Shapes are (n_joints, 2, 2, speeds): coasting and braking, forward and back.
    """
    n, friction, q = robot.n_joints, friction_of_joints(model), middle_of(robot)
    inertia, rest = np.diag(model.mass_matrix(q)), Arm(model).levels(q[None])[0]
    starts, torques, law = [], [], []
    for axis in range(n):
        one = friction[axis]
        level = np.abs((one.forward - one.backward) / 2)
        for brake in (0.0, 0.5):
            for share in (*SHARES, *(-share for share in SHARES)):
                v = share * one.speeds[-1] * np.eye(n)[axis]
                each = inertia[axis] * abs(v[axis]) / (level + brake * rest[axis])
                step = min(STEP, each.min() / STEPS)
                lasts = min(2.0 * each.max(), 0.99 * LONGEST)
                time = len(starts) * LONGEST + step * np.arange(int(lasts / step))
                starts.append(Start(q, v, time, lambda *_: False))
                torques.append(-brake * rest * np.sign(v))
        arm = Arm(model)
        arm._rotors = arm._rotors + HELD * np.diag(np.arange(n) != axis)
        law += arm.run(starts[-4 * len(SHARES) :], Braked(model, np.array(torques)))
    errors = {}
    for name, each in (("mujoco", model), ("plain", find_plain_model(model))):
        rows = []
        for k, other in enumerate(simulate_in_mujoco(each, starts, np.array(torques))):
            axis = k // (4 * len(SHARES))
            way = np.abs(law[k][:, axis] - law[k][0, axis]).max()
            rows.append(np.abs(other[:, axis] - law[k][:, axis]).max() / way)
        errors[name] = np.array(rows).reshape(n, 2, 2, len(SHARES))
    return errors


def find_plain_model(model: hil.Model) -> hil.Model:
    """Return the model with the Coulomb and viscous friction of the export as its law."""
    axes = []
    for law, own in zip(model.friction_law.axes, friction_of_joints(model), strict=True):
        values = {"offset": own.offset, "Coulomb": own.coulomb, "viscous": own.viscous * law.speed}
        stated = law.plain["viscous"]
        terms = {k: stated.model_copy(update={"value": v}) for k, v in values.items()}
        axes.append(law.model_copy(update={"terms": terms, "covariance": (), "beside": ()}))
    return replace(model, friction_law=model.friction_law.model_copy(update={"axes": tuple(axes)}))


def inverse_errors(model: hil.Model, robot: hil.Robot) -> Array:
    """Return errors of `mj_inverse` beyond the stated misfit, as shares of the torque."""
    (text,) = write_mjcf(model, ()).files.values()
    bodies = possible_model(model)
    loaded = mujoco.MjModel.from_xml_string(text)
    loaded.jnt_limited[:] = 0
    data, found = mujoco.MjData(loaded), []
    names = (f"joint{number}" for number in range(1, robot.n_joints + 1))
    order = np.array([loaded.joint(name).qposadr[0] for name in names])
    for axis, own in enumerate(friction_of_joints(model)):
        unit, fastest, errors, sizes = np.eye(robot.n_joints)[axis], own.speeds[-1], [], []
        for v in (*own.speeds, *-own.speeds):
            q, qd, qdd = 0.0 * unit, v * unit, -np.sign(v) * fastest / BRAKING * unit
            data.qpos[order], data.qvel[order], data.qacc[order] = q, qd, qdd
            mujoco.mj_inverse(loaded, data)
            wanted = bodies.predict(q, qd, qdd)[axis]
            sizes.append(wanted)
            errors.append(data.qfrc_inverse[order[axis]] + own.constant - wanted)
        rms, size = (float(np.sqrt(np.mean(np.square(x)))) for x in (errors, sizes))
        found.append((rms - own.coasting.misfit) / size)
    return np.array(found)


def main() -> None:
    """Simulate all robots, print and keep the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("robots", nargs="*")
    chosen = parser.parse_args().robots
    coasting, plain, inverse, axes = [], [], [], 0
    for seed, robot in enumerate(robots()):
        if chosen and robot.name not in chosen:
            continue
        model = find_consistent_robot(identified(robot, seed))
        found, beyond = rest_errors(model, robot), inverse_errors(model, robot)
        laws = [law.law for law in model.friction_law.axes]
        print(robot.name, laws, flush=True)
        for name, errors in found.items():
            print(f"  {name}", np.round(100 * errors.max(axis=(1, 2, 3)), 2))
        print("  inverse", np.round(100 * beyond, 2), flush=True)
        coasting.append(found["mujoco"].max())
        plain.append(found["plain"].max())
        inverse.append(beyond.max())
        axes += robot.n_joints
    figures = {
        "robots": Figure.count(len(coasting)),
        "axes": Figure.count(axes),
        "rest": Figure(100 * max(coasting), "%"),
        "rest-plain": Figure(100 * max(plain), "%"),
        "inverse-beyond": Figure(100 * max(inverse), "%"),
    }
    for name, figure in figures.items():
        print(name, figure.text)
    if not chosen:
        keep(
            "coasting", figures, depends=("hil/export", "hil/simulation"),
            command="python benchmarks/coasting.py",
        )  # fmt: skip


if __name__ == "__main__":
    main()
