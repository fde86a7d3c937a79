"""The plant's drives with faults by plan: the same interface as `SlaveNetwork`, in front of one.

Every frame is counted, faults whose moment has come begin, those whose time is up end. Faults that
are present see each frame on its way to the drives, in the order of the plan, and all that the
drives send on its way back. A SYNC that does not reach the drives lets its cycle of time pass all
the same: the drives' motions and watchdogs do not wait for us.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim_plant.drive.cia402_states import Control
from sim_plant.faults import drive_faults, frame_faults, interlock_faults
from sim_plant.faults.fault_plan import What
from sim_plant.faults.frame_faults import NotSent
from sim_plant.faults.machine_faults import FaultyMachine
from sim_plant.faults.moment import Progress, Watch
from sim_plant.slave_network import CYCLE_DEFAULT, SlaveNetwork

if TYPE_CHECKING:
    from sim_plant.drive.cia402_node import Cia402Node
    from sim_plant.faults.fault_plan import Fault, FaultPlan
    from sim_plant.faults.injection import Injection
    from sim_plant.plant import Plant
    from sim_plant.slave_network import CanFrame, Clock

_INJECTIONS: dict[What, type[Injection]] = {
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
    What.BRAKE_CLOSED: drive_faults.BrakeClosed,
    What.AXIS_WEAK: drive_faults.AxisWeak,
    What.PUSH: drive_faults.Pushed,
    What.QUICK_STOP_IGNORED: drive_faults.QuickStopIgnored,
    What.DISABLE_VOLTAGE_IGNORED: drive_faults.DisableVoltageIgnored,
    What.STOP_WITHOUT_EFFECT: drive_faults.StopWithoutEffect,
}


class FaultyNetwork:
    """A plant's drives, with what goes wrong.

    Parameters
    ----------
    plant : Plant
        What the drives turn.
    clock : {"sync", "wall"}
        See `sim_plant.slave_network`.
    plan : FaultPlan
        May be empty; more can be added by `add`.
    cycle : float
        As for `SlaveNetwork`.

    Attributes
    ----------
    machine : FaultyMachine
    nodes : tuple of Cia402Node
    progress : Progress
        What has been counted.

    Raises
    ------
    FileError
        A fault of an axis that the plant does not have.
    """

    def __init__(
        self, plant: Plant, clock: Clock, plan: FaultPlan, cycle: float = CYCLE_DEFAULT
    ) -> None:
        plan.check_axes(len(plant.axes))
        self.machine = FaultyMachine(plant)
        self.progress = Progress()
        self._clock = clock
        self._network = SlaveNetwork(self.machine, clock, cycle)
        self._waiting: list[tuple[Watch, Injection]] = []
        self._present: list[tuple[Watch, Injection]] = []
        self._controlwords = [0] * len(self.nodes)
        for axis, node in enumerate(self.nodes):
            self._count_set_points(axis, node)
        for fault in plan.faults:
            self.add(fault)

    @property
    def time(self) -> float:
        """Time since power-on [s]."""
        return self._network.time

    @property
    def nodes(self) -> tuple[Cia402Node, ...]:
        """The drives in joint order."""
        return self._network.nodes

    @property
    def present(self) -> tuple[Fault, ...]:
        """What is wrong now."""
        return tuple(injection.fault for _, injection in self._present)

    def add(self, fault: Fault) -> None:
        """Let one more thing go wrong."""
        injection = _INJECTIONS[fault.what](fault, self._network, self.machine)
        self._waiting.append((Watch(fault), injection))

    def power_on(self) -> list[CanFrame]:
        """Boot all drives."""
        return self._network.power_on()

    def receive(self, identifier: int, data: bytes) -> list[CanFrame]:
        """Take a data frame with 11-bit identifier; return what the drives send.

        Raises
        ------
        NotSent
            The frame is not sent; what the drives send meanwhile comes with the exception.
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
            return held + self._passed_on(self._network.receive(identifier, data))
        return held + answer + self._unheard(sync=sync)

    def receive_remote(self, identifier: int) -> list[CanFrame]:
        """Take a remote frame; return what the drives send.

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
        """Let time pass without SYNC [s]; return what the drives send meanwhile."""
        self.progress.between = True
        held = self._update()
        return held + self._passed_on(self._network.elapse(duration))

    def _intercepted(self, identifier: int, data: bytes) -> list[CanFrame] | None:
        """Return what a fault answers in the drives' place, None if the frame reaches them."""
        for _, injection in self._present:
            answer = injection.incoming(identifier, data)
            if answer is not None:
                return answer
        return None

    def _unheard(self, *, sync: bool) -> list[CanFrame]:
        """Let the time of a frame pass that the drives do not get; return what they send."""
        if not (sync and self._clock == "sync"):
            return []
        return self._passed_on(self._network.elapse(self._network.cycle))

    def _update(self) -> list[CanFrame]:
        """Let faults begin and end; return frames that those which end have held back."""
        self.progress.time = self._network.time
        held: list[CanFrame] = []
        for watched in tuple(self._present):
            if not watched[0].present(self.progress):
                self._present.remove(watched)
                held += watched[1].end()
        for watched in tuple(self._waiting):
            if watched[0].present(self.progress):
                self._waiting.remove(watched)
                self._present.append(watched)
                watched[1].begin()
        return held

    def _passed_on(self, frames: list[CanFrame]) -> list[CanFrame]:
        for _, injection in self._present:
            frames = injection.outgoing(frames)
        return frames

    def _count_set_points(self, axis: int, node: Cia402Node) -> None:
        def count(_subindex: int, word: int) -> None:
            risen = word & ~self._controlwords[axis]
            self._controlwords[axis] = word
            if risen & Control.NEW_SET_POINT:
                given = self.progress.set_points
                given[axis + 1] = given.get(axis + 1, 0) + 1

        node.dictionary.react(0x6040, count)
