"""Network of the plant's drives with injected faults, with the interface of `SlaveNetwork`.

Every frame is counted, due faults begin and expired faults end. Active faults process each frame on
its way to the drives, in the order of the plan, and all frames from the drives. A SYNC that does
not reach the drives lets its cycle of time pass nevertheless: motions and watchdogs of the drives
do not wait for the master.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim_plant.faults import drive_faults, frame_faults, interlock_faults
from sim_plant.faults.fault_plan import What
from sim_plant.faults.frame_faults import NotSent
from sim_plant.faults.machine_faults import FaultyMachine
from sim_plant.faults.schedule import FaultSchedule
from sim_plant.slave_network import CYCLE_DEFAULT, SlaveNetwork

if TYPE_CHECKING:
    from sim_plant.drive.cia402_node import Cia402Node
    from sim_plant.faults.fault_plan import FaultPlan
    from sim_plant.faults.injection import Injection, NodeInjection
    from sim_plant.plant import Plant
    from sim_plant.slave_network import CanFrame, Clock

DRIVE_FAULTS: dict[What, type[NodeInjection]] = {
    What.WARNING: drive_faults.Warned,
    What.FAULT: drive_faults.Failed,
    What.NODE_RESET: drive_faults.Reset,
    What.BUS_OFF: drive_faults.NodeBusOff,
    What.VOLTAGE_LOST: drive_faults.VoltageLost,
    What.STO_ACTIVE: interlock_faults.TorqueOff,
    What.SUPPLY_LOST: drive_faults.SupplyLost,
    What.ENCODER_JUMP: drive_faults.EncoderJump,
    What.CURRENT_OFFSET: drive_faults.CurrentOffset,
    What.CURRENT_CLIPPED: drive_faults.CurrentClipped,
    What.CURRENT_STUCK: drive_faults.CurrentStuck,
    What.POSITION_SLOW: drive_faults.PositionSlow,
    What.CURRENT_SLOW: drive_faults.CurrentSlow,
    What.BRAKE_CLOSED: drive_faults.BrakeClosed,
    What.AXIS_WEAK: drive_faults.AxisWeak,
    What.PUSH: drive_faults.Pushed,
    What.QUICK_STOP_IGNORED: drive_faults.QuickStopIgnored,
    What.DISABLE_VOLTAGE_IGNORED: drive_faults.DisableVoltageIgnored,
    What.STOP_WITHOUT_EFFECT: drive_faults.StopWithoutEffect,
}
"""Faults of drives, sensors and motors, on any bus."""

KINDS: dict[What, type[Injection]] = {
    **DRIVE_FAULTS,
    What.TPDO_LOST: frame_faults.TpdoLost,
    What.TPDO_DOUBLED: frame_faults.TpdoDoubled,
    What.TPDO_LATE: frame_faults.TpdoLate,
    What.SDO_SILENT: frame_faults.SdoSilent,
    What.SDO_ABORTED: frame_faults.SdoAborted,
    What.HEARTBEAT_LOST: frame_faults.HeartbeatLost,
    What.MASTER_HEARTBEAT_LOST: frame_faults.MasterHeartbeatLost,
    What.CABLE_CUT: frame_faults.CableCut,
    What.ADAPTER_BUS_OFF: frame_faults.AdapterBusOff,
    What.TRANSMIT_OUTAGE: frame_faults.TransmitOutage,
    What.RECEIVE_OUTAGE: frame_faults.ReceiveOutage,
}


class FaultyNetwork(FaultSchedule[SlaveNetwork]):
    """Drives of a plant with injected faults.

    Parameters
    ----------
    plant : Plant
        Machine of the drives.
    clock : {"sync", "wall"}
        See `sim_plant.slave_network`.
    plan : FaultPlan
        Planned faults, possibly none; `add` adds further faults.
    cycle : float
        As for `SlaveNetwork`.

    Attributes
    ----------
    nodes : tuple of Cia402Node

    Raises
    ------
    FileError
        A fault of an axis that the plant does not have.
    """

    def __init__(
        self, plant: Plant, clock: Clock, plan: FaultPlan, cycle: float = CYCLE_DEFAULT
    ) -> None:
        self._clock = clock
        machine = FaultyMachine(plant)
        super().__init__(SlaveNetwork(machine, clock, cycle), machine, KINDS, plan)

    @property
    def nodes(self) -> tuple[Cia402Node, ...]:
        """Drives in joint order."""
        return self._network.nodes

    def power_on(self) -> list[CanFrame]:
        """Boot all drives."""
        return self._network.power_on()

    def receive(self, identifier: int, data: bytes) -> list[CanFrame]:
        """Process a data frame with 11-bit identifier; return the frames of the drives.

        Raises
        ------
        NotSent
            The frame is not sent; the exception contains frames sent by the drives in the meantime.
        """
        sync = identifier == self.nodes[0].sync_identifier
        self.progress.frames += 1
        self.progress.syncs += sync
        self.progress.between = not sync
        held = self._update()
        try:
            answer = self._intercepted(identifier, data)
        except NotSent as refused:
            refused.frames = held + self._unheard(sync=sync)
            raise
        if answer is None:
            return held + self._passed_on(list(self._network.receive(identifier, data)))
        return held + answer + self._unheard(sync=sync)

    def receive_remote(self, identifier: int) -> list[CanFrame]:
        """Process a remote frame; return the frames of the drives.

        Raises
        ------
        NotSent
            As `receive`.
        """
        self.progress.frames += 1
        self.progress.between = True
        held = self._update()
        answer = self._intercepted(identifier, b"")
        if answer is not None:
            return held + answer
        return held + self._passed_on(self._network.receive_remote(identifier))

    def elapse(self, duration: float) -> list[CanFrame]:
        """Let time pass without SYNC [s]; return the frames of the drives."""
        self.progress.between = True
        held = self._update()
        return held + self._passed_on(self._network.elapse(duration))

    def _intercepted(self, identifier: int, data: bytes) -> list[CanFrame] | None:
        """Return the answer of a fault in place of the drives, None if the frame reaches them."""
        for _, injection in self._present:
            answer = injection.incoming(identifier, data)
            if answer is not None:
                return answer
        return None

    def _unheard(self, *, sync: bool) -> list[CanFrame]:
        """Let the time of a lost frame pass; return the frames of the drives."""
        if not (sync and self._clock == "sync"):
            return []
        return self._passed_on(self._network.elapse(self._network.cycle))

    def _passed_on(self, frames: list[CanFrame]) -> list[CanFrame]:
        for _, injection in self._present:
            frames = injection.outgoing(frames)
        return frames
