"""One fault, or a few, in the middle of a small campaign, with everything looked at.

The driver works on a bus in lock-step that logs all frames and notes the true state of the machine
at every SYNC. So it is known when the first frame showed the fault, when each axis was commanded to
stop, and which samples were wrong.
"""

from __future__ import annotations

import struct
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import can
import numpy as np

from drivers.canopen_bus import CanopenDriveBus
from drivers.cia402 import Command, State, decode_state
from drivers.drive_bus import DriveError
from drivers.drives_file import load_drives
from drivers.pdo_mapping import received, transmitted
from hil.measuring.events import GaveUp, Recorded, Repeated
from hil.measuring.sequencer import measure
from hil.model.robot import ROBOTS, load_robot
from hil.planning.measurement import Gravity
from hil.planning.plan import Plan, PlannedRobot
from sim_plant.faults.fault_plan import FaultPlan
from sim_plant.faults.faulty_network import FaultyNetwork
from sim_plant.physics import state as st
from sim_plant.plant import load_plant

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.drive_bus import Sample
    from sim_plant.faults.fault_plan import Fault

ROBOT = "manutec-r15"
AXIS = 2
"""The axis that is measured, and that fails."""
SYNC = 0x80
SETTLING = 3.0
"""How long drives are left alone afterwards, to react by themselves [s]."""
STEP = 0.01

_STOPS = {Command.QUICK_STOP.value[0], Command.DISABLE_VOLTAGE.value[0]}
_RPDO = struct.Struct("<iH")

robot = load_robot(ROBOT)
drives = load_drives(ROBOTS / f"{ROBOT}.drives.yaml")
plan = Plan(
    robot=PlannedRobot(name=robot.name, digest=robot.digest),
    attempts=2,
    measurements=(
        Gravity(
            id="g", axis=AXIS, q=(0.0,) * 6, stroke=0.4, velocity=0.5, acceleration=8.0, cycles=2
        ),
    ),
)


class Seen(NamedTuple):
    """A frame on the bus, and the number of SYNCs before it (its own included)."""

    sync: int
    ours: bool
    identifier: int
    data: bytes


class LoggedBus(can.BusABC):
    """The faulty plant as a python-can bus in lock-step that logs every frame.

    Attributes
    ----------
    log : list of Seen
    began : int or None
        Length of the log when the first fault began.
    off_after : float or None
        Time from there until no axis was energised [s].
    """

    lock_step = True

    def __init__(self, faults: Sequence[Fault]) -> None:
        super().__init__("faulty plant")
        self.channel_info = "faulty plant"
        self.plant = load_plant(ROBOT)
        self.network = FaultyNetwork(self.plant, "sync", FaultPlan(faults=tuple(faults)))
        self.log: list[Seen] = []
        self.began: int | None = None
        self.off_after: float | None = None
        self._began_at = 0.0
        self._syncs = 0
        self._inbox: deque[can.Message] = deque()
        self.network.power_on()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002
        """Pass a frame to the drives."""
        self._syncs += msg.arbitration_id == SYNC
        here = len(self.log)
        self.log.append(Seen(self._syncs, True, msg.arbitration_id, bytes(msg.data)))
        try:
            frames = self.network.receive(msg.arbitration_id, bytes(msg.data))
        finally:
            self._look(here)
        for _, identifier, data in frames:
            self.log.append(Seen(self._syncs, False, identifier, data))
            self._inbox.append(
                can.Message(arbitration_id=identifier, data=data, is_extended_id=False)
            )

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:  # noqa: ARG002
        return (self._inbox.popleft() if self._inbox else None), False

    def leave_alone(self) -> None:
        """Let time pass without us."""
        for _ in range(round(SETTLING / STEP)):
            self.network.elapse(STEP)
            self._look(len(self.log))

    @property
    def all_off(self) -> bool:
        """No axis is energised and none moves."""
        state = self.plant.state
        return not state[:, st.ENABLED].any() and bool(np.all(np.abs(state[:, st.QD]) < 1e-3))

    def _look(self, here: int) -> None:
        if self.began is None and self.network.present:
            self.began, self._began_at = here, self.network.time
        if self.began is not None and self.off_after is None and self.all_off:
            self.off_after = self.network.time - self._began_at


