"""Serves the plant as EtherCAT slaves on a network interface of Linux, by raw frames."""

from __future__ import annotations

import errno
import select
import socket
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
    while not stop_event.is_set():
        ready = select.select([wire], [], [], wall.pause if clock == "wall" else IDLE)[0]
        if clock == "wall":
            segment.elapse(wall.elapsed())
            wall.stepped()
        if not ready:
            continue
        frame, address = wire.recvfrom(_FRAME_MAX)
        if address[2] != _OURS:
            answer = segment.process(frame)
            if answer is not None:
                _send(wire, answer)


def _send(wire: socket.socket, frame: bytes) -> None:
    """Send; a frame that the full queue of the interface does not take is lost, as on a cable."""
    try:
        wire.send(frame)
    except OSError as error:
        if error.errno != errno.ENOBUFS:
            raise
