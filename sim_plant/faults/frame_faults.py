"""Faults of the wire: what is lost, doubled, late, refused or cut off between master and drives."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import can

from sim_plant.canopen.heartbeat import HEARTBEAT
from sim_plant.faults.injection import Injection, NodeInjection

if TYPE_CHECKING:
    from sim_plant.slave_network import CanFrame

_NODE = 0x7F
_ABORT = struct.Struct("<B3sI")


class NotSent(can.CanOperationError):
    """Our adapter does not take a frame.

    Attributes
    ----------
    frames : list of CanFrame
        What reaches us from the drives meanwhile.
    """

    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.frames: list[CanFrame] = []


class BusOff(NotSent):
    """Our controller has left the bus."""


class TpdoLost(NodeInjection):
    """Process data do not arrive."""

    def outgoing(self, frames: list[CanFrame]) -> list[CanFrame]:
        """Drop them."""
        return [frame for frame in frames if frame[1] not in self.tpdos]


class TpdoDoubled(NodeInjection):
    """Process data arrive twice."""

    def outgoing(self, frames: list[CanFrame]) -> list[CanFrame]:
        """Double them."""
        return [copy for frame in frames for copy in [frame] * (1 + (frame[1] in self.tpdos))]


class TpdoLate(NodeInjection):
    """Process data arrive when the drives get the next frame, whichever that is."""

    def begin(self) -> None:
        """Hold none yet."""
        self._held: list[CanFrame] = []

    def outgoing(self, frames: list[CanFrame]) -> list[CanFrame]:
        """Hold what is new, let go what was held."""
        late, self._held = self._held, [frame for frame in frames if frame[1] in self.tpdos]
        return late + [frame for frame in frames if frame[1] not in self.tpdos]

    def end(self) -> list[CanFrame]:
        """Let go what is held."""
        return self._held


class SdoSilent(NodeInjection):
    """No request is answered."""

    def incoming(self, identifier: int, data: bytes) -> list[CanFrame] | None:
        """Swallow requests."""
        del data
        return [] if identifier == 0x600 + self.node.node_id else None


class SdoAborted(NodeInjection):
    """Every request is refused."""

    def incoming(self, identifier: int, data: bytes) -> list[CanFrame] | None:
        """Answer with the abort code."""
        if identifier != 0x600 + self.node.node_id or len(data) != 8:
            return None
        answer = _ABORT.pack(0x80, data[1:4], self.fault.code or 0)
        return [(self.network.time, 0x580 + self.node.node_id, answer)]


class HeartbeatLost(NodeInjection):
    """The node's heartbeat does not arrive."""

    def outgoing(self, frames: list[CanFrame]) -> list[CanFrame]:
        """Drop it."""
        return [frame for frame in frames if frame[1] != HEARTBEAT + self.node.node_id]


class MasterHeartbeatLost(Injection):
    """No heartbeat but the drives' own gets through."""

    def incoming(self, identifier: int, data: bytes) -> list[CanFrame] | None:
        """Swallow heartbeats."""
        del data
        return [] if HEARTBEAT < identifier <= HEARTBEAT + _NODE else None


class TransmitOutage(Injection):
    """Our adapter sends no frame, but receives whatever arrives."""

    def incoming(self, identifier: int, data: bytes) -> list[CanFrame] | None:
        """Refuse it."""
        del data
        raise NotSent(f"transmit outage: frame {identifier:03X} was not sent")


class ReceiveOutage(Injection):
    """Nothing that the drives send reaches us."""

    def outgoing(self, frames: list[CanFrame]) -> list[CanFrame]:
        """Swallow everything."""
        del frames
        return []


class CableCut(ReceiveOutage):
    """No frame passes in either direction."""

    def incoming(self, identifier: int, data: bytes) -> list[CanFrame] | None:
        """Swallow everything."""
        del identifier, data
        return []


class AdapterBusOff(ReceiveOutage):
    """Our controller takes no frame and hears none."""

    def incoming(self, identifier: int, data: bytes) -> list[CanFrame] | None:
        """Refuse it."""
        del data
        raise BusOff(f"bus-off: frame {identifier:03X} was not sent")
