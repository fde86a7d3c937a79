"""The campaigns of the paper measured and judged, and their figures in one small file."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.drift_study.drift import judged as judged_study
from benchmarks.drift_study.drift import prepare
from benchmarks.drift_study.summary import summarise
from hil.runs.run import Run

from . import assessment
from .campaigns import CASES, FIRST_SEED, ROBOT, measure

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from hil.model.robot import Robot

    Figures = dict[str, Any]

BOTH = ("bare", "loaded", "uneven")
"""Cases that both methods judge."""
ONCE = ("sweep", "stops", "operation", "offset")
"""Cases of one seed: they are drawn."""


def judged(folder: Path, robot: Robot, name: str, seed: int) -> Figures:
    """Return the figures of a campaign, measured and judged unless they are there."""
    cell = measure(folder, robot, *CASES[name], name, seed)
    if not cell.verdict.exists():
        run = Run.open(cell.run)
        if name == "offset":
            figures = assessment.of_offset(run)
        elif name in ONCE:
            model = measure(folder, robot, *CASES["default"], "default", FIRST_SEED).run
            subprocess.run([sys.executable, "-m", "hil", "identify", str(model)], check=True)
            figures = assessment.of_friction(run, model)
        else:
            figures = assessment.of_strokes(run, cell.plant, both=name in BOTH)
        if (name, seed) == ("bare", FIRST_SEED):
            figures["filters"] = assessment.of_filters(run, cell.plant)
            figures["trajectories"] = [assessment.course(run, each) for each in ("g01", "i39")]
        cell.verdict.write_text(json.dumps(figures, default=np.ndarray.tolist))
    return dict(json.loads(cell.verdict.read_text()))


def gather(folder: Path, robot: Robot, seeds: Sequence[int]) -> Figures:
    """Measure and judge all cases at all seeds, or what is drawn at the first one."""
    drawn: Figures = {name: judged(folder, robot, name, seeds[0]) for name in ONCE}
    cases: Figures = {}
    for name in (name for name in CASES if name not in ONCE):
        cases[name] = [judged(folder, robot, name, seed) for seed in seeds]
        elements = [each.pop("elements") for each in cases[name]]
        drawn |= {name: elements[0]} if name in ("bare", "loaded") else {}
    drawn |= {key: cases["bare"][0].pop(key) for key in ("filters", "trajectories")}
    scenarios, kinds = ("off", "strong"), ("trajectory", "compensated")
    cells = prepare(folder, ROBOT, ROBOT, seeds, scenarios, kinds, minutes=10)
    rows = {f"{row.method}, {row.scenario}": row for row in summarise(judged_study(cells))}
    drift = {name: {"n": row.n, "torque": row.torque_error} for name, row in rows.items()}
    return {"cases": cases, "drawn": drawn, "drift": drift}
