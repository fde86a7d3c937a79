"""Many runs identified on a Dask cluster of one and of two workers on this machine.

The recording of `examples/pan_tilt` is imported once; each run has its torques with further noise
of its own. The models of both clusters must be the same::

    python benchmarks/many_runs.py --runs 200 --seed 1
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from figures import Figure, keep

from hil import execution
from hil.commands.fleet import identify_runs
from hil.imports.importing import import_recordings
from hil.optional_packages import needed_for
from hil.results.model_file import NAME
from hil.runs.recording_file import read_measured, write_measured

EXAMPLE = Path(__file__).parents[1] / "examples" / "pan_tilt" / "other.yaml"
NOISE = 0.002
"""Standard deviation of the added noise [N m]; small, so that all runs take the same time."""


def write_runs(folder: Path, number: int, seed: int) -> None:
    """Write runs with noise of their own."""
    first = import_recordings([EXAMPLE], folder / "first")
    for k in range(number):
        run = folder / "runs" / str(k)
        shutil.copytree(first.path, run)
        random = np.random.default_rng([seed, k])
        for path in (run / "recordings").iterdir():
            measured = read_measured(path)
            tau = measured.recording.tau
            tau = tau + NOISE * random.standard_normal(tau.shape)
            recording = replace(measured.recording, tau=tau)
            write_measured(path, replace(measured, recording=recording), first.robot)


def identify(folder: Path, workers: int) -> tuple[float, dict[str, str]]:
    """Return the time on a cluster [s], and all models without their time of identification."""
    with needed_for(folder, "dask"):
        import distributed
    for path in (*folder.glob("*/model.yaml"), *folder.glob("*/findings.json")):
        path.unlink()
    with (
        distributed.LocalCluster(  # type: ignore[no-untyped-call]
            n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=":0"
        ) as cluster,
        execution.cluster(cluster.scheduler_address) as execute,
    ):
        for _ in execute(_loaded, range(2 * workers)):  # numerics of each worker are loaded
            pass
        begun = time.perf_counter()
        found = identify_runs([folder], execute, lambda _: None)
        taken = time.perf_counter() - begun
    if found.left_out:
        raise SystemExit("\n".join(found.left_out))
    models = {
        str(path): "".join(line for line in path.open() if "  identified: " not in line)
        for path in folder.glob(f"*/{NAME}")
    }
    return taken, models


def _loaded(_: int) -> None:
    import hil.results.identification  # noqa: F401

    time.sleep(1.0)  # so that another worker takes the next job


def main() -> None:
    """Identify, compare and keep."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        write_runs(Path(name), given.runs, given.seed)
        one, alone = identify(Path(name) / "runs", 1)
        two, together = identify(Path(name) / "runs", 2)
    if alone != together:
        raise SystemExit("the models of one and of two workers differ")
    print(f"{given.runs} runs: {one:.0f} s, {two:.0f} s, {one / two:.2f} times as fast")
    kept = {
        "runs": Figure.count(given.runs),
        "one": Figure(one, "s"),
        "two": Figure(two, "s"),
        "ratio": Figure(one / two, "times", 3),
    }
    command = f"python benchmarks/many_runs.py --runs {given.runs} --seed {given.seed}"
    depends = ("hil/execution.py", "hil/commands/fleet.py")
    keep("many-runs", kept, depends=depends, command=command, seeds=(given.seed,))


if __name__ == "__main__":
    main()
