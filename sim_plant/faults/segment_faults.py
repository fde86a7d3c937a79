"""Faults of EtherCAT: cables, frames and slave controllers."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

from sim_plant.ethercat import registers as reg
from sim_plant.ethercat.al_states import AlState
from sim_plant.faults.injection import Injection

if TYPE_CHECKING:
    from sim_plant.ethercat.segment import Segment
    from sim_plant.faults.fault_plan import Fault
    from sim_plant.faults.machine_faults import FaultyMachine
    from sim_plant.slave_network import CanFrame

_PERCENT = 100.0
_MILLION = 1e6


class SegmentInjection(Injection):
    """Fault of EtherCAT; without axis a fault of the first slave, or of all slaves.

    Attributes
    ----------
    segment : Segment
    axis : int
        From 0.
    node : EthercatSlave
    """

    def __init__(self, fault: Fault, network: Segment, machine: FaultyMachine) -> None:
        super().__init__(fault, network, machine)
        self.segment = network
        self.axis = (fault.axis or 1) - 1
        self.node = network.nodes[self.axis]

    def there(self, frame: bytes) -> bytes | None:
        """Return the frame as received by the first slave, None if lost."""
        return frame

    def back(self, frame: bytes | None) -> bytes | None:
        """Return the frame as received by the master, None if lost."""
        return frame


class SegmentCut(SegmentInjection):
    """Cable cut before this slave."""

    def begin(self) -> None:
        """Cut the cable."""
        self.segment.cuts.add(self.axis)

    def end(self) -> list[CanFrame]:
        """Reconnect the cable."""
        self.segment.cuts.discard(self.axis)
        return []


class FramesLost(SegmentInjection):
    """Random loss of frames on their way back."""

    def begin(self) -> None:
        """Seed the random losses, equal in every run."""
        self._chance = random.Random(0)  # noqa: S311 - repeatable, no secret

    def back(self, frame: bytes | None) -> bytes | None:
        """Lose the frame by chance."""
        lost = self._chance.random() < (self.fault.size or 0.0) / _PERCENT
        return None if lost else frame


class FramesNotBack(SegmentInjection):
    """Loss of every frame on the way back."""

    def back(self, frame: bytes | None) -> None:
        """Lose the frame."""
        del frame


class FramesNotThere(SegmentInjection):
    """Loss of all frames before the slaves."""

    def there(self, frame: bytes) -> None:
        """Lose the frame."""
        del frame


class FrameLate(SegmentInjection):
    """Delay of a frame until the next frame is sent."""

    def begin(self) -> None:
        """Start without a held frame."""
        self._held: bytes | None = None

    def back(self, frame: bytes | None) -> bytes | None:
        """Hold the new frame and release the previous one."""
        held, self._held = self._held, frame
        return held


class MailboxStuck(SegmentInjection):
    """Dead mailbox of the slave."""

    def begin(self) -> None:
        """Stop serving the mailbox."""
        self.node.mailbox.is_stuck = True

    def end(self) -> list[CanFrame]:
        """Serve the mailbox again."""
        self.node.mailbox.is_stuck = False
        return []


class RequestsAborted(SegmentInjection):
    """Refusal of every SDO request."""

    def begin(self) -> None:
        """Start refusing."""
        self.node.coe.abort_code = self.fault.code

    def end(self) -> list[CanFrame]:
        """Answer again."""
        self.node.coe.abort_code = None
        return []


class AlError(SegmentInjection):
    """Spontaneous exit of the slave from OP."""

    def begin(self) -> None:
        """Enter SAFEOP with the AL status code."""
        self.node.states.fall(AlState.SAFEOP, self.fault.code or 0)


class Alias(SegmentInjection):
    """Alias of the slave, possibly equal to another slave's."""

    def begin(self) -> None:
        """Write the alias."""
        self.node.eeprom.alias = round(self.fault.size or 0)
        self.node.controller.put(reg.ALIAS, 2, self.node.eeprom.alias)


class ClockDrift(SegmentInjection):
    """Frequency error of the slave's crystal."""

    def begin(self) -> None:
        """Set the clock drift."""
        drift = (self.fault.size or 0.0) / _MILLION
        self.node.clock.set_drift(drift, self.segment.time)

    def end(self) -> list[CanFrame]:
        """Remove the clock drift."""
        self.node.clock.set_drift(0.0, self.segment.time)
        return []
