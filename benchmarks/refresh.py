"""How near the truth runs get whose drives renew position and current only every few SYNCs.

`check` then refuses the drives file and names the period to use. Each run is a `hil run` of one
plan on the same plant, whose six drives all renew both values every 2, 3, 5 or 8 times 4 ms, with
the period that was named; its torques are compared with those of drives that renew them at once::

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
"""Torque error of a run at the period that was named, relative to that of a normal run."""


def measure(every: int, folder: Path) -> Path:
    """Run the plan with drives that renew values every `every` SYNCs, unless it was before."""
    run = folder / f"every-{every}"
    if run.exists():
        return run
    plan, drives = folder / f"plan-{every}.yaml", folder / f"drives-{every}.yaml"
    faults = folder / f"faults-{every}.yaml"
    _copied(folder / "plan.yaml", "sample_period", every, plan)
    period = _copied(Path("hil/robots") / f"{ROBOT}.drives.yaml", "sync_period", every, drives)
    lines = ["faults:"]
    for axis in range(1, 7) if every > 1 else ():
        for value in ("position", "current"):
            whole = f"what: {value}-slow, axis: {axis}, at: {{time: 0}}, size: {1000 * period:g}"
            lines.append(f"- {{{whole}}}")
    faults.write_text("\n".join(lines) if every > 1 else "faults: []", encoding="utf-8")
    options = ("--bus-option", "seed=1", "--bus-option", f"faults={faults}")
    hil("run", plan, "-o", run, "--drives", drives, *options)
    return run


def _copied(path: Path, key: str, every: int, copy: Path) -> float:
    """Copy a file with a multiple of one of its times, and return that."""
    before, after = path.read_text(encoding="utf-8").split(f"\n{key}: ")
    was, *rest = after.splitlines(keepends=True)
    period = every * float(was.split()[0])
    copy.write_text(f"{before}\n{key}: {period:g}\n{''.join(rest)}", encoding="utf-8")
    return period


def main() -> int:
    """Return 0 if no run is less exact than it may be."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("--every", type=int, nargs="+", default=EVERY, help="[SYNCs of 4 ms]")
    parser.add_argument("--keep", type=Path, help="folder for plan and runs; reused if there")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        if not (folder / "plan.yaml").exists():
            hil("plan", ROBOT, "-o", folder / "plan.yaml")
        every = (1, *given.every)
        with ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
            runs = list(pool.map(lambda each: measure(each, folder), every))
        errors = [judge(Run.open(run), [METHOD])[METHOD][1].mean_torque_error for run in runs]
    kept = {"normal": Figure(100 * errors[0], "%", 2)}
    for each, error in zip(given.every, errors[1:], strict=True):
        ratio = error / errors[0]
        print(f"renewed every {each} SYNCs: torques {100 * error:.3f} %, {ratio:.2f} x normal")
        kept[f"every-{each}"] = Figure(ratio, "", 2)
    print(f"at once: torques {100 * errors[0]:.3f} %")
    keep(
        "refresh", kept, depends=("drivers", "hil/measuring", "hil/estimation", "sim_plant/faults"),
        command="python benchmarks/refresh.py", seeds=(1,),
    )  # fmt: skip
    return int(any(error > MOST * errors[0] for error in errors[1:]))


if __name__ == "__main__":
    sys.exit(main())
