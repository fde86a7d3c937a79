"""Faults of the wire: frames between master and drives lost, doubled, delayed or refused."""

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
    """Refusal of a frame by the master's adapter.

    Attributes
    ----------
    frames : list of CanFrame
        Frames received from the drives meanwhile.
    """

    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.frames: list[CanFrame] = []


class BusOff(NotSent):
    """Bus-off of the master's controller."""


class TpdoLost(NodeInjection):
    """Loss of a drive's process data."""

    def outgoing(self, frames: list[CanFrame]) -> list[CanFrame]:
        """Drop the process data."""
        return [frame for frame in frames if frame[1] not in self.tpdos]


class TpdoDoubled(NodeInjection):
    """Duplication of a drive's process data."""

    def outgoing(self, frames: list[CanFrame]) -> list[CanFrame]:
        """Send the process data twice."""
        return [copy for frame in frames for copy in [frame] * (1 + (frame[1] in self.tpdos))]


class TpdoLate(NodeInjection):
    """Delay of a drive's process data until the drives receive the next frame."""

    def begin(self) -> None:
        """Start without held frames."""
        self._held: list[CanFrame] = []

    def outgoing(self, frames: list[CanFrame]) -> list[CanFrame]:
        """Hold new process data and release the process data held before."""
        late, self._held = self._held, [frame for frame in frames if frame[1] in self.tpdos]
        return late + [frame for frame in frames if frame[1] not in self.tpdos]

    def end(self) -> list[CanFrame]:
        """Release the held frames."""
        return self._held


class SdoSilent(NodeInjection):
    """Silent SDO server."""

    def incoming(self, identifier: int, data: bytes) -> list[CanFrame] | None:
        """Drop requests to this node."""
        del data
        return [] if identifier == 0x600 + self.node.node_id else None


class SdoAborted(NodeInjection):
    """Refusal of every SDO request."""

    def incoming(self, identifier: int, data: bytes) -> list[CanFrame] | None:
        """Answer requests with the abort code."""
        if identifier != 0x600 + self.node.node_id or len(data) != 8:
            return None
        answer = _ABORT.pack(0x80, data[1:4], self.fault.code or 0)
        return [(self.network.time, 0x580 + self.node.node_id, answer)]


class HeartbeatLost(NodeInjection):
    """Loss of a node's heartbeat."""

    def outgoing(self, frames: list[CanFrame]) -> list[CanFrame]:
        """Drop the heartbeat."""
        return [frame for frame in frames if frame[1] != HEARTBEAT + self.node.node_id]


class MasterHeartbeatLost(Injection):
    """Loss of the master's heartbeat on its way to the drives."""

    def incoming(self, identifier: int, data: bytes) -> list[CanFrame] | None:
        """Drop heartbeats."""
        del data
        return [] if HEARTBEAT < identifier <= HEARTBEAT + _NODE else None


class TransmitOutage(Injection):
    """Transmit outage of the master's adapter, which still receives."""

    def incoming(self, identifier: int, data: bytes) -> list[CanFrame] | None:
        """Refuse the frame."""
        del data
        raise NotSent(f"transmit outage: frame {identifier:03X} was not sent")


class ReceiveOutage(Injection):
    """Loss of all frames from the drives."""

    def outgoing(self, frames: list[CanFrame]) -> list[CanFrame]:
        """Drop all frames."""
        del frames
        return []


class CableCut(ReceiveOutage):
    """Cable cut: loss of all frames in both directions."""

    def incoming(self, identifier: int, data: bytes) -> list[CanFrame] | None:
        """Drop the frame."""
        del identifier, data
        return []


class AdapterBusOff(ReceiveOutage):
    """Bus-off of the master's controller: nothing is sent or received."""

    def incoming(self, identifier: int, data: bytes) -> list[CanFrame] | None:
        """Refuse the frame."""
        del data
        raise BusOff(f"bus-off: frame {identifier:03X} was not sent")
