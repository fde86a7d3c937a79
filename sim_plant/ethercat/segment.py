"""EtherCAT segment: all drives of the plant on a line, processing frames in turn.

There are two clocks. With ``"sync"`` time stands still between cycles: when every slave in SAFEOP
or OP has received its outputs (or, without outputs, has been read), the outputs act and one cycle
passes. The cycle is the longest SYNC0 cycle, else the longest 1C32h:2, else the option `cycle`. So
a master runs as fast as the processor and always gets the same answers. A master without outputs
lets a cycle pass with each frame that reads the watchdog status of all (BRD of 0440h). With
``"wall"`` the caller advances time by `elapse`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError
from sim_plant.drive.process_image import AxisImage
from sim_plant.ethercat import registers as reg
from sim_plant.ethercat.clock import HOP
from sim_plant.ethercat.cyclic_frame import CyclicFrame
from sim_plant.ethercat.frame import (
    BROADCAST,
    LOGICAL,
    MULTIPLE,
    POSITION,
    READING,
    WRITING,
    Command,
    Datagram,
    datagrams,
    mark_passed,
)
from sim_plant.ethercat.objects import SYNC_OUT
from sim_plant.ethercat.slave import EthercatSlave
from sim_plant.slave_network import CYCLE_DEFAULT, Clock
from sim_plant.timed_network import TimedNetwork

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sim_plant.machine_protocol import Machine

_FIRST = 16
"""Place of the first datagram's command."""
_SIMULTANEOUS = 1e-6
"""Time difference up to which the SYNC0 of several slaves count as simultaneous [s]."""
_LINK_FIRST, _LINK_NEXT = 0x0010, 0x0020
_OPEN_FIRST, _OPEN_NEXT = 0x0200, 0x0800
_CLOSED_NEXT, _CLOSED_OTHERS = 0x0400, 0x1000 | 0x4000
_OPERATIONAL = 0x0001
"""Bits of DL status: the slave's side works; link, communication or a closed loop at each port."""


