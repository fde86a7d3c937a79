"""Exchange of process data: a frame with the outputs and inputs of the drives.

Each axis has its own datagram, whose working counter shows that the drive took its outputs and gave
inputs; the AL states are read in the same frame. The inputs were latched at the passage of the
frame before (drives synchronous to their sync managers), and get its instant. After lost frames it
is unknown which of them the drives saw: the next inputs may be as old as the first, and are not
used.

Drives with clocks act and latch at SYNC0, and the frame returns the time of its passage at the
reference: the sample gets the instant of the SYNC0 before. If there was no SYNC0 since the frame
before, the sample is flagged as doubled; an axis whose clock is out of step, as late.

Outputs act until replaced, so the next frame makes up for a lost one. A sequence of controlwords
takes one completed cycle for each; a controlword that stops an axis does not wait.
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
from drivers.ethercat.clocks import OUT_OF_STEP, ReferenceClock, is_together, size_of
from drivers.ethercat.drive import GUARDS
from drivers.ethercat.line import HEAD, START, TAIL, Command, Datagram, address_of, answers_of
from drivers.ethercat.pdo_set_up import locate_inputs
from drivers.ethercat.registers import AlState
from drivers.remote_dictionary import NoAnswer

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from drivers.drives_file import AxisDrive
    from drivers.ethercat.clocks import Clocks
    from drivers.ethercat.drive import EthercatDrive
    from drivers.ethercat.line import Line
    from drivers.ethercat.pdo_set_up import Place
    from drivers.fieldbus import Entry
    from drivers.sync_clock import SyncClock

LOGICAL, APART = 0x0001_0000, 0x1000
"""Logical address of the first drive's process data, and distance between drives."""
FOREIGN = 3
"""Number of foreign frames attributed to chance."""
_BOTH, _READ = 3, 1
"""Working counter of a drive with outputs (2) and inputs (1), or of a drive only read."""
_ASKED = 20
"""Number of drives whose watchdogs are read by a frame."""
_TIMES = 4
"""Number of clock values: time of the reference, and differences, each with its working counter."""
_VALUES = 5
"""Values of an axis: statusword, position, current, state of the mailbox, working counter."""
_STOPS = frozenset({Order.QUICK_STOP.value[0], Order.DISABLE_VOLTAGE.value[0]})
_MISSING, _LATE, _DOUBLED = (
    flag.value for flag in (SampleFlag.MISSING, SampleFlag.LATE, SampleFlag.DOUBLED)
)
_WATCHDOGS = Datagram(Command.BRD, reg.WATCHDOG_STATUS << 16, bytes(2))
"""Datagram without outputs: a plant in lock-step counts it as a cycle."""


