"""EtherCAT drives on an open network interface (`drivers.session.connection.Fieldbus`)."""

from __future__ import annotations

from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from drivers.drive_bus import BusUnavailable, DriveRefused, NodeSilent
from drivers.ethercat.communication import EthercatCommunication
from drivers.ethercat.connection import EthercatConnection
from drivers.ethercat.cycle_time import MAX_LOAD, StopwatchWire, cycle_time
from drivers.ethercat.drive import make_drives
from drivers.ethercat.line import LOCK_STEP_PATIENCE, PATIENCE, Line
from drivers.ethercat.monitor import LinePicture
from drivers.ethercat.process_data import EthercatProcessData
from drivers.ethercat.reference_clock import ReferenceClock
from drivers.ethercat.rules import RULES
from drivers.ethercat.scan import scan_line
from drivers.ethercat.slaves import Slaves
from drivers.remote_dictionary import NoAnswer
from drivers.session.connection import Fieldbus, TimedFieldbus, UnpoweredDrives, places_of
from drivers.sync_clock import LockStep

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator

    from drivers.dictionary.found_nodes import Scan
    from drivers.drives_file import DrivesFile
    from drivers.ethercat.drive import EthercatDrive
    from drivers.ethercat.wire import Wire
    from drivers.fieldbus import PacingName
    from drivers.remote_dictionary import RemoteDictionary
    from drivers.session.connection import Place
    from drivers.sync_clock import SyncClock

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
        """Find slaves and their offers (see `drivers.ethercat.scan.scan_line`)."""
        line = self._line()
        return scan_line(
            line, lambda node: node not in besides and (only is None or node in only), SDO_TIMEOUT
        )

    def wait(self, timeout: float) -> object:
        """Wait for a frame, at most `timeout` [s]."""
        return self._wire.receive(timeout)

    @contextmanager
    def timed(self, drives: DrivesFile) -> Iterator[TimedEthercatBus]:
        """Measure the return times of frames, with a stopwatch in front of this bus."""
        del drives
        yield TimedEthercatBus(StopwatchWire(self._wire), lock_step=self.lock_step)

    def picture(self, drives: DrivesFile, *, inputs: bool = False) -> LinePicture:
        """Show the axes by reading their mailboxes: passive listening is impossible on this bus."""
        return LinePicture(drives, self.unpowered(drives), inputs=inputs)

    def load(self, drives: DrivesFile) -> tuple[float, float]:
        """Return the duration of a cycle on the line [s], and its largest share of the period."""
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
        Pacing of the measured bus.
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
