"""The campaigns of the paper measured and judged, and their figures in one small file."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.drift_study.drift import judged as judged_study
from benchmarks.drift_study.drift import prepare
from benchmarks.drift_study.summary import summarise

from . import assessment
from .campaigns import CASES, FIRST_SEED, ROBOT, hil, measure

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
    path = folder / name / f"seed-{seed}.json"
    if not path.exists():
        run, plant = measure(folder, robot, name, CASES[name], seed), path.with_suffix(".yaml")
        if name == "offset":
            figures = assessment.of_offset(run)
        elif name in ONCE:
            model = measure(folder, robot, "default", CASES["default"], FIRST_SEED).path
            if not (model / "model.yaml").exists():
                hil("identify", model)
            figures = assessment.of_friction(run, model)
        else:
            figures = assessment.of_strokes(run, plant, both=name in BOTH)
        if (name, seed) == ("bare", FIRST_SEED):
            figures["filters"] = assessment.of_filters(run, plant)
            figures["trajectories"] = [assessment.course(run, each) for each in ("g01", "i39")]
        path.write_text(json.dumps(figures, default=plain))
    return dict(json.loads(path.read_text()))


def plain(value: Any) -> Any:
    """Arrays and numbers of NumPy as JSON has them, to five digits."""
    if isinstance(value, np.ndarray):
        return [plain(each) for each in value]
    if isinstance(value, np.bool_):
        return bool(value)
    return float(f"{value:.5g}")


def gather(folder: Path, robot: Robot, cases: Sequence[str], seeds: Sequence[int]) -> Figures:
    """Measure and judge cases at all seeds, or what is drawn at the first one."""
    jobs = [(n, s) for s in seeds for n in cases if n not in ONCE or s == seeds[0]]
    with ThreadPoolExecutor(2) as pool:
        done = list(pool.map(lambda job: judged(folder, robot, *job), jobs))
    drawn: Figures = {}
    found: dict[str, list[Figures]] = {}
    for (name, _), figures in zip(jobs, done, strict=True):
        if name in ONCE:
            drawn[name] = figures
        else:
            elements = figures.pop("elements")
            found.setdefault(name, []).append(figures)
            if name in ("bare", "loaded"):
                drawn.setdefault(name, elements)
                drawn |= {k: figures.pop(k) for k in ("filters", "trajectories") if k in figures}
    return {"cases": found, "drawn": drawn, "drift": _of_drift(folder / "drift", seeds)}


def _of_drift(folder: Path, seeds: Sequence[int]) -> Figures:
    """Torque errors of methods in the study of drift, whose campaigns lie beside these."""
    scenarios, kinds = ("off", "strong"), ("trajectory", "compensated")
    rows = summarise(
        judged_study(prepare(folder, ROBOT, ROBOT, seeds, scenarios, kinds, minutes=10))
    )
    return {
        f"{row.method}, {row.scenario}": {"n": row.n, "torque": row.torque_error} for row in rows
    }
