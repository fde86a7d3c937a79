"""Public MJCF robots, simulated by MuJoCo: identify, patch the file, replay.

    python benchmarks/public_mjcf.py FOLDER [ROBOT ...] [--first SEED] [--seeds NUMBER]

FOLDER holds these files of github.com/kevinzakka/mink, which are those of MuJoCo Menagerie, at
commit cf1a302ff31b1f620abecdcbdebfd2c42d125a54, below ``examples``; meshes are not needed::

    universal_robots_ur5e/ur5e.xml    six axes
    kuka_iiwa_14/iiwa14.xml           seven axes
    unitree_go1/go1.xml               a leg of three axes, without the free joint
    leap_hand/right_hand.xml          a hand: tree of four fingers, 16 axes
    unitree_h1/h1.xml                 torso and two arms: tree of nine axes, without the free joint

No constant of `hil` was tuned on these seeds; the sum of covariances was checked on 11 to 13. The
machine of a seed has every mass, centre and inertia, armature, damping and friction loss of the
file, times 0.8 or 1.2; files without friction or armature get some (`complete`). MuJoCo moves the
machine in closed loop through a minute of random motion, then through a held-out one. Recordings
are at 500 Hz, with an encoder of 17 bit a turn and 1 % of noise on the torque. The true base
parameters are those of MuJoCo's inverse dynamics in random states. The file is patched with the
identified values; all else must be the same text. The replay error is that of recorded torques in
stretches of 0.5 s in MuJoCo, as a share of each axis's range, rms. Beside it stand that of the
machine itself, the bound by noise, and that of the file, complete with friction off by 20 %.

MuJoCo integrates by the Runge-Kutta method: its Euler method takes damping d at the end of a step
h, which looks like d h / 2 of armature, three standard errors of the H1's wrists.
"""

from __future__ import annotations

import argparse
import copy
import re
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import mujoco
import numpy as np
import yaml
from figures import Figure, keep

import hil
from hil.errors import HilError
from hil.estimation.identify import estimate
from hil.ground_truth.comparison import Comparison
from hil.imports.importing import import_recordings
from hil.model.readers.mjcf_text import MjcfText
from hil.results.identification import model_of
from hil.runs.pooling import Pooled
from hil.simulation.replay import Lanes, Replay
from hil.tasks.exporting import exported_model

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.simulation.arm import Drive, Start

    Array = NDArray[np.float64]

ROBOTS = {
    "universal_robots_ur5e/ur5e.xml": None,
    "kuka_iiwa_14/iiwa14.xml": None,
    "unitree_go1/go1.xml": "FR_calf",
    "leap_hand/right_hand.xml": None,
    "unitree_h1/h1.xml": "left_elbow_link,right_elbow_link",
}
"""Files, and the last links of the robot."""
FIRST_SEED, SEEDS = 21, 3
STEP = 0.0005
"""Step of MuJoCo [s]."""
EVERY = 4
"""Steps of a sample."""
INCREMENTS, NOISE = 1 << 17, 0.01
DURATION, HELD_OUT, RESTART = 60.0, 20.0, 0.5
PERIOD, HARMONICS, AMPLITUDE = 10.0, 5, 1.0
"""Period [s], harmonics and largest amplitude [rad] of a motion; it stays within the middle 80 % of
a joint's range.
"""
STIFFNESS = 2 * np.pi * 5.0
"""Bandwidth of the machine's controller [rad/s]."""
OFF = 0.2
JOINT = re.compile(r"<joint\b[^>]*")
OF_JOINT = re.compile(r"\s*\b(armature|damping|frictionloss)=\"[^\"]*\"")
INERTIAL = re.compile(r"<inertial\b[^>]*")
FREE = re.compile(r"\s*<freejoint[^>]*/>")


