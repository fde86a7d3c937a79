"""Observation of a bus without control of its drives: passive monitor, and scan for nodes.

`BusPicture` receives frames and sends none, so it works beside a running master, on a bus object of
its own. TPDOs are decoded as mapped by our driver or as stated in the drives file
(`pdo_mapping.transmitted`); those of another length are counted as foreign. Digital inputs, which
show safe torque off, are in no TPDO: they are taken from answers to SDO requests of anybody, and
`questions` returns such requests.

`scan` finds all 127 node numbers. At first it only listens: heartbeats, boot-ups and emergencies
reveal nodes without SDO answers, and a SYNC reveals another master. Then every number is asked for
its device type (1000), all in a row, within one time-out; and the objects for a review are read
from each node that answers. Nothing is written, no state of a node changes and nothing is
energised: only SDO read requests are sent.
"""

from __future__ import annotations

import math
import struct
import time
from collections import deque
from functools import partial
from typing import TYPE_CHECKING

import can

from drivers.can_bus.capabilities import find_capabilities
from drivers.canopen.network import PumpedNetwork
from drivers.canopen.objects import NMT_STATES, SYNC
from drivers.canopen.pdo_mapping import transmitted
from drivers.canopen.rules import RULES
from drivers.canopen.sdo import SdoAccess
from drivers.cia402 import objects
from drivers.cia402.error_codes import decode_emergency
from drivers.cia402.picture import AxisPicture, Picture
from drivers.dictionary.live import read_dictionary
from drivers.dictionary.review import Scan, review
from drivers.in_node import find_axes, show_axis
from drivers.remote_dictionary import ABSENT, AccessRefused, NoAnswer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.drives_file import AxisDrive, DrivesFile

NODES = range(1, 128)
LISTENING = 1.2
"""Duration of listening [s]: heartbeats rarely come less often than once a second."""
ANSWERING = 0.5
"""Longest time to the first answer of a node [s]."""
SDO_TIMEOUT = 0.25
BATCH = 8
"""Largest number of requests in a row; socketcan queues ten."""
REQUEST = bytes([0x40, 0x00, 0x10, 0, 0, 0, 0, 0])


def scan_bus(
    bus: can.BusABC,
    *,
    listening: float = LISTENING,
    answering: float = ANSWERING,
    timeout: float = SDO_TIMEOUT,
    only: Sequence[int] = NODES,
) -> Scan:
    """Find the nodes on an open bus, and read their object dictionaries.

    Parameters
    ----------
    bus : can.BusABC
        An open bus; in lock-step listening is useless, since time does not advance.
    listening, answering, timeout : float
        Time to listen, to wait for first answers, and for each further answer [s].
    only : sequence of int
        Node numbers to ask.

    Raises
    ------
    BusUnavailable
            The bus accepts no frames or has gone.
    """
    network = PumpedNetwork(bus, synchronous=find_capabilities(bus).lock_step)
    scan = Scan()
    for identifier in (SYNC, *(base + node for base in (0x700, 0x580, 0x080) for node in NODES)):
        network.subscribe(identifier, partial(_take_frame, scan))
    network.pump(listening)
    asked = tuple(only)
    for first in range(0, len(asked), BATCH):
        for node in asked[first : first + BATCH]:
            network.send_message(0x600 + node, REQUEST)
        network.pump(0.01)
    network.pump(answering)
    for node, found in sorted(scan.nodes.items()):
        answers = found.answers
        if answers and node in asked:
            access = SdoAccess(network, node, timeout)
            for within in find_axes(partial(_has, access)):
                dictionary = read_dictionary(show_axis(access, within), node, RULES, within.axis)
                if within.axis == 1:
                    found.within, found.dictionary = within, dictionary
                    found.review = review(dictionary, RULES)
                else:
                    found.further.append((within, dictionary, review(dictionary, RULES)))
        found.answers = answers
    scan.nodes = {node: scan.nodes[node] for node in sorted(scan.nodes) if node in asked}
    return scan


def _has(access: SdoAccess, index: int, subindex: int) -> bool:
    try:
        access.read(index, subindex)
    except AccessRefused as error:
        return error.code not in ABSENT  # the object exists, and may be write-only
    except NoAnswer:
        return False
    return True


def _take_frame(scan: Scan, can_id: int, data: bytearray, _: float) -> None:
    """Record a heartbeat, an answer to our request, an emergency or a SYNC."""
    service, node = can_id & ~0x7F, can_id & 0x7F
    if can_id == SYNC:
        scan.syncs += 1
    elif service == 0x700:
        found = scan.heard(node)
        found.state = NMT_STATES.get(data[0] & 0x7F, "unknown state") if data else "unknown state"
        found.boots += found.state == "boot-up"
    elif service == 0x580 and len(data) == 8 and data[1:4] == REQUEST[1:4]:
        scan.heard(node).answers += 1
    elif service == 0x080 and len(data) == 8:
        scan.heard(node).emergencies += 1


