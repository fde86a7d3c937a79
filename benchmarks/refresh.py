"""Torque errors of runs with drives that update position and current only every few SYNCs.

For such drives `hil drives check` recommends a SYNC period. Each run is a `hil run` of one plan on
the same plant. All six drives update both values every 2, 3, 5 or 8 times 4 ms, and the SYNC period
has this length. The torque errors are compared with those of drives that update at every SYNC, with
this period and with 4 ms::

    python benchmarks/refresh.py [--every 2 3 5 8] [--keep FOLDER]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from accuracy import ROBOT, SIDE_BY_SIDE, hil, judge
from figures import Figure, keep

from hil.runs.run import Run

EVERY = (2, 3, 5, 8)
METHOD = "improved"
MOST = 1.2
"""Bound of the torque error of slowly updating drives, relative to drives that update at every SYNC
of the same period."""


def measure(every: int, folder: Path, *, old: bool) -> Path:
    """Run the plan at `every` times its period, with drives of slow (`old`) or immediate updates.

    An existing run is kept.
    """
    run = folder / (f"every-{every}" if old else f"prompt-{every}")
    if run.exists():
        return run
    plan, drives = run.with_suffix(".plan.yaml"), run.with_suffix(".drives.yaml")
    faults = run.with_suffix(".faults.yaml")
    copied(folder / "plan.yaml", "sample_period", every, plan)
    period = copied(Path("hil/robots") / f"{ROBOT}.drives.yaml", "sync_period", every, drives)
    whole = [
        f"{{what: {value}-slow, axis: {axis}, at: {{time: 0}}, size: {1000 * period:g}}}"
        for axis in range(1, 7)
        for value in ("position", "current")
        if old
    ]
    faults.write_text(f"faults: [{', '.join(whole)}]", encoding="utf-8")
    options = ("--bus-option", "seed=1", "--bus-option", f"faults={faults}")
    hil("run", plan, "-o", run, "--drives", drives, *options)
    return run


def copied(path: Path, key: str, every: int, copy: Path) -> float:
    """Copy a file with a multiple of one of its times, and return this time."""
    before, after = path.read_text(encoding="utf-8").split(f"\n{key}: ")
    was, *rest = after.splitlines(keepends=True)
    period = every * float(was.split()[0])
    copy.write_text(f"{before}\n{key}: {period:g}\n{''.join(rest)}", encoding="utf-8")
    return period


def main() -> int:
    """Return 0 if all runs are as accurate as required."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("--every", type=int, nargs="+", default=EVERY, help="[SYNCs of 4 ms]")
    parser.add_argument("--keep", type=Path, help="folder for plan and runs; reused if there")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        if not (folder / "plan.yaml").exists():
            hil("plan", ROBOT, "-o", folder / "plan.yaml")
        wanted = [(1, False), *((each, old) for each in given.every for old in (False, True))]
        with ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
            runs = list(pool.map(lambda each: measure(each[0], folder, old=each[1]), wanted))
        errors = [judge(Run.open(run), [METHOD])[METHOD][1].mean_torque_error for run in runs]
    normal, *others = errors
    kept = {"normal": Figure(100 * normal, "%", 2)}
    print(f"torques at 4 ms: {100 * normal:.3f} %")
    ratios = [old / prompt for prompt, old in zip(others[::2], others[1::2], strict=True)]
    for each, error, ratio in zip(given.every, others[1::2], ratios, strict=True):
        print(
            f"renewed every {each} SYNCs: {100 * error:.3g} %, {ratio:.2f} x others at that period"
        )
        kept |= {
            f"every-{each}": Figure(100 * error, "%", 2), f"to-prompt-{each}": Figure(ratio, "", 3)
        }  # fmt: skip
    keep(
        "refresh", kept, depends=("drivers", "hil/measuring", "hil/estimation", "sim_plant/faults"),
        command="python benchmarks/refresh.py", seeds=(1,),
    )  # fmt: skip
    return int(max(ratios) > MOST)


if __name__ == "__main__":
    sys.exit(main())