class Segment(TimedNetwork):
    """Drives of a machine on one cable.

    Parameters
    ----------
    machine : Machine
    clock : {"sync", "wall"}
    cycle : float
        Cycle time while no slave has a cycle time [s].

    Attributes
    ----------
    nodes : tuple of EthercatSlave
    time : float
        Time since power-on [s].
    cuts : set of int
        Cut cables: 0 in front of the first slave, 1 after it.
    """

    def __init__(
        self, machine: Machine, clock: Clock = "sync", cycle: float = CYCLE_DEFAULT
    ) -> None:
        super().__init__(machine)
        for drive in machine.drives:
            if drive.axis > 1:
                raise FileError(
                    f"{drive.name}: axis {drive.axis} of node {drive.node_id}; several axes in "
                    "one node are supported only on CAN: give each a node of its own"
                )
        self._clock = clock
        self._default_cycle = cycle
        self._latched: float | None = None
        self._row: list[int] = []
        self._usual_cycle = cycle
        self._exchanged: set[int] = set()
        self.cuts: set[int] = set()
        self._usual: CyclicFrame | None = None
        self.nodes: tuple[EthercatSlave, ...] = tuple(
            EthercatSlave(settings, axis, AxisImage(self._image, i), self._timers, self._latch_once)
            for i, (settings, axis) in enumerate(zip(machine.drives, machine.axes, strict=True))
        )

    def power_on(self) -> None:
        """Boot all drives."""
        self._latch()
        for node in self.nodes:
            node.boot()

    def process(self, frame: bytes) -> bytes | None:
        """Return a frame after passing the slaves, None if the frame is lost."""
        usual = self._usual
        if usual is not None and not self.cuts and usual.fits(frame):
            answer = usual.passed(frame)
            for node in self.nodes:
                node.take_outputs()
            self._exchanged.clear()
            image: Sequence[int] = ()
            for node in usual.by_frames:
                if node.exchanges:
                    image = image or self._latch_once()
                    node.exchange(image, repeated=usual.is_repeated)
            if self._clock == "sync":
                self._advance(self._usual_cycle)
            return answer
        reached = self._reached()
        if not reached:
            return None
        self._show_links(len(reached))
        passing = bytearray(frame)
        waits = False
        for datagram in datagrams(passing):
            if datagram.command is not Command.NOP:
                waits |= datagram.command is Command.BRD and datagram.offset == reg.WATCHDOG_STATUS
                self._pass(datagram, reached)
        mark_passed(passing)
        self._work(reached, waits=waits)
        self._usual = None
        if reached is self.nodes and self._is_cyclic(frame):
            usual = CyclicFrame(self.nodes, frame)
            self._usual, self._usual_cycle = (usual if usual.is_plain else None), self.cycle
        return bytes(passing)

    def _is_cyclic(self, frame: bytes) -> bool:
        """Return True if a frame starts with process data and all slaves exchange data."""
        logical = frame[_FIRST] in LOGICAL if len(frame) > _FIRST else False
        return logical and all(node.exchanges for node in self.nodes)

    def elapse(self, duration: float) -> None:
        """Let time pass [s]."""
        self._advance(duration)

    @property
    def cycle(self) -> float:
        """Cycle time of an exchange of process data [s]."""
        longest = max(node.clock.cycle for node in self.nodes)
        longest = longest or max(node.dictionary.get(SYNC_OUT, 2) for node in self.nodes)
        return longest * 1e-9 or self._default_cycle

    def _reached(self) -> Sequence[EthercatSlave]:
        """Return the slaves reached by frames."""
        for number, node in enumerate(self.nodes):
            if number in self.cuts or not node.is_connected:
                return self.nodes[:number]
        return self.nodes

    def _pass(self, datagram: Datagram, reached: Sequence[EthercatSlave]) -> None:
        command = datagram.command
        reads, writes = command in READING, command in WRITING
        for number, node in enumerate(reached):
            if command in POSITION:
                meant = datagram.position == 0
            elif command in BROADCAST or command in LOGICAL:
                meant = True
            else:
                meant = node.is_addressed(datagram)
            if command in MULTIPLE:
                node.serve(datagram, reads=meant, writes=not meant, delay=number * HOP)
            elif meant:
                node.serve(datagram, reads=reads, writes=writes, delay=number * HOP)
            if command in POSITION or command in BROADCAST:
                datagram.pass_on()

    def _work(self, reached: Sequence[EthercatSlave], *, waits: bool) -> None:
        """Execute the consequences of a frame; `waits` ends the cycle without outputs."""
        last = len(reached) - 1
        due = False
        for number, node in enumerate(reached):
            back = (2 * last - number) * HOP if number < last else None
            if node.work(number * HOP, back):
                due = due or number in self._exchanged
                self._exchanged.add(number)
        if self._exchanged:
            waiting = {n for n, node in enumerate(reached) if node.exchanges} - self._exchanged
            if due or not waiting:
                self._finish_cycle()
        elif waits:
            self._finish_cycle()

    def _finish_cycle(self) -> None:
        self._exchanged.clear()
        for node in self.nodes:
            if node.exchanges and not node.clock.cycle:
                node.exchange(self._latch_once())
        if self._clock == "sync":
            self._advance(self.cycle)

    def _latch_once(self) -> list[int]:
        """Latch all axes once per instant; return the process image."""
        if self._latched is None or self.time - self._latched > _SIMULTANEOUS:
            self._latched = self.time
            self._latch()
            self._row = self._image.values.tolist()
        return self._row

    def _show_links(self, count: int) -> None:
        for number, node in enumerate(self.nodes[:count]):
            status = _OPERATIONAL | _LINK_FIRST | _OPEN_FIRST | _CLOSED_OTHERS
            status |= _LINK_NEXT | _OPEN_NEXT if number < count - 1 else _CLOSED_NEXT
            node.controller.put(reg.DL_STATUS, 2, status)