class EthercatProcessData(ProcessData):
    """Process data of EtherCAT axes (`drivers.cycle_data.ProcessData`).

    Parameters
    ----------
    line : Line
    axes : sequence of AxisDrive
        Axes in joint order.
    drives : sequence of EthercatDrive
        Drives in joint order.
    clock : SyncClock
        Source of the cycle time.

    Attributes
    ----------
    feeding : bool
        True if outputs are sent; otherwise inputs are only read.
    unusual, fallen : bool
        True if a drive is not in OP, or absent; True if one shows another state than OP.
    mail : tuple of int
        Axes with waiting mailbox services.
    farthest : float
        Largest difference of a clock to the reference since synchronisation [s].
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
            drive.carry = self._make_carrier(axis)

    def wire(self, clocks: Clocks | None = None, *, alone: bool) -> None:
        """Make the frames of a cycle for the configured process data, with zero outputs.

        Parameters
        ----------
        clocks : Clocks, optional
            Clocks by which the drives latch.
        alone : bool
            True if only the drives are on the line, so that one datagram reads their AL states.
        """
        layout, order, place = f"<{START}x", list[int](), START
        written, read = list[Datagram](), list[Datagram]()
        for axis, drive in enumerate(self._drives):
            size = drive.outputs.size + drive.inputs.size + 1
            address = LOGICAL + APART * axis
            written.append(Datagram(Command.LRW, address, bytes(size)))
            read.append(Datagram(Command.LRD, address, bytes(size)))
            found = drive.outputs.places.items()
            self._outputs[axis] = {key: (place + HEAD + start, n) for key, (start, n) in found}
            picked, own = locate_inputs(drive.inputs, self._axes[axis])
            layout += f"{HEAD + drive.outputs.size}x{picked}BH"
            order += [_VALUES * axis + n for n in (*own, 3, 4)]
            place += HEAD + size + TAIL
        states = [
            Datagram(Command.FPRD, address_of(drive.station.address, reg.AL_STATUS), bytes(2))
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
            Datagram(Command.FPRD, address_of(drive.station.address, place), bytes(size))
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

    # commands

    def command(self, axis: int, target: int, controlword: int) -> None:
        """Send target position [increments] and controlword to an axis in the next cycle."""
        if controlword in _STOPS:
            self._queues.pop(axis, None)
        elif axis in self._fresh:
            queue = self._queues.setdefault(axis, deque())
            start, size = self._outputs[axis][objects.CONTROLWORD.index, 0]
            sent = int.from_bytes(self._frames[True][start : start + size], "little")
            last = queue[-1][0] if queue else sent
            if controlword != last:
                queue.append((controlword, target))
                return
            if queue:
                queue[-1] = (controlword, target)
                return
        self._set(axis, controlword, target)

    def lead(self, axis: int, target: int) -> None:
        """Send a streamed set-point to an axis [increments]."""
        self._put(axis, objects.TARGET_POSITION, target)

    def feed_forward(self, axis: int, velocity: int, torque: int) -> None:
        """Send offsets of velocity [drive's unit] and torque [per mille of rated] to an axis."""
        self._put(axis, objects.VELOCITY_OFFSET, velocity)
        self._put(axis, objects.TORQUE_OFFSET, torque)

    def withdraw(self, axis: int) -> None:
        """Cancel the feed-forward of an axis; no effect where drives take no offsets."""
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

    def _make_carrier(self, axis: int) -> Callable[[int, int, bytes], bool]:
        """Return a function that puts written objects into the outputs if mapped there."""

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
        """Send the next controlword once a drive has taken the present one."""
        for axis in tuple(self._fresh):
            if counters[axis] == _BOTH:
                queue = self._queues.get(axis)
                if queue:
                    word, target = queue.popleft()
                    self._set(axis, word, target)
                else:
                    self._fresh.discard(axis)

    # cycle

    def sync(self) -> float:
        """Exchange process data when due; return the instant of the inputs (see `ProcessData`)."""
        clock, line = self._clock, self._line
        while (due := clock.due()) > 0:  # oversleeping skips this deadline
            time.sleep(due)
        self.untimed = clock.uncertain  # inputs are those of the previous frame
        clock.note_sending()
        line.send(self._frames[self.feeding])
        instant = self._sent_at = clock.note_sent()
        answer = line.receive(clock.window())
        before, self._passed_at = self._passed_at, instant
        self._pass_to(clock.latch_instant(instant, before))
        if answer is None or len(answer) < self._size:
            now = self._clock.now()
            for axis in range(len(self._axes)):
                self._gone.setdefault(axis, now)
            self.unusual, self.fallen = True, False
            self._publish(dict.fromkeys(range(len(self._axes)), _MISSING))
            return self.time
        values = self._unpack(answer)
        end = self._end
        states = values[end : self._states]
        off = self._evaluate_times(values, instant) if self._clocks else {}
        counters = values[4:end:_VALUES]
        if self._mailboxes != (mailboxes := values[3:end:_VALUES]):
            self._mailboxes = mailboxes
            self.mail = tuple(n for n, each in enumerate(mailboxes) if each & reg.FULL)
        if counters == self._counters[self.feeding] and not (self._gone or off):
            self.words, self.positions = values[0:end:_VALUES], values[1:end:_VALUES]
            self.currents = values[2:end:_VALUES]
            if self.unusual or states != self._in_op:
                self._evaluate_states(states)
            if self.irregular or clock.passed_over:
                self._publish({})
        else:
            self._take_partly(values, counters, off)
        if self._fresh and self.feeding:
            self._confirm(counters)
        return self.time

    def _take_partly(
        self, values: Sequence[int], counters: Sequence[int], off: Mapping[int, int]
    ) -> None:
        """Store the values of axes that took part; flags set before are kept."""
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
        self._evaluate_states(values[self._end : self._states])
        self._publish(found)

    def _evaluate_states(self, states: Sequence[int]) -> None:
        """Evaluate AL states and their working counters."""
        pairs = zip(states[::2], states[1::2], strict=True)
        self.fallen = any(state != AlState.OP for state, counter in pairs if counter)
        self.unusual = self.fallen or bool(self._gone)

    def _evaluate_times(self, values: Sequence[int], instant: float) -> Mapping[int, int]:
        """Follow the reference; return flags of axes whose inputs have another instant."""
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

    # time

    def tick(self) -> None:
        """Let a period pass, also for a plant in lock-step."""
        if self._wired:
            self.sync()
            return
        if (due := self._clock.due()) > 0:
            time.sleep(due)
        self._clock.note_sending()
        self._line.send(self._ticking)
        self._clock.note_sent()
        self._line.receive(self._clock.window())

    # sign of life

    def since_sent(self) -> float:
        """Return the time since outputs were sent [s]."""
        return self._clock.now() - self._sent_at

    def find_unwatched(self) -> str:
        """Find a drive with a changed watchdog, and restore it; return a description, or ""."""
        line, each = self._line, len(GUARDS)
        for first in range(0, len(self._drives), _ASKED):
            asked = self._guards[first * each : (first + _ASKED) * each]
            line.send(line.frame(asked))
            frame = line.receive(self._clock.window())
            answers = frame and answers_of(frame, asked)
            if not answers or not all(answer.counter for answer in answers):
                continue  # absence is detected in the cycle
            for number in range(0, len(answers), each):
                data = [answer.data for answer in answers[number : number + each]]
                drive = self._drives[first + number // each]
                if words := drive.why_unwatched(data):
                    with suppress(NoAnswer):
                        drive.set_watchdog()  # the axis is under power until it has stopped
                    return words
        return ""

    def repeat(self) -> None:
        """Send the present outputs again, and ignore the inputs."""
        if self._wired:
            self._sent_at = self._clock.now()
            self._line.send(self._frames[True])
            self._line.receive(self._line.patience)

    @property
    def foreign(self) -> bool:
        """True if another master sends on this interface."""
        return self._line.foreign > FOREIGN

    @property
    def absent(self) -> Sequence[int]:
        """Axes that did not take part in the last cycle."""
        return tuple(self._gone)

    @property
    def absence(self) -> float:
        """Time since the first of the absent axes left [s]."""
        return self._clock.now() - min(self._gone.values(), default=math.inf)

    def forget_absence(self) -> None:
        """Restart the time of absence."""
        self._gone = dict.fromkeys(self._gone, self._clock.now())

    def collect_mail(self) -> None:
        """Receive waiting mailbox services: emergencies."""
        for axis in self.mail:
            try:
                self._drives[axis].collect()
            except NoAnswer:
                continue  # absence is detected in the cycle
        self._mailboxes, self.mail = (), ()
