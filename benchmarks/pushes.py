"""What `hil watch` sees: pushes on plants on which nothing was tuned, and alarms without a push.

`python benchmarks/pushes.py [--seeds SEED ...] [--hours HOURS]`, by default seeds 31 to 36 and 10
hours in all. Each seed is another plant, whose friction drifts otherwise, and another trajectory;
the model of each comes from 20 s of a third one. Pushes of 10, 5 and 2 % of the torque limit come
at random instants on every axis, forward and back, and last 0.2 s. Delays count from the beginning
of a push to the sample that shows it; a sample that shows a push where there is none is a false
alarm. A lost telegram at a stated time finds the plant's clock in the recording.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import yaml
from feed_forward import called, plan

import hil
from hil.model.robot import load_robot
from hil.results.watch import load_watched

ROBOT = load_robot("manutec-r15")
SEEDS = (31, 32, 33, 34, 35, 36)
SHARES = {0.10: 0.02, 0.05: 0.1, 0.02: 0.2}
"""Sizes of pushes as shares of the torque limit, and within what time they are to be seen [s]."""
PERIOD, LASTS, APART = 0.004, 0.2, 1.25
FIRST, MARK = 45.0, 20.0
"""When the first push comes, and the lost telegram [s]."""
ALARMED = 3
"""Exit status of a watch with alarms."""
CYCLES = 14
"""Periods of 20 s: 4.7 minutes."""


def pushes(rng: np.random.Generator) -> list[tuple[float, int, float]]:
    """Time, axis and share of every push."""
    found, when = [], FIRST
    while when < CYCLES * 20.0 - 5:
        share = rng.choice(list(SHARES)) * rng.choice([-1, 1])
        found.append((when, int(rng.integers(ROBOT.n_joints)), float(share)))
        when += APART + float(rng.uniform(0, 0.5))
    return [(PERIOD * (np.floor(t / PERIOD) + 0.5), axis, share) for t, axis, share in found]


def faults(path: Path, given: list[tuple[float, int, float]]) -> Path:
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
    """Identify a plant from 20 s."""
    known = plan(folder / "known.yaml", 1000 + seed, 5.0023, 4, 10, (0.9, 0.49))
    called("run", known, "-o", folder / "known", "--bus-option", f"seed={seed}")
    called("identify", folder / "known")
    return folder / "known"


def watched(folder: Path, seed: int, model: Path, cycles: int, name: str, *more: object) -> Path:
    """Watch a trajectory of a seed; `more` are further options."""
    fast = plan(folder / f"{name}.yaml", seed, 20.0, cycles, 10, (0.8, 0.4))
    out = folder / name
    bus = ("--bus-option", f"seed={seed}")
    called("watch", fast, "--model", model, "-o", out, *bus, *more, accepted=ALARMED)
    return out


def seen(out: Path, given: list[tuple[float, int, float]]) -> tuple[list[tuple[float, ...]], int]:
    """Share and delay of every push, infinite where it was not seen; and false alarms."""
    recording = next(iter(hil.Run.open(out / "run"))).recording
    lost = float(recording.time[np.flatnonzero(recording.flags[:, 0] & 1)[0]])
    offset = lost - PERIOD - (MARK + PERIOD / 2)  # the push begins a period before it is sampled
    alarms = [(alarm.time - offset, alarm.axis - 1) for alarm in load_watched(out).alarms]
    found, right = [], set()
    for when, axis, share in given:
        own = [k for k, (t, a) in enumerate(alarms) if a == axis and 0 < t - when < LASTS + 0.15]
        right |= set(own)
        delay = alarms[own[0]][0] - when if own else np.inf
        found.append((abs(share), axis, delay if delay <= LASTS + PERIOD else np.inf))
    return found, len(alarms) - len(right)


def report(found: np.ndarray, false: int) -> None:
    """State what was seen of pushes of each size."""
    print("push, %  axis    n  seen, %  in time, %  median, ms  95 %, ms")
    for share, within in SHARES.items():
        for axis in (*range(ROBOT.n_joints), None):
            rows = found[np.isclose(found[:, 0], share)]
            rows = rows if axis is None else rows[rows[:, 1] == axis]
            delay = rows[:, 2]
            late = np.quantile(delay, 0.95, method="higher")
            print(
                f"{100 * share:7.0f}  {'all' if axis is None else axis + 1:>4} {len(rows):4d}"
                f" {100 * np.isfinite(delay).mean():8.1f} {100 * (delay <= within + 1e-6).mean():11.1f}"
                f" {1e3 * np.median(delay):11.0f} {1e3 * late:9.0f}"
            )
    print(f"alarms without a push beside these: {false}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", nargs="*", type=int, default=SEEDS)
    parser.add_argument("--hours", type=float, default=10.0)
    asked = parser.parse_args()
    found, false, hours, alarms, sights = [], 0, 0.0, [], []
    for seed in asked.seeds:
        begun = time.perf_counter()
        with TemporaryDirectory() as name:
            folder = Path(name)
            model = model_of(folder, seed)
            given = pushes(np.random.default_rng(seed))
            option = ("--bus-option", f"faults={faults(folder / 'faults.yaml', given)}")
            rows, wrong = seen(watched(folder, seed, model, CYCLES, "pushed", *option), given)
            found += rows
            false += wrong
            if asked.hours:
                share = ("--hours", asked.hours / len(asked.seeds))
                left = load_watched(watched(folder, seed, model, CYCLES, "free", *share))
                hours += left.watched / 3600
                alarms += [(seed, alarm) for alarm in left.alarms]
                sights.append([(100 * a.blind, 100 * a.dim) for a in left.axes])
        print(f"seed {seed}: {time.perf_counter() - begun:.0f} s", flush=True)
    report(np.array(found), false)
    if asked.hours:
        print(f"without a push: {len(alarms)} alarms in {hours:.2f} hours")
        for seed, alarm in alarms:
            print(f"  seed {seed}: {alarm}")
        print("blind and dim, % of the time, by axis:", np.mean(sights, axis=0).round(1).tolist())
