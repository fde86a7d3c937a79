"""One campaign over CANopen and over EtherCAT, on the same plant with the same seed.

Both run in lock-step within this process, without wires. On EtherCAT a frame contains the values
latched at the previous frame, and a drive acts after a frame has passed. So a master sees the
effect of its commands two cycles later than on CAN, as on hardware, and its decisions are two
cycles later as well. To have the same decisions at the same instants, the CAN side is given its
inputs two SYNCs late; and since the buses need different numbers of cycles to start, the one that
is ready first waits. The remaining numbers must be equal, bit for bit::

    python benchmarks/same_campaign.py [COUNTS]
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from unittest import mock

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))

import numpy as np
from figures import Figure, keep
from plant_wire import PlantWire

from drivers.canopen.bus import CanopenBus
from drivers.canopen.process_data import SyncProcessData
from drivers.drives_file import load_drives
from drivers.ethercat.bus import EthercatBus
from drivers.session.servo_axes import ServoAxes
from drivers.session.session import Session
from hil.measuring.campaign import run_campaign
from hil.model.robot import ROBOTS, Robot
from hil.planning.design.by_counts import design
from hil.runs.journal import BusName
from hil.runs.run import Run
from hil.runs.run_folder import RunFolder
from sim_plant.ethercat.segment import Segment
from sim_plant.serving.bus import PlantBus
from sim_plant.switch_on import load_machine

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from drivers.drive_bus import DriveBus
    from hil.planning.plan import Plan
    from sim_plant.timed_network import TimedNetwork

ROBOT, SEED = "manutec-r15", 5
LATE = 2
"""Additional delay of feedback for a master on EtherCAT, relative to CAN [SYNCs]."""
COUNTS = {"gravity": 56, "inertia": 80, "coupling": 16}
"""Counts of the default plan: the whole campaign."""
SHORT, TURNS = {"gravity": 10, "inertia": 20, "coupling": 4}, 5
"""Counts of the plan for times on either bus, and number of
turns: single runs differ by a fifth.
"""

robot = Robot.load(ROBOT)
drives = load_drives(ROBOTS / f"{ROBOT}.drives.yaml")


class LateProcessData(SyncProcessData):
    """Process data of CAN with the delay of a master on EtherCAT: two SYNCs."""

    def sync(self) -> float:
        """Exchange, and return the data of two SYNCs ago."""
        if not hasattr(self, "_past"):
            self._past: deque[tuple[Any, ...]] = deque(maxlen=LATE + 1)
            self._instants: deque[float] = deque([self.time] * LATE, maxlen=LATE)
        latched = self._instants[-1]
        self.words, self.positions, self.currents = (
            self._true if self._past else (self.words, self.positions, self.currents)
        )
        instant = super().sync()
        self._instants.append(instant)
        self._true = self.words, self.positions, self.currents
        self._past.append(self._true)
        self.words, self.positions, self.currents = self._past[0]
        self.time = latched
        return latched

    def sync_ahead(self, times: int) -> None:
        """Exchange once."""
        del times
        self.sync()


class Start(NamedTuple):
    """State of a plant at the switch-on of its axes.

    Attributes
    ----------
    cycles : int
        Number of past cycles.
    readings : int
        Number of readings of the current sensors, each with separate noise.
    """

    cycles: int
    readings: int

    def ahead(self, other: Start) -> Start:
        """Return the lead of another plant in cycles, 0 without one."""
        pairs = zip(self, other, strict=True)
        return Start(*(max(0, theirs - ours) for ours, theirs in pairs))


AT_ONCE = Start(0, 0)


def measure_can(plan: Plan, folder: Path, waiting: Start = AT_ONCE) -> Start:
    """Measure over CAN; return the plant's state at the switch-on of axes."""
    with (
        PlantBus(ROBOT, seed=SEED) as bus,
        mock.patch("drivers.canopen.connection.SyncProcessData", LateProcessData),
    ):
        assert bus._plant is not None  # the plant behind the bus
        return measured(
            plan, folder, ServoAxes(CanopenBus(bus), drives), bus._plant._network, waiting
        )


