"""Models from recordings of two kinds together, against models from each kind alone.

Every seed is a plant with different noise and friction. Trajectories of three minutes are written
as tables and imported, like recordings of another controller::

    python benchmarks/mixtures.py [KIND ...] [--drift 1] [--first 1101] [--seeds 20] [--runs FOLDER]

strokes
    Strokes measured by `hil run`, and an imported trajectory.
rates
    Two imported trajectories, of 250 and of 125 samples per second.
loads
    Strokes of the bare arm, and an imported trajectory of the arm with a load of 4 kg.

The table has the torque error of the base parameters on a free motion, as the mean of all axes, and
the coverage of 95 % intervals, for each part and for both together. For loads, the error of a part
is that of the arm with the load of this part, and intervals of the load are added. ``--drift 3``
multiplies the drift of friction by three. Rules of the estimator were chosen on seeds 801 to 829,
831 to 850 (state cells, friction laws) and 861 to 880 (covariance of loads). Seeds from 1101 on are
held out.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from back_and_forth import exported
from covariances import KINDS, measured
from figures import Figure, keep
from golden import LIGHT

from hil.estimation.free_motion.variants import DEFAULT
from hil.estimation.identify import JOINT, estimate
from hil.estimation.intervals import half_width
from hil.ground_truth.true_parameters import true_parameters
from hil.model.load import load_columns
from hil.results.load import BareRun, find_load
from hil.results.prediction import FreeTorques
from hil.runs.pooling import Pooled

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from hil.arrays import Array
    from hil.runs.run import Run

SLOWER = 2
"""Ratio of the sampling rates of two imported trajectories."""
OTHER = 1000
"""Difference of seeds between both recordings, for independent noise and friction."""


class Part(NamedTuple):
    """Torque error [%], and number of intervals that contain the truth, of all."""

    name: str
    missed: float
    inside: int
    of: int


def estimate_by_method(runs: list[Run], method: str, truth: Array, name: str) -> Part:
    """Return the estimate of runs by one method."""
    made = estimate(runs[0].robot, Pooled(runs), method)
    inside = np.abs(made.values - truth) <= made.half_width()
    return Part(name, error(runs[0], made.values, truth), int(inside.sum()), len(truth))


def error(run: Run, p: Array, truth: Array) -> float:
    """Return the error of free-motion torques, in the mean of all axes [%]."""
    free = FreeTorques(run.robot)
    return 100 * float((free.rms(p - truth) / free.rms(truth)).mean())


def strokes(folder: Path, seed: int) -> Iterator[Part]:
    """Return the results of strokes, of an import, and of both."""
    own, plant = measured(folder, "strokes", seed)
    other, _ = measured(folder, "trajectories", seed)
    imported = exported(other, folder / f"csv-{seed}", strokes=False)
    truth = true_parameters(own.robot, plant)
    yield estimate_by_method([own], "improved", truth, "strokes")
    yield estimate_by_method([imported], DEFAULT, truth, "import")
    yield estimate_by_method([own, imported], JOINT, truth, "both")


def rates(folder: Path, seed: int) -> Iterator[Part]:
    """Return the results of imports of 250 and of 125 samples per second, and of both."""
    first, plant = measured(folder, "trajectories", seed)
    second, _ = measured(folder, "trajectories", seed + OTHER)
    fast = exported(first, folder / f"csv-{seed}", strokes=False)
    slow = exported(second, folder / f"slow-{seed}", strokes=False, every=SLOWER)
    truth = true_parameters(first.robot, plant)
    yield estimate_by_method([fast], DEFAULT, truth, "fast")
    yield estimate_by_method([slow], DEFAULT, truth, "slow")
    yield estimate_by_method([fast, slow], DEFAULT, truth, "both")


def loads(folder: Path, seed: int) -> Iterator[Part]:
    """Return the results of bare strokes, of a loaded import, and of both."""
    bare, plant = measured(folder, "strokes", seed)
    heavy, plant_with = measured(folder, "load", seed)
    loaded = exported(heavy, folder / f"loaded-{seed}", strokes=False)
    truth, with_load = (true_parameters(bare.robot, each) for each in (plant, plant_with))
    yield estimate_by_method([bare], "improved", truth, "bare")
    yield estimate_by_method([loaded], DEFAULT, with_load, "loaded")
    found, K = find_load(BareRun(bare), [loaded]), load_columns(bare.robot).K
    inside = np.abs(found.p - truth) <= half_width(
        np.diag(found.p_covariance), np.zeros(len(truth)), found.p_degrees, 0.95
    )
    yield Part("bare-by-both", error(bare, found.p, truth), int(inside.sum()), len(truth))
    shown = np.diag(found.covariance) > 0
    half = half_width(np.diag(found.covariance), np.zeros(10), found.degrees, 0.95)
    held = int((np.abs(found.phi - standard_parameters(**LIGHT)) <= half)[shown].sum())
    missed = error(bare, found.p + K @ found.phi, with_load)
    yield Part("loaded-by-both", missed, held, int(shown.sum()))


def standard_parameters(
    mass: float, centre: list[float], Ixx: float, Iyy: float, Izz: float
) -> Array:
    """Return a load's ten parameters about the flange, with its centre on the axis."""
    *_, z = centre
    return np.array(
        [Ixx + mass * z**2, 0.0, 0.0, Iyy + mass * z**2, 0.0, Izz, 0.0, 0.0, mass * z, mass]
    )


MIXTURES: dict[str, Callable[[Path, int], Iterator[Part]]] = {
    "strokes": strokes, "rates": rates, "loads": loads,
}  # fmt: skip


def main() -> None:
    """Measure, import, identify, print and keep."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("kind", nargs="*", help=f"of {', '.join(MIXTURES)}; all by default")
    parser.add_argument("--drift", type=float, default=1.0)
    parser.add_argument("--first", type=int, default=1101)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--runs", type=Path, default=Path("build/mixtures"))
    given = parser.parse_args()
    folder = given.runs.resolve() / f"drift-{given.drift:g}"
    folder.mkdir(parents=True, exist_ok=True)
    for kind, (plan, differs) in KINDS.items():
        KINDS[kind] = plan, differs | {"drift_strength": given.drift}
    seeds = range(given.first, given.first + given.seeds)
    for kind in given.kind or MIXTURES:
        rows = []
        for seed in seeds:
            rows.append(list(MIXTURES[kind](folder, seed)))
            print(kind, seed, *(f"{p.name} {p.missed:.3f} % {p.inside}/{p.of}" for p in rows[-1]),
                  flush=True)  # fmt: skip
        kept: dict[str, Figure] = {}
        for parts in zip(*rows, strict=True):
            missed, of = np.array([p.missed for p in parts]), sum(p.of for p in parts)
            inside, name = sum(p.inside for p in parts), parts[0].name
            print(f"{kind}, {name}: {missed.mean():.3f} %, {inside} of {of} hold", flush=True)
            kept[f"{name}-error"] = Figure(missed.mean(), "%", scatter=float(missed.std()) or None)
            kept[f"{name}-inside"] = Figure(100 * inside / of, "%", 3)
        drift = "" if given.drift == 1 else f"-drift-{given.drift:g}".replace(".", "-")
        command = f"python benchmarks/mixtures.py {kind} --drift {given.drift:g}"
        command += f" --first {given.first} --seeds {given.seeds}"
        keep(f"mixtures-{kind}{drift}", kept, depends=("hil/estimation",), command=command,
             seeds=seeds)  # fmt: skip


if __name__ == "__main__":
    main()