_SDO_ANSWER, _SDO_REQUEST = 0x580, 0x600
_EXPEDITED = 0x43
RATE_OVER = 50
"""Number of SYNCs for the rate."""
STOPPED = 2.0
"""Time without SYNC after which the rate is 0 [s]."""


class BusPicture(Picture):
    """Picture of the axes of a drives file, from received frames.

    Parameters
    ----------
    drives : DrivesFile
        Axes in joint order.
    bus : can.BusABC, optional
        Bus to listen to.
    asked : sequence of can.Message
        Requests sent before listening.
    """

    def __init__(
        self, drives: DrivesFile, bus: can.BusABC | None = None, asked: Sequence[can.Message] = ()
    ) -> None:
        super().__init__(drives)
        self._bus, self._asked = bus, asked
        self._syncs: deque[float] = deque(maxlen=RATE_OVER)
        self._last_sync = -math.inf
        self._tpdos = {
            pdo.cob_id: (number, pdo.entries, pdo.size)
            for number, axis in enumerate(drives.axes)
            for pdo in transmitted(axis)
        }
        self._of_node: dict[int, list[AxisPicture]] = {}
        for axis in self.axes:
            self._of_node.setdefault(axis.node, []).append(axis)

    def listen(self, duration: float) -> None:
        """Receive frames for a duration [s]."""
        assert self._bus is not None  # noqa: S101 - by the caller
        for question in self._asked:
            self._bus.send(question)
        ends = time.monotonic() + duration
        while (left := ends - time.monotonic()) > 0:
            frame = self._bus.recv(left)
            if frame is not None:
                self.take(frame, time.monotonic())

    def sync_rate(self, now: float) -> float:
        """Return the rate of the last SYNCs [1/s], 0 if SYNC has ended at `now` [s]."""
        if now - self._last_sync > STOPPED:
            return 0.0
        span = self._syncs[-1] - self._syncs[0] if len(self._syncs) > 1 else 0.0
        return (len(self._syncs) - 1) / span if span > 0 else 0.0

    def take(self, frame: can.Message, now: float) -> None:
        """Evaluate a frame received at `now` [s] of any steady clock."""
        if frame.is_error_frame or frame.is_remote_frame or frame.is_extended_id:
            return
        number, data = frame.arbitration_id, bytes(frame.data)
        if number == SYNC:
            self._syncs.append(frame.timestamp or now)
            self._last_sync = now
        elif number in self._tpdos:
            self._take_tpdo(number, data, now)
        elif number & 0x780 == _SDO_ANSWER and number & 0x7F in self._of_node:
            # an expedited upload of 60FD in four bytes, requested by anybody
            for axis in self._of_node[number & 0x7F]:
                request = _upload(axis.drive)
                if len(data) == 8 and data[0] == _EXPEDITED and data[1:4] == request[1:]:
                    axis.show(objects.DIGITAL_INPUTS, int.from_bytes(data[4:], "little"))
        elif number & 0x780 in {0x080, 0x700} and number & 0x7F in self._of_node and data:
            for axis in self._of_node[number & 0x7F]:
                axis.heard = now
                if number & 0x700:
                    axis.nmt = NMT_STATES.get(data[0] & 0x7F, f"{data[0]:02X}h")
                else:
                    emergency = decode_emergency(data)
                    axis.emergencies += bool(emergency.code & 0xFF00)
                    axis.emergency = emergency if emergency.code & 0xFF00 else None

    def _take_tpdo(self, number: int, data: bytes, now: float) -> None:
        slot, entries, size = self._tpdos[number]
        axis = self.axes[slot]
        axis.heard = now
        if len(data) != size:
            axis.foreign += 1
            return
        for entry in entries:
            value, data = data[: entry.size], data[entry.size :]
            axis.show(entry, entry.number(value))


def questions(drives: DrivesFile) -> tuple[can.Message, ...]:
    """Return requests for the digital inputs (60FD) of each drive."""
    return tuple(
        can.Message(
            arbitration_id=_SDO_REQUEST + axis.node,
            data=_upload(axis) + bytes(4),
            is_extended_id=False,
        )
        for axis in drives.axes
    )


def _upload(axis: AxisDrive) -> bytes:
    """Return the SDO request for the digital inputs (60FD) of an axis, without unused bytes."""
    entry = objects.DIGITAL_INPUTS
    return struct.pack("<BHB", 0x40, axis.within.place(entry.index), entry.subindex)
