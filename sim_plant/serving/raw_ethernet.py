"""Server of the plant as EtherCAT slaves on a network interface of Linux, by raw frames."""

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
"""Time to wait for a frame between two checks of `stop_event` [s]."""
EAGER = 0.0003
"""Time to poll for the next frame of a master in lock-step before the server sleeps [s].

Some ten cycles of such a master; waking up takes longer than a cycle (drivers/sync_clock.py).
"""
_FRAME_MAX = 2048
_OURS = 4
"""Packet type of outgoing frames (PACKET_OUTGOING)."""


def open_interface(interface: str) -> socket.socket:
    """Open a network interface for EtherCAT frames.

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
        raise OSError("raw Ethernet frames need root or CAP_NET_RAW") from error
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
        frame = _poll(wire) if came and clock == "sync" else None
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


def _poll(wire: socket.socket) -> bytes | None:
    """Poll for a frame within `EAGER`; return None without a frame."""
    ends = time.perf_counter() + EAGER
    while time.perf_counter() < ends:
        if (frame := _received(wire)) is not None:
            return frame
        os.sched_yield()  # the sender may need this core
    return None


def _received(wire: socket.socket) -> bytes | None:
    """Return a received frame, None if none is waiting."""
    try:
        frame, address = wire.recvfrom(_FRAME_MAX, socket.MSG_DONTWAIT)
    except BlockingIOError:
        return None
    return frame if address[2] != _OURS else None


def _send(wire: socket.socket, frame: bytes) -> None:
    """Send a frame; a frame refused by a full transmit queue is lost, as on a cable."""
    try:
        wire.send(frame)
    except OSError as error:
        if error.errno != errno.ENOBUFS:
            raise
