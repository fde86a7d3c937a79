"""Robot time per wall time of a campaign over CANopen, recorded to disk, on two buses in turn.

The same minute of motion is measured with the whole program (sequencer, driver, CAN frames, drives,
physics, checks, run folder) once over ``sim_plant``, where the plant keeps step with SYNC inside
``send``, and once over python-can's stock ``virtual`` bus with the plant served by a thread. Both
run in lock-step, so each is as fast as possible. Drive switch-on is not counted. The buses take
turns, so that a busy machine slows both; the table shows medians and the best run.

The cost of each layer is measured in a separate run, with a stopwatch around the layer's entry; the
figures contain the cost of the stopwatches::

    python benchmarks/campaign.py
"""

from __future__ import annotations

import itertools
import tempfile
import threading
import time
from collections import defaultdict
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING
from unittest import mock

import can
from figures import Figure, keep
from rich.console import Console
from rich.table import Table

from drivers.canopen.bus import CanopenBus
from drivers.canopen.process_data import SyncProcessData
from drivers.drives_file import load_drives
from drivers.opening import open_drive_bus
from drivers.session.servo_axes import ServoAxes
from hil.measuring.campaign import run_campaign
from hil.measuring.sequencer import Finished, Started
from hil.model.robot import ROBOTS, Robot
from hil.planning.design.by_counts import design
from hil.planning.timetable import timetable
from hil.runs.run_folder import RunFolder
from sim_plant.plant import Plant, load_plant
from sim_plant.serving.bus import PlantBus
from sim_plant.serving.server import serve
from sim_plant.slave_network import SlaveNetwork

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from hil.planning.measurement import Measurement
    from hil.planning.plan import Plan

ROBOT = "manutec-r15"
DURATION = 60.0
"""Duration of the measured motion [s]."""
REPEATS = 7

robot = Robot.load(ROBOT)
drives = load_drives(ROBOTS / f"{ROBOT}.drives.yaml")


def minute() -> Plan:
    """Return a part of the designed campaign of about `DURATION`, with all kinds."""
    whole = design(robot)
    kinds: dict[str, list[Measurement]] = {}
    for measurement in whole.measurements:
        kinds.setdefault(measurement.kind, []).append(measurement)
    taken, time_left = [], DURATION
    for measurement in itertools.chain(*zip(*kinds.values(), strict=False)):
        if measurement.duration < time_left:
            taken.append(measurement)
            time_left -= measurement.duration
    return whole.model_copy(update={"measurements": tuple(taken)})


@contextmanager
def open_in_step() -> Iterator[ServoAxes]:
    """Open a bus with the plant inside `send`."""
    yield open_drive_bus(drives, "sim_plant", ROBOT)


@contextmanager
def open_in_thread() -> Iterator[ServoAxes]:
    """Open a bus with the plant in a thread behind python-can's ``virtual`` bus."""
    stop = threading.Event()
    with (
        can.Bus(interface="virtual", channel="campaign") as plant_side,
        can.Bus(interface="virtual", channel="campaign") as our_side,
    ):
        arguments = (plant_side, load_plant(ROBOT), "sync", stop)
        server = threading.Thread(target=serve, args=arguments)
        server.start()
        try:
            yield ServoAxes(CanopenBus(our_side, "lock-step"), drives)
        finally:
            stop.set()
            server.join()


def measure(
    plan: Plan, bus: ServoAxes, started: Callable[[], None] = lambda: None
) -> tuple[float, float]:
    """Carry out the plan into a temporary folder; return robot time and wall time [s].

    `started` is called when the drives are on and nothing has moved yet.
    """
    with tempfile.TemporaryDirectory() as place:
        folder = RunFolder.create(Path(place) / "run", plan, robot)
        for event in run_campaign(folder, bus):
            if isinstance(event, Started):
                started()
                wall, robot_time = -time.perf_counter(), -event.time
            if isinstance(event, Finished):
                wall += time.perf_counter()
                robot_time += event.time
                assert not event.gave_up, f"measured with findings: {event.gave_up}"
    return robot_time, wall


