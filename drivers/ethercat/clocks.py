"""Distributed clocks (ETG.1000.4 clause 6.8): synchronisation of all slaves with the first.

Each slave latches the passage of a frame at each port, which gives the cable delays; offsets turn
the local times of the slaves into one system time. From then on each frame carries the time of the
reference, the first slave with a clock, to all others, which are adjusted to the reference.

`ReferenceClock` makes the reference the driver's clock: each frame with process data returns the
time of its passage at the reference. A second-order filter estimates that time and its rate, so
that a frame sent late has little influence. Deadlines are then in the time of the reference: frames
pass half a period before SYNC0, at which drives apply outputs and latch inputs. A frame may be late
by half a period.
"""

from __future__ import annotations

import math
import time
from itertools import count, pairwise
from typing import TYPE_CHECKING, NamedTuple

from drivers.ethercat import registers as reg
from drivers.ethercat.line import Command, Datagram, address_of
from drivers.sync_clock import WallClock

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from drivers.ethercat.line import Line
    from drivers.ethercat.slaves import Station

SHIFT = 0.5
"""Delay of SYNC0 after the due instant of a frame, as a share of the period."""
AHEAD = 0.1
"""Minimum time from set-up of a drive to its first SYNC0 [s]; as in SOEM."""
_TIME = 0.5
"""Time constant of the filter [s]: some hundred frames, so that it rejects the jitter of a computer
and follows the drift of a warming crystal."""
_STRAY, _STRAYS = 0.25, 10
"""Bounds for a jump of the reference (a plant's process was stopped): deviation as a share of the
period, and number of consecutive frames that deviate in one direction."""
_MOST = 50e-6
"""Largest correction of the filter by a frame [s]; a larger deviation is a delay of the computer.
Within `_TIME` the filter follows clocks that differ by 200 ppm or more, twice as much as
crystals."""


class ReferenceClock(WallClock):
    """Wall clock until `begin`; afterwards the clock of the reference.

    Parameters
    ----------
    period : float
        Time between two frames with process data [s].
    host : callable
        Monotonic clock of this computer [s].

    Attributes
    ----------
    host : callable
        Clock of this computer.
    follows : bool
        True after `begin`.
    skew : float
        Rate of the reference relative to this computer, less 1.
    """

    def __init__(self, period: float, *, host: Callable[[], float] = time.perf_counter) -> None:
        self.host = host
        self.follows, self.skew = False, 0.0
        self._at = self._shown = host()
        self._zero = 0
        self._strays: list[float] = []
        super().__init__(period, clock=lambda: self._convert_host(self.host()))

    def begin(self, reference: int, host: float) -> None:
        """Follow the reference, which showed a time [ns] when this computer's clock was `host`."""
        self._zero, self.follows = reference - round(1e9 * self._convert_host(host)), True
        # deadlines are whole periods after the bus was entered, in time of the reference
        self._deadline = self._start + self._period * math.ceil(self.now() / self._period)

    @property
    def shift(self) -> float:
        """Delay of SYNC0 after the due instant of a frame [s]."""
        return SHIFT * self._period

    def first_sync0(self, reference: int) -> tuple[int, int]:
        """Return a SYNC0 at least `AHEAD` after the reference's time, and the cycle [ns]."""
        shown = 1e-9 * (reference - self._zero) - self._start + AHEAD
        cycle = round(1e9 * self._period)
        grid = self._zero + round(1e9 * (self._start + self.shift))
        return grid + cycle * math.ceil(shown / self._period), cycle

    def note_sent(self) -> float:
        """Return the instant of a frame (see `WallClock`); SYNC0 gives the time of inputs."""
        instant = super().note_sent()
        self.uncertain &= not self.follows
        return instant

    def latch_instant(self, instant: float, before: float) -> float:
        """Return the last SYNC0 before an instant; without clocks, the previous frame's instant."""
        if not self.follows:
            return before
        return self._period * (math.floor(instant / self._period - SHIFT) + SHIFT)

    def follow(self, reference: int, instant: float) -> float:
        """Evaluate a frame sent at `instant`; return the instant of its passage [s].

        `reference` is the reference clock at the passage [ns]. Instants count as those of `now`.
        """
        passed = 1e-9 * (reference - self._zero) - self._start
        off = passed - instant
        if abs(off) > _STRAY * self._period:
            passed += self._evaluate_stray(off)
        else:
            self._strays.clear()
        off = min(max(off, -_MOST), _MOST)
        host, gain = self.host(), self._period / _TIME
        self._shown, self._at = self._convert_host(host) + 2 * gain * off, host
        self.skew += gain * off / _TIME
        return passed

    def _evaluate_stray(self, off: float) -> float:
        """Record a frame with a large deviation [s]; return the change of the estimated time."""
        if self._strays and (off > 0) != (self._strays[-1] > 0):
            self._strays.clear()
        self._strays.append(off)
        if len(self._strays) < _STRAYS:
            return 0.0
        periods = round(min(self._strays, key=abs) / self._period)
        jump = min(self._strays, key=abs) - periods * self._period
        self._shown += jump  # deadlines keep their distance from SYNC0
        self._zero += round(1e9 * periods * self._period)
        self._strays.clear()
        return -periods * self._period

    def _convert_host(self, host: float) -> float:
        """Convert a time of this computer's clock to the estimated time of the reference [s]."""
        return self._shown + (host - self._at) * (1 + self.skew)


