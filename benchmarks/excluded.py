"""Detection of errors from recordings: flaws of stated sizes, clean runs, stated errors, time.

Flaws of a plant are measured on a plant that differs from the robot file. Flaws of a robot file,
drives file or map are put into the file, or into a clean run's recordings with the same effect.
Sizes are multiples of the detection limit of a clean run (80 % power). Clean runs are campaigns of
eight minutes, and CSV files with a minute of free motion of other robots' twins::

    python benchmarks/excluded.py [ROW ...] [--seed 900] [--clean 20] [--keep FOLDER]

Rows: ``flaws`` (20 flaws of three sizes each), ``far`` (flaws too large for a linearisation),
``clean``, ``sizes`` (each cause at its detection limit, added to a clean run as its column),
``time``, ``gears`` (plants with soft gears, which are not a flaw), ``axes`` (axes of a clean run on
which a flaw is visible), ``distinguish`` (joint offsets and a load, by the usual plan and by a plan
that distinguishes them), ``runs`` (runs in a folder of `benchmarks.paper`, each with its plant
file: all causes are accounted for). Wrong maps are those of `wrong_maps`. Every row states how many
models judged *good* have errors above three times the stated error.
"""

from __future__ import annotations

import argparse
import re
import tempfile
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from accuracy import DEPENDS, ROBOT, SIDE_BY_SIDE, hil
from excluded_cases import (
    FLAWS,
    HONEST,
    Case,
    Said,
    campaign,
    judge_run,
    said,
    shares,
    smallest,
    smallest_parts,
)
from figures import Figure, keep
from planted_flaws import PLANTS

from hil.errors import HilError
from hil.ground_truth.true_parameters import true_parameters
from hil.planning.measurement import shows_parameters
from hil.runs.pooling import Pooled
from hil.runs.run import Run

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    Kept = dict[str, Figure]

PLAN = ("--gravity", 12, "--inertia", 16, "--coupling", 5)
TWINS = ("ur10e", "panda", "scara", "pan-tilt")
SIZES = (1 / 3, 1.0, 3.0)
"""Multiples of the smallest stated size."""
NAMED = ("first", "same", "accounted for", "other", "nothing")
"""Outcomes of naming a planted cause: named alone or first; named with an indistinguishable cause;
fitted by the estimate; another cause named; none named.
"""
GEARS = (80.0, 45.0, 20.0)
"""Natural frequencies of all gears with blocked motor [Hz]."""
FAR = (
    ("wrong direction of an axis", 3, 0.0), ("wrong direction of an axis", 5, 0.0),
    ("wrong sign of a position", 2, 0.0), ("wrong sign of a position", 5, 0.0),
    ("wrong sign of a torque", 3, 0.0), ("wrong sign of a torque", 4, 0.0),
    ("two axes exchanged", 2, 0.0), ("two axes exchanged", 4, 0.0), ("two axes exchanged", 5, 0.0),
    ("joint offset", 3, 20.0), ("joint offset", 5, 90.0), ("gravity", 0, 90.0),
    ("gear ratio", 2, -50.0), ("torque constant", 2, 30.0), ("torque at its limit", 2, 700.0),
    ("slip", 3, 5.0),
)  # fmt: skip
"""Cause, axis and size of flaws beyond a linearisation."""

CONFUSED = (
    ("joint offset", 4, 5.0),
    ("joint offset", 5, 4.0),
    ("joint offset", 5, -4.0),
    ("load", 0, 0.03),
)
"""Cause, axis and size of flaws that the usual plan does not show on seed 1, or confuses with a
joint offset.
"""


