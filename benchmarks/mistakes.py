"""What is said of flaws of a plant: the word, the first cause, and whether *good* is honest.

Robot file and drives file stay as they come along, and the virtual plant differs from them; what
cannot be had of a plant is done to what was recorded of a good one. Each campaign takes eight
minutes of robot time. Of each flaw the table states the word of the outcome and the likeliest
mistake beside those that are right, and of every *good* how many times its stated error the true
one is, on the axis where that is most (`hil.ground_truth.comparison`). Good runs on other seeds
show how often something is named where nothing is wrong::

    python benchmarks/mistakes.py [--seed 40] [--good 20] [--keep FOLDER]
    python benchmarks/mistakes.py --every-axis [--keep FOLDER]

The second makes the mistakes that have an axis on every axis of one good run's recordings, and
states what becomes of each: there are some that no recording can show.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import yaml
from accuracy import ROBOT, SIDE_BY_SIDE, hil
from flawed_plants import CASES, ON_EVERY_AXIS

from hil.errors import HilError
from hil.estimation.excluded.causes import CAUSES
from hil.estimation.excluded.proof import proved
from hil.estimation.excluded.result import located
from hil.estimation.identify import estimate
from hil.ground_truth.comparison import comparison
from hil.ground_truth.true_parameters import true_parameters
from hil.results.identification import model_of
from hil.results.prediction import uncertainty
from hil.runs.pooling import Pooled
from hil.runs.run import Run
from sim_plant.plant_file import load_plant_file

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from flawed_plants import Case, Change, Plant

    from hil.estimation.excluded.result import Excluded, Found
    from hil.planning.measurement import RecordedMotion
    from hil.runs.recording import Recording

    Recorded = tuple[RecordedMotion, Recording]

COUNTS = ("--gravity", 12, "--inertia", 16, "--coupling", 5)
HONEST = 3.0
"""Times its stated error that the true one of a good model may be."""


def measure(folder: Path, stem: str, seed: int, change: Callable[[Plant], None] | None) -> Path:
    """Measure the plan on a plant of its own; what was refused stands in a file beside."""
    run, plant = folder / stem, folder / f"{stem}.yaml"
    if not run.exists():
        content = load_plant_file(ROBOT).model_dump(mode="json")
        if change is not None:
            change(content)
        plant.write_text(yaml.safe_dump(content, sort_keys=False))
        given = (folder / "plan.yaml", "-o", run, "--channel", plant, "--bus-option")
        command = [sys.executable, "-m", "hil", "run", *map(str, given), f"seed={seed}"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        (folder / f"{stem}.txt").write_text(done.stderr if done.returncode else "")
    return run


def recordings_of(run: Run, change: Change) -> list[Recorded]:
    """Recordings of a run with other positions and torques."""
    found = []
    for motion, recording in Pooled([run]):
        q, tau = recording.q.copy(), recording.tau.copy()
        change(q, tau, recording.time)
        found.append((motion, replace(recording, q=q, tau=tau)))
    return found


@dataclass(frozen=True)
class Said:
    """What is said of a campaign.

    Attributes
    ----------
    word, cause : str
    mistake : Found or None
    times : float
        True error of a good model over its stated error, on the axis where that is most.
    """

    word: str
    cause: str
    mistake: Found | None
    times: float

    @property
    def honest(self) -> bool:
        """Whether the stated error holds where the model is called good."""
        return self.word != "good" or self.times <= HONEST

    def right(self, case: Case) -> str:
        """FIRST, SAME (as another in these data) or nothing."""
        if self.mistake is None or case.name is None:
            return "FIRST" if self.mistake is None and case.name is None else ""
        if (self.mistake.cause, self.mistake.axes) == (case.name, case.axes):
            return "SAME" if self.mistake.others else "FIRST"
        start = located(case.axes, CAUSES[case.name].words)
        return "SAME" if any(each.startswith(start) for each in self.mistake.others) else ""


def first(proof: Excluded | None) -> Found | None:
    """The cause that explains most, if any is found."""
    return proof.found[0] if proof is not None and proof.found else None


def say(run: Run, recorded: Sequence[Recorded]) -> Said:
    """Identify a campaign and hear what is said; the truth is that of the plant as it should be."""
    try:
        found = estimate(run.robot, recorded)
    except HilError as error:
        mistake = first(proved(run.robot, recorded))
        # hil identify refuses it, and states the mistake first
        return Said("failed" if mistake else "refused", str(mistake or error), mistake, 0.0)
    proof = proved(run.robot, recorded, found.p, found.drive_train)
    model, mistake = model_of(run, found, proof=proof), first(proof)
    assert model.outcome is not None
    stated = uncertainty(model)
    if found.usual_effect is not None:
        stated = uncertainty(model, found.usual_effect @ found.usual_effect.T)
    true = comparison(found, run.robot, true_parameters(run.robot, ROBOT)).torque_error
    return Said(model.outcome.word, model.outcome.reason, mistake, float(np.nanmax(true / stated)))


def said_of(folder: Path, number: int, *, seed: int, good: Sequence[Path]) -> Said | None:
    """Measure a case, unless it was before, and judge it; None where nothing could be measured."""
    name, case = list(CASES.items())[number]
    stem = "".join(letter if letter.isalnum() else "-" for letter in name)
    if case.recorded is not None:
        run = Run.open(good[number % len(good)])
        return say(run, recordings_of(run, case.recorded))
    every = [measure(folder, f"{stem}-{seed + number}", seed + number, case.plant)]
    if case.later is not None:
        every.append(measure(folder, f"{stem}-later-{seed}", seed + number + 1, case.later))
    runs = [Run.open(each) for each in every if each.exists()]
    return say(runs[0], list(Pooled(runs))) if runs and len(runs[0]) else None


def show_every_axis(run: Run) -> None:
    """Print what is named where one good run's recordings have each mistake on each axis."""
    for what, change in ON_EVERY_AXIS.items():
        for axis in range(1, run.robot.n_joints + 1):
            found = first(proved(run.robot, recordings_of(run, change(axis))))
            print(f"{what}, axis {axis}: {found or 'nothing'}", flush=True)


