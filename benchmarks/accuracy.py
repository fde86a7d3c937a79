"""Deviation of whole campaigns over CANopen frames from the truth, for several seeds of the plant.

Each seed is a `hil run` of the designed plan on the virtual plant into a separate folder, two runs
in parallel. The improved and the published method are then judged on the same recordings. The
targets are those of the improved method::

    python benchmarks/accuracy.py [--seeds 5] [--method improved] [--keep FOLDER]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from figures import Figure, keep

from hil.estimation.identify import estimate
from hil.ground_truth.comparison import Comparison
from hil.ground_truth.true_parameters import true_parameters
from hil.results.prediction import free_torques
from hil.runs.pooling import recorded
from hil.runs.run import Run
from hil.show.rounding import clock

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from hil.estimation.estimate import Estimate
    from hil.results.model import Model

ROBOT = "manutec-r15"
SIDE_BY_SIDE = 2
METHODS = ("improved", "published")
TARGETS = {"gravity": 0.03, "diagonal": 0.3, "off_diagonal": 2.0}
"""Bounds of the relative error in the norm of each group, rms over the seeds [%]."""
TORQUE_TARGET = 0.4
"""Bound of the relative torque error [%]."""
COVERAGE_TARGET = "88-100"
DEPENDS = (
    "hil/estimation", "hil/least_squares", "hil/friction", "hil/planning", "sim_plant/physics",
)  # fmt: skip
"""Code on which the figures depend."""
HONEST = 3.0
"""Bound of the ratio of true to stated error of a good model."""
CONFIGURATIONS = 1000
"""Configurations at which the mass matrix of a good model is tested."""


def hil(*arguments: object) -> None:
    """Call the command line; the command prints its own error messages."""
    command = [sys.executable, "-m", "hil", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(done.stderr)


def times_stated(model: Model, found: Estimate, truth: ArrayLike) -> float:
    """Return the true over the stated error of torque on a free motion, of the worst axis."""
    free = free_torques(model)
    if free is None:
        return 0.0
    usual = found.effect * model.robot.usual_uncertainty
    stated = free.standard_error(model.covariance + usual @ usual.T)
    return float(np.max(free.rms(model.values - truth) / np.maximum(stated, 1e-12)))


def is_positive(model: Model) -> bool:
    """Return True if the mass matrix is positive definite throughout the ranges of the joints."""
    low, high = np.nan_to_num([model.robot.q_min, model.robot.q_max], neginf=-np.pi, posinf=np.pi)
    q = np.random.default_rng(0).uniform(low, high, (CONFIGURATIONS, model.robot.n_joints))
    return bool((np.linalg.eigvalsh(model.mass_matrix(q)) > 0).all())


def measure(seed: int, folder: Path) -> Path:
    """Run the whole campaign on the plant of `seed`, unless the run exists."""
    run = folder / f"seed-{seed}"
    if not run.exists():
        hil("run", folder / "plan.yaml", "-o", run, "--bus-option", f"seed={seed}")
    return run


def judge(
    folder: Run, methods: Sequence[str], plant: Path | str = ROBOT
) -> dict[str, tuple[Estimate, Comparison]]:
    """Return the estimates of a run by all methods, with their errors."""
    truth, measured = true_parameters(folder.robot, plant), list(recorded(folder))
    every = {method: estimate(folder.robot, measured, method) for method in methods}
    return {method: (found, Comparison(found, truth)) for method, found in every.items()}


def extent(folder: Run) -> str:
    """Return the number of measurements of a run and its robot time, in words."""
    measured = list(recorded(folder))
    kinds = [m.kind for m, _ in measured]
    counts = " + ".join(str(kinds.count(kind)) for kind in ("gravity", "inertia", "coupling"))
    return f"{counts} measurements in {clock(measured[-1][1].time[-1])} of robot time"


def summarise(method: str, results: list[Comparison]) -> dict[str, Figure]:
    """Print one method's figures over all seeds beside the targets, and return the figures."""
    print(f"\n{method} method, {len(results)} seeds{'':17}reached    target")
    kept = {}
    for group, target in TARGETS.items():
        errors = [100 * result.group_error[group] for result in results]
        what = "rms of the relative error, " + group.replace("_", "-")
        kept[f"{method}-{group}"] = line(what, errors, target)
    torques = [100 * result.mean_torque_error for result in results]
    what = "torques on a free motion, mean of joints"
    kept[f"{method}-torque"] = line(what, torques, TORQUE_TARGET)
    inside = 100 * float(np.mean([result.inside for result in results]))
    print(f"{'intervals of 95 % that hold the truth':42}{inside:8.1f} %  {COVERAGE_TARGET:>8} %")
    size = rms(np.concatenate([result.z for result in results]))
    print(f"{'rms of error over standard error':42}{size:8.2f}")
    return kept | {f"{method}-inside": Figure(inside, "%", 3), f"{method}-z": Figure(size)}


def line(what: str, percents: list[float], target: float) -> Figure:
    """Print the root mean square of percentages beside its target, and return it."""
    reached = rms(percents)
    print(f"{what:42}{reached:8.3f} %  {target:8g} %")
    return Figure(reached, "%", scatter=float(np.std(percents)) or None)


def rms(values: ArrayLike) -> float:
    """Return the root mean square of values."""
    return float(np.sqrt(np.mean(np.square(values))))


def main() -> None:
    """Measure, estimate, compare, print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("--seeds", type=int, default=5, help="plants 1 to this")
    parser.add_argument("--method", choices=METHODS, help="one of both [both]")
    parser.add_argument("--keep", type=Path, help="folder for plan and runs; reused if there")
    given = parser.parse_args()
    methods = [given.method] if given.method else list(METHODS)
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        if not (folder / "plan.yaml").exists():
            hil("plan", ROBOT, "-o", folder / "plan.yaml")
        with ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
            runs = list(pool.map(lambda seed: measure(seed, folder), range(1, given.seeds + 1)))
        folders = [Run.open(run) for run in runs]
        judged = [judge(each, methods) for each in folders]
        for seed, each in enumerate(folders, start=1):
            print(f"seed {seed}: {extent(each)}")
    kept: dict[str, Figure] = {}
    for method in methods:
        kept |= summarise(method, [each[method][1] for each in judged])
    command = f"python benchmarks/accuracy.py --seeds {given.seeds}"
    if given.method:
        command += f" --method {given.method}"
    keep("accuracy", kept, depends=DEPENDS, command=command, seeds=range(1, given.seeds + 1))


if __name__ == "__main__":
    main()
