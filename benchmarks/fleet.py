"""A fleet of simulated machines: false alarms, a bearing that wears, time and memory by size.

Each machine has its own parameters and friction, a run a month for three years, and errors: those
that its models state, temperature that moves the friction of all axes (season and hour of the day),
and a share of it on each axis by itself. No bus and no plant: rows of models are drawn. One machine
in fifty wears: friction of one axis grows evenly by 20 % in the second year::

    python benchmarks/fleet.py --machines 10 100 1000 --seed 1
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from figures import Figure, keep

from hil.commands.fleet import FIELDS, ask, read_fleets, write_part
from hil.results.departures import FIRST, Fleet, departures
from hil.results.quantities import Quantity

MONTHS, MONTH = 36, 365.25 / 12 * 86400.0
AXES, PARAMETERS = 6, 14
WORN = 50
"""One machine of so many."""
GROWTH = 0.2
"""In a year."""


def drawn(n: int, seed: int) -> tuple[Fleet, dict[str, int]]:
    """Return a fleet of `n` machines, and the worn axis (from 1) of those that wear."""
    random = np.random.default_rng(seed)
    found = [
        *(Quantity(f"p{k + 1}", "inertia parameter", "kg m^2") for k in range(PARAMETERS)),
        *(
            Quantity(
                f"friction of axis {a} at {v:g} rad/s", "friction level", "N m", axis=a, speed=v
            )
            for a in range(1, AXES + 1)
            for v in (0.2, 1.4)
        ),
        *(Quantity(f"offset of axis {a}", "offset", "N m", axis=a) for a in range(1, AXES + 1)),
    ]
    month = np.tile(np.arange(MONTHS), n)
    machine = np.repeat(np.arange(n), MONTHS)
    axis = np.array([each.axis or 0 for each in found])
    friction = np.array([each.kind == "friction level" for each in found])
    level = np.where(friction, 20.0, np.where(axis > 0, 0.3, 1.0))
    own = level * (1.0 + 0.15 * random.standard_normal((n, len(found))))
    warm = 0.08 * np.sin(2 * np.pi * month / 12) + 0.05 * random.standard_normal(len(month))
    by_axis = warm[:, None] * (1.0 + 0.25 * random.standard_normal((n, AXES + 1))[machine])
    by_axis += 0.01 * random.standard_normal(by_axis.shape)
    error = np.where(friction, 0.007 * level, np.where(axis > 0, 0.1 * level, 0.003 * level))
    value = own[machine] * np.where(friction, 1.0 - by_axis[:, axis], 1.0)
    value += error * random.standard_normal(value.shape)
    worn = {f"m{k:04d}": int(random.integers(1, AXES + 1)) for k in range(0, n, WORN)}
    for name, at in worn.items():
        rows, columns = machine == int(name[1:]), friction & (axis == at)
        grown = 1.0 + GROWTH * np.clip(month[rows] / 12.0 - 1.0, 0.0, 1.0)
        value[np.ix_(rows, columns)] *= grown[:, None]
    labels = np.array([f"m{k:04d}/{m:02d}" for k, m in zip(machine, month, strict=True)])
    stated = np.broadcast_to(error, value.shape).copy()
    allowance = np.where(friction, 0.05 * level, 0.0) + np.zeros_like(value)
    names = tuple(f"m{k:04d}" for k in range(n))
    return (
        Fleet(names, tuple(found), machine, month * MONTH, labels, value, stated, allowance),
        worn,
    )


def columns(fleet: Fleet) -> dict[str, object]:
    """Return the rows of a fleet as columns of the index."""
    n, m = fleet.value.shape
    found: dict[str, object] = {name: [None] * (n * m) for name in FIELDS}
    by_run = {"machine": np.array(fleet.machines)[fleet.machine], "run": fleet.runs}
    by_run |= {"key": fleet.runs, "time": fleet.time, "indexed": fleet.time}
    about = {"quantity": "name", "kind": "kind", "axis": "axis", "speed": "speed", "unit": "unit"}
    found |= {name: np.repeat(each, m) for name, each in by_run.items()}
    found |= {
        name: [getattr(each, of) for each in fleet.quantities] * n for name, of in about.items()
    }
    found |= {"meaning": [""] * (n * m), "value": fleet.value.ravel()}
    return found | {
        "standard_error": fleet.error.ravel(),
        "allowance": fleet.allowance.ravel(),
    }


def until(fleet: Fleet, month: int) -> Fleet:
    """Return the runs up to a month."""
    used = fleet.time <= month * MONTH
    arrays = ("machine", "time", "runs", "value", "error", "allowance")
    return replace(fleet, **{name: getattr(fleet, name)[used] for name in arrays})


def judged(fleet: Fleet, worn: dict[str, int], rate: float) -> tuple[float, list[float]]:
    """Return false alarms a machine and decade, and the growth at which wear was found."""
    false, years, seen = 0, 0.0, dict.fromkeys(worn, np.inf)
    before: set[str] = set()
    for month in range(FIRST, MONTHS):
        found = departures(until(fleet, month), rate).changes
        alarmed = {each.run for each in found}
        years += (len(fleet.machines) - len(worn)) / 12.0
        false += len(alarmed - before - set(worn))
        before = alarmed
        for each in found:
            if each.run in worn and each.quantity.axis == worn[each.run] and month >= 12:
                seen[each.run] = min(seen[each.run], GROWTH * (month / 12.0 - 1.0))
    return 10.0 * false / years, list(seen.values())


def sizes(fleet: Fleet) -> tuple[float, float, float]:
    """Return seconds to write the rows, seconds to ask the index, and its bytes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "fleet.parquet"
        begun = time.perf_counter()
        write_part(path, "drawn", "rows", columns(fleet))
        written = time.perf_counter()
        ask(read_fleets(path), 0.5)
        ended = time.perf_counter()
        size = sum(each.stat().st_size for each in path.rglob("*.parquet"))
    return written - begun, ended - written, float(size)


def main() -> None:
    """Simulate, print and keep."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("--machines", type=int, nargs="+", default=[10, 100, 1000])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rate", type=float, default=0.5)
    given = parser.parse_args()
    kept = {}
    for n in given.machines:
        fleet, worn = drawn(n, given.seed)
        false, growth = judged(fleet, worn, given.rate)
        writing, asking, size = sizes(fleet)
        print(
            f"{n} machines, {fleet.value.size} rows: {false:.2g} false alarms a machine and decade;"
            f" wear found at {100 * np.median(growth):.1f} % growth, at most"
            f" {100 * max(growth):.1f} %; written in {writing:.1f} s, asked in {asking:.1f} s,"
            f" {size / 1e6:.0f} MB"
        )
        kept |= {
            f"{n}-false": Figure(false, ""),
            f"{n}-growth": Figure(100 * max(growth), "%"),
            f"{n}-query": Figure(asking, "s"),
        }
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(f"at most {memory:.0f} MB of memory")
    numbers = " ".join(map(str, given.machines))
    command = f"python benchmarks/fleet.py --machines {numbers} --seed {given.seed}"
    depends = ("hil/results/departures.py", "hil/commands/fleet.py")
    keep("fleet", kept, depends=depends, command=command, seeds=(given.seed,))
    sys.stdout.flush()


if __name__ == "__main__":
    main()
