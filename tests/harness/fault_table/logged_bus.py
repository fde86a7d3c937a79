"""Faulty plant as a bus in lock-step with a log of all frames and a witness.

A fault begins by its plan, or at a frame of ours that fulfils a condition; Ctrl-C may be
pressed at the same moment. A frame refused by our adapter also advances the plant's time: a SYNC by
its cycle, another frame by the driver's wait before the next attempt. So drives and outages
continue as on the wall clock, independently of the driver's attempts to send.
"""

from __future__ import annotations

import signal
from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import can

from drivers.canopen.network import SEND_BACK_OFF
from fault_table.witness import Witness
from sim_plant.faults.fault_plan import FaultPlan
from sim_plant.faults.faulty_network import FaultyNetwork
from sim_plant.faults.frame_faults import NotSent
from sim_plant.plant import load_plant

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from sim_plant.faults.fault_plan import Fault
    from sim_plant.faults.faulty_segment import FaultySegment
    from sim_plant.slave_network import CanFrame

    Condition = Callable[[can.Message], bool]

ROBOT = "manutec-r15"
SYNC = 0x80
SETTLING = 3.0
"""Time without a master afterwards, for the drives' own reactions [s]."""
HEARD = 0.002
"""Half the SYNC period of 4 ms, which separates two looks [s]."""
STEP = 0.01
FOREIGN = 400
"""SYNC in the second stroke."""


class Seen(NamedTuple):
    """A frame on the bus, and the number of SYNCs before it (its own included)."""

    sync: int
    ours: bool
    identifier: int
    data: bytes


class WitnessedLog:
    """Log of the bus of a faulty plant, and witness of the events after its first fault.

    Parameters
    ----------
    network : FaultyNetwork or FaultySegment
    witness : Witness
    interrupted : bool
        True if Ctrl-C is pressed at the begin of the first fault.

    Attributes
    ----------
    log : list of Seen
        Frames received by the drives or by the driver.
    began : int or None
        Length of the log when the first fault began.
    """

    def __init__(
        self, network: FaultyNetwork | FaultySegment, witness: Witness, *, interrupted: bool
    ) -> None:
        self.network, self.witness, self._interrupted = network, witness, interrupted
        self.log: list[Seen] = []
        self.began: int | None = None

    def leave_alone(self) -> None:
        """Let time pass without a master."""
        for _ in range(round(SETTLING / STEP)):
            self.network.elapse(STEP)
            self._look(len(self.log))

    def _begin(self, here: int) -> None:
        self.began = here
        self.witness.begin()

    def _look(self, here: int) -> None:
        begins = self.began is None and bool(self.network.present)
        if begins:
            self._begin(here)
        self.witness.look()
        if begins and self._interrupted:
            signal.raise_signal(signal.SIGINT)


class LoggedBus(can.BusABC, WitnessedLog):
    """The faulty plant as a python-can bus in lock-step.

    Parameters
    ----------
    faults : sequence of Fault
    condition : callable, optional
        Condition of sent frames: the faults enter the plan at the first frame that fulfils the
        condition, instead of at the start.
    interrupted : bool
        True if Ctrl-C is pressed at the begin of the first fault.
    reaction : float
        See `fault_table.witness.Witness`.
    foreign : sequence of (int, bytes)
        Frames sent by another participant right after the SYNC number `FOREIGN`.

    Attributes
    ----------
    log, began, witness
        As of `WitnessedLog`.
    truth : ndarray
        State of the plant, latched for the last sample.
    """

    lock_step = True

    def __init__(
        self,
        faults: Sequence[Fault],
        condition: Condition | None = None,
        *,
        interrupted: bool = False,
        reaction: float = 0.0,
        foreign: Sequence[tuple[int, bytes]] = (),
    ) -> None:
        can.BusABC.__init__(self, "faulty plant")
        self.channel_info = "faulty plant"
        self.plant = load_plant(ROBOT)
        at_once = () if condition else tuple(faults)
        network = FaultyNetwork(self.plant, "sync", FaultPlan(faults=at_once))
        # frames of another participant are received at once, and answered before the next SYNC
        witness = Witness(network, reaction, unnoticed=HEARD)
        WitnessedLog.__init__(self, network, witness, interrupted=interrupted)
        self.truth = self.plant.state
        self._condition, self._waiting = condition, tuple(faults)
        self._syncs, self._foreign = 0, tuple(foreign)
        self._inbox: deque[can.Message] = deque()
        self.network.power_on()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Pass a frame to the drives."""
        if self._condition and self._condition(msg):
            self._condition = None
            for fault in self._waiting:
                self.network.add(fault)
        self._syncs += msg.arbitration_id == SYNC
        here, data = len(self.log), bytes(msg.data)
        try:
            frames = self.network.receive(msg.arbitration_id, data)
        except NotSent as refused:
            self._take(refused.frames)
            if msg.arbitration_id != SYNC:
                self._take(self.network.elapse(SEND_BACK_OFF))
            raise
        else:
            self.log.append(Seen(self._syncs, True, msg.arbitration_id, data))
            self._take(frames)
        finally:
            self._look(here)
        if self._foreign and self._syncs == FOREIGN:
            self._hear_another()

    def _hear_another(self) -> None:
        """Pass frames of another participant to the drives and to us."""
        self._begin(len(self.log))
        foreign, self._foreign = self._foreign, ()
        for identifier, data in foreign:
            answers = self.network.receive(identifier, data)
            self._take([(0.0, identifier, data), *answers])

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return (self._inbox.popleft() if self._inbox else None), False

    def _take(self, frames: Sequence[CanFrame]) -> None:
        for _, identifier, data in frames:
            self.log.append(Seen(self._syncs, False, identifier, data))
            self._inbox.append(
                can.Message(arbitration_id=identifier, data=data, is_extended_id=False)
            )
