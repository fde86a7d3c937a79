"""Fleet of simulated machines: false alarms, detection of worn bearings, time and memory by size.

A campaign on the virtual manutec-r15 is identified, and machines are drawn from its model, one run
per month for three years. Machines differ by 2 % in parameters and 10 % in friction. Every run has
errors from the stated covariances. Friction of all axes varies by 5 % with the season and by 2 %
with the day; the response of single axes differs by up to a quarter. The friction level of each
axis also wanders: two runs differ by the law's `wander` at most. On sixty further machines friction
of one axis grows evenly by 20 % in the second year. Wear is detected in the first month in which
the axis deviates from the machine's past; a false alarm is a run of an unchanged machine with a
deviation, if the previous run had none::

    python benchmarks/fleet.py --machines 10 100 1000 --seed 41

`--models N` writes the model files of N runs instead (100 kB each), and measures the time and
memory of `hil fleet index` for them, on this machine's cores; `--keep FOLDER` keeps the files for
another measurement::

    python benchmarks/fleet.py --models 28000 --seed 41
"""

from __future__ import annotations

import argparse
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from figures import Figure, keep
from pyarrow import parquet

import hil
from hil.commands.fleet import ask
from hil.friction.law import TermValue
from hil.results.fleet_index import (
    FIRST,
    Fleet,
    deviations,
    model_rows,
    read_fleets,
    table_of,
    write_part,
)

if TYPE_CHECKING:
    from hil.friction.law import AxisLaw

BEGIN = datetime(2023, 1, 1, tzinfo=UTC)
MONTHS, MONTH = 36, 365.25 / 12
WORN, GROWTH = 60, 0.2
RATE = 0.5


class Machine:
    """Machine with runs drawn from a model; `worn`: axis from 1, 0 for none."""

    def __init__(self, model: hil.Model, seed: list[int], worn: int = 0) -> None:
        self._model, self._random, self._worn = model, np.random.default_rng(seed), worn
        n = model.robot.n_joints
        self._values = model.values * (1 + 0.02 * self._random.standard_normal(len(model.values)))
        self._built = 1 + 0.1 * self._random.standard_normal(n).clip(-3, 3)
        self._response = 1 + self._random.uniform(-0.25, 0.25, n)

    def run(self, month: int) -> hil.Model:
        """Return the model of a run."""
        model, random, day = self._model, self._random, month * MONTH
        warm = 0.05 * np.cos(2 * np.pi * day / 365.25) + random.uniform(-0.02, 0.02)
        factors = self._built * (1 + self._response * warm)
        if self._worn:
            factors[self._worn - 1] *= 1 + growth(month)
        axes = tuple(
            own and self._law(own, factor)
            for own, factor in zip(model.friction_law.axes, factors.tolist(), strict=True)
        )
        measured = (BEGIN + timedelta(days=day)).isoformat()
        return replace(
            model,
            values=random.multivariate_normal(self._values, model.scatter_covariance),
            friction_law=model.friction_law.model_copy(update={"axes": axes}),
            provenance=model.provenance.model_copy(update={"measured": measured}),
        )

    def _law(self, law: AxisLaw, factor: float) -> AxisLaw:
        factor *= 1 + law.wander * self._random.uniform(-0.5, 0.5)
        drawn = self._random.multivariate_normal(law.values, law.uncertainty)
        terms = {
            name: TermValue(value=factor * value, standard_error=0.0)
            for name, value in zip(law.terms, drawn.tolist(), strict=True)
        }
        plain = {
            name: each.model_copy(
                update={"value": each.value + each.standard_error * self._random.standard_normal()}
            )
            for name, each in law.plain.items()
        }
        return law.model_copy(update={"terms": terms, "plain": plain})


def growth(month: int) -> float:
    """Return the relative growth of a worn axis's friction."""
    return GROWTH * min(max(month / 12.0 - 1.0, 0.0), 1.0)


def rows_of(name: str, machine: Machine) -> list[tuple[Any, ...]]:
    """Return the rows of all runs of a machine."""
    return [
        row
        for month in range(MONTHS)
        for row in model_rows(machine.run(month), name, f"{name}/{month}", f"{name}/{month}", "")
    ]


def select_until(fleet: Fleet, month: int) -> Fleet:
    """Return the runs up to a month."""
    used = fleet.time <= BEGIN.timestamp() + (month + 0.5) * MONTH * 86400.0
    arrays = ("machine", "time", "runs", "value", "error", "degrees", "allowance")
    return replace(fleet, **{name: getattr(fleet, name)[used] for name in arrays})


def judged(fleet: Fleet) -> tuple[float, dict[str, float]]:
    """Return the false alarms per machine and decade, and the growth at the detection of wear."""
    worn = {name: int(name.split("-")[1]) for name in fleet.machines if name.startswith("worn")}
    false, found = 0, dict.fromkeys(worn, np.inf)
    before: set[str] = set()
    for month in range(FIRST, MONTHS):
        changes = deviations(select_until(fleet, month), RATE).changes
        named = {each.run for each in changes}
        false += len(named - before - set(worn))
        before = named
        for each in changes:
            own = each.run in worn and each.against != "the fleet"
            if own and each.quantity.axis == worn[each.run] and growth(month) > 0.0:
                found[each.run] = min(found[each.run], growth(month))
    decades = (len(fleet.machines) - len(worn)) * (MONTHS - FIRST) / 120.0
    return false / decades, found


