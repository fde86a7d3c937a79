"""What can be seen of the drives by listening alone: states, positions, currents, emergencies.

`BusPicture` takes frames and sends none, so it works beside a running master, on a bus object of
its own. TPDOs are understood as our driver maps them or as the drives file has them
(`pdo_mapping.transmitted`); one of another length is counted as foreign, not guessed at. Digital
inputs, which show safe torque off, are in none of them: they are taken from the answers to
whoever asks, and `questions` are frames to ask.
"""

from __future__ import annotations

import math
import struct
import time
from collections import deque
from typing import TYPE_CHECKING

import can

from drivers.canopen.objects import NMT_STATES, SYNC
from drivers.canopen.pdo_mapping import transmitted
from drivers.cia402 import objects
from drivers.cia402.error_codes import decode_emergency
from drivers.cia402.picture import AxisPicture, Picture

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.drives_file import AxisDrive, DrivesFile

_SDO_ANSWER, _SDO_REQUEST = 0x580, 0x600
_EXPEDITED = 0x43
RATE_OVER = 50
"""SYNCs over which their rate is taken."""
STOPPED = 2.0
"""Without a SYNC for so long there is no rate any more [s]."""


class BusPicture(Picture):
    """What was seen of all axes of a drives file.

    Parameters
    ----------
    drives : DrivesFile
        The axes in joint order.
    bus : can.BusABC, optional
        To be listened to.
    asked : sequence of can.Message
        Sent on it before it is.
    """

    def __init__(
        self,
        drives: DrivesFile,
        bus: can.BusABC | None = None,
        asked: Sequence[can.Message] = (),
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
        """Take what comes on the bus, for so long [s]."""
        assert self._bus is not None  # noqa: S101 - by the caller
        for question in self._asked:
            self._bus.send(question)
        ends = time.monotonic() + duration
        while (left := ends - time.monotonic()) > 0:
            frame = self._bus.recv(left)
            if frame is not None:
                self.take(frame, time.monotonic())

    def sync_rate(self, now: float) -> float:
        """Rate of the last SYNCs [1/s], 0 if there are none any more at `now` [s]."""
        if now - self._last_sync > STOPPED:
            return 0.0
        span = self._syncs[-1] - self._syncs[0] if len(self._syncs) > 1 else 0.0
        return (len(self._syncs) - 1) / span if span > 0 else 0.0

    def take(self, frame: can.Message, now: float) -> None:
        """Take a frame, heard at `now` [s] of any steady clock."""
        if frame.is_error_frame or frame.is_remote_frame or frame.is_extended_id:
            return
        number, data = frame.arbitration_id, bytes(frame.data)
        if number == SYNC:
            self._syncs.append(frame.timestamp or now)
            self._last_sync = now
        elif number in self._tpdos:
            self._take_tpdo(number, data, now)
        elif number & 0x780 == _SDO_ANSWER and number & 0x7F in self._of_node:
            for axis in self._of_node[number & 0x7F]:
                _take_inputs(axis, data)
        elif number & 0x780 in {0x080, 0x700} and number & 0x7F in self._of_node and data:
            for axis in self._of_node[number & 0x7F]:
                axis.heard = now
                if number & 0x700:
                    axis.nmt = NMT_STATES.get(data[0] & 0x7F, f"{data[0]:02X}h")
                else:
                    _take_emergency(axis, data)

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
    """Return the requests that ask each drive for its digital inputs (60FD)."""
    return tuple(
        can.Message(
            arbitration_id=_SDO_REQUEST + axis.node,
            data=_upload(axis) + bytes(4),
            is_extended_id=False,
        )
        for axis in drives.axes
    )


def _upload(axis: AxisDrive) -> bytes:
    """Return the request for the digital inputs (60FD) of an axis, less its unused bytes."""
    entry = objects.DIGITAL_INPUTS
    return struct.pack("<BHB", 0x40, axis.within.place(entry.index), entry.subindex)


def _take_inputs(axis: AxisPicture, data: bytes) -> None:
    """Take the answer to an upload of 60FD in four bytes, whoever asked for it."""
    if len(data) == 8 and data[0] == _EXPEDITED and data[1:4] == _upload(axis.drive)[1:]:
        axis.show(objects.DIGITAL_INPUTS, int.from_bytes(data[4:], "little"))


def _take_emergency(axis: AxisPicture, data: bytes) -> None:
    emergency = decode_emergency(data)
    if emergency.code & 0xFF00:
        axis.emergency = emergency
        axis.emergencies += 1
    else:
        axis.emergency = None