def measure_ethercat(plan: Plan, folder: Path, waiting: Start = AT_ONCE) -> Start:
    """Measure over EtherCAT; return the plant's state at the switch-on of axes."""
    segment = Segment(load_machine(ROBOT, SEED))
    segment.power_on()
    bus = ServoAxes(EthercatBus(PlantWire(segment), "lock-step"), drives)
    return measured(plan, folder, bus, segment, waiting)


def measured(
    plan: Plan, folder: Path, bus: DriveBus, network: TimedNetwork, waiting: Start
) -> Start:
    """Measure a plan on a bus whose axes wait before the switch-on."""
    begun: list[Start] = []
    power_on, read = Session.power_on, network._machine.read
    readings = 0

    def counted() -> NDArray[np.int64]:
        nonlocal readings
        readings += 1
        return read()

    def patient(session: Session) -> None:
        for _ in range(waiting.cycles):
            session.connection.cycle()
        for _ in range(waiting.readings - waiting.cycles):
            read()
        begun.append(Start(round(network.time / drives.sync_period), readings))
        power_on(session)

    with mock.patch.object(Session, "power_on", patient):
        network._machine.read = counted
        for _ in run_campaign(RunFolder.create(folder, plan, robot), bus, BusName("sim_plant", "")):
            pass
    return begun[0]


def compared(counts: Mapping[str, int], folder: Path) -> tuple[int, int, float, float, Start]:
    """Return numbers of equal and of all data sets, both durations [s], and the wait on CAN."""
    plan = design(robot, counts)
    first = plan.model_copy(update={"measurements": plan.measurements[:1]})
    can, ethercat = (
        measure_can(first, folder / "can0"),
        measure_ethercat(first, folder / "ethercat0"),
    )
    waiting = can.ahead(ethercat)
    waiting = waiting._replace(readings=waiting.readings + 1)  # EtherCAT also reads before cycle 0
    begun = time.perf_counter()
    measure_can(plan, folder / "can", waiting)
    between = time.perf_counter()
    measure_ethercat(plan, folder / "ethercat", ethercat.ahead(can))
    took = between - begun, time.perf_counter() - between
    same = total = 0
    for ours, theirs in zip(Run.open(folder / "can"), Run.open(folder / "ethercat"), strict=True):
        for axis in range(robot.n_joints):
            pairs = (
                (getattr(ours.recording, name), getattr(theirs.recording, name))
                for name in ("q", "tau")
            )
            total += 1
            same += all(
                a.shape == b.shape and np.array_equal(a[:, axis], b[:, axis]) for a, b in pairs
            )
    return same, total, *took, waiting


def ethercat_over_can(folder: Path) -> Figure:
    """Return the ratio of the processor times of a short campaign over EtherCAT and over CAN."""
    plan = design(robot, SHORT)

    def took(measure: Callable[[Plan, Path], Start], name: str) -> float:
        begun = time.process_time()
        measure(plan, folder / name)
        return time.process_time() - begun

    return Figure.median(
        [
            took(measure_ethercat, f"ethercat-{k}") / took(measure_can, f"can-{k}")
            for k in range(TURNS)
        ]
    )


if __name__ == "__main__":
    counts = dict(zip(COUNTS, map(int, sys.argv[1:]), strict=False)) or COUNTS
    with tempfile.TemporaryDirectory() as name:
        same, total, can, ethercat, ahead = compared(counts, Path(name))
        ratio = ethercat_over_can(Path(name))
    print(f"{same} of {total} data sets identical; CAN waited before power-on for {ahead}")
    print(f"CAN {can:.1f} s, EtherCAT {ethercat:.1f} s, within this process, with recording")
    print(f"processor time of EtherCAT over that of CAN, {TURNS} turns: {ratio.stated}")
    keep(
        "same-campaign",
        {
            "identical": Figure.count(same),
            "data-sets": Figure.count(total),
            "ethercat-over-can": ratio,
            "can": Figure(can, "s"),
            "ethercat": Figure(ethercat, "s"),
        },
        depends=("drivers", "sim_plant"),
        command=" ".join(["python benchmarks/same_campaign.py", *map(str, counts.values())]),
        seeds=[SEED],
    )
