"""What is said of flaws of a plant: the word, the first cause, and whether *good* is honest.

Robot file and drives file stay as they come along, and the virtual plant differs from them; what
cannot be had of a plant is done to what was recorded of a good one. Each campaign takes eight
minutes of robot time. Of each flaw the table states the word of the outcome and the likeliest
mistake beside those that are right, and of every *good* how many times its stated error the true
one is, on the axis where that is most (`hil.study.comparison`). Good runs on other seeds show how
often something is named where nothing is wrong::

    python benchmarks/mistakes.py [--seed 40] [--good 20] [--keep FOLDER]
    python benchmarks/mistakes.py --every-axis [--keep FOLDER]

The second makes the mistakes that have an axis on every axis of one good run's recordings, and
states what becomes of each: there are some that no recording can show.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml
from accuracy import ROBOT, SIDE_BY_SIDE, hil

from hil.errors import HilError
from hil.estimation.identify import estimate
from hil.estimation.mistakes.finding import find_mistake
from hil.estimation.mistakes.mistake import MistakeName as Name
from hil.results.identification import model_of
from hil.results.outcome import uncertainty
from hil.runs.pooling import Pooled
from hil.runs.run import Run
from hil.study.comparison import comparison
from hil.study.truth import true_parameters
from sim_plant.plant_file import load_plant_file

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from hil.estimation.mistakes.mistake import Mistake
    from hil.planning.measurement import RecordedMotion
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]
    Plant = dict[str, Any]
    Change = Callable[[Array, Array, Array], None]
    Recorded = tuple[RecordedMotion, Recording]

COUNTS = ("--gravity", 12, "--inertia", 16, "--coupling", 5)
HONEST = 3.0
"""Times its stated error that the true one of a good model may be."""


@dataclass(frozen=True)
class Case:
    """A flaw, what should be said of it, and how it comes about.

    Attributes
    ----------
    words : tuple of str
        Words that are right; *good* is one where the flaw cannot show, if its stated error holds.
    name : MistakeName or None
        None where it cannot show.
    axes : tuple of int
        From 1; none where it concerns none in particular.
    plant : callable, optional
        Changes the plant's file.
    recorded : callable, optional
        Changes positions and torques as they were recorded.
    later : callable, optional
        Changes the plant's file for a second half of the campaign.
    """

    words: tuple[str, ...]
    name: Name | None
    axes: tuple[int, ...]
    plant: Callable[[Plant], None] | None = None
    recorded: Change | None = None
    later: Callable[[Plant], None] | None = None


def drive(axis: int, **factors: float) -> Callable[[Plant], None]:
    """Multiply values of a drive."""

    def change(plant: Plant) -> None:
        own = plant["axes"][axis - 1]["drive"]
        for key, factor in factors.items():
            own[key] = type(own[key])(own[key] * factor)

    return change


def zero(axis: int, degrees: float) -> Callable[[Plant], None]:
    """Shift what the encoder shows at q = 0."""

    def change(plant: Plant) -> None:
        own = plant["axes"][axis - 1]["drive"]
        turns = own["direction"] * own["gear_ratio"] * degrees / 360
        own["zero"] += round(turns * own["increments"])
        own["range_deg"] += abs(degrees)  # the drive's own limits move along with its zero

    return change


def tilted(roll: float, pitch: float) -> Callable[[Plant], None]:
    """Let gravity come from elsewhere than the robot file says [degrees]."""

    def change(plant: Plant) -> None:
        a, b = math.radians(roll), math.radians(pitch)
        g = -9.81
        plant["gravity"] = [g * math.sin(b), -g * math.sin(a) * math.cos(b),
                            g * math.cos(a) * math.cos(b)]  # fmt: skip

    return change


def load(mass: float, centre: tuple[float, float, float]) -> Callable[[Plant], None]:
    """Bolt a body to the last link."""

    def change(plant: Plant) -> None:
        plant["payload"] = {"mass": mass, "centre": list(centre),
                            "Ixx": 0.02, "Iyy": 0.02, "Izz": 0.02}  # fmt: skip

    return change


def backlash(axis: int, angle: float, hertz: float) -> Callable[[Plant], None]:
    """Let a gear be soft, so that its load swings with `hertz`, and have play [rad]."""

    def change(plant: Plant) -> None:
        own = plant["axes"][axis - 1]["drive"]
        own["stiffness"] = own["load_inertia"] * (2 * math.pi * hertz) ** 2
        own["backlash"] = angle

    return change


def torque_sign(axis: int) -> Change:
    """Count torques the other way."""

    def change(_q: Array, tau: Array, _time: Array) -> None:
        tau[:, axis - 1] *= -1

    return change


def position_sign(axis: int) -> Change:
    """Count positions the other way."""

    def change(q: Array, _tau: Array, _time: Array) -> None:
        q[:, axis - 1] *= -1

    return change


def both_signs(axis: int) -> Change:
    """Count positions and torques the other way."""

    def change(q: Array, tau: Array, _time: Array) -> None:
        q[:, axis - 1] *= -1
        tau[:, axis - 1] *= -1

    return change


def exchanged(one: int, other: int) -> Change:
    """Give two axes each other's columns."""

    def change(q: Array, tau: Array, _time: Array) -> None:
        for x in (q, tau):
            x[:, [one - 1, other - 1]] = x[:, [other - 1, one - 1]]

    return change