_HAS_CLOCK, _IS_LONG = 0x04, 0x08
"""Features of a controller: distributed clock; clock of 64 bits."""
_PORTS = (0, 3, 1, 2)
"""Ports in the order of a frame's passage."""
_SHORT, _LONG = 1 << 32, 1 << 64
OUT_OF_STEP = 10e-6
"""Difference to the reference from which a drive's samples are flagged [s]: at 1 rad/s it is
10 urad, and hardware stays below 1 us."""
_SETTLE_LEAST, _SETTLE_TIME = 100, 1.0
"""Minimum number of frames that distribute the reference's time before the first cycle, and their
longest duration [s]: 10 000 frames of 0.1 ms, where TwinCAT sends 15 000."""
_SIZE = 0x7FFF_FFFF
"""Mask of a difference without its sign."""
TIME_SIZE, DIFFERENCE_SIZE = 8, 4


class Passage(NamedTuple):
    """Passage of a frame through one slave.

    Attributes
    ----------
    times : tuple of int
        Receive times at the open ports, in their order [ns]; empty without a clock.
    branches : int
        Number of ports with further slaves.
    """

    times: tuple[int, ...]
    branches: int


def compute_delays(passages: Sequence[Passage]) -> list[int]:
    """Compute the delay of a frame from the first clock to each slave [ns].

    The time between leaving a port and returning there, less the time within the branch, is spent
    on the cable, half of it on the way out. After a junction without a clock the time cannot be
    split, and the delay is that of the slave before the junction.
    """
    found: list[int] = []
    branches: list[tuple[int, int | None]] = []
    for times, ahead in passages:
        start, span = branches.pop() if branches else (0, None)
        if times:
            inside = (times[-1] - times[0]) % _SHORT
            start += 0 if span is None else max(0, span - inside) // 2
            spans = [(b - a) % _SHORT for a, b in pairwise(times)]
            branches += [(start + sum(spans[:n]), spans[n]) for n in reversed(range(len(spans)))]
        else:
            branches += [(start, span if ahead == 1 else None)] * ahead
        found.append(start)
    return found


