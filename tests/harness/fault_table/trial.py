"""One or more faults in the middle of a small campaign, with complete observation.

The driver works on a bus in lock-step that logs all frames and observes the machine. The log shows
the first frame with the fault, the stop command and the distance of each axis, the state of the
watchdogs, and the wrong samples.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from drivers.canopen.bus import CanopenBus
from drivers.canopen.pdo_mapping import received
from drivers.cia402.states import Command
from drivers.drive_bus import DriveError
from drivers.drives_file import load_drives
from drivers.ethercat.bus import EthercatBus
from drivers.session.servo_axes import ServoAxes
from fault_table.logged_bus import ROBOT, LoggedBus
from fault_table.logged_cable import LoggedCable
from fault_table.stopping_way import reaction_time
from hil.measuring.sequencer import GaveUp, Recorded, Repeated, measure
from hil.model.robot import ROBOTS, Robot
from hil.planning.measurement import Gravity
from hil.planning.plan import Plan, PlannedRobot
from sim_plant.physics import state as st

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.drive_bus import Sample
    from fault_table.case import Case
    from fault_table.logged_bus import Seen
    from fault_table.witness import Witness

AXIS = 2
"""Measured axis, which has the fault."""
FAST_AXIS = 1
"""Measured axis with the fault, where speed matters."""

_STOPS = {Command.QUICK_STOP.value[0], Command.DISABLE_VOLTAGE.value[0]}
_RPDO = struct.Struct("<iH")

robot = Robot.load(ROBOT)
drives = load_drives(ROBOTS / f"{ROBOT}.drives.yaml")


def _plan(axis: int, stroke: float, velocity: float, acceleration: float, cycles: int = 2) -> Plan:
    strokes = Gravity(
        id="g",
        axis=axis,
        q=(0.0,) * 6,
        stroke=stroke,
        velocity=velocity,
        acceleration=acceleration,
        cycles=cycles,
    )
    measured_by = PlannedRobot(name=robot.name, digest=robot.digest)
    return Plan(robot=measured_by, attempts=2, measurements=(strokes,))


SLOW = _plan(AXIS, stroke=0.4, velocity=0.5, acceleration=8.0)
MANY = _plan(AXIS, stroke=0.4, velocity=0.5, acceleration=8.0, cycles=6)
FAST = _plan(FAST_AXIS, stroke=2.4, velocity=2.4, acceleration=10.0)


class AuditedBus(ServoAxes):
    """Driver whose samples are compared with the truth.

    Parameters
    ----------
    seen : LoggedBus or LoggedCable
        Bus under the driver.

    Attributes
    ----------
    wrong : dict
        Axes with wrong values and no flag, by time of the sample.
    flagged : int
        Samples with a flag.
    """

    def __init__(self, seen: LoggedBus | LoggedCable) -> None:
        if isinstance(seen, LoggedBus):
            super().__init__(CanopenBus(seen), drives)
        else:  # an answer comes at once or never
            quick = drives.model_copy(update={"sdo_timeout": 0.05})
            super().__init__(EthercatBus(seen, "lock-step"), quick)
        self._seen = seen
        self.wrong: dict[float, np.ndarray] = {}
        self.flagged = 0
        const = seen.plant.const
        self._increment = 2.0 / np.abs(const[:, st.COUNTS_PER_RAD])
        self._noise = 6.0 * const[:, st.NOISE] + np.abs(const[:, st.CURRENT_PER_MILLE])

    def sample(self) -> Sample:
        """Return the sample after comparing it with the truth."""
        sample = super().sample()
        state, flags = self._seen.truth, np.array(sample.flags)
        wrong = np.abs(np.array(sample.q) - state[:, st.Q]) > self._increment
        wrong |= np.abs(np.array(sample.tau) - state[:, st.TORQUE]) > self._noise
        self.wrong[sample.time] = wrong & (flags == 0)
        self.flagged += bool(flags.any())
        return sample


@dataclass
class Outcome:
    """Outcome of a fault.

    Attributes
    ----------
    error : DriveError, KeyboardInterrupt or None
        Error that ended the campaign.
    findings : list of str
        Names of the checks that a recording failed.
    kept, kept_with_findings : int
        Number of kept recordings, and of those with findings.
    wrong : int
        Samples of kept recordings without findings that are wrong and not flagged.
    flagged : int
        Samples with a flag.
    notes : tuple of str
        Further messages to the operator.
    cycles : int or None
        SYNCs from the first frame that shows the fault to the last axis's command to stop.
    energised : bool
        True if an axis was energised at any time.
    off : bool
        True if at the end no axis is energised or moving.
    off_after : float or None
        Time from the start of the fault until all axes were off [s].
    ways, speeds : ndarray, shape (n_axes,)
        Distance and highest speed of each axis since the fault began; see
        `fault_table.witness.Witness`.
    unwatched : set of int
        Axes that were energised with their watchdog off at any time.
    """

    error: DriveError | KeyboardInterrupt | None = None
    findings: list[str] = field(default_factory=list)
    messages: list[str] = field(default_factory=list)
    kept: int = 0
    kept_with_findings: int = 0
    wrong: int = 0
    flagged: int = 0
    notes: tuple[str, ...] = ()
    cycles: int | None = None
    energised: bool = False
    off: bool = False
    off_after: float | None = None
    ways: np.ndarray = field(default_factory=lambda: np.zeros(6))
    speeds: np.ndarray = field(default_factory=lambda: np.zeros(6))
    unwatched: set[int] = field(default_factory=set)

    @property
    def text(self) -> str:
        """Text of the operator's messages."""
        if self.error is not None:
            return "\n".join([str(self.error), *getattr(self.error, "__notes__", ())])
        return "\n".join([*self.notes, *self.messages])


