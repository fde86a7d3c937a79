"""Detection of pushes by `hil watch` on plants without tuning, and alarms without a push.

`python benchmarks/pushes.py [--seeds SEED ...] [--hours HOURS]`, by default seeds 31 to 36 and 10
hours in total. Each seed is a plant with another drift of friction, and another trajectory; the
model is identified from 20 s of a different trajectory. Pushes of 10, 5 and 2 % of the torque limit
come at random instants on every axis, in both directions, and last 0.2 s. Delays count from the
beginning of a push to the sample that shows it; a sample with an alarm but without a push is a
false alarm. A telegram lost at a stated time relates the plant's clock to the recording. Recordings
are watched after the measurement, with the same results as live watching (`tests/hil/watching`).
"""

from __future__ import annotations

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import yaml
from feed_forward import called, plan
from figures import Figure, keep

import hil
from hil.model.robot import Robot
from hil.planning.plan import dump_plan, load_plan, repeat_measurements
from hil.watching.watcher import Watcher

if TYPE_CHECKING:
    from hil.results.watch import Watched

    Push = tuple[float, int, float]

ROBOT = Robot.load("manutec-r15")
SEEDS = (31, 32, 33, 34, 35, 36)
SHARES = {0.10: 0.02, 0.05: 0.1, 0.02: 0.2}
"""Sizes of pushes as shares of the torque limit, and bounds of the detection delay [s]."""
PERIOD, LASTS, APART = 0.004, 0.2, 1.25
FIRST, MARK = 45.0, 20.0
"""Times of the first push and of the lost telegram [s]."""
TURN, LEARNED = 20.0, 30.0
"""Period of the trajectories, and time for learning thresholds [s]."""
AROUND = (-0.04, 0.02)
"""Half width of a window around the beginning of a push, for reversals of a slow axis [s]."""
SLOW = 0.05
"""Share of the velocity limit below which an axis is slow."""
CYCLES = 14
"""Number of periods of 20 s: 4.7 minutes."""


def pushes(rng: np.random.Generator) -> list[Push]:
    """Return time, axis and share of every push."""
    found, when = [], FIRST
    while when < CYCLES * TURN - 5:
        share = rng.choice(list(SHARES)) * rng.choice([-1, 1])
        found.append((when, int(rng.integers(ROBOT.n_joints)), float(share)))
        when += APART + float(rng.uniform(0, 0.5))
    return [(PERIOD * (np.floor(t / PERIOD) + 0.5), axis, share) for t, axis, share in found]


def faults(path: Path, given: list[Push]) -> Path:
    """Write pushes as faults of the plant."""
    mark = {
        "what": "tpdo-lost",
        "axis": 1,
        "at": {"time": MARK + PERIOD / 2},
        "lasts": {"syncs": 1},
    }
    listed = [
        {
            "what": "push",
            "axis": axis + 1,
            "size": float(share * ROBOT.torque_limit[axis]),
            "at": {"time": float(when)},
            "lasts": {"time": LASTS},
        }
        for when, axis, share in given
    ]
    path.write_text(yaml.safe_dump({"faults": [mark, *listed]}))
    return path


def model_of(folder: Path, seed: int) -> Path:
    """Identify a plant from a trajectory of 20 s."""
    known = plan(folder / "known.yaml", 1000 + seed, 5.0023, 4, 10, (0.9, 0.49))
    called("run", known, "-o", folder / "known", "--bus-option", f"seed={seed}")
    called("identify", folder / "known")
    return folder / "known"


def recorded(folder: Path, seed: int, name: str, rounds: int, *more: str) -> hil.Run:
    """Measure a number of cycles of a seed's trajectory; `more` are options of the plant."""
    file = plan(folder / f"{name}.yaml", seed, TURN, CYCLES, 10, (0.8, 0.4))
    file.write_bytes(dump_plan(repeat_measurements(load_plan(file), rounds)).encode())
    options = [word for each in (f"seed={seed}", *more) for word in ("--bus-option", each)]
    called("run", file, "-o", folder / name, *options)
    return hil.Run.open(folder / name)


def watched(run: hil.Run, model: Path) -> Watched:
    """Return the detections of `hil watch` for a measured run."""
    watcher = Watcher(hil.Model.load(model), PERIOD, LEARNED)
    for each in run:
        watcher.take_all(each.recording.time, each.recording.q, each.recording.tau)
    return watcher.found(run.plan.digest, str(model))


class Seen(NamedTuple):
    """Push: share of the torque limit, axis, delay [s], and reversal of the axis."""

    share: float
    axis: int
    delay: float
    turning: bool


