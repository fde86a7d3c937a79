"""Changes between recordings of one machine: planted changes detected, and false detections.

    python benchmarks/changes.py [FOLDER]

FOLDER holds a folder of each machine, with the imported runs ``before`` and ``after``, further ones
``before-2`` and so on; by default the two recordings of `examples/pan_tilt`. First, the changes by
`hil validate` are printed. Then changes are planted into the later recordings, one at a time, on
every axis and in either direction, at the detection limit stated for these recordings: a factor of
the axis's torques, an offset of its position, a delay of its torque, its friction, and a point mass
on the last link. Axis and cause found are right if they are named, alone or among those that these
recordings cannot distinguish; the target is 80 %. Backlash has no limit in recordings without
located contacts.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from figures import Figure, keep
from planted_flaws import RECORDED
from scipy import signal

from hil.estimation.excluded.proof import changed
from hil.friction.law import friction_torque
from hil.imports.importing import import_recordings
from hil.model.dynamics import inverse_dynamics
from hil.model.load import MASS, load_columns
from hil.results.identification import identified
from hil.runs.pooling import Pooled
from hil.runs.run import Run

if TYPE_CHECKING:
    from hil.estimation.excluded.result import Limit
    from hil.results.model import Model
    from hil.runs.recording import Recorded, Recording

PLANTED = {
    "torque constant": 50.0, "joint offset": 28.0, "torque delay": 20.0, "friction": 100.0,
    "load": np.inf,
}  # fmt: skip
"""Causes, and their largest planted size, up to which the change is small [unit of the cause]."""
CUT_OFF = 10.0
"""Cut-off frequency of the positions for planted friction and loads [Hz]."""


def main(folder: Path) -> np.ndarray:
    """Print detected and planted changes; return the numbers of named, found and planted."""
    first, *more = [Run.open(run) for run in sorted(folder.glob("before*"))]
    after = Pooled([Run.open(run) for run in sorted(folder.glob("after*"))])
    before, robot = Pooled([first, *more]), first.robot
    unchanged = changed(robot, before, after)
    if unchanged is None:
        print(f"{folder.name}: too little was recorded")
        return np.zeros(3, dtype=int)
    print(f"{folder.name} unchanged:", *map(str, unchanged.found or ["nothing named"]))
    model = identified(first, "free motion", more).model
    count = np.array([len(unchanged.found), 0, 0])
    for limit in unchanged.limits:
        size, mass = limit.size, limit.part in {"", f"m{robot.n_joints}"}
        if size is None or size > PLANTED.get(limit.cause, 0.0) or not mass:
            continue
        words = f"axis {limit.axis or robot.n_joints}: {limit.cause}".replace("load", "a load")
        for signed in (size,) if limit.cause == "load" else (size, -size):
            found = changed(robot, before, _planted(model, after, limit, signed))
            said = [] if found is None else [*map(str, found.found)]
            right = any(words in each for each in said)
            count += 0, right, 1
            print(f"{words} by {signed:.3g}: {'found' if right else 'missed'}, {said}", flush=True)
    print(f"{count[1]} of {count[2]} found")
    return count


def _planted(model: Model, recorded: Recorded, limit: Limit, size: float) -> Recorded:
    """Return recordings with a change."""
    found = []
    for motion, recording in recorded:
        q, tau = recording.q.copy(), recording.tau.copy()
        if change := RECORDED.get(limit.cause):
            change(q, tau, recording.time, limit.axis - 1, size)
        else:
            tau += size * _per_unit(model, recording, limit)
        found.append((motion, replace(recording, q=q, tau=tau)))
    return found


def _per_unit(model: Model, recording: Recording, limit: Limit) -> np.ndarray:
    """Return torques of 1 kg on the last link, or of 1 % of an axis's friction."""
    b, a = signal.butter(4, min(2.0 * CUT_OFF * recording.period, 0.9))
    robot, q = model.robot, signal.filtfilt(b, a, recording.q, axis=0)
    qd = np.gradient(q, recording.period, axis=0)
    qdd = np.gradient(qd, recording.period, axis=0)
    if limit.cause == "load":
        complete = robot.free_links(robot.last_links)
        return inverse_dynamics(complete, load_columns(complete).K[:, MASS], q, qd, qdd)
    load = inverse_dynamics(robot, model.values, q, qd, qdd)
    forward, back = (friction_torque(robot, model.friction_law, q, v, load) for v in (qd, -qd))
    return (np.arange(robot.n_joints) == limit.axis - 1) * (forward - back) / 200.0


def keep_all(folder: Path, file: str, command: str) -> None:
    """Keep the figures of all machines."""
    counts = np.sum([main(each) for each in sorted(folder.iterdir())], axis=0)
    kept = {
        name: Figure.count(number)
        for name, number in zip(("named", "found", "planted"), counts, strict=True)
    }
    keep(file, kept, depends=("hil/estimation/excluded",), command=command)


if __name__ == "__main__":
    if folders := sys.argv[1:]:
        keep_all(Path(folders[0]), "changes-real", "python benchmarks/changes.py FOLDER")
    else:
        example = Path(__file__).parents[1] / "examples" / "pan_tilt"
        with tempfile.TemporaryDirectory() as folder:
            for maps, run in (("excitation", "before"), ("other", "after")):
                import_recordings([example / f"{maps}.yaml"], Path(folder) / "pan-tilt" / run)
            keep_all(Path(folder), "changes", "python benchmarks/changes.py")
