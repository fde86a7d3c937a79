"""A plant that several bus objects of one process share, and the list of those that are open.

Every bus has an inbox. A frame sent by one goes to the other buses' inboxes and to the drives, and
the drives' answers to all inboxes, all within the sender's call and under one lock. Time stamps are
the plant's time plus the time that the frames before took on the wire.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import can

from drivers.yaml_file import FileError
from sim_plant.plant import load_plant
from sim_plant.slave_network import CLOCKS, Clock, SlaveNetwork
from sim_plant.wall_clock import TICK, WallClock

if TYPE_CHECKING:
    import queue
    from collections.abc import Iterable

    from sim_plant.slave_network import Frame

    Inbox = queue.SimpleQueue[can.Message]

BITRATE = 1_000_000

_channels: dict[str, PlantChannel] = {}
_channels_lock = threading.Lock()


class DriveFrame(can.Message):
    """A data frame from a drive.

    What is the same for all of them stands in the class, which makes one in a third of the time of
    ``can.Message(...)``: six of them are built for every SYNC.
    """

    __slots__ = ()
    is_extended_id = False
    is_remote_frame = False
    is_error_frame = False
    is_fd = False
    is_rx = True
    bitrate_switch = False
    error_state_indicator = False

    def __init__(self, timestamp: float, identifier: int, data: bytes, channel: str) -> None:
        self.timestamp = timestamp
        self.arbitration_id = identifier
        self.dlc = len(data)
        self.data = bytearray(data)
        self.channel = channel


class PlantChannel:
    """One plant and the inboxes of the buses on it."""

    def __init__(self, name: str, seed: int | None, clock: Clock, bitrate: int) -> None:
        self.name = name
        self.seed = seed
        self.clock = clock
        self.inboxes: list[Inbox] = []
        self._lock = threading.Lock()
        self._network = SlaveNetwork(load_plant(name, seed), clock)
        self._durations = [(47 + 8 * n) / bitrate for n in range(9)]
        self._wire_free = 0.0
        self._stop = threading.Event()
        self._follower = threading.Thread(target=self._follow_wall, name=name, daemon=True)

    def power_on(self) -> None:
        """Boot the drives and start the clock."""
        with self._lock:
            self._deliver(self._network.power_on())
        if self.clock == "wall":
            self._follower.start()

    def power_off(self) -> None:
        """Stop the clock."""
        self._stop.set()
        if self._follower.is_alive():
            self._follower.join()

    def transmit(self, message: can.Message, sender: Inbox, echo: bool) -> None:
        """Pass a frame from one bus to the others and to the drives, and back what they answer."""
        lock, network = self._lock, self._network
        lock.acquire()  # a third of the time of `with`
        try:
            time = self._occupy(network.time, message.dlc)
            if echo or len(self.inboxes) > 1:
                self._pass_on(message, time, sender, echo=echo)
            if message.is_extended_id or message.is_error_frame:
                return
            if message.is_remote_frame:
                self._deliver(network.receive_remote(message.arbitration_id))
            else:
                self._deliver(network.receive(message.arbitration_id, bytes(message.data)))
        finally:
            lock.release()

    def _pass_on(self, message: can.Message, time: float, sender: Inbox, *, echo: bool) -> None:
        for inbox in self.inboxes:
            if inbox is not sender or echo:
                copy = can.Message(
                    timestamp=time,
                    arbitration_id=message.arbitration_id,
                    is_extended_id=message.is_extended_id,
                    is_remote_frame=message.is_remote_frame,
                    is_error_frame=message.is_error_frame,
                    channel=self.name,
                    dlc=message.dlc,
                    data=bytes(message.data),
                    is_rx=inbox is not sender,
                )
                inbox.put(copy)

    def _deliver(self, frames: Iterable[Frame]) -> None:
        free, durations, name, inboxes = self._wire_free, self._durations, self.name, self.inboxes
        for time, identifier, data in frames:
            free = (free if free > time else time) + durations[len(data)]
            for inbox in inboxes:
                inbox.put(DriveFrame(free, identifier, data, name))
        self._wire_free = free

    def _occupy(self, time: float, size: int) -> float:
        """End of a frame that is ready at `time`: the wire carries one after the other."""
        start = self._wire_free if self._wire_free > time else time
        self._wire_free = start + self._durations[size if size < 8 else 8]
        return self._wire_free

    def _follow_wall(self) -> None:
        wall = WallClock()
        while not self._stop.wait(TICK):
            with self._lock:
                self._deliver(self._network.elapse(wall.elapsed()))


def open_channel(
    name: str,
    inbox: Inbox,
    *,
    seed: int | str | None,
    clock: str | None,
    bitrate: int | str,
) -> PlantChannel:
    """Join the plant on a channel, or switch it on.

    Raises
    ------
    can.CanInitializationError
        An unknown channel, an option without meaning, or a channel open with other options.
    """
    wanted_seed = None if seed is None else _whole("seed", seed, 0)
    wanted_rate = _whole("bitrate", bitrate, 1)
    if clock is not None and clock not in CLOCKS:
        raise can.CanInitializationError(f"clock={clock!r}: must be one of {', '.join(CLOCKS)}")
    with _channels_lock:
        channel = _channels.get(name)
        if channel is not None:
            _check_same(channel, wanted_seed, clock)
            channel.inboxes.append(inbox)
            return channel
        try:
            made = PlantChannel(name, wanted_seed, clock or "sync", wanted_rate)
        except FileError as error:
            raise can.CanInitializationError(str(error)) from error
        made.inboxes.append(inbox)
        made.power_on()
        _channels[name] = made
        return made


def close_channel(channel: PlantChannel, inbox: Inbox) -> None:
    """Leave a channel; the last one to leave switches its plant off."""
    with _channels_lock:
        channel.inboxes = [other for other in channel.inboxes if other is not inbox]
        if not channel.inboxes:
            channel.power_off()
            _channels.pop(channel.name, None)


def _check_same(channel: PlantChannel, seed: int | None, clock: str | None) -> None:
    for option, wanted, present in (("seed", seed, channel.seed), ("clock", clock, channel.clock)):
        if wanted is not None and wanted != present:
            raise can.CanInitializationError(
                f"{channel.name}: is open in this process with {option}={present}, "
                f"not {option}={wanted}; leave {option} out or shut the other bus down"
            )


def _whole(option: str, value: int | str, least: int) -> int:
    try:
        number = int(value)
    except ValueError:
        number = least - 1
    if number < least:
        raise can.CanInitializationError(
            f"{option}={value!r}: must be a whole number from {least} up"
        )
    return number
