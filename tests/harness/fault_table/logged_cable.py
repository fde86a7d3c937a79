"""Faulty EtherCAT slaves of the plant as a wire in lock-step with a log of all frames and a
witness.

The log has the format of the CAN log (`fault_table.logged_bus`): a frame with process data
is a SYNC, its outputs are commands to an axis, and the inputs of a participating axis are answers.
So the same readers evaluate both logs.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from plant_wire import PlantWire

from drivers.canopen.pdo_mapping import received
from drivers.drives_file import load_drives
from fault_table.logged_bus import FOREIGN, ROBOT, SYNC, Seen, WitnessedLog
from fault_table.witness import Witness
from hil.model.robot import ROBOTS
from sim_plant.ethercat.al_states import AlState
from sim_plant.ethercat.frame import Command, datagrams
from sim_plant.faults.fault_plan import FaultPlan
from sim_plant.faults.faulty_segment import FaultySegment
from sim_plant.plant import load_plant

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Any, Self

    import numpy as np
    from numpy.typing import NDArray

    from sim_plant.ethercat.segment import Segment
    from sim_plant.faults.fault_plan import Fault

OUTPUTS = 6
"""Size of the outputs [bytes]: controlword and target position."""
BOTH = 3
"""Working counter of a drive that accepted outputs and gave inputs."""
_REACTING = frozenset({0x07, 0x0F})
"""Bits of a statusword: quick stop, fault reaction."""
_AXES = load_drives(ROBOTS / f"{ROBOT}.drives.yaml").axes


class WatchedSlave:
    """Slave with the witness's question: would it react to the loss of our process data?"""

    def __init__(self, slave: object) -> None:
        self._slave = slave

    @property
    def is_watching(self) -> bool:
        """Return True if the slave would react to lost process data, or does."""
        slave = self._slave
        if slave.states.state is AlState.OP:  # type: ignore[attr-defined]
            return bool(slave._watchdog)  # type: ignore[attr-defined]
        return (slave.dictionary.get(0x6041) & 0x4F) in _REACTING  # type: ignore[attr-defined]


class WatchedSegment:
    """The plant as seen by the witness."""

    def __init__(self, segment: Segment, plant: object) -> None:
        self._segment = segment
        self.nodes = [WatchedSlave(node) for node in segment.nodes]
        self.machine = type("Machine", (), {"plant": plant})

    @property
    def time(self) -> float:
        """Time since power-on [s]."""
        return self._segment.time


class LoggedCable(PlantWire, WitnessedLog):
    """Faulty slaves at the other end of a wire.

    Parameters
    ----------
    faults, interrupted, reaction
        As in `fault_table.logged_bus.LoggedBus`.
    changed, unnoticed
        See `fault_table.case.Case`; `changed` is called with the drive of the second axis.

    Attributes
    ----------
    log, began, witness, plant
        As of `fault_table.logged_bus.LoggedBus`.
    truth : ndarray
        State of the plant, latched for the last received inputs.
    """

    def __init__(
        self,
        faults: Sequence[Fault],
        *,
        interrupted: bool = False,
        reaction: float = 0.0,
        changed: Callable[[Any], None] | None = None,
        unnoticed: float = 0.0,
    ) -> None:
        self.plant = load_plant(ROBOT)
        faulty = FaultySegment(self.plant, "sync", FaultPlan(faults=tuple(faults)))
        PlantWire.__init__(self, faulty)
        watched = WatchedSegment(faulty._network, self.plant)
        witness = Witness(watched, reaction, unnoticed)  # type: ignore[arg-type]
        self._nodes, self._changed = faulty._network.nodes, changed
        WitnessedLog.__init__(self, faulty, witness, interrupted=interrupted)
        self.truth: NDArray[np.float64] = self.plant.state.copy()
        self._before = self.truth
        self._syncs = 0
        faulty.power_on()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Do nothing: there is nothing to close."""

    def send(self, frame: bytes | bytearray) -> bool:
        """Pass a frame to the slaves."""
        here = len(self.log)
        outputs = [found for found in datagrams(bytearray(frame)) if found.command is Command.LRW]
        if outputs:
            self._syncs += 1
            self.truth, self._before = self._before, self.plant.state.copy()
            self._note(True, SYNC, b"")
            for axis, datagram in zip(_AXES, outputs, strict=True):
                word, target = struct.unpack_from("<Hi", datagram.data)
                self._note(True, received(axis).cob_id, struct.pack("<iH", target, word))
        count = len(self._back)
        super().send(frame)
        if outputs and len(self._back) > count:
            self._note_answers(self._back[-1])
        self._look(here)
        if self._changed and self._syncs == FOREIGN:
            self._begin(len(self.log))
            self._changed(self._nodes[1])
            self._changed = None
        return True

    def _note(self, ours: bool, identifier: int, data: bytes) -> None:
        self.log.append(Seen(self._syncs, ours, identifier, data))

    def _note_answers(self, frame: bytes) -> None:
        found = [each for each in datagrams(bytearray(frame)) if each.command is Command.LRW]
        for axis, datagram in zip(_AXES, found, strict=True):
            end = datagram.place + 10 + datagram.size
            if int.from_bytes(frame[end : end + 2], "little") == BOTH:
                self._note(False, 0x180 + axis.node, datagram.data[OUTPUTS:])