def shifted(axis: int, degrees: float) -> Change:
    """Shift positions."""

    def change(q: Array, _tau: Array, _time: Array) -> None:
        q[:, axis - 1] -= math.radians(degrees)

    return change


def geared(axis: int, ratio: float) -> Change:
    """Let a gear ratio be `ratio` times the stated one; drives that know theirs are refused."""

    def change(q: Array, tau: Array, _time: Array) -> None:
        q[:, axis - 1] *= ratio
        tau[:, axis - 1] /= ratio

    return change


def constant(axis: int, factor: float) -> Change:
    """Let a torque constant be `factor` times the stated one."""

    def change(_q: Array, tau: Array, _time: Array) -> None:
        tau[:, axis - 1] /= factor

    return change


def drifting(axis: int, share: float) -> Change:
    """Let a torque constant fall by `share` in eight minutes."""

    def change(_q: Array, tau: Array, time: Array) -> None:
        tau[:, axis - 1] /= 1 - share * time / 480.0

    return change


def spring(axis: int, stiffness: float) -> Change:
    """Let a spring pull [N m/rad]."""

    def change(q: Array, tau: Array, _time: Array) -> None:
        tau[:, axis - 1] += stiffness * q[:, axis - 1]

    return change


def meshing(axis: int, size: float, order: int) -> Change:
    """Let a torque repeat so many times a turn [N m]."""

    def change(q: Array, tau: Array, _time: Array) -> None:
        tau[:, axis - 1] += size * np.sin(order * q[:, axis - 1])

    return change


def clipped(axis: int, most: float) -> Change:
    """Let the drive report no more than a torque [N m]."""

    def change(_q: Array, tau: Array, _time: Array) -> None:
        np.clip(tau[:, axis - 1], -most, most, out=tau[:, axis - 1])

    return change


