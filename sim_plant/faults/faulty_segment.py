"""EtherCAT slaves of the plant with injected faults, with the interface of `Segment`.

Faults of drives, sensors and motors are those on CAN. A frame lost before the slaves still advances
the time by its cycle, and is counted.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim_plant.ethercat.frame import LOGICAL, datagrams
from sim_plant.ethercat.segment import Segment
from sim_plant.faults import segment_faults
from sim_plant.faults.fault_plan import What
from sim_plant.faults.faulty_network import DRIVE_FAULTS
from sim_plant.faults.machine_faults import FaultyMachine
from sim_plant.faults.schedule import FaultSchedule
from sim_plant.faults.segment_faults import SegmentInjection
from sim_plant.slave_network import CYCLE_DEFAULT

if TYPE_CHECKING:
    from collections.abc import Callable

    from sim_plant.faults.fault_plan import Fault, FaultPlan
    from sim_plant.faults.injection import Injection
    from sim_plant.plant import Plant
    from sim_plant.slave_network import Clock

KINDS: dict[What, Callable[[Fault, Segment, FaultyMachine], Injection]] = {
    **DRIVE_FAULTS,
    What.SDO_SILENT: segment_faults.MailboxStuck,
    What.SDO_ABORTED: segment_faults.RequestsAborted,
    What.CABLE_CUT: segment_faults.SegmentCut,
    What.SEGMENT_CUT: segment_faults.SegmentCut,
    What.TRANSMIT_OUTAGE: segment_faults.FramesNotThere,
    What.RECEIVE_OUTAGE: segment_faults.FramesNotBack,
    What.FRAMES_LOST: segment_faults.FramesLost,
    What.FRAME_LATE: segment_faults.FrameLate,
    What.AL_ERROR: segment_faults.AlError,
    What.ALIAS: segment_faults.Alias,
    What.CLOCK_DRIFT: segment_faults.ClockDrift,
}


class FaultySegment(FaultSchedule[Segment]):
    """EtherCAT slaves of a plant with injected faults.

    Parameters
    ----------
    plant : Plant
        Machine of the drives.
    clock : {"sync", "wall"}
        See `sim_plant.ethercat.segment`.
    plan : FaultPlan
        Planned faults, possibly none; `add` adds further faults.
    cycle : float
        As for `Segment`.

    Raises
    ------
    FileError
        A fault of an axis that the plant does not have, or one of CAN.
    """

    def __init__(
        self, plant: Plant, clock: Clock, plan: FaultPlan, cycle: float = CYCLE_DEFAULT
    ) -> None:
        self._clock = clock
        machine = FaultyMachine(plant)
        super().__init__(Segment(machine, clock, cycle), machine, KINDS, plan)

    def power_on(self) -> None:
        """Boot all drives."""
        self._network.power_on()

    def elapse(self, duration: float) -> None:
        """Let time pass [s]."""
        self.progress.between = True
        self._update()
        self._network.elapse(duration)

    def process(self, frame: bytes) -> bytes | None:
        """Return a frame after passing the slaves, None if the frame is lost."""
        cyclic = any(found.command in LOGICAL for found in datagrams(bytearray(frame)))
        self.progress.frames += 1
        self.progress.syncs += cyclic
        self.progress.between = not cyclic
        self._update()
        present = [found for _, found in self._present if isinstance(found, SegmentInjection)]
        passing: bytes | None = frame
        for injection in present:
            passing = None if passing is None else injection.there(passing)
        answer = None if passing is None else self._network.process(passing)
        if answer is None and cyclic and self._clock == "sync":
            self._network.elapse(self._network.cycle)
        for injection in present:
            answer = injection.back(answer)
        return answer
