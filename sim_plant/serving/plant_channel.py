"""Plants shared by several bus objects of a process, and the list of open channels.

Every bus has an inbox. A frame sent by a bus goes to the other buses' inboxes and to the drives,
and the drives' answers to all inboxes, all within the sender's call and under one lock. Time stamps
are the plant's time plus the time of the preceding frames on the wire.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import can

from checked_files.yaml_file import FileError
from sim_plant.faults.fault_plan import load_fault_plan
from sim_plant.faults.faulty_network import FaultyNetwork
from sim_plant.faults.frame_faults import NotSent
from sim_plant.serving.hand import Hand
from sim_plant.serving.plant_options import PlantOptions
from sim_plant.serving.wall_clock import TICK, WallClock
from sim_plant.slave_network import FRAME, FramesOfSync, SlaveNetwork
from sim_plant.switch_on import load_machine

if TYPE_CHECKING:
    import queue
    from collections.abc import Iterable, Iterator, Sequence

    from sim_plant.plant import Plant
    from sim_plant.slave_network import CanFrame

    Block = tuple[float, bytes]
    """Start of a block of frames on the wire [s], and the block."""
    Inbox = queue.SimpleQueue[can.Message | Block]

_channels: dict[str, PlantChannel] = {}
_channels_lock = threading.Lock()


class PlantChannel:
    """Plant with the inboxes of its buses."""

    def __init__(self, name: str, options: PlantOptions) -> None:
        self.name = name
        self.options = options
        self.inboxes: list[Inbox] = []
        self._lock = threading.Lock()
        machine = load_machine(name, options.seed, options.personality)
        self._network = _network(machine, options)
        self._hand = None if options.hand is None else Hand(options.hand, machine)
        self._durations = [(47 + 8 * n) / options.bitrate for n in range(9)]
        self._wire_free = 0.0
        self._of_blocks: dict[bytes, float] = {}
        self._stop = threading.Event()
        self._follower = threading.Thread(target=self._follow_wall, name=name, daemon=True)

    def power_on(self) -> None:
        """Boot the drives and start the clock."""
        with self._lock:
            self._deliver(self._network.power_on())
        if self.options.clock == "wall":
            self._follower.start()

    def power_off(self) -> None:
        """Stop the clock."""
        self._stop.set()
        if self._follower.is_alive():
            self._follower.join()
        if self._hand is not None:
            self._hand.close()

    def transmit(self, message: can.Message, sender: Inbox, echo: bool) -> None:
        """Pass a frame from a bus to the other buses and the drives, and deliver the answers."""
        network = self._network
        with self._lock:  # an interrupt after a call of `acquire` would never release the lock
            time = self._occupy(network.time, message.dlc)
            if self._hand is not None:
                self._hand.act(network.time)
            if echo or len(self.inboxes) > 1:
                self._pass_on(message, time, sender, echo=echo)
            if message.is_extended_id or message.is_error_frame:
                return
            try:
                if message.is_remote_frame:
                    self._deliver(network.receive_remote(message.arbitration_id))
                else:
                    self._deliver_answers(
                        network.receive(message.arbitration_id, bytes(message.data))
                    )
            except NotSent as refused:
                self._deliver(refused.frames)
                raise

    def transmit_repeatedly(
        self, message: can.Message, times: int, sender: Inbox, echo: bool
    ) -> list[bytes]:
        """Pass a SYNC to the drives several times; return all answers except the last.

        Answers are packed as `FramesOfSync`, after heartbeats of operational nodes, if any. The
        answers to the last SYNC go to the inboxes. With other listeners or actors on the channel,
        the first SYNC is the last.
        """
        network, packed = self._network, list[bytes]()
        alone = len(self.inboxes) == 1 and self._hand is None and not echo
        if not (alone and isinstance(network, SlaveNetwork)):
            self.transmit(message, sender, echo)
            return packed
        with self._lock:
            before = network.time
            *answers, last = network.receive_repeatedly(message.arbitration_id, times)
            for frames in map(FramesOfSync.pack, answers):
                self._occupy(before, 0)
                self._occupy_for(frames)
                packed.append(frames.packed)
                before = frames.time
            self._occupy(before, 0)
            self._deliver_answers(last)
        return packed

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

    def _deliver(self, frames: Iterable[CanFrame]) -> None:
        free, durations, name, inboxes = self._wire_free, self._durations, self.name, self.inboxes
        for time, identifier, data in frames:
            free = (free if free > time else time) + durations[len(data)]
            for inbox in inboxes:
                inbox.put(_message(free, identifier, data, name))
        self._wire_free = free

    def _deliver_answers(self, frames: Sequence[CanFrame]) -> None:
        """Put frames into all inboxes; those of a SYNC are unpacked by the readers."""
        if isinstance(frames, FramesOfSync):
            start = self._occupy_for(frames)
            for inbox in self.inboxes:
                inbox.put((start, frames.packed))
        else:
            self._deliver(frames)

    def _occupy_for(self, frames: FramesOfSync) -> float:
        """Return the start on the wire of the frames of a SYNC [s], and occupy the wire."""
        sizes = frames.packed[4 :: FRAME.size]
        start = self._wire_free if self._wire_free > frames.time else frames.time
        if sizes not in self._of_blocks:
            self._of_blocks[sizes] = sum(self._durations[size] for size in sizes)
        self._wire_free = start + self._of_blocks[sizes]
        return start

    def messages(self, block: Block) -> Iterator[can.Message]:
        """Yield the frames of a block as messages."""
        free, frames = block
        for identifier, size, data in FRAME.iter_unpack(frames):
            free += self._durations[size]
            yield _message(free, identifier, data[:size], self.name)

    def _occupy(self, time: float, size: int) -> float:
        """Return the end of a frame ready at `time`: the wire carries frames in sequence."""
        start = self._wire_free if self._wire_free > time else time
        self._wire_free = start + self._durations[size if size < 8 else 8]
        return self._wire_free

    def _follow_wall(self) -> None:
        wall = WallClock()
        while not self._stop.wait(TICK):
            with self._lock:
                if self._hand is not None:
                    self._hand.act(self._network.time)
                self._deliver(self._network.elapse(wall.elapsed()))


def _message(timestamp: float, identifier: int, data: bytes, channel: str) -> can.Message:
    return can.Message(timestamp, identifier, is_extended_id=False, data=data, channel=channel)


def open_channel(name: str, inbox: Inbox, given: dict[str, object]) -> PlantChannel:
    """Join the plant on a channel, or switch it on.

    Parameters
    ----------
    name : str
    inbox : SimpleQueue
        Queue of frames for the joining bus.
    given : dict
        See `PlantOptions`.

    Raises
    ------
    can.CanInitializationError
        An unknown channel, an option without meaning, or a channel open with other options.
    """
    options = PlantOptions.parse(given)
    with _channels_lock:
        channel = _channels.get(name)
        if channel is not None:
            channel.options.refuse_others(given, name)
            channel.inboxes.append(inbox)
            return channel
        try:
            made = PlantChannel(name, options)
        except FileError as error:
            raise can.CanInitializationError(str(error)) from error
        made.inboxes.append(inbox)
        made.power_on()
        _channels[name] = made
        return made


def close_channel(channel: PlantChannel, inbox: Inbox) -> None:
    """Leave a channel; the last bus to leave switches its plant off."""
    with _channels_lock:
        channel.inboxes = [other for other in channel.inboxes if other is not inbox]
        if not channel.inboxes:
            channel.power_off()
            _channels.pop(channel.name, None)


def _network(machine: Plant, options: PlantOptions) -> SlaveNetwork | FaultyNetwork:
    if options.faults is None:
        return SlaveNetwork(machine, options.clock, options.cycle)
    plan = load_fault_plan(options.faults)
    return FaultyNetwork(machine, options.clock, plan, options.cycle)
