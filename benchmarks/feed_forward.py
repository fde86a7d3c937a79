"""Effect of feed-forward on following errors, on plants without tuning.

`python benchmarks/feed_forward.py [SEED ...]`, by default 31 to 36. Each seed is a plant with
another drift of friction, and another trajectory of 5 s. The model of the plant is identified from
20 s of a different trajectory. Each of the three passes begins cold. Torque feed-forward is
compared with velocity feed-forward alone.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from figures import Figure, keep

from checked_files.yaml_file import load_yaml
from hil.cli import main
from hil.commands.track import NAME, PASSES, Tracking
from hil.model.robot import ROBOTS, Robot
from hil.planning.design.trajectories import Basis
from hil.planning.plan import Plan, PlannedRobot, dump_plan

ROBOT = Robot.load("manutec-r15")
SEEDS = (31, 32, 33, 34, 35, 36)
SPEED, ACCELERATION = 0.8, 0.4
"""Shares of the limits used by a fast trajectory; torques then reach 0.8 of their limits."""
WINDOW = 0.2
"""Following error window [rad]: without feed-forward, axes lag 0.1 rad behind at full speed."""


def plan(
    path: Path, seed: int, period: float, cycles: int, harmonics: int, shares: tuple[float, float]
) -> Path:
    """Write a plan of one random trajectory with these shares of velocity and acceleration."""
    basis = Basis(ROBOT, period, harmonics)
    speed, acceleration = shares[0] * ROBOT.velocity_limit, shares[1] * ROBOT.acceleration_limit
    basis._limits = np.stack([basis._reach, speed, acceleration])
    drawn = basis.random(np.random.default_rng(seed))
    robot = PlannedRobot(name=ROBOT.name, digest=ROBOT.digest)
    planned = Plan(robot=robot, measurements=(basis.trajectory(drawn, cycles, "t"),))
    path.write_bytes(dump_plan(planned).encode())
    return path


def called(*words: object) -> None:
    """Call a command of hil."""
    try:
        main([str(word) for word in words])
    except SystemExit as left:
        if left.code:
            raise


def errors(folder: Path, seed: int) -> np.ndarray:
    """Return the error ratios of each axis by velocity, and by velocity and torque."""
    drives = folder / "drives.yaml"
    text = (ROBOTS / "manutec-r15.drives.yaml").read_text()
    drives.write_text(re.sub(r"(following_error_window:) [\d.]+", rf"\1 {WINDOW}", text))
    plant = ("--drives", drives, "--bus-option", f"seed={seed}")
    known = plan(folder / "known.yaml", 1000 + seed, 5.0023, 4, 10, (0.9, 0.49))
    fast = plan(folder / "fast.yaml", seed, 5.0, 2, 5, (SPEED, ACCELERATION))
    called("run", known, "-o", folder / "known", *plant)
    called("identify", folder / "known")
    called("track", fast, "--model", folder / "known", "-o", folder / "fast", *plant)
    axes = load_yaml(folder / "fast" / NAME, Tracking).axes
    return np.array([[axis.rms[name] for name in PASSES] for axis in axes])


if __name__ == "__main__":
    found = []
    for seed in map(int, sys.argv[1:] or SEEDS):
        with TemporaryDirectory() as folder:
            found.append(errors(Path(folder), seed))
    print("rms following error, mrad, mean over plants; and by how much torque makes it smaller")
    table = 1e3 * np.array(found)
    for axis, row in enumerate(table.mean(axis=0), start=1):
        factors = table[:, axis - 1, 1] / table[:, axis - 1, 2]
        print(
            axis, *(f"{each:8.3f}" for each in row), f"{factors.min():6.1f} to {factors.max():.1f}"
        )
    medians = np.median(table[:, :, 1] / table[:, :, 2], axis=1)
    print("factor, median over axes:", *(f"{each:.1f}" for each in medians))
    first, scatter = table[:, 0].mean(axis=0), table[:, 0].std(axis=0)
    keep(
        "feed-forward",
        {
            "least-factor": Figure(medians.min()),
            "largest-factor": Figure(medians.max(), digits=3),
            **{
                f"axis-1-{name}": Figure(x, "mrad", 3, s)
                for name, x, s in zip(PASSES, first, scatter, strict=True)
            },
        },
        depends=("hil/estimation", "drivers/cia402/feed_forward.py", "sim_plant/physics"),
        command="python benchmarks/feed_forward.py",
        seeds=[int(seed) for seed in sys.argv[1:] or SEEDS],
    )
