"""Network of the plant's drives on a bus segment: frames in, frames out, passage of time.

There are two clocks. With ``"sync"`` time stands still between SYNCs; each SYNC advances the
machine by the communication cycle period (1006h, the longest of all drives), so a master paced by
SYNC runs as fast as the processor and always gets the same answers. With ``"wall"`` the caller
advances time by `elapse`, and a SYNC only latches; masters without SYNC need this clock.

Either way the machine stops at every due timer, all axes are latched at the same instant, and the
frames of one instant leave in the order of their identifiers, as arbitration would have it.
"""

from __future__ import annotations

import struct
from collections import defaultdict
from collections.abc import Sequence
from operator import itemgetter
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeAlias, overload

from sim_plant.canopen.heartbeat import HEARTBEAT
from sim_plant.canopen.nmt import NmtState
from sim_plant.canopen.object_dictionary import bounds
from sim_plant.drive.cia402_node import Cia402Node
from sim_plant.drive.process_image import AxisImage, Field, FrameBlock
from sim_plant.timed_network import TimedNetwork

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from sim_plant.canopen.pdo import Report, Rpdo
    from sim_plant.machine_protocol import Machine

Clock: TypeAlias = Literal["sync", "wall"]
CLOCKS: tuple[Clock, ...] = ("sync", "wall")

CYCLE_DEFAULT = 0.004
"""SYNC period while no drive is set to a period [s]."""

FRAME = struct.Struct("=IB3x8s")
"""``struct can_frame``: identifier, length, data."""

_OPERATIONAL = bytes([NmtState.OPERATIONAL])
_by_identifier = itemgetter(1)


CanFrame: TypeAlias = tuple[float, int, bytes]
"""Data frame sent by a drive: instant [s], 11-bit identifier, data."""


class FramesOfSync(Sequence[CanFrame]):
    """Frames that answer a SYNC, unpacked only when read.

    Parameters
    ----------
    time : float
        Instant of all frames [s].
    packed : bytes
        One `FRAME` after another.
    """

    __slots__ = ("packed", "time")

    def __init__(self, time: float, packed: bytes) -> None:
        self.time, self.packed = time, packed

    @classmethod
    def pack(cls, frames: Sequence[CanFrame]) -> FramesOfSync:
        """Pack frames as of the instant of the last one, unless already packed."""
        if isinstance(frames, cls):
            return frames
        packed = b"".join(FRAME.pack(number, len(data), data) for _, number, data in frames)
        return cls(frames[-1][0], packed)

    def __len__(self) -> int:
        return len(self.packed) // FRAME.size

    def __iter__(self) -> Iterator[CanFrame]:
        for identifier, size, data in FRAME.iter_unpack(self.packed):
            yield self.time, identifier, data[:size]

    @overload
    def __getitem__(self, index: int) -> CanFrame: ...
    @overload
    def __getitem__(self, index: slice) -> list[CanFrame]: ...
    def __getitem__(self, index: int | slice) -> CanFrame | list[CanFrame]:
        return list(self)[index]


class _Synced(NamedTuple):
    """Consequences of a SYNC: actions, pending RPDOs, then reports.

    `block` packs all reports at once; None if a report contains values outside the axes' images.
    """

    actions: list[Callable[[], None]]
    rpdos: list[Rpdo]
    reports: list[Report]
    block: FrameBlock | None