class Clocks:
    """Synchronised clocks on a line.

    Parameters
    ----------
    line : Line
    stations : sequence of Station
        Slaves on the line, in order.

    Attributes
    ----------
    clocked : list of Station
        Slaves with a clock; the first is the reference.
    delay : int
        Delay of a frame from the reference to the last clock [ns].
    """

    def __init__(self, line: Line, stations: Sequence[Station]) -> None:
        self._line = line
        features = [station.word(reg.FEATURES) for station in stations]
        line.ask(Datagram(Command.BWR, reg.RECEIVE_TIMES << 16, bytes(4)))
        passages = [_passage(*each) for each in zip(stations, features, strict=True)]
        found = zip(stations, features, compute_delays(passages), strict=True)
        clocked = [each for each in found if each[1] & _HAS_CLOCK]
        if clocked and not clocked[0][1] & _IS_LONG:
            clocked = []  # a reference of 32 bits restarts every 4 s
        self.clocked = [station for station, _, _ in clocked]
        self.delay = clocked[-1][2] if clocked else 0
        first = _local(self.clocked[0]) if clocked else 0
        for station, own, delay in clocked:
            offset = (first + delay - _local(station)) % (_LONG if own & _IS_LONG else _SHORT)
            station.write(reg.TIME_OFFSET, offset.to_bytes(8, "little"))
            station.write(reg.TIME_DELAY, delay.to_bytes(4, "little"))
            station.write(reg.SPEED_START, station.read(reg.SPEED_START, 2))  # resets the filter

    @property
    def reference(self) -> Station:
        """The first slave with a clock."""
        return self.clocked[0]

    @property
    def datagrams(self) -> tuple[Datagram, Datagram]:
        """Datagrams that distribute the reference's time and read all differences at once."""
        reference = address_of(self.reference.address, reg.SYSTEM_TIME)
        return (
            Datagram(Command.FRMW, reference, bytes(TIME_SIZE)),
            Datagram(Command.BRD, reg.TIME_DIFFERENCE << 16, bytes(DIFFERENCE_SIZE)),
        )

    def settle(self, host: Callable[[], float]) -> tuple[int, float]:
        """Adjust the clocks to the reference.

        Parameters
        ----------
        host : callable
            Clock of this computer [s].

        Returns
        -------
        reference : int
            Time of the reference at the passage of the fastest frame [ns].
        host : float
            `host` at that instant [s], halfway between sending and return.
        """
        ends, soonest = time.monotonic() + _SETTLE_TIME, (math.inf, 0, 0.0)
        for sent in count(1):
            before = host()
            found, apart = self._line.ask(*self.datagrams)
            now = host()
            reference = int.from_bytes(found.data, "little")
            soonest = min(soonest, (now - before, reference, (before + now) / 2))
            settled = is_together(int.from_bytes(apart.data, "little"))
            if (settled and sent >= _SETTLE_LEAST) or time.monotonic() > ends:
                break
        return soonest[1:]

    def now(self) -> int:
        """Return the time of the reference [ns]."""
        return int.from_bytes(self.reference.read(reg.SYSTEM_TIME, TIME_SIZE), "little")

    def differences(self, stations: Sequence[Station]) -> list[float]:
        """Return the differences of clocks to the reference at the last update [s].

        Infinity if the frame is lost.
        """
        datagrams = [
            Datagram(
                Command.FPRD,
                address_of(station.address, reg.TIME_DIFFERENCE),
                bytes(DIFFERENCE_SIZE),
            )
            for station in stations
        ]
        answers = self._line.exchange(*datagrams) or ()
        found = [1e-9 * size_of(int.from_bytes(a.data, "little")) for a in answers if a.counter]
        return found if len(found) == len(stations) else [math.inf] * len(stations)


def size_of(difference: int) -> int:
    """Return a difference without its sign [ns]; for combined bits of several, an upper bound."""
    return difference & _SIZE


def is_together(differences: int) -> bool:
    """Return True if no clock is out of step, from the combined bits of the differences.

    Combined bits are at most twice the largest difference, so some checks are false alarms.
    """
    return 1e-9 * size_of(differences) <= OUT_OF_STEP


def _passage(station: Station, features: int) -> Passage:
    status = station.word(reg.DL_STATUS)
    ports = [port for port in _PORTS if status >> 9 + 2 * port & 1]
    if not features & _HAS_CLOCK:
        return Passage((), max(0, len(ports) - 1))
    data = station.read(reg.RECEIVE_TIMES, 16)
    times = [int.from_bytes(data[4 * port : 4 * port + 4], "little") for port in ports]
    return Passage(tuple(times or [0]), max(0, len(ports) - 1))


def _local(station: Station) -> int:
    return int.from_bytes(station.read(reg.RECEIVE_TIME, 8), "little")
