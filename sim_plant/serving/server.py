"""Server of the plant on any python-can bus: real, vcan, or ``virtual`` inside a process."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import can

from sim_plant.faults.faulty_network import FaultyNetwork
from sim_plant.faults.frame_faults import NotSent
from sim_plant.serving.wall_clock import WallClock
from sim_plant.slave_network import CYCLE_DEFAULT, SlaveNetwork

if TYPE_CHECKING:
    import threading
    from collections.abc import Iterable, Sequence

    from sim_plant.faults.fault_plan import FaultPlan
    from sim_plant.plant import Plant
    from sim_plant.serving.hand import Hand
    from sim_plant.slave_network import CanFrame, Clock

SYNC = 0x80
"""Identifier of SYNC: time is brought up to date before, since drives latch at SYNC."""

IDLE = 0.1
"""Time to wait for a frame between two checks of `stop_event` [s]."""

RETRIES = 12
"""Doubling pauses from 0.1 ms: half a second for a full transmit queue to drain."""


def serve(
    bus: can.BusABC,
    plant: Plant,
    clock: Clock,
    stop_event: threading.Event,
    faults: FaultPlan | None = None,
    cycle: float = CYCLE_DEFAULT,
    hand: Hand | None = None,
) -> None:
    """Answer on `bus` as the plant's drives until `stop_event` is set.

    Parameters
    ----------
    bus : can.BusABC
        Left open.
    plant : Plant
    clock : {"sync", "wall"}
        See `sim_plant.slave_network`.
    stop_event : threading.Event
    faults : FaultPlan, optional
        Injected faults. A frame refused by the master's adapter is lost here.
    cycle : float
        See `sim_plant.slave_network`.
    hand : Hand, optional
        Receiver of pushes.

    Raises
    ------
    can.CanError
        The bus fails.
    FileError
        A fault of an axis that the plant does not have.
    """
    network: SlaveNetwork | FaultyNetwork
    if faults is None:
        network = SlaveNetwork(plant, clock, cycle)
    else:
        network = FaultyNetwork(plant, clock, faults, cycle)
    wall = WallClock()
    _send(bus, network.power_on())
    while not stop_event.is_set():
        known = time.time()  # all frames sent before this instant have been answered
        message = bus.recv(wall.pause if clock == "wall" else IDLE)
        if hand is not None:
            hand.act(network.time)
        if clock == "wall" and (wall.due or message is None or message.arbitration_id == SYNC):
            until = known if message is None else message.timestamp
            _send(bus, network.elapse(wall.elapsed(until)))
            wall.stepped()
        if message is not None:
            _send(bus, _answer(network, message))


def _answer(network: SlaveNetwork | FaultyNetwork, message: can.Message) -> Sequence[CanFrame]:
    if message.is_extended_id or message.is_error_frame or message.is_fd:
        return []
    if message.is_remote_frame:
        return network.receive_remote(message.arbitration_id)
    try:
        return network.receive(message.arbitration_id, bytes(message.data))
    except NotSent as refused:
        return refused.frames


def _send(bus: can.BusABC, frames: Iterable[CanFrame]) -> None:
    for _, identifier, data in frames:
        message = can.Message(arbitration_id=identifier, data=data, is_extended_id=False)
        _send_patiently(bus, message)


def _send_patiently(bus: can.BusABC, message: can.Message) -> None:
    """Send a frame, waiting for a full transmit queue (ten frames on socketcan) to drain."""
    for attempt in range(RETRIES):
        try:
            bus.send(message)
        except can.CanOperationError:
            time.sleep(1e-4 * 2**attempt)
        else:
            return
    bus.send(message)
