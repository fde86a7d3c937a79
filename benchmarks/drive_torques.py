"""Predicted torques of the drives for a motion of another recording, by parts of the model.

    python benchmarks/drive_torques.py [runs/first runs/other]

The first run is identified, the second one only predicted. The table has the root mean squares of
the torque and of the residuals of the whole prediction, of the prediction without motors and
without friction, and the share of samples in intervals of 95 %. Signals pass the low-pass of the
improved method; samples near a reversal of any axis are left out, as no law of velocity holds
there. The default runs are a campaign of benchmarks/history.py and a motion that `hil validate
--measure` designs.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from figures import Figure, keep
from history import FOLDER, made
from history import hil as hil_command
from rich.console import Console
from rich.table import Table

import hil
from hil.estimation.signals import signals
from hil.friction.equation import moving
from hil.results.identified_robot import PARTS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SEED, ITS_SEED = 300, 31
"""Seeds of the default campaign and of the default motion."""


def samples(run: hil.Run) -> tuple[Array, ...]:
    """Return smoothed positions, velocities, accelerations and torques of a run."""
    found: list[list[Array]] = [[], [], [], []]
    for measured in run:
        s = signals(measured.recording)
        axes = range(run.robot.n_joints)
        used = s.valid & np.all([moving(run.robot, s, axis) for axis in axes], axis=0)
        for kept, each in zip(found, (s.q, s.qd, s.qdd, s.tau), strict=True):
            kept.append(s.smoothed(each)[used])
    return tuple(np.concatenate(kept) for kept in found)


def campaign_and_motion() -> tuple[Path, Path]:
    """Return both default runs, recorded if missing."""
    first, motion = made(FOLDER, "unchanged", SEED), FOLDER / "motion"
    if not motion.exists():
        seed = ("--bus-option", f"seed={ITS_SEED}")
        hil_command("validate", motion, "--model", first, "--measure", *seed)
    return first, motion


def main(identified: str, other: str) -> None:
    """Print and keep the table of torques."""
    model = hil.identify(hil.Run.open(identified))
    *motion, tau = samples(hil.Run.open(other))
    low, high = np.moveaxis(model.torque_interval(*motion), -1, 0)
    columns = {
        "torque": tau,
        "left": tau - model.predict(*motion),
        "without motors": tau - model.predict(*motion, parts=[PARTS[0], PARTS[2]]),
        "without friction": tau - model.predict(*motion, parts=PARTS[:2]),
    }
    rms = {name: np.sqrt(np.mean(values**2, axis=0)) for name, values in columns.items()}
    inside = np.mean((low <= tau) & (tau <= high), axis=0)
    table = Table("axis", *columns, "inside", title=f"{other} by {identified}, N m rms (N)")
    kept: dict[str, Figure] = {}
    for axis, turns in enumerate(model.robot.revolute):
        figures = {name: values[axis] for name, values in rms.items()}
        row = (f"{each:.3g}" for each in figures.values())
        table.add_row(str(axis + 1), *row, f"{inside[axis]:.0%}")
        kept |= {
            f"axis-{axis + 1}-{name.replace(' ', '-')}": Figure(each, "N m" if turns else "N", 3)
            for name, each in figures.items()
        }
        kept[f"axis-{axis + 1}-inside"] = Figure(100 * inside[axis], "%")
    Console().print(table)
    command = "python benchmarks/drive_torques.py"
    if FOLDER not in Path(identified).parents:
        command += f" {identified} {other}"
    keep("drive-torques", kept, depends=("hil/estimation", "hil/results"), command=command)


if __name__ == "__main__":
    main(*(sys.argv[1:] or map(str, campaign_and_motion())))
