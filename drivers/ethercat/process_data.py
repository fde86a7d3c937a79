"""The hot path: one frame out with the outputs of all drives, back with their inputs.

Each axis has a datagram of its own, so its working counter says whether this very drive took its
outputs and gave inputs; beside them the AL state of all is read. What comes back was latched when
the frame before passed (drives synchronous to their sync managers), and stands under that instant.
After lost frames nobody knows which of them the drives saw: the next inputs may be as old as the
first of them, and are not taken.

Where drives have clocks they act and latch at SYNC0, and the frame brings the time at which it
passed the reference: the sample stands under the SYNC0 before that. A frame that came so late, or
so early, that there was none since the last one is flagged as doubled, an axis whose clock is off
as late.

Outputs stay until others take their place, so a lost frame is made good by the next. Controlwords
that must follow each other have a cycle each that the drive has taken; one that stops an axis
waits for none.
"""

from __future__ import annotations

import math
import struct
import time
from collections import deque
from contextlib import suppress
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.cia402.states import Command as Order
from drivers.cycle_data import ProcessData, make_unpacker
from drivers.drive_bus import SampleFlag
from drivers.ethercat import registers as reg
from drivers.ethercat.al_states import AlState
from drivers.ethercat.clocks import OUT_OF_STEP, is_together, size_of
from drivers.ethercat.drive import GUARDS
from drivers.ethercat.frames import HEAD, START, TAIL, Command, Datagram, answers_of, at
from drivers.ethercat.process_layout import picking
from drivers.ethercat.reference_clock import ReferenceClock
from drivers.remote_dictionary import NoAnswer

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from drivers.drives_file import AxisDrive
    from drivers.ethercat.clocks import Clocks
    from drivers.ethercat.drive import EthercatDrive
    from drivers.ethercat.line import Line
    from drivers.ethercat.process_layout import Place
    from drivers.fieldbus import Entry
    from drivers.sync_clock import SyncClock

LOGICAL, APART = 0x0001_0000, 0x1000
"""Where the process data of the first drive stand in logical memory, and how far apart."""
FOREIGN = 3
"""Frames that are not ours: more of them are no chance."""
_BOTH, _READ = 3, 1
"""Working counter of a drive that took outputs (2) and gave inputs (1), or that was read."""
_ASKED = 20
"""Drives whose watchdogs are read by one frame."""
_TIMES = 4
"""Unpacked of the clocks: the reference's time, all differences, each with its working counter."""
_VALUES = 5
"""Unpacked of an axis: statusword, position, current, state of the mailbox, working counter."""
_STOPS = frozenset({Order.QUICK_STOP.value[0], Order.DISABLE_VOLTAGE.value[0]})
_MISSING, _LATE, _DOUBLED = (
    flag.value for flag in (SampleFlag.MISSING, SampleFlag.LATE, SampleFlag.DOUBLED)
)
_WATCHDOGS = Datagram(Command.BRD, reg.WATCHDOG_STATUS << 16, bytes(2))
"""Read where no outputs are sent: what a plant in lock-step takes for a cycle that passes."""


