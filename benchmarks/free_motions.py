"""Results of `hil identify` for foreign recordings, robot by robot, with known truth.

Every case and seed is a different machine (`foreign_recordings`), imported from a CSV of positions
and torques and identified by the default method. For each robot, or for each case with --cases, the
table has the error of the rigid-body torques on a free motion, the residual torque of another
recording, the share of 95 % intervals that contain the truth, and good models with three times the
stated error, or with a mass matrix that is not positive definite. Constants of the method were not
tuned on seeds from 201 on, with two exceptions: the doubt about unusual offsets (601 to 611) and
friction of slow samples (1901 to 1912)::

    python benchmarks/free_motions.py [ROBOT ...] [--quick] [--cases] [--keep FOLDER]
    python benchmarks/free_motions.py manutec-r15 --case "10 min" --first 301 --seeds 20
"""

from __future__ import annotations

import argparse
import shlex
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from accuracy import HONEST, is_positive, times_stated
from figures import Figure, keep
from foreign_recordings import CASES, NAMES, ROBOTS, record

from hil.errors import HilError
from hil.estimation.free_motion.result import FreeMotionFit
from hil.estimation.identify import estimate
from hil.ground_truth.comparison import Comparison
from hil.ground_truth.true_parameters import true_parameters
from hil.imports.importing import import_recordings
from hil.results.identification import model_of
from hil.results.recorded_torque import predict_recording
from hil.runs.pooling import Pooled

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

FIRST_SEED, SEEDS = 201, 2
"""First seed, and number of seeds of each case."""
LONG = ("10 min", "10 min of strong drift")
"""Cases run only on request."""


class Judged(NamedTuple):
    """Judgement by the truth: relative errors, z of each parameter, and words of the report."""

    torque: float
    seen: float
    unseen: float
    inside: NDArray[np.bool_]
    z: NDArray[np.float64]
    warned: bool
    good: bool
    wrong: bool
    said: str


def judge(recorded: Path) -> Judged:
    """Import and identify one recording; judge by the truth and the held-out recording.

    Raises
    ------
    HilError
        Refused by import or identification.
    """
    for name in ("seen", "unseen"):
        shutil.rmtree(recorded / name, ignore_errors=True)
    run, other = (
        import_recordings([recorded / f"{name}.yaml"], recorded / name, files=[ROBOTS])
        for name in ("seen", "unseen")
    )
    found = estimate(run.robot, Pooled([run]), "free motion")
    model, fit = model_of(run, found), found.details
    assert isinstance(fit, FreeMotionFit)
    truth = true_parameters(run.robot, recorded / "plant.yaml")
    judged = Comparison(found, truth)
    good = model.verdict is not None and model.verdict.word == "good"
    honest = times_stated(model, found, truth) <= HONEST and is_positive(model)
    left = [predict_recording(model, measured.recording) for measured in other]
    laws = ", ".join(axis.law for axis in fit.axes)
    said = f"cut-off {fit.cut_off:.3g} Hz, dead zone {fit.dead_zone:g}; {laws}; {fit.remarks}"
    unseen = float(np.mean([each.overall for each in left]))
    return Judged(
        judged.mean_torque_error, fit.overall_residual, unseen, judged.inside, judged.z,
        bool(fit.remarks), good, good and not honest, said,
    )  # fmt: skip


class Found(NamedTuple):
    """Estimates of one case or robot, and number of refused recordings."""

    judged: list[Judged]
    refused: int


def judge_all(folder: Path, name: str, case: str, seeds: Iterable[int]) -> Found:
    """Record and judge some seeds of a case; a refusal is printed with its reason."""
    judged, refused = [], 0
    for seed in seeds:
        recorded = record(folder, name, case, seed)
        try:
            judged.append(judge(recorded))
        except HilError as error:
            refused += 1
            print(f"  {recorded}: {error}")
    return Found(judged, refused)


def figures(of: Found) -> dict[str, Figure]:
    """Return the figures of some estimates, in the order of the table."""
    found, refused = of
    if not found:
        return {"refused": Figure.count(refused)}
    torque, seen, unseen = (
        100 * np.array([getattr(each, key) for each in found])
        for key in ("torque", "seen", "unseen")
    )
    inside = np.concatenate([each.inside for each in found])
    z = np.concatenate([each.z for each in found])
    return {
        "torque": Figure(np.sqrt(np.mean(torque**2)), "%", scatter=torque.std() or None),
        "residual": Figure(seen.mean(), "%", scatter=seen.std() or None),
        "residual-of-another": Figure(unseen.mean(), "%", scatter=unseen.std() or None),
        "inside": Figure.count(int(inside.sum())),
        "intervals": Figure.count(len(inside)),
        "z": Figure(np.sqrt(np.mean(z**2))),
        "estimates": Figure.count(len(found)),
        "refused": Figure.count(refused),
        "warned": Figure.count(sum(each.warned for each in found)),
        "good": Figure.count(sum(each.good for each in found)),
        "good-and-wrong": Figure.count(sum(each.wrong for each in found)),
    }


def line(name: str, stated: dict[str, Figure]) -> str:
    """Return one line of the table."""
    if len(stated) == 1:
        return f"{name:28} {stated['refused'].value} refused"
    torque, seen, unseen, inside, of, z, *counts = (each.value for each in stated.values())
    return (
        f"{name:28} {torque:6.2f} %  {seen:5.1f} %  {unseen:5.1f} %  {100 * inside / of:5.1f} %"
        f" of {of:4}  {z:5.2f}  {'  '.join(map(str, counts))}"
    )


def main() -> None:
    """Record, import, identify, judge and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("robots", nargs="*", help=", ".join(NAMES))
    parser.add_argument("--first", type=int, default=FIRST_SEED, help="first seed")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="of each case")
    parser.add_argument("--quick", action="store_true", help="the first seed of each case alone")
    parser.add_argument("--case", action="append", choices=CASES, help="one of the cases [all]")
    parser.add_argument("--cases", action="store_true", help="a line for every case, and why")
    parser.add_argument("--keep", type=Path, help="folder for recordings; reused if there")
    given = parser.parse_args()
    kept: dict[str, Figure] = {}
    recorded: set[int] = set()
    print("robot: rms error of rigid-body torques, residual, of another recording, intervals of")
    print("95 % that hold the truth, rms of error over standard error, estimates, refused, warned,")
    print("good, good but wrong")
    with tempfile.TemporaryDirectory() as temporary:
        for name in given.robots or NAMES:
            total = Found([], 0)
            cases = given.case or [case for case in CASES if case not in LONG]
            for number, case in enumerate(cases):
                first = given.first + given.seeds * number
                seeds = range(first, first + (1 if given.quick else given.seeds))
                recorded.update(seeds)
                found = judge_all(given.keep or Path(temporary), name, case, seeds)
                if given.cases:
                    print(line(f"  {name}, {case}", figures(found)), flush=True)
                    print(*(f"      {each.said}" for each in found.judged), sep="\n", flush=True)
                total = Found(total.judged + found.judged, total.refused + found.refused)
            stated = figures(total)
            print(line(name, stated), flush=True)
            kept |= {f"{name}-{key}": figure for key, figure in stated.items()}
    words = ["python", "benchmarks/free_motions.py", *given.robots, *["--quick"] * given.quick]
    words += ["--first", str(given.first), "--seeds", str(given.seeds)]
    words += [word for case in given.case or () for word in ("--case", case)]
    depends = ("hil/estimation/free_motion", "hil/least_squares", "hil/imports")
    keep("free-motions", kept, depends=depends, command=shlex.join(words), seeds=sorted(recorded))


if __name__ == "__main__":
    main()
