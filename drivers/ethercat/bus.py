"""EtherCAT drives on an open network interface (`drivers.session.connection.Fieldbus`).

Duration of a cycle: computed for the cable, and measured.

Scan of the line: slaves and their object dictionaries.

A slave gives access to its objects in PREOP, so each is brought there, and back to INIT if found
there; nothing else is written, and nothing is energised.

Picture of idle drives: states, positions, currents, by requests.

Passive listening is impossible on EtherCAT, so the mailboxes of the drives are read, in PREOP.
"""

from __future__ import annotations

import time
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

import numpy as np

from drivers.cia402 import objects
from drivers.cia402.picture import Picture
from drivers.dictionary.live import read_dictionary
from drivers.dictionary.review import Scan, review
from drivers.drive_bus import BusUnavailable, DriveError, DriveRefused, NodeSilent
from drivers.ethercat.clocks import DIFFERENCE_SIZE, TIME_SIZE, ReferenceClock
from drivers.ethercat.communication import EthercatCommunication
from drivers.ethercat.connection import EthercatConnection
from drivers.ethercat.drive import EthercatDrive, make_drives
from drivers.ethercat.line import HEAD, LOCK_STEP_PATIENCE, PATIENCE, START, TAIL, Command, Line
from drivers.ethercat.pdo_set_up import inputs_of, outputs_of
from drivers.ethercat.process_data import EthercatProcessData
from drivers.ethercat.rules import RULES
from drivers.ethercat.slaves import Slaves
from drivers.remote_dictionary import NoAnswer
from drivers.session.connection import Fieldbus, TimedFieldbus, UnpoweredDrives, places_of
from drivers.sync_clock import LockStep

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator

    from drivers.drives_file import DrivesFile
    from drivers.ethercat.slaves import Station
    from drivers.ethercat.wire import Wire
    from drivers.fieldbus import PacingName
    from drivers.remote_dictionary import RemoteDictionary
    from drivers.session.connection import Place
    from drivers.sync_clock import SyncClock

PAUSE = 0.02
"""Time between two rounds of requests [s]."""


class LinePicture(Picture):
    """Picture of the axes of a drives file.

    Parameters
    ----------
    drives : DrivesFile
        Axes in joint order.
    reached : UnpoweredDrives
        Access to the objects of the drives.
    inputs : bool
        True to read digital inputs too.
    """

    def __init__(self, drives: DrivesFile, reached: UnpoweredDrives, *, inputs: bool) -> None:
        super().__init__(drives)
        self._reached, self._inputs = reached, inputs

    def listen(self, duration: float) -> None:
        """Read all drives repeatedly for a duration [s]."""
        ends = time.monotonic() + duration
        while time.monotonic() < ends:
            for axis, server in zip(self.axes, self._reached.servers, strict=True):
                try:
                    for entry in inputs_of(axis.drive):
                        axis.show(entry, server.measure(entry))
                    axis.heard = time.monotonic()
                    if self._inputs:
                        axis.show(objects.DIGITAL_INPUTS, server.find(objects.DIGITAL_INPUTS) or 0)
                except DriveError:
                    continue  # the time of the last answer marks the drive as silent
            time.sleep(PAUSE)

    def sync_rate(self, now: float) -> float:
        """Return 0: this is the master, and sends no cycles."""
        del now
        return 0.0


def scan_line(line: Line, is_asked: Callable[[int], bool], timeout: float) -> Scan:
    """Find the slaves on a line, and read their object dictionaries.

    Parameters
    ----------
    line : Line
    is_asked : callable
        Returns True if the slave at a position, from 1, is to be read.
    timeout : float
        Longest response time [s].

    Raises
    ------
    BusUnavailable
        No frame returns, or another master is at work.
    """
    scan = Scan()
    for station in Slaves(line).all:
        if is_asked(station.position):
            _read_slave(station, scan, timeout)
    return scan