class SlaveNetwork(TimedNetwork):
    """Drives of a machine on a bus.

    Parameters
    ----------
    machine : Machine
    clock : {"sync", "wall"}
    cycle : float
        SYNC period while no drive has a period (1006h) [s].

    Attributes
    ----------
    nodes : tuple of Cia402Node
    time : float
        Time since power-on [s].
    cycle : float
        Simulated time per SYNC [s].
    """

    def __init__(
        self, machine: Machine, clock: Clock = "sync", cycle: float = CYCLE_DEFAULT
    ) -> None:
        super().__init__(machine)
        self.cycle = self._default_cycle = cycle
        self._clock = clock
        self._past: list[CanFrame] = []
        self._present: list[CanFrame] = []
        self._stale = True
        self._synced: dict[int, _Synced] = {}
        self._counted: dict[int, _Synced] = {}
        self._routes: dict[int, list[Callable[[bytes], None]]] = {}
        self._remote: dict[int, list[Callable[[], None]]] = {}
        self._event_actions: list[Callable[[], None]] = []
        self.nodes: tuple[Cia402Node, ...] = tuple(
            Cia402Node(
                settings, axis, AxisImage(self._image, i), self._timers, self._emit, self._rewire
            )
            for i, (settings, axis) in enumerate(zip(machine.drives, machine.axes, strict=True))
        )
        for first in self.nodes:
            own = [node for node in self.nodes if node.node_id == first.node_id]
            if first.dictionary.owner[1] == 1 and len(own) > 1:
                first.join(sorted(own, key=lambda node: node.dictionary.owner)[1:])
        for node in self.nodes:
            node.dictionary.react(0x1006, lambda _subindex, _value: self._rewire())

    def power_on(self) -> list[CanFrame]:
        """Boot all drives."""
        self._latch()
        for node in self.nodes:
            node.boot()
        return self._take()

    def receive(self, identifier: int, data: bytes) -> Sequence[CanFrame]:
        """Process a data frame with 11-bit identifier; return the frames of the drives.

        Returns
        -------
        sequence of CanFrame
            `FramesOfSync` if only the answers to one SYNC are sent.
        """
        if self._stale:
            self._wire()
        synced = (self._counted if data else self._synced).get(identifier)
        if synced is not None:
            return self._sync(synced)
        for handle in self._routes.get(identifier, ()):
            handle(data)
        return self._take()

    def receive_repeatedly(self, identifier: int, times: int) -> list[Sequence[CanFrame]]:
        """Process several SYNCs without data in advance, up to any news.

        Returns
        -------
        list of sequence of CanFrame, length 1 to `times`
            Frames of the drives for each SYNC. All but the last are answers with unchanged
            statuswords, and heartbeats of operational nodes; the last may be anything.
        """
        answers: list[Sequence[CanFrame]] = []
        while True:
            answers += self._foresee(identifier, times - len(answers))
            if len(answers) == times:
                return answers
            words, synced = self._image.statuswords.tolist(), self._synced.get(identifier)
            frames = self.receive(identifier, b"")
            answers.append(frames)
            same = words == self._image.statuswords.tolist()
            if synced is None or not (same and synced is self._synced.get(identifier)):
                return answers
            before = () if isinstance(frames, FramesOfSync) else frames[: -len(synced.reports)]
            if any(number < HEARTBEAT or data != _OPERATIONAL for _, number, data in before):
                return answers

    def _foresee(self, identifier: int, times: int) -> Sequence[FramesOfSync]:
        """Simulate several SYNCs at once, up to the next timer or news of a drive."""
        if self._stale:
            self._wire()
        synced = self._synced.get(identifier)
        if synced is None or self._clock != "sync":
            return ()
        actions, rpdos, _, block = synced
        waits = self._past or self._present or self._event_actions or actions
        if block is None or waits or any(rpdo.pending is not None for rpdo in rpdos):
            return ()
        instants, readings = self._advance_quietly(times, self.cycle)
        return [*map(FramesOfSync, instants, block.pack_all(readings))] if instants else ()

    def receive_remote(self, identifier: int) -> list[CanFrame]:
        """Process a remote frame; return the frames of the drives."""
        if self._stale:
            self._wire()
        for answer in self._remote.get(identifier, ()):
            answer()
        return self._take()

    def elapse(self, duration: float) -> list[CanFrame]:
        """Let time pass without SYNC [s]; return the frames of the drives."""
        if self._stale:
            self._wire()
        self._advance(duration)
        self._latch()
        return self._take()

    def _sync(self, synced: _Synced) -> Sequence[CanFrame]:
        if self._clock == "sync":
            self._advance(self.cycle)
        actions, rpdos, reports, block = synced
        for rpdo in rpdos:
            if rpdo.pending is not None:
                actions = [*(each.act_on_sync for each in rpdos), *actions]
                break
        if block is None:
            self._latch()
        elif news := block.latch(self._machine.read()):
            self._attend(news)
            block.pack()
        if not (block is None or actions or self._event_actions or self._present or self._stale):
            frames = FramesOfSync(self._timers.now, block.frames)
            if not self._past:
                return frames
            past, self._past = self._past, []
            return [*past, *frames]
        for act in actions:
            act()
        if block is None:
            now = self._timers.now
            self._present += [(now, report.identifier, report.data()) for report in reports]
        else:
            block.pack()
            self._present += FramesOfSync(self._timers.now, block.frames)
        return self._take()

    def _emit(self, identifier: int, data: bytes) -> None:
        self._present.append((self._timers.now, identifier, data))

    def _settle(self) -> None:
        """Append the frames of the present instant in arbitration order."""
        self._past += self._take_present()

    def _take(self) -> list[CanFrame]:
        if self._stale:
            self._wire()
        frames = self._take_present()
        if not self._past:
            return frames
        past, self._past = self._past, []
        return past + frames

    def _take_present(self) -> list[CanFrame]:
        for act in self._event_actions:
            act()
        frames, self._present = self._present, []
        if len(frames) > 1:
            frames.sort(key=_by_identifier)
        return frames

    def _rewire(self) -> None:
        self._stale = True

    def _wire(self) -> None:
        """Collect the handlers of all drives by identifier."""
        self._stale = False
        routes: defaultdict[int, list[Callable[[bytes], None]]] = defaultdict(list)
        remote: defaultdict[int, list[Callable[[], None]]] = defaultdict(list)
        for node in self.nodes:
            for identifier, handle in node.routes():
                routes[identifier].append(handle)
            for identifier, answer in node.remote_routes():
                remote[identifier].append(answer)
        self._routes, self._remote = dict(routes), dict(remote)
        self._synced = self._counted = self._collect_synced(counter=False)
        if any(node.sync_counter.expected for node in self.nodes):
            self._counted = self._collect_synced(counter=True)
        self._event_actions = [act for node in self.nodes for act in node.event_actions()]
        longest = max(node.dictionary.get(0x1006) for node in self.nodes)
        self.cycle = longest * 1e-6 or self._default_cycle

    def _collect_synced(self, *, counter: bool) -> dict[int, _Synced]:
        """Return the consequences of a SYNC with or without counter, by identifier."""
        actions: defaultdict[int, list[Callable[[], None]]] = defaultdict(list)
        rpdos: defaultdict[int, list[Rpdo]] = defaultdict(list)
        reports: defaultdict[int, list[Report]] = defaultdict(list)
        for node in self.nodes:
            number, expected = node.sync_identifier, node.sync_counter.expected
            if expected:
                actions[number].append(
                    node.sync_counter.take if counter else node.sync_counter.miss
                )
            if counter or not expected:
                actions[number] += node.sync_actions()
                rpdos[number] += node.sync_rpdos()
                reports[number] += node.sync_reports()
        return {
            number: _Synced(
                actions[number], rpdos[number], reports[number], self._block(reports[number])
            )
            for number in actions
        }

    def _block(self, reports: Sequence[Report]) -> FrameBlock | None:
        frames = [
            (report.identifier, [_field(slot, code) for slot, code in report.imaged])
            for report in reports
            if report.imaged is not None
        ]
        return FrameBlock(self._image, frames) if len(frames) == len(reports) else None


def _field(slot: int, code: str) -> Field:
    return Field(slot, struct.calcsize("<" + code), *bounds(code))