def show_flaws(kept: Kept, folder: Path, pool: ProcessPoolExecutor, seed: int) -> Iterator[Said]:
    """Print the named causes at each size of each flaw."""
    clean = {}
    for twin in dict.fromkeys(twin for twin, *_ in FLAWS):
        clean[twin] = said(folder, Case(twin, "", 0, 0.0, 0.0, seed)).proof
    own = smallest_parts(folder, seed)
    least = [own.get((cause, axis)) or smallest(clean[twin], cause, axis)
             for twin, cause, axis in FLAWS]  # fmt: skip
    cases = [
        Case(twin, cause, axis, times, times * least[k], seed + 1 + k)
        for k, (twin, cause, axis) in enumerate(FLAWS)
        for times in SIZES
        if least[k]
    ]
    for (twin, cause, axis), size in zip(FLAWS, least, strict=True):
        if not size:
            print(f"{cause}, {twin or ROBOT}, axis {axis}: no size stated, none planted")
    # flaws put into a clean run are put into the run of the stated sizes
    cases = [c if c.cause in PLANTS and not c.twin else c._replace(seed=seed) for c in cases]
    count: dict[float, list[str]] = {times: [] for times in SIZES}
    with ThreadPoolExecutor(SIDE_BY_SIDE) as threads:
        plants = [c for c in cases if c.cause in PLANTS and not c.twin and c.size]
        list(threads.map(lambda case: campaign(folder, case.seed, case), plants))
    print("| flaw | times | size | named | first | word |\n|---|---|---|---|---|---|")
    for case, each in zip(cases, pool.map(partial(said, folder), cases), strict=True):
        named = each.named(case)
        count[case.times].append(named)
        first = str(each.found[0]) if each.found else ""
        where = f"{case.twin or ROBOT}, axis {case.axis}"
        print(f"| {case.cause}, {where} | {case.times:.2g} | {case.size:.3g} | {named} |"
              f" {first[:150]} | {each.word} |", flush=True)  # fmt: skip
        yield each
    for times, names in count.items():
        sums = ", ".join(f"{names.count(x)} {x}" for x in NAMED)
        print(f"{times:.2g} times the smallest size: {sums}")
        kept |= {key(f"{times:.2g} times", x): Figure.count(names.count(x)) for x in NAMED}


def show_far(kept: Kept, folder: Path, pool: ProcessPoolExecutor, seed: int) -> Iterator[Said]:
    """Print the named causes for flaws beyond a linearisation."""
    cases = [Case("", cause, axis, np.inf, size, seed) for cause, axis, size in FAR]
    campaign(folder, seed)  # measured now, since several processes need the run
    names = []
    for case, each in zip(cases, pool.map(partial(said, folder), cases), strict=True):
        names.append(each.named(case))
        first = str(each.found[0]) if each.found else "nothing"
        print(f"{case.cause}, axis {case.axis}, {case.size:g}: {names[-1]}: {each.word}:"
              f" {first[:200]} ({each.seconds:.1f} s)", flush=True)  # fmt: skip
        yield each
    print(f"far: {names.count('first')} first, {names.count('same')} same of {len(names)}")
    kept |= {key(x): Figure.count(names.count(x)) for x in NAMED}


def show_clean(
    kept: Kept, folder: Path, pool: ProcessPoolExecutor, seed: int, n: int
) -> Iterator[Said]:
    """Print the named causes of clean runs."""
    seeds = range(seed + 100, seed + 100 + n)
    with ThreadPoolExecutor(SIDE_BY_SIDE) as threads:
        list(threads.map(partial(campaign, folder), seeds))
    cases = [Case(twin, "", 0, 0.0, 0.0, each)
             for k, each in enumerate(seeds) for twin in ("", TWINS[k % len(TWINS)])]  # fmt: skip
    alarms = 0
    for case, each in zip(cases, pool.map(partial(said, folder), cases), strict=True):
        alarms += bool(each.found)
        if each.found or not each.honest:
            print(f"{case.twin or ROBOT}, seed {case.seed}: {each.word}, {each.times:.2g} times:"
                  f" {'; '.join(map(str, each.found))[:300]}", flush=True)  # fmt: skip
        yield each
    print(f"causes found in {alarms} of {len(cases)} clean runs")
    kept["causes-found"] = Figure.count(alarms)