class EthercatProcessData(ProcessData):
    """Process data of all axes (`drivers.cycle_data.ProcessData`).

    Parameters
    ----------
    line : Line
        That the drives are on.
    axes : sequence of AxisDrive
        In joint order.
    drives : sequence of EthercatDrive
        The same.
    clock : SyncClock
        Where the time of a cycle comes from.

    Attributes
    ----------
    feeding : bool
        Outputs are sent; else inputs are read alone.
    unusual, fallen : bool
        A drive is not in OP, or away; one shows that it is not in OP.
    mail : tuple of int
        Axes in whose mailbox something waits.
    farthest : float
        How far any clock was from the reference since they were set, at most [s].
    """

    def __init__(
        self,
        line: Line,
        axes: Sequence[AxisDrive],
        drives: Sequence[EthercatDrive],
        clock: SyncClock,
    ) -> None:
        super().__init__(len(axes), clock)
        self._line, self._axes, self._drives = line, axes, drives
        self.unusual = self.fallen = False
        self.farthest = 0.0
        self._clocks: Clocks | None = None
        self.mail: tuple[int, ...] = ()
        self.feeding, self._wired = True, False
        self.time = clock.now()
        self._sent_at = self._passed_at = self._shown = self.time
        self._gone: dict[int, float] = {}
        self._fresh: set[int] = set()
        self._queues: dict[int, deque[tuple[int, int]]] = {}
        self._mailboxes: Sequence[int] = self._regular
        self._ticking = line.frame([_WATCHDOGS])
        self._outputs: list[dict[Place, Place]] = [{} for _ in axes]
        for axis, drive in enumerate(drives):
            drive.carry = self._carry(axis)

    def wire(self, clocks: Clocks | None = None, *, alone: bool) -> None:
        """Make the frames of a cycle for process data as they are set up, all outputs zero.

        Parameters
        ----------
        clocks : Clocks, optional
            That drives latch by.
        alone : bool
            Nothing but the drives is on the line, so their AL state is read at once.
        """
        layout, order, place = f"<{START}x", list[int](), START
        written, read = list[Datagram](), list[Datagram]()
        for axis, drive in enumerate(self._drives):
            size = drive.outputs.size + drive.inputs.size + 1
            address = LOGICAL + APART * axis
            written.append(Datagram(Command.LRW, address, bytes(size)))
            read.append(Datagram(Command.LRD, address, bytes(size)))
            found = drive.outputs.places.items()
            self._outputs[axis] = {key: (place + HEAD + at, n) for key, (at, n) in found}
            picked, own = picking(drive.inputs, self._axes[axis])
            layout += f"{HEAD + drive.outputs.size}x{picked}BH"
            order += [_VALUES * axis + n for n in (*own, 3, 4)]
            place += HEAD + size + TAIL
        states = [
            Datagram(Command.FPRD, at(drive.station.address, reg.AL_STATUS), bytes(2))
            for drive in self._drives
        ]
        if alone:
            states = [Datagram(Command.BRD, reg.AL_STATUS << 16, bytes(2))]
        layout += f"{HEAD}xHH" * len(states)
        order += range(len(order), len(order) + 2 * len(states))
        if clocks is not None:
            layout += f"{HEAD}xQH{HEAD}xIH"
            order += range(len(order), len(order) + _TIMES)
            states += clocks.datagrams
        self._clocks = clocks if isinstance(self._clock, ReferenceClock) else None
        n = len(self._drives)
        self._in_op = (AlState.OP.value, n) if alone else (AlState.OP.value, 1) * n
        self._gone.clear()
        self._counters = {True: (_BOTH,) * n, False: (_READ,) * n}
        self._frames = {
            True: self._line.frame((*written, *states)),
            False: self._line.frame((*read, *states, _WATCHDOGS)),
        }
        self._guards = [
            Datagram(Command.FPRD, at(drive.station.address, place), bytes(size))
            for drive in self._drives
            for place, size in GUARDS
        ]
        self._size = struct.calcsize(layout)
        self._unpack = make_unpacker(layout, order)
        self._end = _VALUES * n
        self._states = self._end + len(self._in_op)
        self._fresh.clear()
        self._queues.clear()
        self._wired = True

    # Commands

    def command(self, axis: int, target: int, controlword: int) -> None:
        """Send target position [increments] and controlword to one axis with the next cycle."""
        if controlword in _STOPS:
            self._queues.pop(axis, None)
        elif axis in self._fresh:
            queue = self._queues.setdefault(axis, deque())
            last = queue[-1][0] if queue else self._word(axis)
            if controlword != last:
                queue.append((controlword, target))
                return
            if queue:
                queue[-1] = (controlword, target)
                return
        self._set(axis, controlword, target)

    def lead(self, axis: int, target: int) -> None:
        """Send a set-point of a stream to one axis that follows it [increments]."""
        self._put(axis, objects.TARGET_POSITION, target)

    def feed_forward(self, axis: int, velocity: int, torque: int) -> None:
        """Send offsets of velocity [drive's unit] and torque [per mille of rated] to one axis."""
        self._put(axis, objects.VELOCITY_OFFSET, velocity)
        self._put(axis, objects.TORQUE_OFFSET, torque)

    def withdraw(self, axis: int) -> None:
        """Take back what is fed forward to one axis; nothing where drives take no offsets."""
        self.feed_forward(axis, 0, 0)

    def _set(self, axis: int, controlword: int, target: int) -> None:
        self._put(axis, objects.TARGET_POSITION, target)
        self._put(axis, objects.CONTROLWORD, controlword)
        self._fresh.add(axis)

    def _put(self, axis: int, entry: Entry, value: int) -> None:
        self._store(
            axis,
            (entry.index, entry.subindex),
            value.to_bytes(entry.size, "little", signed=entry.signed),
        )

    def _store(self, axis: int, place: Place, data: bytes) -> None:
        found = self._outputs[axis].get(place)
        if found is not None:
            start, size = found
            self._frames[True][start : start + size] = data[:size].ljust(size, b"\0")

    def _word(self, axis: int) -> int:
        start, size = self._outputs[axis][objects.CONTROLWORD.index, 0]
        return int.from_bytes(self._frames[True][start : start + size], "little")

    def _carry(self, axis: int) -> Callable[[int, int, bytes], bool]:
        """Return what takes writes to objects of a drive that its outputs carry too."""

        def carry(index: int, subindex: int, data: bytes) -> bool:
            if not self._wired or (index, subindex) not in self._outputs[axis]:
                return False
            if index == objects.CONTROLWORD.index:
                word = int.from_bytes(data, "little")
                self.command(axis, self.positions[axis], word)
            else:
                self._store(axis, (index, subindex), data)
            return True

        return carry

    def _confirm(self, counters: Sequence[int]) -> None:
        """Let the next controlword take its place where a drive has taken the present one."""
        for axis in tuple(self._fresh):
            if counters[axis] == _BOTH:
                queue = self._queues.get(axis)
                if queue:
                    word, target = queue.popleft()
                    self._set(axis, word, target)
                else:
                    self._fresh.discard(axis)

    # A cycle

    def sync(self) -> float:
        """Exchange process data when it is due; return the instant of the inputs [s].

        Raises
        ------
        BusUnavailable
            The interface does not take or give frames any more.
        """
        clock, line = self._clock, self._line
        while (due := clock.due()) > 0:  # whoever sleeps too long passes this deadline over
            time.sleep(due)
        self.untimed = clock.uncertain  # inputs are those of the frame before
        clock.note_sending()
        line.send(self._frames[self.feeding])
        instant = self._sent_at = clock.note_sent()
        answer = line.receive(clock.window())
        before, self._passed_at = self._passed_at, instant
        self._pass_to(clock.latch_instant(instant, before))
        if answer is None or len(answer) < self._size:
            self._take_nothing()
            return self.time
        values = self._unpack(answer)
        end = self._end
        states = values[end : self._states]
        off = self._look_at_times(values, instant) if self._clocks else {}
        counters = values[4:end:_VALUES]
        if self._mailboxes != (mailboxes := values[3:end:_VALUES]):
            self._mailboxes = mailboxes
            self.mail = tuple(n for n, each in enumerate(mailboxes) if each & reg.FULL)
        if counters == self._counters[self.feeding] and not (self._gone or off):
            self.words, self.positions = values[0:end:_VALUES], values[1:end:_VALUES]
            self.currents = values[2:end:_VALUES]
            if self.unusual or states != self._in_op:
                self._look_at_states(states)
            if self.irregular or clock.passed_over:
                self._publish({})
        else:
            self._take(values, counters, off)
        if self._fresh and self.feeding:
            self._confirm(counters)
        return self.time

    def _take(self, values: Sequence[int], counters: Sequence[int], off: Mapping[int, int]) -> None:
        """Take the values of those axes that took part; what is flagged already stays so."""
        full = self._counters[self.feeding][0]
        words, positions = list(self.words), list(self.positions)
        currents, found = list(self.currents), dict(off)
        for axis, counter in enumerate(counters):
            if counter != full:
                self._gone.setdefault(axis, self._clock.now())
                found[axis] = _MISSING
                continue
            if self._gone.pop(axis, None) is not None and not self._clocks:
                found[axis] = _MISSING
                continue
            start = _VALUES * axis
            words[axis], positions[axis], currents[axis] = values[start : start + 3]
        self.words, self.positions, self.currents = tuple(words), tuple(positions), currents
        self._look_at_states(values[self._end : self._states])
        self._publish(found)

    def _look_at_states(self, states: Sequence[int]) -> None:
        """Take AL states, each with its working counter."""
        pairs = zip(states[::2], states[1::2], strict=True)
        self.fallen = any(state != AlState.OP for state, counter in pairs if counter)
        self.unusual = self.fallen or bool(self._gone)

    def _look_at_times(self, values: Sequence[int], instant: float) -> Mapping[int, int]:
        """Follow the reference; return flags of axes whose inputs are not of their instant."""
        clock, clocks = self._clock, self._clocks
        assert isinstance(clock, ReferenceClock) and clocks  # noqa: S101, PT018 - by `wire`
        reference, counter, differences, _ = values[-_TIMES:]
        if counter == len(clocks.clocked):
            self.time = clock.latch_instant(clock.follow(reference, instant), instant)
        last, self._shown = self._shown, self.time
        if self.time <= last:
            return dict.fromkeys(range(len(self._axes)), _DOUBLED)
        if is_together(differences):
            self.farthest = max(self.farthest, 1e-9 * size_of(differences))
            return {}
        apart = clocks.differences([drive.station for drive in self._drives])
        self.farthest = max(self.farthest, *apart)
        return {axis: _LATE for axis, each in enumerate(apart) if each > OUT_OF_STEP}

    def _take_nothing(self) -> None:
        now = self._clock.now()
        for axis in range(len(self._axes)):
            self._gone.setdefault(axis, now)
        self.unusual, self.fallen = True, False
        self._publish(dict.fromkeys(range(len(self._axes)), _MISSING))

    # Time

    def tick(self) -> None:
        """Let one period pass; a plant in lock-step knows of it."""
        if self._wired:
            self.sync()
            return
        if (due := self._clock.due()) > 0:
            time.sleep(due)
        self._clock.note_sending()
        self._line.send(self._ticking)
        self._clock.note_sent()
        self._line.receive(self._clock.window())

    # For our sign of life

    def since_sent(self) -> float:
        """Return how long ago outputs were sent [s]."""
        return self._clock.now() - self._sent_at

    def unwatched(self) -> str:
        """Return in words a drive whose watchdog was changed, and set it; empty if none was."""
        line, each = self._line, len(GUARDS)
        for first in range(0, len(self._drives), _ASKED):
            asked = self._guards[first * each : (first + _ASKED) * each]
            line.send(line.frame(asked))
            frame = line.receive(self._clock.window())
            answers = frame and answers_of(frame, asked)
            if not answers or not all(answer.counter for answer in answers):
                continue  # a drive that is away is counted by the cycle
            for number in range(0, len(answers), each):
                data = [answer.data for answer in answers[number : number + each]]
                drive = self._drives[first + number // each]
                if words := drive.why_unwatched(data):
                    with suppress(NoAnswer):
                        drive.set_watchdog()  # its axis is under power until it has stopped
                    return words
        return ""

    def repeat(self) -> None:
        """Send the present outputs again, and take nothing of what comes back."""
        if self._wired:
            self._sent_at = self._clock.now()
            self._line.send(self._frames[True])
            self._line.receive(self._line.patience)

    @property
    def foreign(self) -> bool:
        """Whether another master sends on this interface."""
        return self._line.foreign > FOREIGN

    @property
    def absent(self) -> Sequence[int]:
        """Axes that took no part in the last cycle."""
        return tuple(self._gone)

    @property
    def absence(self) -> float:
        """How long the first of them has been away [s]."""
        return self._clock.now() - min(self._gone.values(), default=math.inf)

    def forget_absence(self) -> None:
        """Count absence from now on."""
        self._gone = dict.fromkeys(self._gone, self._clock.now())

    def collect_mail(self) -> None:
        """Take what waits in mailboxes: emergencies."""
        for axis in self.mail:
            try:
                self._drives[axis].collect()
            except NoAnswer:
                continue  # the cycle itself shows whether the drive is there
        self._mailboxes, self.mail = (), ()
