"""The campaigns of the paper measured, judged and summed up in one small file."""

from __future__ import annotations

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.estimation.signals import signals
from hil.runs.pooling import recorded

from . import assessment
from .campaigns import CASES, FIRST_SEED, measure

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from hil.model.robot import Robot
    from hil.runs.run import Run

WHOLE = ("bare", "loaded", "uneven")
"""Cases that both methods judge."""
FRICTION = ("sweep", "stops", "operation")
ONCE = (*FRICTION, "offset")
"""Cases of one seed: they are drawn."""


def judged(folder: Path, robot: Robot, name: str, seed: int) -> dict[str, Any]:
    """Return the figures of a campaign, measured and judged unless they are there."""
    path = folder / name / f"seed-{seed}.json"
    if not path.exists():
        run, plant = measure(folder, robot, name, CASES[name], seed), path.with_suffix(".yaml")
        if name in FRICTION:
            figures = assessment.of_friction(run, _identified(folder, robot))
        elif name == "offset":
            figures = assessment.of_offset(run)
        else:
            figures = assessment.of_strokes(run, plant, whole=name in WHOLE)
        if name == "bare" and seed == FIRST_SEED:
            figures["filters"] = assessment.of_filters(run, plant)
            figures["trajectories"] = [_course(run, each) for each in ("g01", "i39")]
        path.write_text(json.dumps(figures, default=plain))
    return dict(json.loads(path.read_text()))


def _identified(folder: Path, robot: Robot) -> Path:
    """Folder of a run with a model, which compensates gravity of friction."""
    run = measure(folder, robot, "default", CASES["default"], FIRST_SEED).path
    if not (run / "model.yaml").exists():
        command = (sys.executable, "-m", "hil", "identify", str(run))
        subprocess.run(command, capture_output=True, check=True)
    return run


def _course(run: Run, name: str) -> dict[str, Any]:
    """One measurement as it was recorded: time, and velocity and torque of its axis."""
    m, recording = next(each for each in recorded(run) if each[0].id == name)
    s, axis = signals(recording), m.moved[0]
    every = slice(None, None, 5)
    columns = s.time - s.time[0], s.smoothed(s.qd)[:, axis], s.smoothed(s.tau)[:, axis]
    return {"axis": axis + 1, **dict(zip("tvQ", (c[every] for c in columns), strict=True))}


def plain(value: Any) -> Any:
    """Arrays and numbers of NumPy as JSON has them, to five digits."""
    if isinstance(value, np.ndarray):
        return [plain(each) for each in value]
    if isinstance(value, np.bool_):
        return bool(value)
    return float(f"{value:.5g}") if isinstance(value, np.floating) else value


def everything(
    folder: Path, robot: Robot, cases: Sequence[str], seeds: Sequence[int], workers: int = 2
) -> dict[str, dict[int, dict[str, Any]]]:
    """Measure and judge cases at all seeds, those that are drawn at the first one."""
    jobs = [(n, s) for s in seeds for n in cases if n not in ONCE or s == seeds[0]]
    with ThreadPoolExecutor(workers) as pool:
        done = list(pool.map(lambda job: judged(folder, robot, *job), jobs))
    found: dict[str, dict[int, dict[str, Any]]] = {}
    for (name, seed), figures in zip(jobs, done, strict=True):
        found.setdefault(name, {})[seed] = figures
    return found
