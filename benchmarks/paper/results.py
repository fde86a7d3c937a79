"""The campaigns of the paper measured, judged and summed up in one small file."""

from __future__ import annotations

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.drift_study.drift import judged as judged_study
from benchmarks.drift_study.drift import prepare
from benchmarks.drift_study.summary import summarise
from hil.model.dependencies import GROUPS
from hil.planning.measurement import ELEMENT_KINDS

from . import assessment
from .campaigns import CASES, FIRST_SEED, ROBOT, measure

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from hil.model.robot import Robot

Figures = dict[str, Any]
WHOLE = ("bare", "loaded", "uneven")
"""Cases that both methods judge."""
FRICTION = ("sweep", "stops", "operation")
ONCE = (*FRICTION, "offset")
"""Cases of one seed: they are drawn."""
SCENARIOS, STUDIED = ("off", "strong"), ("trajectory", "compensated")
"""Of the study of drift, whose campaigns lie beside those of the paper."""


def judged(folder: Path, robot: Robot, name: str, seed: int) -> Figures:
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
            figures["trajectories"] = [assessment.course(run, each) for each in ("g01", "i39")]
        path.write_text(json.dumps(figures, default=plain))
    return dict(json.loads(path.read_text()))


def _identified(folder: Path, robot: Robot) -> Path:
    """Folder of a run with a model, which compensates gravity of friction."""
    run = measure(folder, robot, "default", CASES["default"], FIRST_SEED).path
    if not (run / "model.yaml").exists():
        command = (sys.executable, "-m", "hil", "identify", str(run))
        subprocess.run(command, capture_output=True, check=True)
    return run


def plain(value: Any) -> Any:
    """Arrays and numbers of NumPy as JSON has them, to five digits."""
    if isinstance(value, np.ndarray):
        return [plain(each) for each in value]
    if isinstance(value, np.bool_):
        return bool(value)
    return float(f"{value:.5g}") if isinstance(value, np.floating) else value


def gather(folder: Path, robot: Robot, cases: Sequence[str], seeds: Sequence[int]) -> Figures:
    """Measure and judge cases at all seeds, or what is drawn at the first one, and sum up."""
    jobs = [(n, s) for s in seeds for n in cases if n not in ONCE or s == seeds[0]]
    with ThreadPoolExecutor(2) as pool:
        done = list(pool.map(lambda job: judged(folder, robot, *job), jobs))
    found: dict[str, list[Figures]] = {}
    for (name, _), figures in zip(jobs, done, strict=True):
        found.setdefault(name, []).append(figures)
    first = {name: each[0] for name, each in found.items()}
    drawn = {k: f if k in ONCE else f["elements"] for k, f in first.items() if k in DRAWN}
    drawn |= {k: first["bare"][k] for k in ("filters", "trajectories") if "bare" in first}
    return {
        "cases": {name: summed(each) for name, each in found.items() if name not in ONCE},
        "drawn": drawn,
        "drift": of_drift(folder / "drift", seeds),
    }


DRAWN = (*ONCE, "bare", "loaded")


def summed(every: Sequence[Figures]) -> Figures:
    """Root mean squares over the seeds of a case, and what else its claims rest on."""
    methods = [name for name in ("published", "improved") if name in every[0]]
    errors = {name: [each[name] for each in every] for name in (*methods, "known_gravity")}
    bound = {group: [each["bound"][group] for each in every] for group in GROUPS}
    return {
        "n": len(every),
        "minutes": np.mean([each["minutes"] for each in every]),
        **{
            name: {k: rms([each[k] for each in own]) for k in (*GROUPS, "torque") if k in own[0]}
            for name, own in errors.items()
        },
        "p": {name: [each[name]["p"] for each in every] for name in methods},
        "inside": {name: np.mean([each[name]["inside"] for each in every]) for name in methods},
        "coriolis": {
            **{kind: max(each["coriolis"][kind] for each in every) for kind in ELEMENT_KINDS},
            "p3": rms([each["coriolis"]["moved"][2] for each in every]),
        },
        "bound": {
            group: {
                "condition": np.median([each["condition"] for each in own]),
                "allowed": rms([each["bound"] for each in own]),
                "used": [f([e["error"] / e[b] for e in own]) for f, b in USED],
            }
            for group, own in bound.items()
        },
        "asymmetry": {
            axis: {
                "mean": np.mean([each["asymmetry"][axis][0] for each in every]),
                "failed": sum(not each["asymmetry"][axis][1] for each in every),
            }
            for axis in every[0]["asymmetry"]
        },
    }


USED = ((np.median, "bound"), (np.max, "bound"), (np.max, "bound_of_exact"))


def rms(values: Sequence[float]) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def of_drift(folder: Path, seeds: Sequence[int]) -> Figures:
    """Torque error, error of the diagonal group and coverage of methods in the study of drift."""
    cells = prepare(folder, ROBOT, ROBOT, seeds, SCENARIOS, STUDIED, minutes=10)
    return {
        f"{row.method}, {row.scenario}": {
            "n": row.n, "torque": row.torque_error, "diagonal": row.group_error["diagonal"],
            "inside": row.coverage, "worst": max(row.torque_errors),
        }
        for row in summarise(judged_study(cells))
    }  # fmt: skip