class Machine(NamedTuple):
    """Model of MuJoCo, and the numbers of its degrees of freedom for the robot's joints."""

    model: mujoco.MjModel
    dofs: NDArray[np.intp]

    @classmethod
    def load(cls, path: Path, robot: hil.Robot) -> Machine:
        """Compile a file without its meshes, contacts, limits and actuators."""
        model = mujoco.MjModel.from_xml_string(*MjcfText(path).reduce())
        model.opt.timestep, model.opt.integrator = STEP, mujoco.mjtIntegrator.mjINT_RK4
        for each in ("CONTACT", "LIMIT", "ACTUATION"):
            model.opt.disableflags |= getattr(mujoco.mjtDisableBit, f"mjDSBL_{each}")
        return cls(model, np.array([model.joint(name).dofadr[0] for name in robot.joint_names]))

    def complete(self, motion: tuple[Array, ...]) -> None:
        """Add armature and friction to a file without.

        Armature is half of the mean inertia of the axis, friction loss and damping are 5 % of the
        rms torque, the latter at the rms speed.
        """
        q, qd, _ = motion
        tau = self.torques(*(each[::50] for each in motion))
        size, M = np.sqrt(np.mean(tau**2, axis=0)), np.zeros((self.model.nv, self.model.nv))
        data, inertia = mujoco.MjData(self.model), []
        for each in q[::50]:
            data.qpos[self.dofs] = each
            mujoco.mj_forward(self.model, data)
            mujoco.mj_fullM(self.model, data, M)
            inertia.append(np.diag(M)[self.dofs])
        for name, value in (
            ("dof_armature", 0.5 * np.mean(inertia, axis=0)),
            ("dof_frictionloss", 0.05 * size),
            ("dof_damping", 0.05 * size / np.sqrt(np.mean(qd**2, axis=0))),
        ):
            array = getattr(self.model, name).reshape(self.model.nv, -1)[:, 0]
            if not array[self.dofs].any():
                array[self.dofs] = value

    def off(self, rng: np.random.Generator) -> Machine:
        """Return a machine with all values larger or smaller by `OFF`."""
        model = copy.copy(self.model)
        for name in (
            "body_mass", "body_inertia", "dof_armature", "dof_frictionloss", "dof_damping",
        ):  # fmt: skip
            array = getattr(model, name)
            rows = array.reshape(len(array), -1)
            rows *= 1.0 + OFF * rng.choice([-1.0, 1.0], (len(rows), 1))
        model.body_ipos[:] *= 1.0 + OFF * rng.choice([-1.0, 1.0], model.body_ipos.shape)
        mujoco.mj_setConst(model, mujoco.MjData(model))
        return Machine(model, self.dofs)

    def torques(self, q: Array, qd: Array, qdd: Array) -> Array:
        """Return the torques of inverse dynamics, shape (n, n_joints)."""
        data, found = mujoco.MjData(self.model), np.empty_like(q)
        for k, state in enumerate(zip(q, qd, qdd, strict=True)):
            data.qpos[self.dofs], data.qvel[self.dofs], data.qacc[self.dofs] = state
            mujoco.mj_inverse(self.model, data)
            found[k] = data.qfrc_inverse[self.dofs]
        return found

    def truth(self, robot: hil.Robot) -> Array:
        """Return the base parameters that have MuJoCo's torques of bodies and rotors."""
        bare = Machine(copy.copy(self.model), self.dofs)
        bare.model.dof_damping[:], bare.model.dof_frictionloss[:] = 0.0, 0.0
        states = np.random.default_rng(0).uniform(-2.0, 2.0, (3, 200, robot.n_joints))
        A = hil.regressor(robot, *states).reshape(200 * robot.n_joints, -1)
        p, left, rank, _ = np.linalg.lstsq(A, bare.torques(*states).ravel(), rcond=None)
        assert rank == A.shape[1]
        assert left < 1e-12 * np.sum((A @ p) ** 2)
        return np.asarray(p)

    def record(self, motion: tuple[Array, ...], rng: np.random.Generator) -> tuple[Array, Array]:
        """Return positions and torques of a controlled motion, shapes (n, n_joints)."""
        data, M = mujoco.MjData(self.model), np.zeros((self.model.nv, self.model.nv))
        feed = self.torques(*motion)
        data.qpos[self.dofs], data.qvel[self.dofs] = motion[0][0], motion[1][0]
        mujoco.mj_forward(self.model, data)
        mujoco.mj_fullM(self.model, data, M)
        stiff = STIFFNESS * np.diag(M)[self.dofs]
        found = np.empty((2, len(feed) // EVERY, len(self.dofs)))
        before = feed[0]
        for k, (q, qd, torque) in enumerate(zip(*motion[:2], feed, strict=True)):
            lag = q - data.qpos[self.dofs], qd - data.qvel[self.dofs]
            tau = torque + stiff * (STIFFNESS * lag[0] + 2.0 * lag[1])
            if k % EVERY == 0 and k // EVERY < found.shape[1]:
                # held over a step: at the sample acts the mean
                found[:, k // EVERY] = data.qpos[self.dofs], (before + tau) / 2
            before = tau
            data.qfrc_applied[self.dofs] = tau
            mujoco.mj_step(self.model, data)
        turn = 2 * np.pi / INCREMENTS
        noise = NOISE * np.sqrt(np.mean(found[1] ** 2, axis=0)) * rng.normal(size=found[1].shape)
        return turn * np.round(found[0] / turn), found[1] + noise

    def run(self, starts: Sequence[Start], drive: Drive) -> list[Array]:
        """Simulate like `hil.simulation.arm.Arm.run`."""
        found = []
        for q, qd, time, _ in starts:
            data, positions = mujoco.MjData(self.model), np.full((len(time), len(q)), np.nan)
            data.qpos[self.dofs], data.qvel[self.dofs], positions[0] = q, qd, q
            instants = time[0] + STEP * (np.arange(EVERY * len(time)) + 0.5)
            torques = [np.interp(instants, drive.time, column) for column in drive.torque.T]
            steps = np.column_stack(torques).reshape(len(time), EVERY, -1)
            for k in range(1, len(time)):
                for torque in steps[k - 1]:
                    data.qfrc_applied[self.dofs] = torque
                    mujoco.mj_step(self.model, data)
                positions[k] = data.qpos[self.dofs]
            found.append(positions)
        return found


def motion_of(robot: hil.Robot, rng: np.random.Generator, duration: float) -> tuple[Array, ...]:
    """Return positions, velocities and accelerations at every step, (n, n_joints) each."""
    time, w = np.arange(0.0, duration, STEP)[:, None], 2 * np.pi / PERIOD
    order = np.arange(1, HARMONICS + 1)
    a = rng.normal(size=(2, HARMONICS, robot.n_joints)) / np.sqrt(order)[:, None]
    sin, cos = np.sin(w * order * time), np.cos(w * order * time)
    q = sin @ a[0] + cos @ a[1]
    low, high = np.nan_to_num(robot.q_min, nan=-np.pi), np.nan_to_num(robot.q_max, nan=np.pi)
    half = np.minimum(0.4 * (high - low), AMPLITUDE)
    scale = half / (0.5 * np.ptp(q, axis=0))
    a *= scale
    q = scale * (q - 0.5 * (q.max(axis=0) + q.min(axis=0))) + 0.5 * (low + high)
    qd = (w * order * cos) @ a[0] - (w * order * sin) @ a[1]
    return q, qd, -((w * order) ** 2 * sin) @ a[0] - ((w * order) ** 2 * cos) @ a[1]


def write(folder: Path, name: str, robot: dict[str, str], recorded: tuple[Array, Array]) -> Path:
    """Write a recording as CSV, and its map; return the path of the map."""
    q, tau = recorded
    n, time = q.shape[1], EVERY * STEP * np.arange(len(q))
    names = [f"{what}{k}" for what in ("q", "tau") for k in range(1, n + 1)]
    np.savetxt(
        folder / f"{name}.csv", np.column_stack([time, q, tau]), "%.9g", ",",
        header=",".join(["t", *names]), comments="",
    )  # fmt: skip
    joints = [
        {
            "position": {"column": f"q{k}", "unit": "rad"},
            "torque": {"column": f"tau{k}", "unit": "N m"},
        }
        for k in range(1, n + 1)
    ]
    stated = {"robot": robot, "files": [f"{name}.csv"], "time": {"column": "t", "unit": "s"}}
    (path := folder / f"{name}.yaml").write_text(yaml.safe_dump(stated | {"joints": joints}))
    return path


class Judged(NamedTuple):
    """Intervals that hold the truth, z of each parameter, replay errors [%], changed text."""

    inside: NDArray[np.bool_]
    z: Array
    patched: float
    bound: float
    off: float
    changed: bool


def strip_values(text: str) -> str:
    """Return the text of a file without inertials, and without values of joints."""
    return INERTIAL.sub("", JOINT.sub(lambda found: OF_JOINT.sub("", found[0]), text))


def share(lanes: Lanes, robot: hil.Robot, machine: Machine) -> float:
    """Return the position error of a replay as a share of each axis's range, rms [%]."""
    found = Replay(robot, lanes.simulated(machine), "")
    return 100.0 * float(np.sqrt(np.mean((found.rms / found.covered) ** 2)))


def judge(folder: Path, source: Path, tip: str | None, seed: int) -> Judged:
    """Record, import, identify, patch and replay the machine of a seed.

    Raises
    ------
    HilError
        Refused by import, identification or export.
    """
    text, file = FREE.sub("", source.read_text()), folder / source.name
    file.write_text(text)
    rng = np.random.default_rng(seed)
    stated = {"urdf": file.name} | ({"to": tip} if tip else {})
    robot = hil.Robot.load(file, tip=tip)
    motions = [motion_of(robot, rng, duration) for duration in (DURATION, HELD_OUT)]
    given = Machine.load(file, robot)
    given.complete(motions[0])
    machine = given.off(rng)
    seen, other = (
        import_recordings([write(folder, name, stated, machine.record(each, rng))], folder / name)
        for name, each in zip(("seen", "other"), motions, strict=True)
    )
    found = estimate(seen.robot, Pooled([seen]), "free motion")
    model = model_of(seen, found)
    judged = Comparison(found, machine.truth(seen.robot))
    _, exported = exported_model(model, "mjcf", seen.path, patch=file)
    (new := folder / "patched.xml").write_text(exported.files[file.name])
    lanes = Lanes.create(((e.measurement, e.recording) for e in other), model, None, RESTART)
    patched, bound, off = (
        share(lanes, robot, each) for each in (Machine.load(new, robot), machine, given)
    )
    changed = strip_values(new.read_text()) != strip_values(text)
    return Judged(judged.inside, judged.z, patched, bound, off, changed)


def figures(found: list[Judged], refused: int) -> dict[str, Figure]:
    """Return the figures of a robot, in the order of the table."""
    if not found:
        return {"refused": Figure.count(refused)}
    inside, z = (
        np.concatenate([getattr(each, name) for each in found]) for name in ("inside", "z")
    )
    patched, bound, off = (
        np.array([getattr(each, name) for each in found]) for name in ("patched", "bound", "off")
    )
    return {
        "inside": Figure(100 * inside.mean(), "%", 3),
        "intervals": Figure.count(len(inside)),
        "z": Figure(np.sqrt(np.mean(z**2))),
        "replay": Figure(patched.mean(), "%", scatter=patched.std() or None),
        "replay-machine": Figure(bound.mean(), "%", scatter=bound.std() or None),
        "replay-off": Figure(off.mean(), "%", scatter=off.std() or None),
        "smaller": Figure((off / patched).min(), ""),
        "changed-otherwise": Figure.count(sum(each.changed for each in found)),
        "refused": Figure.count(refused),
    }


def main() -> None:
    """Judge all robots, print and keep the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("robots", nargs="*", help=", ".join(ROBOTS))
    parser.add_argument("--first", type=int, default=FIRST_SEED, help="first seed")
    parser.add_argument("--seeds", type=int, default=SEEDS)
    arguments = parser.parse_args()
    seeds = range(arguments.first, arguments.first + arguments.seeds)
    kept: dict[str, Figure] = {}
    for path in arguments.robots or ROBOTS:
        found: list[Judged] = []
        refused, name = 0, path.split("/")[0].replace("_", "-")
        for seed in seeds:
            with tempfile.TemporaryDirectory() as folder:
                try:
                    found.append(judge(Path(folder), arguments.folder / path, ROBOTS[path], seed))
                except HilError as error:
                    refused += 1
                    print(f"  {path}, seed {seed}: {error}", flush=True)
        stated = figures(found, refused)
        said = ", ".join(f"{key} {figure.stated}" for key, figure in stated.items())
        print(f"{name}: {said}", flush=True)
        kept |= {f"{name}-{key}": figure for key, figure in stated.items()}
    if not arguments.robots:
        command = (
            f"python benchmarks/public_mjcf.py FOLDER --first {arguments.first}"
            f" --seeds {arguments.seeds}"
        )
        depends = ("hil/estimation", "hil/export/patch.py", "hil/model/readers/mjcf.py")
        keep("public-mjcf", kept, depends=depends, command=command, seeds=list(seeds))


if __name__ == "__main__":
    main()
