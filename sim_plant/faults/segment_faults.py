"""Faults of EtherCAT: of its cables, its frames and its slave controllers."""

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
    """A fault of EtherCAT; without axis it is one of the first slave, or of all.

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
        """Return what reaches the first slave of a frame, None for nothing."""
        return frame

    def back(self, frame: bytes | None) -> bytes | None:
        """Return what reaches the master of a frame that came back, or did not."""
        return frame


class SegmentCut(SegmentInjection):
    """Slaves from this one on are not reached."""

    def begin(self) -> None:
        """Cut."""
        self.segment.cuts.add(self.axis)

    def end(self) -> list[CanFrame]:
        """Plug in again."""
        self.segment.cuts.discard(self.axis)
        return []


class FramesLost(SegmentInjection):
    """Some frames pass the slaves and do not come back."""

    def begin(self) -> None:
        """Lose the same ones in every run."""
        self._chance = random.Random(0)  # noqa: S311 - repeatable, no secret

    def back(self, frame: bytes | None) -> bytes | None:
        """Lose it or not."""
        lost = self._chance.random() < (self.fault.size or 0.0) / _PERCENT
        return None if lost else frame


class FramesNotBack(SegmentInjection):
    """Frames pass the slaves and do not come back."""

    def back(self, frame: bytes | None) -> None:
        """Lose it."""
        del frame


class FramesNotThere(SegmentInjection):
    """No frame reaches the slaves."""

    def there(self, frame: bytes) -> None:
        """Lose it."""
        del frame


class FrameLate(SegmentInjection):
    """A frame comes back when the next one is sent."""

    def begin(self) -> None:
        """Hold none yet."""
        self._held: bytes | None = None

    def back(self, frame: bytes | None) -> bytes | None:
        """Hold the new one, let go the old one."""
        held, self._held = self._held, frame
        return held


class MailboxStuck(SegmentInjection):
    """The slave looks at no mailbox."""

    def begin(self) -> None:
        """Hang."""
        self.node.mailbox.is_stuck = True

    def end(self) -> list[CanFrame]:
        """Go on."""
        self.node.mailbox.is_stuck = False
        return []


class RequestsAborted(SegmentInjection):
    """Every SDO request is refused."""

    def begin(self) -> None:
        """Refuse."""
        self.node.coe.abort_code = self.fault.code

    def end(self) -> list[CanFrame]:
        """Answer again."""
        self.node.coe.abort_code = None
        return []


class AlError(SegmentInjection):
    """The slave leaves OP by itself."""

    def begin(self) -> None:
        """Fall."""
        self.node.states.fall(AlState.SAFEOP, self.fault.code or 0)


class Alias(SegmentInjection):
    """The slave has an alias, which another may have too."""

    def begin(self) -> None:
        """Have it."""
        self.node.eeprom.alias = round(self.fault.size or 0)
        self.node.controller.put(reg.ALIAS, 2, self.node.eeprom.alias)


class ClockDrift(SegmentInjection):
    """The slave's crystal is too fast."""

    def begin(self) -> None:
        """Run fast."""
        drift = (self.fault.size or 0.0) / _MILLION
        self.node.clock.set_drift(drift, self.segment.time)

    def end(self) -> list[CanFrame]:
        """Run true."""
        self.node.clock.set_drift(0.0, self.segment.time)
        return []
