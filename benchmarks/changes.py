"""Changes between recordings of one machine: planted changes detected, and false detections.

    python benchmarks/changes.py [TRAIN... -- TEST...]

takes run folders of one machine, by default the two recordings of `examples/pan_tilt`. First, the
changes from TRAIN to TEST by `hil validate` are printed. Then changes are planted into the
recordings of TEST, one at a time, on every axis and in either direction, at the detection limit
stated for these recordings: a factor of the axis's torques, an offset of its position, a delay of
its torque, and friction. The output lists the changes found with the right axis and cause; the
target is 80 %.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from figures import Figure, keep
from scipy import signal

from hil.estimation.excluded.proof import changed
from hil.imports.importing import import_recordings
from hil.model.dynamics import inverse_dynamics
from hil.results.identification import identified
from hil.runs.pooling import Pooled
from hil.runs.run import Run

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.model.robot import Robot
    from hil.runs.recording import Recorded, Recording

PLANTED = {"torque constant": 50.0, "joint offset": 28.0, "torque delay": 20.0, "friction": 100.0}
"""Causes, and their largest planted size, up to which the change is small [unit of the cause]."""
CUT_OFF = 10.0
"""Cut-off frequency of the positions for planted friction [Hz]."""


def main(train: Sequence[Path | str], test: Sequence[Path | str]) -> tuple[int, int, int]:
    """Print detected and planted changes; return the numbers of named, detected and planted."""
    first, *more = [Run.open(folder) for folder in train]
    before, after = Pooled([first, *more]), Pooled([Run.open(folder) for folder in test])
    robot = first.robot
    unchanged = changed(robot, before, after)
    if unchanged is None:
        print("too little was recorded")
        return 0, 0, 0
    print("unchanged:", *map(str, unchanged.found or ["nothing named"]))
    p = identified(first, "free motion", more).model.values
    sizes = {(each.cause, each.axis): each.size for each in unchanged.limits}
    found = planted = 0
    for cause, most in PLANTED.items():
        for axis in range(robot.n_joints):
            size = sizes.get((cause, axis + 1))
            if size is None or size > most:
                continue
            for signed in (size, -size):
                proof = changed(robot, before, _planted(robot, p, after, cause, axis, signed))
                named = [(each.cause, each.axes) for each in proof.found] if proof else []
                right = (cause, (axis + 1,)) in named or any(
                    f"axis {axis + 1}: " in other for each in proof.found for other in each.others
                )
                planted, found = planted + 1, found + right
                print(f"{cause} of axis {axis + 1} by {signed:.3g}: {named or 'nothing named'}")
    print(f"{found} of {planted} found")
    return len(unchanged.found), found, planted


def _planted(
    robot: Robot, p: np.ndarray, recorded: Recorded, cause: str, axis: int, size: float
) -> list[tuple[object, Recording]]:
    """Return recordings with a change of one axis."""
    found = []
    for motion, recording in recorded:
        q, tau = recording.q.copy(), recording.tau.copy()
        if cause == "torque constant":
            tau[:, axis] /= 1.0 + size / 100.0  # stated sizes are ratios of true to recorded values
        elif cause == "joint offset":
            q[:, axis] -= size * (np.pi / 180.0 if robot.revolute[axis] else 1e-3)
        elif cause == "torque delay":
            tau[:, axis] = np.interp(recording.time - 1e-3 * size, recording.time, tau[:, axis])
        else:
            tau[:, axis] += size / 100.0 * _friction(robot, p, recording)[:, axis]
        found.append((motion, replace(recording, q=q, tau=tau)))
    return found


def _friction(robot: Robot, p: np.ndarray, recording: Recording) -> np.ndarray:
    """Return the Coulomb friction of a recording: half the difference of both directions."""
    b, a = signal.butter(4, min(2.0 * CUT_OFF * recording.period, 0.9))
    q = signal.filtfilt(b, a, recording.q, axis=0)
    qd = np.gradient(q, recording.period, axis=0)
    qdd = np.gradient(qd, recording.period, axis=0)
    rest = recording.tau - inverse_dynamics(robot, p, q, qd, qdd)
    fast = np.abs(qd) > 0.1 * np.abs(qd).max(axis=0)
    forward, back = (
        np.nanmean(np.where(fast & (np.sign(qd) == sign), rest, np.nan), axis=0)
        for sign in (1.0, -1.0)
    )
    return (forward - back) / 2.0 * np.sign(qd)


def keep_example() -> None:
    """Keep the figures of the two recordings of `examples/pan_tilt`."""
    example = Path(__file__).parents[1] / "examples" / "pan_tilt"
    with tempfile.TemporaryDirectory() as folder:
        runs = [Path(folder) / name for name in ("excitation", "other")]
        for run in runs:
            import_recordings([example / f"{run.name}.yaml"], run)
        named, found, planted = main(runs[:1], runs[1:])
    kept = {"named": Figure(named), "found": Figure(found), "planted": Figure(planted)}
    depends = ("hil/estimation/excluded",)
    keep("changes", kept, depends=depends, command="python benchmarks/changes.py")


if __name__ == "__main__":
    if "--" in sys.argv:
        end = sys.argv.index("--")
        main(sys.argv[1:end], sys.argv[end + 1 :])
    else:
        keep_example()