def show_runs(kept: Kept, folder: Path, pool: ProcessPoolExecutor) -> Iterator[Said]:
    """Print the named causes in runs of other benchmarks, case by case."""
    for plant in sorted(folder.glob("*/plant.yaml")):
        runs = sorted(run for run in plant.parent.glob("*/seed-*") if run.is_dir())
        try:
            true_parameters(Run.open(runs[0]).robot, plant)
        except HilError as error:  # a plant with effects unknown to the robot file
            print(f"{plant.parent.name}: {error}")
            continue
        if not any(shows_parameters(motion) for motion, _ in Pooled([Run.open(runs[0])])):
            continue
        every = list(pool.map(judge_run, runs))
        alarms = [each for each in every if each.found]
        print(f"{plant.parent.name}: causes found in {len(alarms)} of {len(every)},"
              f" {sum(each.word == 'good' for each in every)} good", flush=True)  # fmt: skip
        kept[f"{plant.parent.name}-runs"] = Figure.count(len(every))
        kept[f"{plant.parent.name}-causes-found"] = Figure.count(len(alarms))
        for each in alarms[:3]:
            print(f"  {each.word}: {'; '.join(map(str, each.found))[:300]}", flush=True)
        yield from every


def show_gears(
    kept: Kept, folder: Path, pool: ProcessPoolExecutor, seed: int, n: int
) -> Iterator[Said]:
    """Print the named causes for plants with soft gears; the estimate contains their compliance."""
    for frequency in GEARS:
        cases = [Case("", "gears", 0, frequency, frequency, seed + 100 + k) for k in range(n)]
        every = list(pool.map(partial(said, folder), cases))
        alarms = [each for each in every if each.found]
        print(f"gears of {frequency:g} Hz: causes found in {len(alarms)} of {n}", flush=True)
        kept[key(f"{frequency:g} Hz", "causes found")] = Figure.count(len(alarms))
        for each in alarms[:3]:
            print(f"  {each.word}: {'; '.join(map(str, each.found))[:300]}", flush=True)
        yield from every


def show_sizes(kept: Kept, folder: Path, pool: ProcessPoolExecutor, seed: int) -> None:
    """Print the detection rate of causes with the smallest stated size."""
    several = range(seed + 100, seed + 104)
    found = list(pool.map(partial(shares, folder), several))
    for seed_, (n, own, least) in zip(several, found, strict=True):
        print(
            f"seed {seed_}: of {n} causes at their smallest size {own:.0%} are found,"
            f" {least:.0%} by themselves or with their like",
            flush=True,
        )
    for k, what in enumerate(("found", "named"), start=1):
        each = 100 * np.array(found)[:, k]
        kept[what] = Figure(each.mean(), "%", scatter=each.std())


def show_axes(kept: Kept, folder: Path, pool: ProcessPoolExecutor, seed: int) -> None:
    """Print the effect of a mistake on each axis of a clean run."""
    for cause, size in (("wrong direction of an axis", 0.0), ("wrong sign of a position", 0.0),
                        ("wrong sign of a torque", 0.0), ("joint offset", 20.0),
                        ("gear ratio", 1.0), ("gear ratio", -50.0),
                        ("torque constant", 30.0)):  # fmt: skip
        cases = [Case("", cause, axis, np.inf, size, seed) for axis in range(1, 7)]
        names = []
        for case, each in zip(cases, pool.map(partial(said, folder), cases), strict=True):
            first = each.found[0] if each.found else "nothing"
            print(f"{cause}, {size:g}, axis {case.axis}: {first}", flush=True)
            names.append(each.named(case))
        kept |= {key(cause, f"{size:g}", x): Figure.count(names.count(x)) for x in NAMED}


def show_distinguish(
    kept: Kept, folder: Path, pool: ProcessPoolExecutor, seed: int, n: int
) -> None:
    """Print the frequencies of causes confused by a plan, and by a distinguishing plan."""
    seeds = range(seed + 300, seed + 300 + n)
    for name, more in (
        ("as it is", ()),
        ("to distinguish", ("--distinguish", "load,joint offset")),
    ):
        own = folder / name.replace(" ", "-")
        if not (own / "plan.yaml").exists():
            own.mkdir()
            hil("plan", ROBOT, "-o", own / "plan.yaml", *PLAN, *more)
        for cause, axis, size in (*CONFUSED, ("", 0, 0.0)):
            cases = [Case("", cause, axis, np.inf, size, each) for each in seeds]
            found = list(pool.map(partial(said, own), cases))
            names = [each.named(case) for case, each in zip(cases, found, strict=True)]
            both = zip(names, found, strict=True)
            alone = sum(name in NAMED[:2] and each.alone for name, each in both)
            sums = ", ".join(f"{names.count(x)} {x}" for x in NAMED if x in names)
            about = (name, cause or "clean", axis, f"{size:g}")
            kept |= {key(*about, x): Figure.count(names.count(x)) for x in NAMED}
            kept[key(*about, "distinguished")] = Figure.count(alone)
            apart = f"; {alone} distinguished from a load and other zeros" if cause else ""
            print(f"plan {name}: {cause or 'clean'}, axis {axis}, {size:g}: {sums}{apart}",
                  flush=True)  # fmt: skip


