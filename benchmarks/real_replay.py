"""Replay of real logs of public robots: values of their URDF or MJCF, and identified values.

    python benchmarks/real_replay.py NAME FILE TRAIN TEST

FILE is the robot's URDF or MJCF. TRAIN and TEST are folders of imported runs, TRAIN identified. The
recorded torques of TEST move the simulated arm, in stretches of 0.5 s: that of the bodies, rotors
and friction in FILE, and that of TRAIN's model, as by ``hil replay TEST --model TRAIN --before FILE
--restart 0.5``. Errors are those of the axes that cover at least `MOVES`, as a share of the range.
Samples after a loss are not scored; the share of lost samples is stated.

Kept: ``ur10``, from unisa-acg/inverse-dynamics-solver, first 16.5 s and last 11 s, and the URDF of
Gepetto/example-robot-data at 39aa9437; ``ur10e``, from shamilmamedov/dynamic_calibration,
20_02_12-50sec_12harm and 20_02_10-30sec_12harm, with its URDF and drive gains; ``lwr4``, from
kjyv/FloBaRoID, recordings 1 and 2, with its URDF: torques of joint sensors.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from figures import Figure, keep

import hil
from hil.export.patch import patched_file, stated_model
from hil.simulation.replay import Replay, replay

RESTART = 0.5
MOVES = 0.35
"""Least range of a moving axis [rad]: 20 degrees."""
MOST_LOST = 50.0
"""Share of lost samples without a meaningful error of the others [%]."""


def figures_of(name: str, found: Replay) -> dict[str, Figure]:
    """Return the mean error of the axes that move, the largest one, and the share of losses."""
    whole = np.vstack([each.simulated for each in found.recordings])
    lost = 100 * float(np.isnan(whole[:, 0]).mean())
    print(name, np.round(100 * found.rms / found.covered, 2), found.verdict({}))
    figures = {f"{name}-lost": Figure(lost, "%")}
    if lost < MOST_LOST:
        moves = found.covered > MOVES
        share = 100 * found.rms[moves] / found.covered[moves]
        figures[name] = Figure(float(np.sqrt(np.mean(share**2))), "%")
        figures[f"{name}-worst"] = Figure(float(share.max()), "%")
    return figures


def main() -> None:
    """Replay, print and keep the figures."""
    name, path, train, test = sys.argv[1], Path(sys.argv[2]), *map(Path, sys.argv[3:])
    model = hil.Model.load(train)
    figures: dict[str, Figure] = {}
    for which, each in (
        ("file", stated_model(model, patched_file(path, model.robot))),
        ("identified", model),
    ):
        figures |= figures_of(which, replay(test, each, restart=RESTART))
    for key, figure in figures.items():
        print(key, figure.text)
    keep(
        f"real-replay-{name}", figures, depends=("hil/simulation", "hil/estimation"),
        command=f"python benchmarks/real_replay.py {name} FILE TRAIN TEST",
    )  # fmt: skip


if __name__ == "__main__":
    main()