def campaign(folder: Path) -> hil.Model:
    """Measure and identify a campaign on the virtual plant."""
    for words in (
        ("plan", "manutec-r15", "--gravity", "12", "--inertia", "24", "--coupling", "3",
         "-o", "plan.yaml"),
        ("run", "plan.yaml", "-o", "run"),
        ("identify", "run"),
    ):  # fmt: skip
        command = [sys.executable, "-m", "hil", *words]
        subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return hil.Model.load(folder / "run")


def main() -> None:
    """Simulate, print and keep."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("--machines", type=int, nargs="+", default=[10, 100, 1000])
    parser.add_argument("--models", type=int)
    parser.add_argument("--seed", type=int, default=41)
    parser.add_argument("--keep", type=Path)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = given.keep or Path(name)
        if given.models:
            if not (folder / "plant").exists():
                write_models(campaign(folder), folder, given.models, given.seed)
            index_models(folder, given.models, given.seed)
        else:
            judge_machines(campaign(folder), folder, given.machines, given.seed)


def write_models(model: hil.Model, folder: Path, number: int, seed: int) -> None:
    """Write the models of runs."""
    for k in range(0, number, MONTHS):
        machine = Machine(model, [seed, number, k // MONTHS])
        for month in range(min(MONTHS, number - k)):
            run = folder / "plant" / f"machine-{k // MONTHS}" / f"run-{month}"
            run.mkdir(parents=True)
            machine.run(month).save(run / "model.yaml")


def index_models(folder: Path, number: int, seed: int) -> None:
    """Keep time and memory of an index of models."""
    shutil.rmtree(folder / "index", ignore_errors=True)
    command = [sys.executable, "-m", "hil", "fleet", "index", "plant", "-o", "index"]
    begun = time.perf_counter()
    subprocess.run(command, cwd=folder, check=True)
    taken = time.perf_counter() - begun
    rows = sum(
        parquet.read_metadata(each).num_rows for each in (folder / "index").glob("*/*.parquet")
    )
    memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e6
    print(f"{number} models, {rows} rows: {taken:.1f} s, {memory:.2f} GB in one process")
    kept = {
        "models": Figure.count(number),
        "rows": Figure.count(rows),
        "index": Figure(taken, "s"),
        "memory": Figure(memory, "GB"),
    }
    command_kept = f"python benchmarks/fleet.py --models {number} --seed {seed}"
    depends = ("hil/commands/fleet.py", "hil/results/model_file.py", "checked_files/yaml_lines.py")
    keep("fleet-index", kept, depends=depends, command=command_kept, seeds=(seed,))


def judge_machines(model: hil.Model, folder: Path, machines: list[int], seed: int) -> None:
    """Simulate machines, and keep false alarms, wear found and times of queries."""
    kept: dict[str, Figure] = {}
    digest, n_joints = model.provenance.robot_digest, model.robot.n_joints
    for number in machines:
        index, n_rows, writing = folder / f"{number}.parquet", 0, 0.0
        worn = [(f"worn-{1 + k % n_joints}-{k}", 1 + k % n_joints) for k in range(WORN)]
        unchanged = [(f"unchanged-{k}", 0) for k in range(number)]
        for k, (machine, axis) in enumerate([*unchanged, *worn]):
            drawn = Machine(model, [seed, number, k], axis)
            rows = rows_of(machine, drawn)
            begun = time.perf_counter()
            write_part(index, digest, machine, [table_of(rows)])
            writing, n_rows = writing + time.perf_counter() - begun, n_rows + len(rows)
        begun = time.perf_counter()
        ask(fleets := read_fleets(index), RATE)
        asking = time.perf_counter() - begun
        (fleet,) = fleets.values()
        false, found = judged(fleet)
        early = [each for each in found.values() if each < GROWTH / 2]
        late = Counter(n.split("-")[1] for n, each in found.items() if each >= GROWTH / 2)
        print(
            f"{number} machines, {n_rows} rows written in {writing:.0f} s, asked in"
            f" {asking:.1f} s: {false:.2f} false alarms per machine and decade; wear found"
            f" before half on {len(early)} of {WORN}, median growth"
            f" {100 * np.median(list(found.values())):.1f} %; later by axis: {dict(late)}"
        )
        kept |= {
            f"{number}-false": Figure(false, ""),
            f"{number}-early": Figure.count(len(early)),
            f"{number}-query": Figure(asking, "s"),
        }
    print(f"at most {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3:.0f} MB of memory")
    numbers = " ".join(map(str, machines))
    command = f"python benchmarks/fleet.py --machines {numbers} --seed {seed}"
    depends = ("hil/results/fleet_index.py", "hil/results/changes.py", "hil/commands/fleet.py")
    keep("fleet", kept, depends=depends, command=command, seeds=(seed,))


if __name__ == "__main__":
    main()
