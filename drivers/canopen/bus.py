"""CANopen drives on an open python-can bus (`drivers.session.connection.Fieldbus`)."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from drivers.can_bus.capabilities import find_capabilities
from drivers.canopen.communication import CanopenCommunication
from drivers.canopen.connection import CanopenConnection
from drivers.canopen.monitor import NODES, BusPicture, questions, scan_bus
from drivers.canopen.network import PumpedNetwork
from drivers.canopen.process_data import SyncProcessData
from drivers.canopen.rules import RULES
from drivers.canopen.sdo import SDO_TIMEOUT, server_of
from drivers.canopen.stopwatch import StopwatchBus
from drivers.canopen.sync_clock import choose_sync_clock
from drivers.canopen.sync_rate import MAX_LOAD, achievable_rate, cycle_time
from drivers.session.connection import Fieldbus, TimedFieldbus, UnpoweredDrives, places_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator

    import can

    from drivers.dictionary.review import Scan
    from drivers.drives_file import DrivesFile
    from drivers.fieldbus import PacingName
    from drivers.remote_dictionary import RemoteDictionary
    from drivers.session.connection import Place


class CanopenBus(Fieldbus):
    """Open python-can bus with CANopen drives.

    Parameters
    ----------
    bus : can.BusABC
        Open bus without other receivers of frames from this object.
    pacing : {"auto", "lock-step", "wall-clock"}
        See `drivers.canopen.sync_clock.choose_sync_clock`.
    """

    rules = RULES

    def __init__(self, bus: can.BusABC, pacing: PacingName = "auto") -> None:
        self._bus = bus
        self._pacing: PacingName = pacing
        able = find_capabilities(bus)
        self.lock_step, self.keeps_time = able.lock_step, able.kernel_sync
        self.recorded = able.recorded

    def connect(
        self, drives: DrivesFile, period: float, *, feed_forward: bool = False
    ) -> CanopenConnection:
        """Build the services for a set of drives (see `Fieldbus`)."""
        return CanopenConnection.open(
            self._bus, drives, period, self._pacing, feed_forward=feed_forward
        )

    def unpowered(self, drives: DrivesFile) -> UnpoweredDrives:
        """Access drives by SDO alone; where SYNC is the plant's clock, SYNC lets time pass."""
        clock = choose_sync_clock(self._bus, self._pacing, drives.sync_period)
        network = PumpedNetwork(self._bus, synchronous=clock.synchronous)
        servers = tuple(server_of(network, at, drives.sdo_timeout) for at in places_of(drives.axes))
        found = tuple(CanopenCommunication.predefined(axis) for axis in drives.axes)
        return UnpoweredDrives(servers, found, SyncProcessData(network, drives.axes, clock, found))

    def servers(
        self, places: Iterable[Place], timeout: float = SDO_TIMEOUT
    ) -> tuple[RemoteDictionary, ...]:
        """Access drives by node number, with `timeout` for an answer [s]."""
        # no SYNC is sent, so its period has no effect
        synchronous = choose_sync_clock(self._bus, self._pacing, 1.0).synchronous
        network = PumpedNetwork(self._bus, synchronous=synchronous)
        return tuple(server_of(network, at, timeout) for at in places)

    def scan(self, only: Collection[int] | None = None, *, besides: Collection[int] = ()) -> Scan:
        """Find nodes and read their dictionaries (see `drivers.canopen.monitor.scan_bus`)."""
        asked = [node for node in NODES if node not in besides and (only is None or node in only)]
        return scan_bus(self._bus, only=asked)

    def wait(self, timeout: float) -> object:
        """Wait for a frame, at most `timeout` [s]."""
        return self._bus.recv(timeout)

    @contextmanager
    def timed(self, drives: DrivesFile) -> Iterator[TimedCanopenBus]:
        """Yield a bus that measures response times, with a stopwatch in front of this bus."""
        with StopwatchBus(self._bus, drives) as stopwatch:
            yield TimedCanopenBus(stopwatch, drives, self._pacing)

    def picture(self, drives: DrivesFile, *, inputs: bool = False) -> BusPicture:
        """Return a picture of the axes by listening; with `inputs`, also request 60FD."""
        return BusPicture(drives, self._bus, questions(drives) if inputs else ())

    def load(self, drives: DrivesFile) -> tuple[float, float]:
        """Return the duration of a cycle on the bus [s], and the permitted share of the period."""
        return cycle_time(drives), MAX_LOAD

    def shutdown(self) -> None:
        """Close the bus."""
        self._bus.shutdown()


class TimedCanopenBus(CanopenBus, TimedFieldbus):
    """Bus with measured response times of the answers to each SYNC.

    Parameters
    ----------
    stopwatch : StopwatchBus
        Stopwatch in front of the bus.
    drives : DrivesFile
        Drives whose TPDOs are answers.
    pacing
        As for `CanopenBus`.
    """

    def __init__(self, stopwatch: StopwatchBus, drives: DrivesFile, pacing: PacingName) -> None:
        super().__init__(stopwatch, pacing)
        self._stopwatch, self._drives = stopwatch, drives
        self._found: tuple[CanopenCommunication, ...] = ()

    def connect(
        self, drives: DrivesFile, period: float, *, feed_forward: bool = False
    ) -> CanopenConnection:
        """Build the services, and remember the TPDOs set up in the drives."""
        connection = super().connect(drives, period, feed_forward=feed_forward)
        self._found = connection.communications
        return connection

    def achievable_rate(self) -> tuple[float, float]:
        """Return the highest rate of SYNC [1/s] and the slowest answer [s], 0 in lock-step."""
        slowest = 0.0 if self.lock_step else self._stopwatch.slowest
        sent = [drive.transmitted for drive in self._found]
        return achievable_rate(self._drives, slowest, sent), slowest

    def jitter(self, period: float) -> float:
        """Return the deviation of SYNC from its period at the drives [s], 0 in lock-step."""
        return 0.0 if self.lock_step else self._stopwatch.jitter(period)
