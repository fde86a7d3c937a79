"""Cases of `benchmarks/excluded.py`: runs with a flaw, and judgements of their results."""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import yaml
from accuracy import HONEST, ROBOT, hil, is_positive, times_stated
from planted_flaws import HALF_WAY, MESH, PLANTS, RECORDED, STATED

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from twin_recordings import ROBOTS, Load, TwinRecorder

from hil.errors import HilError
from hil.estimation.drive_train import CERTAIN
from hil.estimation.excluded.backlash import half_gap
from hil.estimation.excluded.battery import Battery
from hil.estimation.excluded.causes import CAUSES
from hil.estimation.excluded.columns import columns
from hil.estimation.excluded.evidence import measured
from hil.estimation.excluded.finding import excluded
from hil.estimation.excluded.limits import smallest as smallest_of
from hil.estimation.excluded.proof import proved
from hil.estimation.excluded.result import located
from hil.estimation.excluded.words import name_of
from hil.estimation.identify import estimate
from hil.ground_truth.comparison import Comparison
from hil.ground_truth.true_parameters import true_parameters
from hil.imports.importing import import_recordings
from hil.results.identification import model_of
from hil.runs.pooling import Pooled
from hil.runs.run import Run
from sim_plant.plant_file import load_plant_file

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

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

FLAWS = (
    ("", "joint offset", 2), ("", "joint offset", 3), ("", "position scale", 3),
    ("", "gear ratio", 2), ("", "gear ratio", 4), ("", "torque constant", 2),
    ("", "torque constant", 5), ("", "drift of torque constant", 2), ("", "rotor inertia", 3),
    ("", "position delay", 2), ("", "slip", 3), ("", "gravity", 0), ("", "load", 0),
    ("", "spring", 5), ("", "torque ripple", 4), ("", "backlash", 2),
    ("", "friction of the load", 3), ("ur10e", "joint offset", 3),
    ("ur10e", "torque constant", 2), ("ur10e", "spring", 4),
)  # fmt: skip
"""Twin (without a name the robot of the campaign), cause and axis, from 1."""


class Case(NamedTuple):
    """Run with a flaw of some size; size 0 for a clean run."""

    twin: str
    cause: str
    axis: int
    times: float
    size: float
    seed: int

    @property
    def axes(self) -> tuple[int, ...]:
        """Axes from 1, as stated by a cause."""
        if self.cause == "load":
            return (6,)
        more = (self.axis + 1,) if self.cause == "two axes exchanged" else ()
        return (self.axis, *more) if self.axis else ()


@dataclass(frozen=True)
class Said:
    """Word, causes, true error of the worst axis, and whether the mass matrix is positive."""

    word: str
    reason: str
    found: tuple[Found, ...]
    proof: Excluded | None
    times: float
    seconds: float
    accounted: tuple[tuple[str, int], ...] = ()
    error: float = np.inf
    positive: bool = True

    @property
    def honest(self) -> bool:
        """True if error and mass matrix are as a good model's, or the model is not called good."""
        return self.word != "good" or (self.times <= HONEST and self.positive)

    @property
    def alone(self) -> bool:
        """True if neither a load nor a joint offset is equivalent to the first cause."""
        others = self.found[0].others if self.found else ()
        return not any(CAUSES[x].words in each for x in ("load", "joint offset") for each in others)

    def named(self, case: Case) -> str:
        """Class of the named causes: first, same, accounted for, other or nothing."""
        if (case.cause, case.axis) in self.accounted:
            return "accounted for"
        if not self.found:
            return "nothing"
        first = self.found[0]
        if (first.cause, first.axes) == (case.cause, case.axes):
            return "same" if first.others else "first"
        starts = tuple(located(case.axes, words) for words in beginnings(case.cause))
        return "same" if any(each.startswith(starts) for each in first.others) else "other"


def beginnings(cause: str) -> tuple[str, ...]:
    """Return the first words of a cause, for sizes above and below the stated one."""
    if cause not in CAUSES:
        return ()
    words = CAUSES[cause].words
    return words, words.replace("greater", "less")


@cache
def _twin(name: str) -> TwinRecorder:
    return TwinRecorder(name)


def campaign(folder: Path, seed: int, case: Case | None = None) -> Run:
    """Measure the plan on a plant, unless the run exists."""
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
    """Return recordings with other positions and torques."""
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
    """Measure, import or change a case, identify it, and judge the result."""
    if case.cause and case.cause not in {*PLANTS, *RECORDED, *STATED}:
        raise KeyError(case.cause)
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


def judge_run(folder: Path) -> Said:
    """Judge the result of a run; the plant file is two folders above the run."""
    run = Run.open(folder)
    truth = true_parameters(run.robot, folder.parents[1] / "plant.yaml")
    return judged(run, run.robot, list(Pooled([run])), truth)