class Stopwatch:
    """Stopwatch for functions, without the time of watched functions inside."""

    def __init__(self) -> None:
        self.spent: defaultdict[str, float] = defaultdict(float)
        self._of_thread = threading.local()

    def watch(self, what: str, function: Callable[..., object]) -> Callable[..., object]:
        """Return `function` with time measurement."""
        clock = time.perf_counter

        def watched(*args: object, **kwargs: object) -> object:
            mine = self._of_thread.__dict__
            outer = mine.get("inside", 0.0)
            mine["inside"] = 0.0
            begin = clock()
            try:
                return function(*args, **kwargs)
            finally:
                whole = clock() - begin
                self.spent[what] += whole - mine["inside"]
                mine["inside"] = outer + whole

        return watched


LAYERS = (
    ("driver", ServoAxes, "sample"),
    ("driver", ServoAxes, "samples"),
    ("driver", ServoAxes, "move"),
    ("reception of frames, bus and driver", SyncProcessData, "_collect"),
    ("sending of frames, bus", PlantBus, "send"),
    ("sending of frames, bus", PlantBus, "send_repeatedly"),
    ("drives", SlaveNetwork, "receive"),
    ("drives", SlaveNetwork, "receive_repeatedly"),
    ("physics", Plant, "advance"),
    ("physics", Plant, "advance_quietly"),
    ("physics", Plant, "read"),
)


def split(plan: Plan) -> tuple[dict[str, float], float]:
    """Return the cost of each layer and of the whole [us per SYNC]."""
    stopwatch = Stopwatch()
    with ExitStack() as patches, open_in_step() as bus:
        for what, owner, name in LAYERS:
            watched = stopwatch.watch(what, getattr(owner, name))
            patches.enter_context(mock.patch.object(owner, name, watched))
        robot_time, wall = measure(plan, bus, stopwatch.spent.clear)
    syncs = robot_time / drives.sync_period
    costs = {what: stopwatch.spent[what] / syncs * 1e6 for what, *_ in LAYERS}
    return costs, wall / syncs * 1e6


def main() -> None:
    """Measure and print speeds and costs."""
    plan = minute()
    out = Console()
    table = timetable(plan, robot, plan.measurements)
    moved = sum(entry.travel + entry.duration for entry in table)
    out.print(
        f"{len(plan.measurements)} measurements, {moved:.0f} s of motion, SYNC every"
        f" {drives.sync_period * 1e3:g} ms, recorded to {tempfile.gettempdir()}"
    )
    speeds: dict[str, list[float]] = {"sim_plant, in step": [], "virtual, plant in a thread": []}
    for _ in range(REPEATS):
        for speed, open_bus in zip(speeds.values(), (open_in_step, open_in_thread), strict=True):
            with open_bus() as bus:
                robot_time, wall = measure(plan, bus)
            speed.append(robot_time / wall)
    kept = show_speeds(speeds, out) | show_split(*split(plan), out)
    depends = ("drivers", "sim_plant", "hil/measuring", "hil/runs")
    keep("campaign", kept, depends=depends, command="python benchmarks/campaign.py")


def show_speeds(speeds: dict[str, list[float]], out: Console) -> dict[str, Figure]:
    """Print robot time per wall time, and return it."""
    table = Table("bus", "robot time / wall time", "best", "us per SYNC")
    for name, values in speeds.items():
        middle = median(values)
        each = drives.sync_period / middle * 1e6
        table.add_row(name, f"{middle:.0f}", f"{max(values):.0f}", f"{each:.1f}")
    out.print(table)
    kept = {
        key: Figure.median(values, "times")
        for key, values in zip(("in-step", "in-thread"), speeds.values(), strict=True)
    }
    ratios = [ours / stock for ours, stock in zip(*speeds.values(), strict=True)]
    out.print(f"in step is {median(ratios):.1f} times as fast")
    return kept | {"in-step-over-thread": Figure.median(ratios, "times")}


def show_split(costs: dict[str, float], whole: float, out: Console) -> dict[str, Figure]:
    """Print the cost of each layer, and return it."""
    table = Table("layer", "us per SYNC")
    rest = {"sequencer, recorder, checks": whole - sum(costs.values())}
    every = costs | rest | {"all, stopwatches included": whole}
    for what, cost in every.items():
        table.add_row(what, f"{cost:.1f}")
    out.print(table)
    return {what.split(",")[0].replace(" ", "-"): Figure(us, "us") for what, us in every.items()}


if __name__ == "__main__":
    main()