def seen(run: hil.Run, found: Watched, given: list[Push]) -> tuple[list[Seen], int]:
    """Return all pushes, with an infinite delay for undetected ones; and false alarms."""
    each = next(iter(run))
    recording, trajectory = each.recording, each.measurement
    lost = float(recording.time[np.flatnonzero(recording.flags[:, 0] & 1)[0]])
    offset = lost - PERIOD - (MARK + PERIOD / 2)  # the push begins a period before it is sampled
    begins = float(recording.time[recording.active][0]) - offset
    alarms = [(alarm.time - offset, alarm.axis - 1) for alarm in found.alarms]
    pushes_seen, right = [], set()
    for when, axis, share in given:
        around = np.clip(when - begins + np.linspace(*AROUND, 20), 0, CYCLES * TURN)
        slowest = np.abs(trajectory.motion(around)[1][:, axis]).min()
        own = [k for k, (t, a) in enumerate(alarms) if a == axis and 0 < t - when < LASTS + 0.15]
        right |= set(own)
        delay = alarms[own[0]][0] - when if own else np.inf
        delay = delay if delay <= LASTS + PERIOD else np.inf
        turning = bool(slowest < SLOW * ROBOT.velocity_limit[axis])
        pushes_seen.append(Seen(abs(share), axis, delay, turning))
    return pushes_seen, len(alarms) - len(right)


def report(found: list[Seen], false: int) -> None:
    """Print detections of pushes of each size, and of those away from reversals alone."""
    print(
        "push, %  axis    n  seen, %  in time, %  median, ms  95 %, ms  in time moving, %  moving"
    )
    for share, within in SHARES.items():
        for axis in (*range(ROBOT.n_joints), None):
            rows = [p for p in found if np.isclose(p.share, share) and axis in (None, p.axis)]
            delay = np.array([p.delay for p in rows])
            moving = np.array([p.delay for p in rows if not p.turning])
            figures = (
                f"{100 * np.isfinite(delay).mean():8.1f}",
                f"{100 * np.mean(delay <= within + 1e-6):11.1f}",
                f"{1e3 * np.median(delay):11.0f}",
                f"{1e3 * np.quantile(delay, 0.95, method='higher'):9.0f}",
                f"{100 * np.mean(moving <= within + 1e-6):18.1f} {len(moving):7d}",
            )
            name = "all" if axis is None else axis + 1
            print(f"{100 * share:7.0f}  {name:>4} {len(rows):4d}", *figures)
    print(f"alarms without a push beside these: {false}")


def watch_pushes(folder: Path, seed: int, model: Path) -> tuple[list[Seen], int]:
    """Measure and watch a motion with pushes on the plant of a seed."""
    given = pushes(np.random.default_rng(seed))
    run = recorded(folder, seed, "pushed", 1, f"faults={faults(folder / 'faults.yaml', given)}")
    return seen(run, watched(run, model), given)


def watch_undisturbed(folder: Path, seed: int, model: Path, hours: float) -> Watched:
    """Measure and watch a motion without pushes on the plant of a seed."""
    rounds = round(3600 * hours / (CYCLES * TURN))
    found = watched(recorded(folder, seed, "free", rounds), model)
    shares = [(round(100 * axis.blind, 1), round(100 * axis.dim, 1)) for axis in found.axes]
    what = f"{len(found.alarms)} alarms in {found.watched / 3600:.2f} hours"
    print(f"seed {seed}: {what}; blind and dim, % of the time: {shares}", flush=True)
    print(*found.alarms, sep="\n")
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", nargs="*", type=int, default=SEEDS)
    parser.add_argument("--hours", type=float, default=10.0)
    asked = parser.parse_args()
    everything, false, quiet = [], 0, []
    for seed in asked.seeds:
        with TemporaryDirectory() as name:
            model = model_of(Path(name), seed)
            rows, wrong = watch_pushes(Path(name), seed, model)
            everything += rows
            false += wrong
            if asked.hours:
                quiet.append(
                    watch_undisturbed(Path(name), seed, model, asked.hours / len(asked.seeds))
                )
    report(everything, false)
    if quiet:
        number, hours = sum(len(w.alarms) for w in quiet), sum(w.watched for w in quiet) / 3600
        print(f"without a push: {number} alarms in {hours:.2f} hours")
        kept = {"false-alarms": Figure(number, digits=1), "hours": Figure(hours, "hours")}
        kept["beside-pushes"] = Figure(false, digits=1)
        for share, within in SHARES.items():
            rows = [p for p in everything if np.isclose(p.share, share)]
            for what, chosen in (("all", rows), ("moving", [p for p in rows if not p.turning])):
                seen_in_time = 100 * np.mean([p.delay <= within + 1e-6 for p in chosen])
                name = f"{100 * share:.0f}-percent-{what}"
                kept[name] = Figure(seen_in_time, "%")
                kept[f"{name}-number"] = Figure(len(chosen), digits=3)
                delays = [1e3 * p.delay for p in chosen]
                kept[f"{name}-median"] = Figure(float(np.median(delays)), "ms")
        blind = 100 * np.array([[axis.blind for axis in each.axes] for each in quiet])
        kept |= {"least-blind": Figure(blind.min(), "%"), "most-blind": Figure(blind.max(), "%")}
        command = f"python benchmarks/pushes.py --hours {asked.hours:g} --seeds"
        keep(
            "pushes", kept, depends=("hil/watching",), seeds=asked.seeds,
            command=" ".join([command, *map(str, asked.seeds)]),
        )  # fmt: skip
