"""Recordings of virtual twins of many robots, in the form of another controller's recordings.

Every seed is a different machine: the twin by `hil twin` of a robot file, with drawn friction,
asymmetry and temperature, and with drift. The machine follows an exciting trajectory of this seed,
then a held-out second one. Time, positions and torques are kept as a CSV with a map, at the rate
and with the encoder of the case; there are no velocities and no CAN frames.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import yaml

from hil.ground_truth.true_parameters import find_plant
from hil.model.robot import Robot
from hil.planning.design.trajectories import Search, design_trajectory
from sim_plant.machine_protocol import Reading
from sim_plant.physics import state as st
from sim_plant.plant import load_plant
from sim_plant.twin.files import PLANT
from sim_plant.twin.write import write_twin

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.planning.trajectory import Trajectory
    from sim_plant.plant import Plant

    Array = NDArray[np.float64]

ROBOTS = Path(__file__).parents[1] / "tests" / "robots"
NAMES = ("pan-tilt", "scara", "cartesian", "ur10e", "ur10e-on-a-wall", "panda", "manutec-r15")
SEARCH = Search(random=100, refined=2, steps=25)
"""Options of the trajectory search, with less effort and less excitation than in `hil plan`.
"""
TICK = 0.001
"""Interval of the set-points [s]."""
COUNT, AMPERE = (Reading._fields.index(name) for name in ("position", "current"))
FIRST = 2.0
"""Duration of the travel to the trajectory's start, not recorded [s]."""


@dataclass(frozen=True)
class Case:
    """Recording conditions of a motion.

    Attributes
    ----------
    rate : int
        Sampling rate [Hz].
    duration : float
        Duration of the recording [s].
    harmonics : int
        Number of harmonics of the repeated motion of 10 s.
    increments : int, optional
        Increments of an encoder on the joint [1/turn, or 1/m]; default: the motor's encoder.
    drift : float
        Strength of friction's drift, 1 being the twin's.
    """

    rate: int
    duration: float
    harmonics: int = 15
    increments: int | None = None
    drift: float = 1.0


CASES = {
    "250 Hz": Case(250, 60.0),
    "1 kHz": Case(1000, 60.0),
    "100 Hz": Case(100, 60.0),
    "20 s": Case(500, 20.0),
    "slow": Case(250, 60.0, harmonics=5),
    "16 bit": Case(250, 60.0, increments=1 << 16),
    "12 bit": Case(250, 60.0, increments=1 << 12),
    "10 bit": Case(250, 60.0, increments=1 << 10),
    "10 min": Case(250, 600.0),
    "10 min of strong drift": Case(250, 600.0, drift=3.0),
}


def robot_of(name: str) -> tuple[Robot, str]:
    """Load a robot by its name in `NAMES`; return it with its name in a map."""
    file = ROBOTS / f"{name}.yaml"
    named = str(file) if file.exists() else name
    return Robot.load(named), named


def record(folder: Path, name: str, case: str, seed: int) -> Path:
    """Record one seed of a robot into a separate folder, unless the folder exists.

    Returns
    -------
    Path
        With ``seen.yaml`` and ``unseen.yaml``, maps of two recordings, and ``plant.yaml``.
    """
    own = folder / name / case.replace(" ", "-") / f"seed-{seed}"
    if (own / "unseen.yaml").exists():
        return own
    own.mkdir(parents=True, exist_ok=True)
    robot, named = robot_of(name)
    _write_machine(folder / name / "twin", name, own / "plant.yaml", seed, CASES[case].drift)
    plant = load_plant(str(own / "plant.yaml"), seed)
    for k, what in enumerate(("seen", "unseen")):
        motion = design_trajectory(
            robot, seed=2 * seed + k, search=SEARCH, harmonics=CASES[case].harmonics
        )
        _write(own / what, _follow(plant, motion, CASES[case]), robot, named, CASES[case])
    return own


def _write_machine(twin: Path, name: str, path: Path, seed: int, drift: float) -> None:
    """Write the plant of a seed."""
    if (ROBOTS / f"{name}.yaml").exists():
        if not (twin / PLANT).exists():
            write_twin(ROBOTS / f"{name}.yaml", twin)
        source = twin / PLANT
    else:
        source = find_plant(name)
    content, random = yaml.safe_load(source.read_text()), np.random.default_rng(seed)
    for axis in content["axes"]:
        friction = axis["friction"]
        size, rise = random.uniform(0.6, 1.6), random.uniform(1.2, 2.2)
        friction["creep"] = float(size * friction["creep"])
        friction["full_speed"] = float(rise * friction["creep"])
        friction["asymmetry"] = float(random.normal(0.0, 0.01))
        friction["temperature"] = float(random.uniform(0.0, 25.0))
        friction["lubricant"] = float(random.uniform(0.0, 1.0))
    content |= {"drift": True, "drift_strength": drift}
    path.write_text(yaml.safe_dump(content, sort_keys=False))


def _follow(plant: Plant, motion: Trajectory, case: Case) -> Array:
    """Return time, positions and torques of a motion, shape (n, 1 + 2 n_joints)."""
    scale, zero = plant.const[:, st.COUNTS_PER_RAD], plant.const[:, st.ZERO]
    start = plant.state[:, st.Q].copy()
    for axis in plant.axes:
        axis.enable()
    goal, n = np.array(motion.start), round(FIRST / TICK)
    for k in range(1, n + 1):
        share = 0.5 - 0.5 * np.cos(np.pi * k / n)
        _lead(plant, scale * (start + share * (goal - start)) + zero)
    every, rows = round(1.0 / (case.rate * TICK)), []
    targets = scale * motion.motion(TICK * np.arange(1, round(case.duration / TICK) + 1))[0] + zero
    for k, target in enumerate(targets):
        _lead(plant, target)
        if k % every == 0:
            found = plant.read().reshape(len(scale), -1)
            q = (found[:, COUNT] - zero) / scale
            tau = found[:, AMPERE] * plant.const[:, st.CURRENT_PER_MILLE]
            rows.append([k * TICK, *q, *tau])
    return np.array(rows)


def _lead(plant: Plant, target: Array) -> None:
    for axis, each in zip(plant.axes, target, strict=True):
        axis.follow(float(each), TICK)
    plant.advance(TICK)


def _write(path: Path, columns: Array, robot: Robot, named: str, case: Case) -> None:
    n = robot.n_joints
    if case.increments is not None:
        step = np.where(robot.revolute, 2 * np.pi, 1.0) / case.increments
        columns[:, 1 : 1 + n] = np.round(columns[:, 1 : 1 + n] / step) * step
    names = ["t", *(f"{what}{k + 1}" for what in ("q", "tau") for k in range(n))]
    file = path.with_suffix(".csv")
    np.savetxt(file, columns, "%.9g", ",", header=",".join(names), comments="")
    joints = [
        {
            "position": {"column": f"q{k + 1}", "unit": "rad" if turns else "m"},
            "torque": {"column": f"tau{k + 1}", "unit": "N m" if turns else "N"},
        }
        for k, turns in enumerate(robot.revolute)
    ]
    content = {"robot": named, "files": [file.name], "time": {"column": "t", "unit": "s"}}
    path.with_suffix(".yaml").write_text(yaml.safe_dump(content | {"joints": joints}))
