"""How often a mistake in a robot file, a drives file or a map of columns is named first.

Two of each kind. Robot file and drives file stay as they come along, and the virtual plant differs
from them; what cannot be had of a plant is done to its recordings, as a wrong map of imported
columns would. Each is measured in eight minutes of robot time; good runs on other seeds show how
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
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml
from accuracy import ROBOT, SIDE_BY_SIDE, hil

from hil.estimation.mistakes.finding import find_mistake
from hil.estimation.mistakes.mistake import MistakeName as Name
from hil.runs.pooling import Pooled
from hil.runs.recording_file import write_measured
from hil.runs.run import Run
from sim_plant.plant_file import load_plant_file

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Plant = dict[str, Any]
    Change = Callable[[Array, Array], None]

COUNTS = ("--gravity", 12, "--inertia", 16, "--coupling", 5)


@dataclass(frozen=True)
class Case:
    """A mistake, what it is called, and how it comes about.

    Attributes
    ----------
    name : MistakeName
    axes : tuple of int
        From 1; none where it concerns none in particular.
    plant : callable, optional
        Changes the plant's file.
    recorded : callable, optional
        Changes positions and torques as they were recorded.
    later : callable, optional
        Changes the plant's file for a second half of the campaign.
    """

    name: Name
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


def torque_sign(axis: int) -> Change:
    """Count torques the other way."""

    def change(_q: Array, tau: Array) -> None:
        tau[:, axis - 1] *= -1

    return change


def position_sign(axis: int) -> Change:
    """Count positions the other way."""

    def change(q: Array, _tau: Array) -> None:
        q[:, axis - 1] *= -1

    return change


def exchanged(one: int, other: int) -> Change:
    """Give two axes each other's columns."""

    def change(q: Array, tau: Array) -> None:
        for x in (q, tau):
            x[:, [one - 1, other - 1]] = x[:, [other - 1, one - 1]]

    return change


def geared(axis: int, ratio: float) -> Change:
    """Let a gear ratio be `ratio` times the stated one; drives that know theirs are refused."""

    def change(q: Array, tau: Array) -> None:
        q[:, axis - 1] *= ratio
        tau[:, axis - 1] /= ratio

    return change


def clipped(axis: int, most: float) -> Change:
    """Let the drive report no more than a torque [N m]."""

    def change(_q: Array, tau: Array) -> None:
        np.clip(tau[:, axis - 1], -most, most, out=tau[:, axis - 1])

    return change


