"""Whether strokes and an imported trajectory of one plant make a better model than each alone.

Every seed is a plant with noise and friction of its own. It is measured by strokes and by three
minutes of a trajectory; the trajectory is written as a table and imported, as that of another
controller would be. Torques of a free motion that the base parameters miss are stated in the mean
of all axes, for strokes, the import, and both together, with the intervals of 95 % that hold::

    python benchmarks/mixtures.py [--drift 1] [--first 831] [--seeds 6] [--runs FOLDER]

``--drift 3``: friction drifts three times as strongly. The rule was made on seeds 801 to 829; seeds
831 to 836, and 841 to 846 with ``--drift 3``, were not looked at before.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from back_and_forth import exported
from covariances import KINDS, measured
from figures import Figure, keep

from hil.estimation.identify import JOINT, estimate
from hil.ground_truth.true_parameters import true_parameters
from hil.results.prediction import FreeTorques
from hil.runs.pooling import Pooled

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.runs.run import Run


def judged(strokes: Run, trajectory: Run, truth: Array) -> list[float]:
    """Of strokes, import and both: error of torques [%], and intervals that hold."""
    free, found = FreeTorques(strokes.robot), []
    for runs, method in (
        ([strokes], "improved"),
        ([trajectory], "free motion"),
        ([strokes, trajectory], JOINT),
    ):
        made = estimate(strokes.robot, Pooled(runs), method)
        missed = made.p - truth
        found.append(100 * float((free.rms(missed) / free.rms(truth)).mean()))
        found.append(int((np.abs(missed) <= made.half_width()).sum()))
    return found


def main() -> None:
    """Measure, import, identify, print, keep."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("--drift", type=float, default=1.0)
    parser.add_argument("--first", type=int, default=831)
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--runs", type=Path, default=Path("build/mixtures"))
    given = parser.parse_args()
    folder = given.runs.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    for kind in ("strokes", "trajectories"):
        KINDS[kind] = KINDS[kind][0], {"drift_strength": given.drift}
    rows = []
    print("seed   strokes: % holds   import: % holds   both: % holds")
    seeds = range(given.first, given.first + given.seeds)
    for seed in seeds:
        strokes, plant = measured(folder, "strokes", seed)
        trajectory = exported(
            measured(folder, "trajectories", seed)[0], folder / f"csv-{seed}", strokes=False
        )
        rows.append(judged(strokes, trajectory, true_parameters(strokes.robot, plant)))
        print(seed, *(f"{x:.3f}" if k % 2 == 0 else x for k, x in enumerate(rows[-1])), flush=True)
    mean, n = np.mean(rows, axis=0), len(true_parameters(strokes.robot, plant))
    print("mean", *(f"{x:.3f}" for x in mean[::2]), f"% ; hold {mean[1::2] / n}")
    kept: dict[str, Figure] = {}
    for k, name in enumerate(("strokes", "import", "both")):
        errors, held = np.transpose(rows)[2 * k : 2 * k + 2]
        kept[f"{name}-error"] = Figure(mean[2 * k], "%", scatter=float(errors.std()))
        kept[f"{name}-inside"] = Figure(100 * held.mean() / n, "%", 3, 100 * held.std() / n)
    command = f"python benchmarks/mixtures.py --drift {given.drift:g} --first {given.first}"
    keep(
        "mixtures" if given.drift == 1 else f"mixtures-drift-{given.drift:g}".replace(".", "-"),
        kept, depends=("hil/estimation",), command=f"{command} --seeds {given.seeds}", seeds=seeds,
    )  # fmt: skip


if __name__ == "__main__":
    main()