def judged(run: Run, robot: Robot, recorded: Sequence[Recorded], truth: Array) -> Said:
    """Identify recordings, and judge the result by the truth."""
    begin = time.process_time()
    try:
        found = estimate(robot, recorded)
    except HilError as error:
        proof = proved(robot, recorded)
        causes = proof.found if proof is not None else ()
        return Said("failed", str(error), causes, proof, 0.0, time.process_time() - begin)
    begin = time.process_time()
    proof = proved(robot, recorded, found.values, found.drive_train, found.joint)
    seconds = time.process_time() - begin
    model = replace(model_of(run, found, proof=proof), robot=robot)
    assert model.verdict is not None
    times = times_stated(model, found, truth)
    causes = proof.found if proof is not None else ()
    accounted = [(str(term.cause), axis) for term in model.error_budget if term.accounted
                 for axis in term.axes]  # fmt: skip
    if found.load_friction is not None:
        mu, error = found.load_friction
        loaded = np.flatnonzero(np.nan_to_num(mu / error) > CERTAIN)
        accounted += [("friction of the load", int(axis) + 1) for axis in loaded]
    return Said(model.verdict.word, model.verdict.reason, causes, proof, times, seconds,
                tuple(accounted), float(np.max(Comparison(found, truth).torque)),
                is_positive(model))  # fmt: skip


def smallest(proof: Excluded | None, cause: str, axis: int) -> float:
    """Return the smallest stated size; for a load the first moment across the axis.

    The stated sizes of a slip and of a periodic torque are those of the least visible instant and
    order. `smallest_parts` returns the sizes for the planted instant and order.
    """
    own = [each for each in (proof.limits if proof else ())
           if each.cause == cause and each.axis == axis and each.part in ("", "sx6")]  # fmt: skip
    return min((each.size for each in own if each.size is not None), default=0.0)


def smallest_parts(folder: Path, seed: int) -> dict[tuple[str, int], float]:
    """Return the smallest sizes of the planted slip and periodic torque, by cause and axis."""
    run, found, evidence = rows_of(folder, seed)
    every = columns(run.robot, found.values, evidence)
    battery = Battery(evidence, every, every.fitted)
    n_tests = sum(battery.visible[at].any() for at in every.tests.values())
    of = {"slip": "slip", "torque ripple": f"torque ripple {MESH}"}
    sizes = {}
    for cause, axis in ((cause, axis) for _, cause, axis in FLAWS if cause in of):
        at = every.tests[of[cause], axis - 1]
        each = smallest_of(battery, at, int(n_tests))
        away = [abs(float(every.names[k].part) - HALF_WAY) if cause == "slip" else 0 for k in at]
        sizes[cause, axis] = float(each[int(np.argmin(away))])
    return sizes


def rows_of(folder: Path, seed: int) -> tuple[Run, Estimate, Evidence]:
    """Return a clean run, its estimate, and the rows used to test causes."""
    run = campaign(folder, seed)
    found = estimate(run.robot, list(Pooled([run])))
    assert found.joint is not None
    return run, found, measured(run.robot, found.joint.solver, found.joint.prepared)


def shares(folder: Path, seed: int, most: int = 60) -> tuple[int, float, float]:
    """Return the number of tested causes, and the shares detected and named correctly."""
    run, found, evidence = rows_of(folder, seed)
    every, rng = columns(run.robot, found.values, evidence), np.random.default_rng(seed)
    clean = excluded(run.robot, found.values, evidence)
    visible = [
        each for each in clean.limits if each.size is not None and each.cause != "torque ripple"
    ]
    some = rng.permutation(len(visible))[:most]
    any_found, named = [], []
    for limit in (visible[k] for k in some):
        at = [k for k, name in enumerate(every.names)
              if (name_of((name.cause, 0)), name.axis + 1) == (limit.cause, limit.axis)
              and limit.part in ("", name.part)]  # fmt: skip
        if limit.cause == "backlash":  # column of the gap nearest to the size
            gaps = [half_gap(run.robot, every.names[k][:2]) for k in at]
            at = [at[int(np.argmin(np.abs(np.log(gaps) - np.log(limit.size))))]]
        column = every.values[:, rng.choice(at)] * limit.size * rng.choice([-1.0, 1.0])
        other = replace(evidence, torque=evidence.torque + column,
                        recorded=evidence.recorded + column)  # fmt: skip
        causes = excluded(run.robot, found.values, other).found
        any_found.append(bool(causes))
        named.append(any(each.cause == limit.cause or any(start in x for x in each.others
                                                          for start in beginnings(limit.cause))
                         for each in causes))  # fmt: skip
    return len(named), float(np.mean(any_found)), float(np.mean(named))
