"""Base of all fault injections: effect of a fault while present.

An injection can begin, end, keep a frame from the drives, and change what the drives send.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim_plant.canopen.cob_id import IDENTIFIER, INVALID

if TYPE_CHECKING:
    from sim_plant.faults.fault_plan import Fault
    from sim_plant.faults.machine_faults import FaultyMachine
    from sim_plant.slave_network import CanFrame
    from sim_plant.timed_network import TimedNetwork

_TPDOS = 4


class Injection:
    """Fault without effect.

    Parameters
    ----------
    fault : Fault
    network : TimedNetwork
    machine : FaultyMachine
        Machine of the network.
    """

    def __init__(self, fault: Fault, network: TimedNetwork, machine: FaultyMachine) -> None:
        self.fault = fault
        self.network = network
        self.machine = machine

    def begin(self) -> None:
        """Start the effect."""

    def end(self) -> list[CanFrame]:
        """End the effect; return frames held back."""
        return []

    def incoming(self, identifier: int, data: bytes) -> list[CanFrame] | None:
        """Answer a frame in place of the drives; None passes the frame on."""
        del identifier, data
        return None

    def outgoing(self, frames: list[CanFrame]) -> list[CanFrame]:
        """Return the frames of the drives as changed by the fault."""
        return frames


class NodeInjection(Injection):
    """Fault of a single drive.

    Attributes
    ----------
    axis : int
        From 0.
    node : Cia402Drive
    """

    def __init__(self, fault: Fault, network: TimedNetwork, machine: FaultyMachine) -> None:
        super().__init__(fault, network, machine)
        self.axis = (fault.axis or 1) - 1
        self.node = network.nodes[self.axis]

    @property
    def tpdos(self) -> set[int]:
        """Identifiers of the drive's TPDOs."""
        records = [self.node.dictionary.get(0x1800 + number, 1) for number in range(_TPDOS)]
        return {record & IDENTIFIER for record in records if not record & INVALID}