CASES = {
    "axis 3 counts the other way": Case(Name.DIRECTION, (3,), drive(3, direction=-1)),
    "axis 5 counts the other way": Case(Name.DIRECTION, (5,), drive(5, direction=-1)),
    "sign of position, axis 2": Case(Name.POSITION_SIGN, (2,), recorded=position_sign(2)),
    "sign of position, axis 5": Case(Name.POSITION_SIGN, (5,), recorded=position_sign(5)),
    "sign of torque, axis 3": Case(Name.TORQUE_SIGN, (3,), recorded=torque_sign(3)),
    "sign of torque, axis 4": Case(Name.TORQUE_SIGN, (4,), recorded=torque_sign(4)),
    "zero of axis 3, 20 degrees": Case(Name.ZERO, (3,), zero(3, 20)),
    "zero of axis 5, 90 degrees": Case(Name.ZERO, (5,), zero(5, 90)),
    "gravity, 10 degrees": Case(Name.GRAVITY, (), tilted(10, 0)),
    "gravity, on a wall": Case(Name.GRAVITY, (), tilted(0, 90)),
    "gear of axis 3, 101 for 100": Case(Name.GEAR, (3,), recorded=geared(3, 1.01)),
    "gear of axis 2, 50 for 100": Case(Name.GEAR, (2,), recorded=geared(2, 0.5)),
    "torque constant of axis 2": Case(Name.TORQUE_CONSTANT, (2,), drive(2, torque_constant=1.3)),
    "torque constant of axis 5": Case(Name.TORQUE_CONSTANT, (5,), drive(5, torque_constant=1.3)),
    "axes 2 and 3 exchanged": Case(Name.EXCHANGED, (2, 3), recorded=exchanged(2, 3)),
    "axes 4 and 5 exchanged": Case(Name.EXCHANGED, (4, 5), recorded=exchanged(4, 5)),
    "load of 2 kg": Case(Name.LEFT_OUT, (6,), load(2.0, (0.1, 0.0, 0.1))),
    "load of 6 kg": Case(Name.LEFT_OUT, (6,), load(6.0, (0.0, 0.15, 0.2))),
    "saturation of axis 2": Case(Name.SATURATION, (2,), recorded=clipped(2, 500)),
    "saturation of axis 4": Case(Name.SATURATION, (4,), recorded=clipped(4, 45)),
    "slip of axis 3, 5 degrees": Case(Name.SLIP, (3,), later=zero(3, 5)),
    "slip of axis 5, 10 degrees": Case(Name.SLIP, (5,), later=zero(5, 10)),
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


def rewrite(run: Path, change: Change) -> None:
    """Change what was recorded."""
    folder = Run.open(run)
    for measured in list(folder):
        q, tau = measured.recording.q.copy(), measured.recording.tau.copy()
        change(q, tau)
        other = replace(measured.recording, q=q, tau=tau)
        path = folder.recording_path(measured.measurement)
        write_measured(path, replace(measured, recording=other), folder.robot)


def runs_of(folder: Path, case: str, seed: int) -> list[Run]:
    """Measure a case, unless it was before."""
    what = CASES[case]
    stem = "".join(letter if letter.isalnum() else "-" for letter in case)
    there = (folder / stem).exists()
    first = measure(folder, stem, seed, what.plant)
    if what.recorded is not None and not there:
        rewrite(first, what.recorded)
    every = [first]
    if what.later is not None:
        every.append(measure(folder, f"{stem}-later", seed + 1, what.later))
    return [Run.open(each) for each in every if each.exists()]


def shifted(axis: int, degrees: float) -> Change:
    """Shift positions."""

    def change(q: Array, _tau: Array) -> None:
        q[:, axis - 1] -= math.radians(degrees)

    return change


def both_signs(axis: int) -> Change:
    """Count positions and torques the other way."""

    def change(q: Array, tau: Array) -> None:
        q[:, axis - 1] *= -1
        tau[:, axis - 1] *= -1

    return change


def constant(axis: int, factor: float) -> Change:
    """Let a torque constant be `factor` times the stated one."""

    def change(_q: Array, tau: Array) -> None:
        tau[:, axis - 1] /= factor

    return change


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
            recordings = list(Pooled([run]))
            for k, (motion, recording) in enumerate(recordings):
                q, tau = recording.q.copy(), recording.tau.copy()
                change(axis)(q, tau)
                recordings[k] = motion, replace(recording, q=q, tau=tau)
            found = find_mistake(run.robot, recordings)
            print(f"{what}, axis {axis}: {found or 'nothing'}", flush=True)


def main() -> None:
    """Measure, look for mistakes, print."""
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
        named = 0
        with ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
            every = list(pool.map(
                lambda k: runs_of(folder, list(CASES)[k], given.seed + k), range(len(CASES))
            ))  # fmt: skip
            good = list(pool.map(
                lambda seed: measure(folder, f"good-{seed}", seed, None),
                range(given.seed + 100, given.seed + 100 + given.good),
            ))  # fmt: skip
        for (case, what), runs in zip(CASES.items(), every, strict=True):
            if not runs or not len(runs[0]):
                print(f"{case}: not measured")
                continue
            found = find_mistake(runs[0].robot, Pooled(runs))
            hit = found is not None and (found.name, found.axes) == (what.name, what.axes)
            named += hit
            print(f"{'     ' if hit else 'WRONG'} {case}: {found or 'nothing'}", flush=True)
        print(f"named first in {named} of {len(CASES)}")
        alarms = 0
        for path in good:
            run = Run.open(path)
            if (found := find_mistake(run.robot, Pooled([run]))) is not None:
                alarms += 1
                print(f"ALARM {path.name}: {found}")
        print(f"alarms in {alarms} of {len(good)} good runs")


if __name__ == "__main__":
    main()
