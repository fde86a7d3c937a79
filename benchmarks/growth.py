"""Growth of the cost of commands with the axes of a robot, and with the number of its campaigns.

Robots of 2 to 7 axes are derived from the manutec-r15 by omission of the last axes, or by an
additional hand joint, in robot file, drives file and plant file. For each robot a plan with the
same small number of measurements is designed and measured. Then several campaigns of the whole
robot, each with other noise, are identified together. The tables have the processor time (user and
system) of whole processes, and for growing plans also the time per measurement.

    python benchmarks/growth.py [--times 3]
"""

from __future__ import annotations

import argparse
import tempfile
from copy import deepcopy
from importlib import resources
from pathlib import Path
from typing import Any

import yaml
from figures import Figure, keep
from rich.console import Console
from rich.table import Table
from start_up import PROGRAM, processor_time

from hil.model.robot import ROBOTS

NAME = "manutec-r15"
AXES = range(2, 8)
COUNTS = ("--gravity", "8", "--inertia", "14", "--coupling", "4")
"""Numbers of measurements in the plan of every robot."""
CAMPAIGNS = (1, 2, 4)


def files(n: int, place: Path) -> dict[str, Path]:
    """Write robot, drives and plant of the first `n` axes; the seventh is another hand joint."""
    sources = {
        "robot": ROBOTS / f"{NAME}.yaml",
        "drives": ROBOTS / f"{NAME}.drives.yaml",
        "plant": Path(str(resources.files("sim_plant") / "plants" / f"{NAME}.yaml")),
    }
    found = {}
    for what, source in sources.items():
        data = yaml.safe_load(source.read_text())
        axes = data["joints" if what == "robot" else "axes"]
        if n > len(axes):
            axes.append(_hand_joint(axes[-1], n))
        del axes[n:]
        if n < 6:
            data.pop("ties", None)
        data["name"] = f"{NAME}-{n}"
        if what == "drives":
            del data["name"]
        found[what] = place / f"{what}-{n}.yaml"
        found[what].write_text(yaml.safe_dump(data, sort_keys=False))
    return found


def _hand_joint(last: dict[str, Any], number: int) -> dict[str, Any]:
    """Return a further axis behind the axis `last`, at right angles to it."""
    added = deepcopy(last)
    if "capsule" in added:  # of a robot file
        return {**added, "frame": {"alpha": "-pi/2"}}
    added["name"] = f"joint {number}"
    if "drive" in added:  # of a plant file
        added["frame"] = {"alpha_deg": -90}
        added["link"] = {"Izz": 0.1}
        added["drive"]["node"] = number
    else:
        added["node"] = number
    return added


def spent(*arguments: str | Path) -> float:
    """Return the processor time of a command [s]."""
    return processor_time((*PROGRAM, *map(str, arguments)), {})


def grow_axes(place: Path, times: int, out: Console) -> dict[str, Figure]:
    """Print and return the cost of plan and campaign for robots with increasing numbers of axes."""
    kept: dict[str, Figure] = {}
    table = Table("axes", "plan [s]", "run [s]", "measurements", "run, a measurement [ms]")
    for n in AXES:
        made, plan = files(n, place), place / f"plan-{n}.yaml"
        designed = []
        for _ in range(times):
            plan.unlink(missing_ok=True)
            designed.append(spent("plan", made["robot"], "-o", plan, *COUNTS))
        measurements = len(yaml.safe_load(plan.read_text())["measurements"])
        drives = "--drives", made["drives"], "--channel", made["plant"], "--robot", made["robot"]
        ran = spent("run", plan, "-o", place / f"run-{n}", *drives)
        each, design = 1e3 * ran / measurements, Figure.median(designed, "s")
        row = f"{design.value:.2f}", f"{ran:.1f}", f"{measurements}", f"{each:.0f}"
        table.add_row(str(n), *row)
        kept |= {f"axes-{n}-plan": design, f"axes-{n}-run": Figure(ran, "s")}
        kept[f"axes-{n}-run-of-a-measurement"] = Figure(each, "ms")
    out.print(table)
    return kept


def grow_campaigns(place: Path, times: int, out: Console) -> dict[str, Figure]:
    """Print and return the cost of identification from several campaigns."""
    plan, runs = place / "plan.yaml", [place / f"run {k}" for k in range(max(CAMPAIGNS))]
    spent("plan", NAME, "-o", plan)
    for seed, run in enumerate(runs):
        spent("run", plan, "-o", run, "--bus-option", f"seed={seed + 1}")
    kept = {}
    table = Table("campaigns", "identify [s]", "a campaign [s]")
    for n in CAMPAIGNS:
        others = [argument for run in runs[1:n] for argument in ("--with", run)]
        figure = Figure.median([spent("identify", runs[0], *others) for _ in range(times)], "s")
        table.add_row(str(n), f"{figure.value:.2f}", f"{figure.value / n:.2f}")
        kept[f"campaigns-{n}-identify"] = figure
    out.print(table)
    return kept


def main() -> None:
    """Measure, print and keep both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=3)
    times = parser.parse_args().times
    with tempfile.TemporaryDirectory() as place:
        kept = grow_axes(Path(place), times, Console())
        kept |= grow_campaigns(Path(place), times, Console())
    keep(
        "growth", kept, depends=("hil", "drivers", "sim_plant"),
        command=f"python benchmarks/growth.py --times {times}",
    )  # fmt: skip


if __name__ == "__main__":
    main()