def stop_cycles(log: Sequence[Seen], shown: int) -> int | None:
    """Return SYNCs from frame number `shown` to the last axis's first stop command."""
    waiting = {received(axis).cob_id for axis in drives.axes}
    for frame in log[shown:]:
        if frame.ours and frame.identifier in waiting and _RPDO.unpack(frame.data)[1] in _STOPS:
            waiting.remove(frame.identifier)
            if not waiting:
                return frame.sync - log[shown].sync
    return None


def run(case: Case, *, ethercat: bool = False) -> tuple[Outcome, LoggedBus | LoggedCable]:
    """Run a campaign with faults; return the outcome, and the bus with its log."""
    outcome = Outcome()
    seen: LoggedBus | LoggedCable
    reaction = reaction_time(case.outage, drives)
    if ethercat:
        seen = LoggedCable(
            case.faults,
            interrupted=case.interrupted,
            reaction=reaction,
            changed=case.changed,
            unnoticed=case.unnoticed,
        )
    else:
        seen = LoggedBus(
            case.faults,
            case.condition,
            interrupted=case.interrupted,
            reaction=reaction,
            foreign=case.foreign,
        )
    with seen as bus:
        drive_bus = AuditedBus(bus)
        try:
            with drive_bus:
                for event in measure(case.plan, robot, drive_bus):
                    _take(event, drive_bus, outcome)
        except (DriveError, KeyboardInterrupt) as error:
            outcome.error = error
        bus.leave_alone()
    outcome.notes, outcome.flagged = drive_bus.notes, drive_bus.flagged
    _testify(bus.witness, outcome)
    return outcome, bus


def _testify(witness: Witness, outcome: Outcome) -> None:
    outcome.energised, outcome.off = witness.energised, witness.all_off
    outcome.off_after, outcome.unwatched = witness.off_after, witness.unwatched
    outcome.ways, outcome.speeds = witness.ways, witness.speeds


def _take(event: object, bus: AuditedBus, outcome: Outcome) -> None:
    match event:
        case Repeated() | GaveUp():
            outcome.findings += [finding.check for finding in event.findings]
            outcome.messages += [finding.message for finding in event.findings]
        case Recorded():
            outcome.kept += 1
            outcome.kept_with_findings += bool(event.findings)
            if not event.findings:
                times = event.recording.time.tolist()
                outcome.wrong += sum(bool(bus.wrong[time].any()) for time in times)
