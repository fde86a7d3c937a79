"""Plant as a python-can interface: ``can.Bus(interface="sim_plant", channel="manutec-r15")``.

A channel is the name of a packaged plant or the path of a plant file. The first bus opened on a
channel switches the plant on, the last bus shut down switches it off. All buses of a process on the
same channel share the plant and receive the frames of the drives and of the other buses, so that a
logger can listen to a master.

`PlantBus.lock_step` states whether the plant keeps step with a master's SYNC: all answers of the
drives to a frame are in the receive queue before `send` returns.
"""

from __future__ import annotations

import queue
from collections import deque
from typing import TYPE_CHECKING, Any

import can

from sim_plant.plant_file import packaged_plants
from sim_plant.serving.plant_channel import PlantChannel, close_channel, open_channel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from can.typechecking import AutoDetectedConfig, CanFilters, Channel

    from sim_plant.serving.plant_channel import Block, Inbox

CHANNEL = "manutec-r15"


class PlantBus(can.BusABC):
    """Bus with the plant's drives.

    Parameters
    ----------
    channel : str
        Name of a packaged plant, or path of a plant file.
    can_filters : optional
        Filters of python-can.
    receive_own_messages : bool
        True to receive sent frames.
    **options
        seed, clock, cycle, personality, faults, hand, bitrate: see
        `sim_plant.serving.plant_options`.

    Attributes
    ----------
    lock_step : bool
        True if the plant's time advances by SYNC alone.

    Raises
    ------
    can.CanInitializationError
        An unknown channel, an option without meaning, or a channel open with other options.
    """

    def __init__(
        self,
        channel: Channel = CHANNEL,
        can_filters: CanFilters | None = None,
        *,
        receive_own_messages: bool = False,
        **options: Any,
    ) -> None:
        self._inbox: Inbox = queue.SimpleQueue()
        self._singly: deque[can.Message] = deque()
        self._block: Block = 0.0, b""
        self._echo = receive_own_messages
        self._plant: PlantChannel | None = open_channel(str(channel), self._inbox, options)
        self._direct = True
        self.lock_step = self._plant.options.clock == "sync"
        self.channel_info = f"simulated plant {channel}"
        super().__init__(channel, can_filters)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002
        """Send a frame; the drives' answers are in the receive queues on return.

        Raises
        ------
        can.CanOperationError
            The bus is shut down, or the frame is no classical CAN frame.
        """
        if msg.is_fd:
            raise can.CanOperationError(
                "the plant's drives do not support CAN FD: send classical frames"
            )
        plant = self._plant or self._opened()
        plant.transmit(msg, self._inbox, self._echo)

    def send_repeatedly(self, msg: can.Message, times: int) -> list[bytes]:
        """Send a SYNC repeatedly, each after the answers to the previous SYNC.

        Returns
        -------
        list of bytes
            Answers to all SYNCs but the last, each as `recv_block` returns them. A SYNC with other
            effects than new process data is the last.
        """
        return self._opened().transmit_repeatedly(msg, times, self._inbox, self._echo)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Receive a frame; None if no frame came within `timeout` seconds (None: wait)."""
        if self._direct:
            try:
                return self._next(0.0)
            except queue.Empty:
                if timeout == 0:
                    return None
        return super().recv(timeout)

    def recv_block(self) -> bytes | None:
        """Return all waiting frames as ``struct can_frame``; None if `recv` must be used."""
        if self._singly or not self._direct or self._inbox.qsize() != 1:
            return None
        item = self._inbox.get_nowait()
        if isinstance(item, can.Message):
            self._singly.append(item)
            return None
        self._block = item
        return item[1]

    def put_back(self, block: bytes) -> None:
        """Return the frames of the last block to the queue of single frames."""
        if self._plant is not None and block is self._block[1]:
            self._singly.extend(self._plant.messages(self._block))

    def _next(self, timeout: float | None) -> can.Message:
        while not self._singly:
            item = self._inbox.get_nowait() if timeout == 0 else self._inbox.get(timeout=timeout)
            if isinstance(item, can.Message):
                return item
            self._singly.extend(self._opened().messages(item))
        return self._singly.popleft()

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        self._opened()
        try:
            message = self._next(None if timeout is None else max(0.0, timeout))
            # recv(0) of the base class would give up at the first frame that its filters drop
            while not self._matches_filters(message):
                message = self._next(0.0)
        except queue.Empty:
            return None, False
        return message, True

    def shutdown(self) -> None:
        """Leave the channel; the last bus to leave switches the plant off."""
        super().shutdown()
        self._direct = False
        plant, self._plant = self._plant, None
        if plant is not None:
            close_channel(plant, self._inbox)

    def _apply_filters(self, filters: CanFilters | None) -> None:
        self._direct = filters is None and self._plant is not None

    def _opened(self) -> PlantChannel:
        if self._plant is None:
            raise can.CanOperationError(f"{self.channel_info}: this bus is shut down")
        return self._plant

    @staticmethod
    def _detect_available_configs() -> Sequence[AutoDetectedConfig]:
        return [{"interface": "sim_plant", "channel": name} for name in packaged_plants()]
