"""What a fault does while it is present: the base of all injections.

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
    """A fault that does nothing yet.

    Parameters
    ----------
    fault : Fault
    network : TimedNetwork
    machine : FaultyMachine
        Behind the network.
    """

    def __init__(self, fault: Fault, network: TimedNetwork, machine: FaultyMachine) -> None:
        self.fault = fault
        self.network = network
        self.machine = machine

    def begin(self) -> None:
        """Happen."""

    def end(self) -> list[CanFrame]:
        """Be over; return frames that were held back."""
        return []

    def incoming(self, identifier: int, data: bytes) -> list[CanFrame] | None:
        """Answer a frame in the drives' place, which then never get it; None lets it pass."""
        del identifier, data
        return None

    def outgoing(self, frames: list[CanFrame]) -> list[CanFrame]:
        """Return what becomes of frames that the drives send."""
        return frames


class NodeInjection(Injection):
    """A fault of one drive.

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