def _read_slave(station: Station, scan: Scan, timeout: float) -> None:
    node = station.position
    found = scan.heard(node)
    found.state, found.shown_by = station.shown, "AL state"
    drive = EthercatDrive(lambda: station, station.line, f"slave {node}", timeout)
    try:
        drive.bring_up()
        found.dictionary = read_dictionary(drive, node, RULES)
        found.review = review(found.dictionary, RULES)
        found.answers = 1
        drive.hand_back()
    except (NoAnswer, DriveRefused) as error:
        found.state = f"{found.state}; {error}"


BITRATE = 100_000_000
"""Bit rate of EtherCAT [bit/s]."""
MAX_LOAD = 0.7
"""Largest share of the period for a frame: mailboxes need the rest."""
HOP = 1e-6
"""Time of a frame through one slave, both ways, and its cables [s]."""
_ETHERNET = 24
"""Preamble, check sum and gap of a frame [bytes]."""
ANSWERED = 0.99
"""Share of frames within the time of the slowest answer."""
RESERVE = 2.0
"""Period as a multiple of the slowest answer: the computer itself takes as long."""
_COMMAND = 16
"""Offset of the command of the first datagram in a frame."""


def cycle_time(drives: DrivesFile, *, feed_forward: bool = False) -> float:
    """Return the duration of a frame with the process data of the axes [s]."""
    entries = [(*outputs_of(feed_forward=feed_forward), *inputs_of(axis)) for axis in drives.axes]
    sizes = [sum(entry.word & 0xFF for entry in own) // 8 + 1 for own in entries]
    sizes += [2, TIME_SIZE, DIFFERENCE_SIZE]
    size = START + sum(HEAD + each + TAIL for each in sizes) + _ETHERNET
    return 8 * size / BITRATE + HOP * len(drives.axes)


class StopwatchWire:
    """Wire that measures the return times of frames with process data.

    Parameters
    ----------
    inner : Wire
        Wire to measure; it stays open when this one is closed.
    clock : callable
        Clock [s].
    """

    def __init__(self, inner: Wire, clock: Callable[[], float] = time.perf_counter) -> None:
        self._inner, self._clock = inner, clock
        self._sent: list[float] = []
        self._took: list[float] = []
        self._cyclic = False

    def send(self, frame: bytes | bytearray) -> bool:
        """Send a frame."""
        self._cyclic = frame[_COMMAND] == Command.LRW
        if self._cyclic:
            self._sent.append(self._clock())
        return self._inner.send(frame)

    def receive(self, timeout: float) -> bytes | None:
        """Return the next frame."""
        frame = self._inner.receive(timeout)
        if frame is not None and self._cyclic:
            self._took.append(self._clock() - self._sent[-1])
        return frame

    def close(self) -> None:
        """Leave the wire open."""

    @property
    def slowest(self) -> float:
        """Quantile `ANSWERED` of the return times of frames [s]."""
        return float(np.quantile(self._took, ANSWERED)) if self._took else 0.0

    def achievable_rate(self, slowest: float) -> float:
        """Return the highest rate of cycles with a reserve [1/s], for the slowest answer [s]."""
        took = slowest or float(np.median(self._took or [0.0]))
        return 1 / (RESERVE * took) if took else 0.0

    def jitter(self, period: float) -> float:
        """Return the quantile `ANSWERED` of the frames' deviation from their period [s]."""
        gaps = np.diff(self._sent)
        gaps = gaps[gaps < 2 * period]
        return float(np.quantile(np.abs(gaps - period), ANSWERED)) if gaps.size else 0.0


SDO_TIMEOUT = 1.0
"""Longest response time of a drive without a drives file [s]."""


class EthercatBus(Fieldbus):
    """Open network interface with EtherCAT drives.

    Parameters
    ----------
    wire : Wire
        Open interface.
    pacing : {"auto", "lock-step", "wall-clock"}
        "lock-step" sends the next frame as soon as the last one is back, for a plant whose time
        is that of cycles; otherwise frames keep deadlines of the wall clock.
    """

    rules = RULES
    keeps_time = recorded = False

    def __init__(self, wire: Wire, pacing: PacingName = "auto") -> None:
        self._wire = wire
        self._asked: list[EthercatDrive] = []
        self.lock_step = pacing == "lock-step"

    def connect(
        self, drives: DrivesFile, period: float, *, feed_forward: bool = False
    ) -> EthercatConnection:
        """Build the services for a set of drives (see `Fieldbus`)."""
        clock = self._clock(period)
        return EthercatConnection(self._line(), clock, drives, feed_forward=feed_forward)

    def unpowered(self, drives: DrivesFile) -> UnpoweredDrives:
        """Access drives by their mailboxes alone."""
        line = self._line()
        places = places_of(drives.axes)
        asked, servers = make_drives(line, Slaves(line), places, drives.sdo_timeout)
        self._asked += asked
        found = tuple(EthercatCommunication.prefer(axis) for axis in drives.axes)
        clock = self._clock(drives.sync_period)
        data = EthercatProcessData(line, drives.axes, asked, clock)
        return UnpoweredDrives(servers, found, data)

    def servers(
        self, places: Iterable[Place], timeout: float = SDO_TIMEOUT
    ) -> tuple[RemoteDictionary, ...]:
        """Access drives by position or alias, with `timeout` for an answer [s]."""
        line = self._line()
        asked, servers = make_drives(line, Slaves(line), tuple(places), timeout)
        self._asked += asked
        return servers

    def scan(self, only: Collection[int] | None = None, *, besides: Collection[int] = ()) -> Scan:
        """Find slaves and read their dictionaries (see `drivers.ethercat.bus.scan_line`)."""
        line = self._line()
        return scan_line(
            line, lambda node: node not in besides and (only is None or node in only), SDO_TIMEOUT
        )

    def wait(self, timeout: float) -> object:
        """Wait for a frame, at most `timeout` [s]."""
        return self._wire.receive(timeout)

    @contextmanager
    def timed(self, drives: DrivesFile) -> Iterator[TimedEthercatBus]:
        """Yield a bus that measures return times, with a stopwatch in front of this bus."""
        del drives
        yield TimedEthercatBus(StopwatchWire(self._wire), lock_step=self.lock_step)

    def picture(self, drives: DrivesFile, *, inputs: bool = False) -> LinePicture:
        """Return a picture of the axes by mailbox: passive listening is impossible on this bus."""
        return LinePicture(drives, self.unpowered(drives), inputs=inputs)

    def load(self, drives: DrivesFile) -> tuple[float, float]:
        """Return the duration of a cycle on the line [s], and the permitted share of the period."""
        return cycle_time(drives), MAX_LOAD

    def shutdown(self) -> None:
        """Restore the AL states of drives that were read; close the interface."""
        with suppress(BusUnavailable):
            for drive in self._asked:
                with suppress(DriveRefused, NodeSilent, NoAnswer):
                    drive.hand_back()
        self._wire.close()

    def _line(self) -> Line:
        return Line(self._wire, LOCK_STEP_PATIENCE if self.lock_step else PATIENCE)

    def _clock(self, period: float) -> SyncClock:
        return LockStep(period, synchronous=False) if self.lock_step else ReferenceClock(period)


class TimedEthercatBus(EthercatBus, TimedFieldbus):
    """Bus with measured return times of frames with process data.

    Parameters
    ----------
    stopwatch : StopwatchWire
        Stopwatch in front of the wire.
    lock_step : bool
        True if the measured bus is in lock-step.
    """

    def __init__(self, stopwatch: StopwatchWire, *, lock_step: bool) -> None:
        super().__init__(stopwatch, "lock-step" if lock_step else "wall-clock")
        self._stopwatch = stopwatch

    def achievable_rate(self) -> tuple[float, float]:
        """Return the highest rate of cycles [1/s] and the slowest answer [s], 0 in lock-step."""
        slowest = 0.0 if self.lock_step else self._stopwatch.slowest
        return self._stopwatch.achievable_rate(slowest), slowest

    def jitter(self, period: float) -> float:
        """Return the deviation of frames from their period [s], 0 in lock-step."""
        return 0.0 if self.lock_step else self._stopwatch.jitter(period)
