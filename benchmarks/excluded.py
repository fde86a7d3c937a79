"""How well recordings show what is wrong: flaws of stated sizes, clean runs, honest words, time.

Flaws of a plant are measured on one that differs from the robot file; what differs in robot file,
drives file or map alone is changed there, or in what these make of a clean run's recordings, which
is the same. Sizes are multiples of the smallest that a clean run states (80 % power). Clean runs
are campaigns of eight minutes and a minute of free motion of other robots' twins, as CSV files::

    python benchmarks/excluded.py [ROW ...] [--seed 900] [--clean 20] [--keep FOLDER]

Rows: ``flaws`` (20 flaws of three sizes each), ``far`` (what no derivative shows), ``clean``,
``sizes`` (each cause at its stated size, added to a clean run as its column), ``time``, ``gears``
(plants whose gears are soft, which is no cause), ``axes`` (on which axes of a clean run a mistake
shows at all), ``distinguish`` (zeros and a load by the plan as it is and by one that is to
distinguish them), ``runs`` (in the folder of `benchmarks.paper` or of its like, a plant's file
beside its runs: none of them holds a cause that is not accounted for).
Wrong maps are those of `wrong_maps`. Every row states how often *good* was off by more than three
times its stated error.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import yaml
from accuracy import DEPENDS, ROBOT, SIDE_BY_SIDE, hil
from figures import Figure, keep
from planted_flaws import HALF_WAY, MESH, PLANTS, RECORDED, STATED

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from twin_recordings import ROBOTS, Load, TwinRecorder

from hil.errors import HilError
from hil.estimation.drive_train import CERTAIN
from hil.estimation.excluded.battery import Battery
from hil.estimation.excluded.causes import CAUSES
from hil.estimation.excluded.columns import columns
from hil.estimation.excluded.evidence import measured
from hil.estimation.excluded.finding import excluded
from hil.estimation.excluded.limits import smallest as smallest_of
from hil.estimation.excluded.proof import proved
from hil.estimation.excluded.result import located
from hil.estimation.identify import estimate
from hil.ground_truth.comparison import comparison
from hil.ground_truth.true_parameters import true_parameters
from hil.imports.importing import import_recordings
from hil.planning.measurement import shows_parameters
from hil.results.identification import model_of
from hil.results.prediction import uncertainty
from hil.runs.pooling import Pooled
from hil.runs.run import Run
from sim_plant.plant_file import load_plant_file

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from numpy.typing import NDArray
    from planted_flaws import Change

    from hil.estimation.estimate import Estimate
    from hil.estimation.excluded.evidence import Evidence
    from hil.estimation.excluded.result import Excluded, Found
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]
    Recorded = tuple[RecordedMotion, Recording]
    Kept = dict[str, Figure]

PLAN = ("--gravity", 12, "--inertia", 16, "--coupling", 5)
TWINS = ("ur10e", "panda", "scara", "pan-tilt")
HONEST = 3.0
"""Times its stated error that the true one of a good model may be."""
SIZES = (1 / 3, 1.0, 3.0)
"""Of the smallest size that is stated."""
NAMED = ("first", "same", "accounted for", "other", "nothing")
"""Alone or before others, as the same in these data, fitted by the estimate, another cause."""
GEARS = (80.0, 45.0, 20.0)
"""Natural frequencies of all gears, motor held [Hz]."""
FLAWS = (
    ("", "zero", 2), ("", "zero", 3), ("", "position scale", 3), ("", "gear ratio", 2),
    ("", "gear ratio", 4), ("", "torque constant", 2), ("", "torque constant", 5),
    ("", "drift of torque constant", 2), ("", "rotor inertia", 3), ("", "late position", 2),
    ("", "slip", 3), ("", "gravity", 0), ("", "load", 0), ("", "spring", 5), ("", "repeats", 4),
    ("", "play", 2), ("", "friction of the load", 3),
    ("ur10e", "zero", 3), ("ur10e", "torque constant", 2), ("ur10e", "spring", 4),
)  # fmt: skip
"""Twin (the campaign's robot without a name), cause and axis, from 1."""
FAR = (
    ("wrong direction of an axis", 3, 0.0), ("wrong direction of an axis", 5, 0.0),
    ("wrong sign of a position", 2, 0.0), ("wrong sign of a position", 5, 0.0),
    ("wrong sign of a torque", 3, 0.0), ("wrong sign of a torque", 4, 0.0),
    ("two axes exchanged", 2, 0.0), ("two axes exchanged", 4, 0.0), ("two axes exchanged", 5, 0.0),
    ("zero", 3, 20.0), ("zero", 5, 90.0), ("gravity", 0, 90.0), ("gear ratio", 2, -50.0),
    ("torque constant", 2, 30.0), ("torque at its limit", 2, 700.0), ("slip", 3, 5.0),
)  # fmt: skip
"""Cause, axis and size."""

CONFUSED = (("zero", 4, 5.0), ("zero", 5, 4.0), ("zero", 5, -4.0), ("load", 0, 0.03))
"""Cause, axis and size: what the plan as it is does not show on seed 1, or not beside a zero."""


class Case(NamedTuple):
    """A flaw of some size in a run; sizes of 0 are clean."""

    twin: str
    cause: str
    axis: int
    times: float
    size: float
    seed: int

    @property
    def axes(self) -> tuple[int, ...]:
        """From 1, as a cause names them."""
        if self.cause == "load":
            return (6,)
        more = (self.axis + 1,) if self.cause == "two axes exchanged" else ()
        return (self.axis, *more) if self.axis else ()


@dataclass(frozen=True)
class Said:
    """Word, causes, and the true error of the worst axis over the stated one."""

    word: str
    reason: str
    found: tuple[Found, ...]
    proof: Excluded | None
    times: float
    seconds: float
    accounted: tuple[tuple[str, int], ...] = ()

    @property
    def honest(self) -> bool:
        """Whether the stated error holds where the model is called good."""
        return self.word != "good" or self.times <= HONEST

    @property
    def alone(self) -> bool:
        """Whether neither a load nor a zero is the same in these data as what is named first."""
        others = self.found[0].others if self.found else ()
        return not any(CAUSES[x].words in each for x in ("load", "zero") for each in others)

    def named(self, case: Case) -> str:
        """First, same (as others in these data), accounted for, other or nothing."""
        if (case.cause, case.axis) in self.accounted:
            return "accounted for"
        if not self.found:
            return "nothing"
        first = self.found[0]
        if (first.cause, first.axes) == (case.cause, case.axes):
            return "same" if first.others else "first"
        start = located(case.axes, CAUSES[case.cause].words)
        return "same" if any(each.startswith(start) for each in first.others) else "other"


@cache
def _twin(name: str) -> TwinRecorder:
    return TwinRecorder(name)


def campaign(folder: Path, seed: int, case: Case | None = None) -> Run:
    """Measure the plan on a plant, unless it was before."""
    stem = f"{case.cause}-{case.axis}-{case.times:.2f}-{seed}" if case else f"clean-{seed}"
    run, plant = folder / stem.replace(" ", "-"), folder / f"{stem.replace(' ', '-')}.yaml"
    if not run.exists():
        content = load_plant_file(ROBOT).model_dump(mode="json")
        if case is not None:
            PLANTS[case.cause](content, case.axis, case.size)
        plant.write_text(yaml.safe_dump(content, sort_keys=False))
        hil("run", folder / "plan.yaml", "-o", run, "--channel", plant, "--bus-option",
            f"seed={seed}")  # fmt: skip
    return Run.open(run)


def changed(recorded: Iterable[Recorded], change: Change, k: int, size: float) -> list[Recorded]:
    """Recordings with other positions and torques."""
    found = []
    for motion, recording in recorded:
        q, tau = recording.q.copy(), recording.tau.copy()
        change(q, tau, recording.time, k, size)
        found.append((motion, replace(recording, q=q, tau=tau)))
    return found


def imported(folder: Path, case: Case) -> Run:
    """Import a minute of free motion of a twin, three times 20 s, as CSV files."""
    twin, own = _twin(case.twin), Path(tempfile.mkdtemp(dir=folder))
    load = Load({"sx": case.size}) if case.cause == "load" and case.size else None
    n, names = twin.n, []
    for number, (_, each) in enumerate(twin.recorded(case.seed, load)):
        q, tau = each.q.copy(), each.tau.copy()
        if change := RECORDED.get(case.cause):
            change(q, tau, each.time, case.axis - 1, case.size)
        head = ",".join(["t", *(f"{x}{k + 1}" for x in ("q", "tau") for k in range(n))])
        names.append(f"{number}.csv")
        table = np.column_stack([each.time, q, tau])
        np.savetxt(own / names[-1], table, "%.10g", ",", header=head, comments="")
    (own / "robot.yaml").write_text((ROBOTS / f"{case.twin}.yaml").read_text())
    slides = [not turns for turns in twin.robot.revolute]
    joints = [
        {"position": {"column": f"q{k + 1}", "unit": "m" if slides[k] else "rad"},
         "torque": {"column": f"tau{k + 1}", "unit": "N" if slides[k] else "N m"}}
        for k in range(n)
    ]  # fmt: skip
    content = {"robot": "robot.yaml", "files": names, "time": {"column": "t"}, "joints": joints}
    (own / "map.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
    return import_recordings([own / "map.yaml"], own / "run")


def said(folder: Path, case: Case) -> Said:
    """Measure, import or change a case, identify it, and judge what is said."""
    if case.twin:
        run = imported(folder, case)
        return judged(run, run.robot, list(Pooled([run])), _twin(case.twin).truth)
    run = campaign(folder, case.seed, case if case.size and case.cause in PLANTS else None)
    robot, recorded = run.robot, list(Pooled([run]))
    if case.cause in RECORDED:
        recorded = changed(recorded, RECORDED[case.cause], case.axis - 1, case.size)
    elif case.cause in STATED and case.size:
        robot = STATED[case.cause](robot, case.axis - 1, case.size)
    return judged(run, robot, recorded, true_parameters(run.robot, ROBOT))


def of_run(folder: Path) -> Said:
    """Judge what is said of a run of a plant whose file stands two folders above it."""
    run = Run.open(folder)
    truth = true_parameters(run.robot, folder.parents[1] / "plant.yaml")
    return judged(run, run.robot, list(Pooled([run])), truth)


def judged(run: Run, robot: Robot, recorded: Sequence[Recorded], truth: Array) -> Said:
    """Identify recordings, and judge what is said by the truth."""
    begin = time.process_time()
    try:
        found = estimate(robot, recorded)
    except HilError as error:
        proof = proved(robot, recorded)
        causes = proof.found if proof is not None else ()
        return Said("failed", str(error), causes, proof, 0.0, time.process_time() - begin)
    begin = time.process_time()
    proof = proved(robot, recorded, found.p, found.drive_train, found.joint)
    seconds = time.process_time() - begin
    model = replace(model_of(run, found, proof=proof), robot=robot)
    assert model.outcome is not None
    usual = found.usual_effect
    stated = uncertainty(model, 0.0 if usual is None else usual @ usual.T)
    true = comparison(found, robot, truth).torque_error
    times = 0.0 if stated is None else float(np.nanmax(true / np.maximum(stated, 1e-12)))
    causes = proof.found if proof is not None else ()
    accounted = [(str(term.cause), axis) for term in model.error_budget if term.accounted
                 for axis in term.axes]  # fmt: skip
    if found.load_friction is not None:
        mu, error = found.load_friction
        loaded = np.flatnonzero(np.nan_to_num(mu / error) > CERTAIN)
        accounted += [("friction of the load", int(axis) + 1) for axis in loaded]
    return Said(model.outcome.word, model.outcome.reason, causes, proof, times, seconds,
                tuple(accounted))  # fmt: skip


def smallest(proof: Excluded | None, cause: str, axis: int) -> float:
    """Smallest size that is stated; of a load the first moment across the axis.

    What is stated of a slip and of a torque that repeats is that of the instant and of the order
    that hardly show: `of_parts` has those of the flaws.
    """
    own = [each for each in (proof.limits if proof else ())
           if each.cause == cause and each.axis == axis and each.part in ("", "sx6")]  # fmt: skip
    return min((each.size for each in own if each.size is not None), default=0.0)


def of_parts(folder: Path, seed: int) -> dict[tuple[str, int], float]:
    """Smallest sizes of the slip half-way and of the torque that repeats, by cause and axis."""
    run, found, evidence = rows_of(folder, seed)
    every = columns(run.robot, found.p, evidence)
    battery = Battery(evidence, every, every.fitted)
    n_tests = sum(battery.visible[at].any() for at in every.tests.values())
    of = {"slip": "slip", "repeats": f"repeats {MESH}"}
    sizes = {}
    for cause, axis in ((cause, axis) for _, cause, axis in FLAWS if cause in of):
        at = every.tests[of[cause], axis - 1]
        each = smallest_of(battery, at, int(n_tests))
        away = [abs(float(every.names[k].part) - HALF_WAY) if cause == "slip" else 0 for k in at]
        sizes[cause, axis] = float(each[int(np.argmin(away))])
    return sizes


def show_flaws(kept: Kept, folder: Path, pool: ProcessPoolExecutor, seed: int) -> Iterator[Said]:
    """Print what is named at each size of each flaw."""
    clean = {}
    for twin in dict.fromkeys(twin for twin, *_ in FLAWS):
        clean[twin] = said(folder, Case(twin, "", 0, 0.0, 0.0, seed)).proof
    own = of_parts(folder, seed)
    least = [own.get((cause, axis)) or smallest(clean[twin], cause, axis)
             for twin, cause, axis in FLAWS]  # fmt: skip
    cases = [
        Case(twin, cause, axis, times, times * least[k], seed + 1 + k)
        for k, (twin, cause, axis) in enumerate(FLAWS)
        for times in SIZES
    ]
    # changes of a clean run are of the run whose sizes are stated
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
    """Print what is named where no derivative shows it."""
    cases = [Case("", cause, axis, np.inf, size, seed) for cause, axis, size in FAR]
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
    """Print what is named where nothing is wrong."""
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
    """Print what is named in runs of other benchmarks, case by case."""
    for plant in sorted(folder.glob("*/plant.yaml")):
        runs = sorted(run for run in plant.parent.glob("*/seed-*") if run.is_dir())
        try:
            true_parameters(Run.open(runs[0]).robot, plant)
        except HilError as error:  # a plant with more than the robot file knows
            print(f"{plant.parent.name}: {error}")
            continue
        if not any(shows_parameters(motion) for motion, _ in Pooled([Run.open(runs[0])])):
            continue
        every = list(pool.map(of_run, runs))
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
    """Print what is named where gears are soft, which the estimate takes into account."""
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
    """Print how often a cause of the stated smallest size is found."""
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


def rows_of(folder: Path, seed: int) -> tuple[Run, Estimate, Evidence]:
    """A clean run, its estimate, and the rows that causes are tested on."""
    run = campaign(folder, seed)
    found = estimate(run.robot, list(Pooled([run])))
    assert found.joint is not None
    return run, found, measured(run.robot, found.joint.solver, found.joint.prepared)


def shares(folder: Path, seed: int, most: int = 60) -> tuple[int, float, float]:
    """Of a clean run: causes tried, share in which any is found, and in which it is among them."""
    run, found, evidence = rows_of(folder, seed)
    every, rng = columns(run.robot, found.p, evidence), np.random.default_rng(seed)
    clean = excluded(run.robot, found.p, evidence)
    visible = [each for each in clean.limits if each.size is not None and each.cause != "repeats"]
    some = rng.permutation(len(visible))[:most]
    any_found, named = [], []
    for limit in (visible[k] for k in some):
        at = [k for k, name in enumerate(every.names)
              if (name.cause, name.axis + 1) == (limit.cause, limit.axis)
              and limit.part in ("", name.part)]  # fmt: skip
        column = every.values[:, rng.choice(at)] * limit.size * rng.choice([-1.0, 1.0])
        other = replace(evidence, torque=evidence.torque + column,
                        recorded=evidence.recorded + column)  # fmt: skip
        causes = excluded(run.robot, found.p, other).found
        any_found.append(bool(causes))
        start = CAUSES[limit.cause].words
        named.append(any(each.cause == limit.cause or any(start in x for x in each.others)
                         for each in causes))  # fmt: skip
    return len(named), float(np.mean(any_found)), float(np.mean(named))


def show_axes(kept: Kept, folder: Path, pool: ProcessPoolExecutor, seed: int) -> None:
    """Print what becomes of a mistake on each axis of a clean run."""
    for cause, size in (("wrong direction of an axis", 0.0), ("wrong sign of a position", 0.0),
                        ("wrong sign of a torque", 0.0), ("zero", 20.0), ("gear ratio", 1.0),
                        ("gear ratio", -50.0), ("torque constant", 30.0)):  # fmt: skip
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
    """Print how often causes are named that a plan confuses, unless it is to distinguish them."""
    seeds = range(seed + 300, seed + 300 + n)
    for name, more in (("as it is", ()), ("to distinguish", ("--distinguish", "load,zero"))):
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
    """Print processor time beside the estimate; the second run has compiled code loaded."""
    seconds = [said(folder, Case("", "", 0, 0.0, 0.0, seed)).seconds for _ in range(2)]
    print(f"time beside the estimate: {seconds[0]:.2f} s, again {seconds[1]:.2f} s")
    kept |= {"first": Figure(seconds[0], "s"), "again": Figure(seconds[1], "s")}


def key(*words: object) -> str:
    """Name of a figure, of words that are printed."""
    return re.sub(r"\W+", "-", " ".join(map(str, words)).replace(" -", " minus "))


def honest(every: Sequence[Said]) -> Kept:
    """How many runs are called good, how many of these wrongly, and how far they are off."""
    good = [each for each in every if each.word == "good"]
    wrong = [each for each in good if not each.honest]
    most = max((each.times for each in good), default=0.0)
    counts = {"runs": len(every), "good": len(good), "good-and-wrong": len(wrong)}
    own = {name: Figure.count(number) for name, number in counts.items()}
    return own | {"most-off": Figure(most, "times")}


def main() -> None:
    """Measure, identify, print and keep, each row by itself."""
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
