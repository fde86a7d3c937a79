"""Cost of drafting a map and importing a million rows, against reading the files with pandas.

A free motion of the panda's twin, 1000 s at 1 kHz: time, positions, velocities and torques of seven
joints in 22 columns, and without velocities in 15, each as CSV of six decimals and as Parquet.
Drafting and importing in one process and reading by pandas in another are measured in turns, so
that all see the same machine, one thread each, once the modules are imported. The bound is 1.2
times pandas plus 2 s of processor time (user and system)::

    python benchmarks/import_time.py [--rows 1000000] [--times 3] [--keep FOLDER]
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import yaml
from figures import Figure, keep

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from twin_recordings import PERIOD, TwinRecorder, robot_path

from hil.imports.instants import resampled

if TYPE_CHECKING:
    from numpy.typing import NDArray

ROBOT, FINER = "panda", 4
"""Robot, and number of rows for each sample of the twin."""
PROMISED = 1.2, 2.0
"""Bounds: multiple of pandas' time, and additional time [s]."""
NOISE = 1e-5
"""Noise of positions and velocities [rad, rad/s]."""
MEASURED = """
import json, sys, time
from pathlib import Path
import pandas
from hil.imports.draft import draft_map
from hil.imports.importing import import_recordings

def spent(function, *arguments):
    begin = time.process_time(), time.perf_counter()
    function(*arguments)
    return time.process_time() - begin[0], time.perf_counter() - begin[1]

path = Path(sys.argv[2])
if sys.argv[1] == "pandas":
    found = {"pandas": spent(getattr(pandas, f"read_{path.suffix[1:]}"), path)}
else:
    found = {"draft": spent(draft_map, path, path.name),
             "import": spent(import_recordings, [f"{path}.yaml"], path.parent / "run")}
print(json.dumps(found))
"""
ENDINGS = ("csv", "parquet")


def columns(rows: int) -> dict[str, NDArray[np.float64]]:
    """Return the columns of a recording by name."""
    twin, rng = TwinRecorder(ROBOT), np.random.default_rng(7)
    ((_, slow),) = twin.recorded(7, n=1, duration=PERIOD * (rows / FINER + 2))
    t = PERIOD / FINER * np.arange(rows)
    q = resampled(slow.time, slow.q, t)
    tau = resampled(slow.time, slow.tau, t)
    noise = NOISE * rng.standard_normal((2, *q.shape))
    every = {"q": q + noise[0], "qd": np.gradient(q, t, axis=0) + noise[1], "tau": tau}
    found = {"t": t}
    for name, values in every.items():
        found |= {f"{name}{k}": x.round(6) for k, x in enumerate(values.T, start=1)}
    return found


def write(folder: Path, rows: int) -> list[str]:
    """Write all files and their maps; return their names."""
    import pyarrow as pa
    from pyarrow import csv, parquet

    shutil.copy(robot_path(ROBOT), folder / "robot.yaml")
    every, names = columns(rows), []
    for stem, kinds in (("all", ("q", "qd", "tau")), ("positions", ("q", "tau"))):
        chosen = {k: x for k, x in every.items() if k == "t" or k.rstrip("0123456789") in kinds}
        table = pa.table(chosen)
        csv.write_csv(table, folder / f"{stem}.csv", csv.WriteOptions(quoting_style="none"))
        parquet.write_table(table, folder / f"{stem}.parquet")
        parts = {"q": ("position", "rad"), "qd": ("velocity", "rad/s"), "tau": ("torque", "N m")}
        joints = [
            {parts[kind][0]: {"column": f"{kind}{k}", "unit": parts[kind][1]} for kind in kinds}
            for k in range(1, 8)
        ]
        for ending in ENDINGS:
            names.append(f"{stem}.{ending}")
            content = {"robot": "robot.yaml", "files": [names[-1]], "time": {"column": "t"}}
            text = yaml.safe_dump(content | {"joints": joints}, sort_keys=False)
            (folder / f"{names[-1]}.yaml").write_text(text)
    return names


def spent(folder: Path, name: str) -> dict[str, tuple[float, float]]:
    """Return processor and wall-clock time of drafting, importing and pandas [s]."""
    shutil.rmtree(folder / "run", ignore_errors=True)
    found: dict[str, tuple[float, float]] = {}
    for what in ("hil", "pandas"):
        command = (sys.executable, "-c", MEASURED, what, str(folder / name))
        threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
        done = subprocess.run(
            command, env={**os.environ, **threads}, stdout=subprocess.PIPE, check=True
        )
        found |= json.loads(done.stdout)
    return found


def main() -> None:
    """Measure in turns, print and keep the medians; exit status 1 for a broken bound."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--times", type=int, default=3)
    parser.add_argument("--only", default="", help="files whose name has these words")
    parser.add_argument("--keep", type=Path, help="folder for files, maps and runs")
    given = parser.parse_args()
    kept, broken = {"rows": Figure.count(given.rows)}, False
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.keep or Path(temporary)
        folder.mkdir(exist_ok=True)
        names = write(folder, given.rows)
        turns = [
            {name: spent(folder, name) for name in names if given.only in name}
            for _ in range(given.times)
        ]
    print("| processor (wall-clock) time [s] | draft | import | pandas | both over the bound |")
    print("|---|---|---|---|---|")
    for name in turns[0]:
        middle = {
            what: np.median([turn[name][what] for turn in turns], axis=0)
            for what in ("draft", "import", "pandas")
        }
        both = [turn[name]["draft"][0] + turn[name]["import"][0] for turn in turns]
        bounds = [PROMISED[0] * turn[name]["pandas"][0] + PROMISED[1] for turn in turns]
        ratio = Figure.median([a / b for a, b in zip(both, bounds, strict=True)])
        broken |= ratio.value > 1.0
        cells = " | ".join(f"{used:.2f} ({wall:.2f})" for used, wall in middle.values())
        print(f"| {name} | {cells} | {ratio.value:.2f} |", flush=True)
        key = name.replace(".", "-")
        kept[f"{key}-over-bound"] = ratio
        kept[key] = Figure.median(both, "s")
    if given.rows == 1_000_000 and not given.only:
        keep(
            "import-time", kept, depends=("hil/imports", "hil/runs/recording_file.py"),
            seeds=[7], command=f"python benchmarks/import_time.py --times {given.times}",
        )  # fmt: skip
    sys.exit(broken)


if __name__ == "__main__":
    main()
