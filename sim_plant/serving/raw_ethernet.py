"""Serves the plant as EtherCAT slaves on a network interface of Linux, by raw frames."""

from __future__ import annotations

import errno
import os
import select
import socket
import time
from typing import TYPE_CHECKING

from sim_plant.ethercat.frame import ETHERTYPE
from sim_plant.serving.wall_clock import WallClock

if TYPE_CHECKING:
    import threading

    from sim_plant.ethercat.segment import Segment
    from sim_plant.faults.faulty_segment import FaultySegment
    from sim_plant.slave_network import Clock

IDLE = 0.1
"""How long the server waits for a frame before it looks at `stop_event` [s]."""
EAGER = 0.0003
"""How long the next frame of a master in lock-step is looked for before the server goes to sleep
[s]: some ten cycles of such a master; waking up takes longer than one (drivers/sync_clock.py)."""
_FRAME_MAX = 2048
_OURS = 4
"""Packet type of a frame that leaves (PACKET_OUTGOING)."""


def open_interface(interface: str) -> socket.socket:
    """Open a network interface for frames of EtherCAT.

    Raises
    ------
    OSError
        No such interface, no permission (root or CAP_NET_RAW), or no Linux.
    """
    if not hasattr(socket, "AF_PACKET"):
        raise OSError("EtherCAT needs raw Ethernet frames, which are sent here on Linux only")
    try:
        wire = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERTYPE))
    except PermissionError as error:
        raise OSError("raw Ethernet frames are for root, or with CAP_NET_RAW") from error
    try:
        wire.bind((interface, ETHERTYPE))
    except OSError as error:
        wire.close()
        known = ", ".join(name for _, name in socket.if_nameindex())
        raise OSError(f"{interface}: {error.strerror}; interfaces are {known}") from error
    return wire


def serve_frames(
    wire: socket.socket, segment: Segment | FaultySegment, clock: Clock, stop_event: threading.Event
) -> None:
    """Answer on `wire` as the plant's slaves until `stop_event` is set.

    Parameters
    ----------
    wire : socket
        Left open.
    segment : Segment or FaultySegment
        Switched on.
    clock : {"sync", "wall"}
        See `sim_plant.ethercat.segment`.
    stop_event : threading.Event

    Raises
    ------
    OSError
        The interface fails.
    """
    wall = WallClock()
    came = False
    while not stop_event.is_set():
        frame = _at_once(wire) if came and clock == "sync" else None
        if frame is None:
            ready = select.select([wire], [], [], wall.pause if clock == "wall" else IDLE)[0]
            if clock == "wall":
                segment.elapse(wall.elapsed())
                wall.stepped()
            frame = _received(wire) if ready else None
        came = frame is not None
        answer = segment.process(frame) if frame is not None else None
        if answer is not None:
            _send(wire, answer)


def _at_once(wire: socket.socket) -> bytes | None:
    """Return a frame that comes within `EAGER`, None if none does."""
    ends = time.perf_counter() + EAGER
    while time.perf_counter() < ends:
        if (frame := _received(wire)) is not None:
            return frame
        os.sched_yield()  # who is to send may need this core
    return None


def _received(wire: socket.socket) -> bytes | None:
    """Return a frame that has come, None where there is none."""
    try:
        frame, address = wire.recvfrom(_FRAME_MAX, socket.MSG_DONTWAIT)
    except BlockingIOError:
        return None
    return frame if address[2] != _OURS else None


def _send(wire: socket.socket, frame: bytes) -> None:
    """Send; a frame that the full queue of the interface does not take is lost, as on a cable."""
    try:
        wire.send(frame)
    except OSError as error:
        if error.errno != errno.ENOBUFS:
            raise