FAILED, DOUBTFUL, GOOD = ("failed",), ("doubtful",), ("good",)
SEEN = (*DOUBTFUL, *FAILED)
"""Of a flaw of a size that some parameters survive: how many is a matter of the seed."""
CASES = {
    "axis 3 counts the other way": Case(FAILED, Name.DIRECTION, (3,), drive(3, direction=-1)),
    "axis 5 counts the other way": Case(FAILED, Name.DIRECTION, (5,), drive(5, direction=-1)),
    "sign of position, axis 2": Case(FAILED, Name.POSITION_SIGN, (2,), recorded=position_sign(2)),
    "sign of position, axis 5": Case(FAILED, Name.POSITION_SIGN, (5,), recorded=position_sign(5)),
    "sign of torque, axis 3": Case(FAILED, Name.TORQUE_SIGN, (3,), recorded=torque_sign(3)),
    "sign of torque, axis 4": Case(FAILED, Name.TORQUE_SIGN, (4,), recorded=torque_sign(4)),
    "axes 2 and 3 exchanged": Case(FAILED, Name.EXCHANGED, (2, 3), recorded=exchanged(2, 3)),
    "axes 4 and 5 exchanged": Case(FAILED, Name.EXCHANGED, (4, 5), recorded=exchanged(4, 5)),
    "axes 5 and 6 exchanged": Case(FAILED, Name.EXCHANGED, (5, 6), recorded=exchanged(5, 6)),
    "zero of axis 3, 20 degrees": Case(FAILED, Name.ZERO, (3,), zero(3, 20)),
    "zero of axis 5, 90 degrees": Case(FAILED, Name.ZERO, (5,), zero(5, 90)),
    "zero of axis 5, 2 degrees": Case(GOOD, None, (), zero(5, 2)),
    "gravity, 10 degrees": Case(FAILED, Name.GRAVITY, (), tilted(10, 0)),
    "gravity, on a wall": Case(FAILED, Name.GRAVITY, (), tilted(0, 90)),
    "gear of axis 2, 50 for 100": Case(FAILED, Name.GEAR, (2,), recorded=geared(2, 0.5)),
    "gear of axis 3, 101 for 100": Case(SEEN, Name.GEAR, (3,), recorded=geared(3, 1.01)),
    "gear of axis 4, 102 for 100": Case(GOOD, None, (), recorded=geared(4, 1.02)),
    "torque constant of axis 2, 30 %": Case(
        FAILED, Name.TORQUE_CONSTANT, (2,), drive(2, torque_constant=1.3)
    ),
    "torque constant of axis 5, 30 %": Case(
        SEEN, Name.TORQUE_CONSTANT, (5,), drive(5, torque_constant=1.3)
    ),
    "torque constant of axis 1, 5 %": Case(GOOD, None, (), recorded=constant(1, 1.05)),
    "torque constant of axis 2 falls by 4 %": Case(
        SEEN, Name.DRIFT, (2,), recorded=drifting(2, 0.04)
    ),
    "load of 2 kg": Case(SEEN, Name.LEFT_OUT, (6,), load(2.0, (0.1, 0.0, 0.1))),
    "load of 5 kg": Case(SEEN, Name.LEFT_OUT, (6,), load(5.0, (0.05, 0.0, 0.12))),
    "load of 6 kg": Case(SEEN, Name.LEFT_OUT, (6,), load(6.0, (0.0, 0.15, 0.2))),
    "spring of 10 N m/rad, axis 3": Case(FAILED, Name.SPRING, (3,), recorded=spring(3, 10.0)),
    "spring of 10 N m/rad, axis 5": Case(FAILED, Name.SPRING, (5,), recorded=spring(5, 10.0)),
    "torque of 3 N m sin 12 q, axis 4": Case(SEEN, Name.PERIODIC, (4,), recorded=meshing(4, 3, 12)),
    "backlash of 1 mrad at 45 Hz, axis 4": Case(GOOD, None, (), backlash(4, 1e-3, 45.0)),
    "saturation of axis 2": Case(SEEN, Name.SATURATION, (2,), recorded=clipped(2, 500)),
    "saturation of axis 4": Case(SEEN, Name.SATURATION, (4,), recorded=clipped(4, 45)),
    "slip of axis 3, 5 degrees": Case(SEEN, Name.SLIP, (3,), later=zero(3, 5)),
    "slip of axis 5, 10 degrees": Case(GOOD, None, (), later=zero(5, 10)),
}


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
    mistake : Mistake or None
    times : float
        True error of a good model over its stated error, on the axis where that is most.
    """

    word: str
    cause: str
    mistake: Mistake | None
    times: float

    @property
    def honest(self) -> bool:
        """Whether the stated error holds where the model is called good."""
        return self.word != "good" or self.times <= HONEST

    def right(self, case: Case) -> str:
        """FIRST, SAME (as another in these data) or nothing."""
        named = self.mistake and (self.mistake.name, self.mistake.axes)
        other = self.mistake and self.mistake.other
        expected = case.name and (case.name, case.axes)
        if named == expected:
            return "FIRST" if other is None else "SAME"
        return "SAME" if other and (other.name, other.axes) == expected else ""


def say(run: Run, recorded: Sequence[Recorded]) -> Said:
    """Identify a campaign and hear what is said; the truth is that of the plant as it should be."""
    mistake = find_mistake(run.robot, recorded)
    try:
        found = estimate(run.robot, recorded)
    except HilError as error:
        # hil identify refuses it, and states the mistake first
        return Said("failed" if mistake else "refused", str(mistake or error), mistake, 0.0)
    model = model_of(run, found, mistake=mistake)
    assert model.outcome is not None
    stated = uncertainty(model, 0.0 if found.usual_covariance is None else found.usual_covariance)
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


ON_EVERY_AXIS: dict[str, Callable[[int], Change]] = {
    "direction": both_signs,
    "sign of position": position_sign,
    "sign of torque": torque_sign,
    "zero, 20 degrees": lambda axis: shifted(axis, 20.0),
    "gear, 101 for 100": lambda axis: geared(axis, 1.01),
    "gear, 50 for 100": lambda axis: geared(axis, 0.5),
    "torque constant, 130 %": lambda axis: constant(axis, 1.3),
}


def show_every_axis(run: Run) -> None:
    """Print what is named where one good run's recordings have each mistake on each axis."""
    for what, change in ON_EVERY_AXIS.items():
        for axis in range(1, run.robot.n_joints + 1):
            found = find_mistake(run.robot, recordings_of(run, change(axis)))
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