def show_time(kept: Kept, folder: Path, seed: int) -> None:
    """Print the added processor time of the tests; the second run has compiled code loaded."""
    seconds = [said(folder, Case("", "", 0, 0.0, 0.0, seed)).seconds for _ in range(2)]
    print(f"time beside the estimate: {seconds[0]:.2f} s, again {seconds[1]:.2f} s")
    kept |= {"first": Figure(seconds[0], "s"), "again": Figure(seconds[1], "s")}


def key(*words: object) -> str:
    """Return the name of a figure from printed words."""
    return re.sub(r"\W+", "-", " ".join(map(str, words)).replace(" -", " minus "))


def honest(every: Sequence[Said]) -> Kept:
    """Return the numbers of all, good and wrongly good runs, and the largest error ratio."""
    good = [each for each in every if each.word == "good"]
    wrong = [each for each in good if not each.honest]
    most = max((each.times for each in good), default=0.0)
    counts = {"runs": len(every), "good": len(good), "good-and-wrong": len(wrong)}
    own = {name: Figure.count(number) for name, number in counts.items()}
    return own | {"most-off": Figure(most, "times")}


def main() -> None:
    """Measure, identify, print and keep, each row separately."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("rows", nargs="*", metavar="ROW", default=["flaws", "far", "clean", "sizes",
                                                                   "time"])  # fmt: skip
    parser.add_argument("--seed", type=int, default=900)
    parser.add_argument("--clean", type=int, default=20, help="clean campaigns, as many twins")
    parser.add_argument("--keep", type=Path, help="folder for plan and runs; reused if there")
    given, every = parser.parse_args(), []
    with tempfile.TemporaryDirectory() as temporary, ProcessPoolExecutor(SIDE_BY_SIDE) as pool:
        folder, seed, n = given.keep or Path(temporary), given.seed, given.clean
        folder.mkdir(parents=True, exist_ok=True)
        kept: Kept = {}
        if set(given.rows) - {"runs"} and not (folder / "plan.yaml").exists():
            hil("plan", ROBOT, "-o", folder / "plan.yaml", *PLAN)
        rows: dict[str, Callable[[], Iterator[Said] | None]] = {
            "runs": lambda: show_runs(kept, folder, pool),
            "flaws": lambda: show_flaws(kept, folder, pool, seed),
            "far": lambda: show_far(kept, folder, pool, seed),
            "clean": lambda: show_clean(kept, folder, pool, seed, n),
            "gears": lambda: show_gears(kept, folder, pool, seed, n),
            "sizes": lambda: show_sizes(kept, folder, pool, seed),
            "time": lambda: show_time(kept, folder, seed),
            "axes": lambda: show_axes(kept, folder, pool, seed),
            "distinguish": lambda: show_distinguish(kept, folder, pool, seed, n),
        }
        for name, row in rows.items():
            if name in given.rows:
                kept.clear()
                own = list(row() or ())
                every += own
                kept |= honest(own) if own else {}
                command = f"python benchmarks/excluded.py {name} --seed {seed} --clean {n}"
                keep(f"excluded-{name}", kept, depends=DEPENDS, command=command, seeds=[seed])
        runs, good, wrong, most = (each.value for each in honest(every).values())
        print(f"good and off by more than {HONEST:g} times the stated error: {wrong} of"
              f" {good} ({runs} runs), most {most:.2g} times")  # fmt: skip


if __name__ == "__main__":
    main()