def show_cases(folder: Path, seed: int, good: Sequence[Path]) -> None:
    """Print what is said of every flaw."""
    judge = partial(said_of, folder, seed=seed, good=good)
    words = causes = honest = measured = 0
    with ProcessPoolExecutor(SIDE_BY_SIDE) as pool:
        for (name, case), said in zip(
            CASES.items(), pool.map(judge, range(len(CASES))), strict=True
        ):
            if said is None:
                print(f"{name}: not measured")
                continue
            right, word = said.right(case), said.word in case.words
            measured, words, causes = measured + 1, words + word, causes + bool(right)
            honest += said.honest
            marks = ("     " if word else "WORD ", f"{right:5}" if right else "WRONG")
            times = f"; {said.times:.2f} times its stated error" if said.word == "good" else ""
            print(*marks, f"{name}: {said.word}: {said.cause}{times}", flush=True)
    print(f"of {measured}: right word {words}, right cause {causes}, stated error holds {honest}")


def show_good(good: Sequence[Path]) -> None:
    """Print what is said where nothing is wrong."""
    alarms, times = 0, []
    with ProcessPoolExecutor(SIDE_BY_SIDE) as pool:
        for path, said in zip(good, pool.map(say_of_good, good), strict=True):
            times.append(said.times)
            if said.word != "good":
                alarms += 1
                print(f"ALARM {path.name}: {said.word}: {said.cause}", flush=True)
    print(f"alarms in {alarms} of {len(good)} good runs; worst axis {max(times):.2f} times")


def say_of_good(path: Path) -> Said:
    """Judge a run in which nothing is wrong."""
    run = Run.open(path)
    return say(run, list(Pooled([run])))


def main() -> None:
    """Measure, identify, print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("--seed", type=int, default=40)
    parser.add_argument("--good", type=int, default=20, help="runs in which nothing is wrong")
    parser.add_argument("--keep", type=Path, help="folder for plan and runs; reused if there")
    parser.add_argument("--every-axis", action="store_true", help="what shows on each axis")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        if not (folder / "plan.yaml").exists():
            hil("plan", ROBOT, "-o", folder / "plan.yaml", *COUNTS)
        if given.every_axis:
            show_every_axis(Run.open(measure(folder, "good", given.seed, None)))
            return
        seeds = range(given.seed + 100, given.seed + 100 + given.good)
        with ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
            good = list(pool.map(lambda seed: measure(folder, f"good-{seed}", seed, None), seeds))
        show_cases(folder, given.seed, good)
        show_good(good)


if __name__ == "__main__":
    main()