class AuditedBus(CanopenDriveBus):
    """The driver, each sample of which is compared with the truth.

    Attributes
    ----------
    wrong : dict
        By time of the sample, which axes were wrong and not flagged.
    flagged : int
        Samples with a flag.
    """

    def __init__(self, bus: LoggedBus) -> None:
        super().__init__(bus, drives)
        self._plant = bus.plant
        self.wrong: dict[float, np.ndarray] = {}
        self.flagged = 0
        const = self._plant.const
        self._increment = 2.0 / np.abs(const[:, st.COUNTS_PER_RAD])
        self._noise = 6.0 * const[:, st.NOISE] + np.abs(const[:, st.CURRENT_PER_MILLE])

    def sample(self) -> Sample:
        """Return the sample, having looked at it."""
        sample = super().sample()
        state, flags = self._plant.state, np.array(sample.flags)
        wrong = np.abs(np.array(sample.q) - state[:, st.Q]) > self._increment
        wrong |= np.abs(np.array(sample.tau) - state[:, st.TORQUE]) > self._noise
        self.wrong[sample.time] = wrong & (flags == 0)
        self.flagged += bool(flags.any())
        return sample


@dataclass
class Outcome:
    """What came of a fault.

    Attributes
    ----------
    error : DriveError or None
        What ended the campaign.
    findings : list of str
        Names of the checks that a recording failed.
    kept, kept_with_findings : int
        Recordings.
    wrong : int
        Samples of kept recordings without findings that are wrong and not flagged.
    flagged : int
        Samples with a flag.
    notes : tuple of str
        What the operator was told beside.
    cycles : int or None
        SYNCs from the first frame that shows the fault to the last axis's command to stop.
    energised : bool
        Some axis was energised at all.
    off : bool
        At the end no axis is energised and none moves.
    off_after : float or None
        When that was, since the fault began [s].
    """

    error: DriveError | None = None
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

    @property
    def told(self) -> str:
        """What the operator reads."""
        if self.error is not None:
            return "\n".join([str(self.error), *getattr(self.error, "__notes__", ())])
        return "\n".join([*self.notes, *self.messages])


def stop_cycles(log: Sequence[Seen], shown: int) -> int | None:
    """Return SYNCs from frame number `shown` to the last axis's first command to stop."""
    waiting = {received(axis).cob_id for axis in drives.axes}
    for frame in log[shown:]:
        if frame.ours and frame.identifier in waiting and _RPDO.unpack(frame.data)[1] in _STOPS:
            waiting.remove(frame.identifier)
            if not waiting:
                return frame.sync - log[shown].sync
    return None


def energises(log: Sequence[Seen]) -> bool:
    """Whether any drive showed OPERATION ENABLED."""
    words = {transmitted(axis)[0].cob_id for axis in drives.axes}
    return any(
        decode_state(int.from_bytes(frame.data[:2], "little")) is State.OPERATION_ENABLED
        for frame in log
        if not frame.ours and frame.identifier in words
    )


def run(faults: Sequence[Fault]) -> tuple[Outcome, LoggedBus]:
    """Measure while something goes wrong; return what came of it, and the bus with its log."""
    outcome = Outcome()
    with LoggedBus(faults) as bus:
        drive_bus = AuditedBus(bus)
        try:
            with drive_bus:
                for event in measure(plan, robot, drive_bus):
                    _take(event, drive_bus, outcome)
        except DriveError as error:
            outcome.error = error
        bus.leave_alone()
    outcome.notes, outcome.flagged = drive_bus.notes, drive_bus.flagged
    outcome.energised, outcome.off = energises(bus.log), bus.all_off
    outcome.off_after = bus.off_after
    return outcome, bus


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
