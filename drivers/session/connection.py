"""Interfaces between session and bus: connection to drives, and open bus."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from drivers.cia402.power import Power
from drivers.cia402.supervision import Supervision
from drivers.drive_bus import DriveRefused, Tripped
from drivers.found_settings.settings_file import WRITTEN_ONCE
from drivers.in_node import ALONE, InNode

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence
    from contextlib import AbstractContextManager
    from typing import Self

    from drivers.cia402.picture import Picture
    from drivers.commissioning.communication import Communication
    from drivers.cycle_data import ProcessData
    from drivers.dictionary.review import BusRules, Scan
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import LifeSign
    from drivers.found_settings.settings_file import FoundDrive
    from drivers.remote_dictionary import RemoteDictionary


class Connection(ABC):
    """Services of the drives on a bus, in joint order; implemented by each bus.

    Parameters
    ----------
    servers : tuple of RemoteDictionary
        Object dictionaries of the drives.
    communications : tuple of Communication
        Communication of each drive; completed by set-up.
    process_data : ProcessData
    life_sign : LifeSign
        Mutual supervision.

    Attributes
    ----------
    silence, wiring : str
        Parts of the message about missing telegrams: missing object, and remedy.
    doubling : str
        Message about doubled telegrams, with the remedy.
    guards : collection of int
        Index of the objects by which drives supervise us.
    requests_delay : bool
        True if requests to drives delay SYNC, and are not made between equal strokes.
    supervision : Supervision
        Supervision of statuswords and emergencies.
    power : Power
        Power-on and power-off of drives.
    written : list of RemoteDictionary
        Drives that may have been written to; the list grows.
    """

    silence: str
    wiring: str
    doubling: str
    guards: Collection[int] = ()
    requests_delay = True

    def __init__(
        self,
        servers: tuple[RemoteDictionary, ...],
        communications: tuple[Communication, ...],
        process_data: ProcessData,
        life_sign: LifeSign,
    ) -> None:
        self.servers, self.communications = servers, communications
        self.process_data, self.life_sign = process_data, life_sign
        self.supervision = Supervision(servers)
        self.power = Power(process_data, servers, self.supervision)
        self.written: list[RemoteDictionary] = []
        self._looked = -1

    def remarks(self) -> Sequence[str]:
        """Return remarks on the bus without effect on the session."""
        return ()

    def conflicts(self) -> Sequence[DriveRefused]:
        """Return an error for each drive that cannot share the bus, after configuration."""
        return ()

    @abstractmethod
    def start(self) -> None:
        """Expect the telegrams of the drives as set up, and command the drives to send."""

    @abstractmethod
    def await_answers(self) -> None:
        """Wait until each drive answers SYNC, after the command to start.

        Raises
        ------
        NodeSilent
            Drives without answers or life sign.
        """

    def refuse_unwatched(self) -> None:
        """Refuse drives whose supervision of our life sign was changed, just before power-on.

        Raises
        ------
        DriveRefused
            Another master may be at work.
        """
        for server in self.servers:
            server.refuse_changed(server.held(self.guards), DriveRefused)

    def look_at_limits(self) -> None:
        """Read back the guards of the drives, and a limit of every drive in turn.

        Raises
        ------
        Tripped
            A value differs from the one written: another tool wrote it, not over this bus.
        """
        self._looked += 1
        for server in self.servers:
            limits = server.held(WRITTEN_ONCE)
            turn = self._looked % max(1, len(limits))
            server.refuse_changed([*server.held(self.guards), *limits[turn : turn + 1]], Tripped)

    @abstractmethod
    def collect_late(self) -> None:
        """Receive late telegrams."""

    @abstractmethod
    def close(self) -> None:
        """Release the resources of this connection on the bus; the bus stays open."""

    def cycle(self) -> None:
        """Let a SYNC pass before the axes are in operation.

        Raises
        ------
        DriveRefused, NodeSilent, BusUnavailable
            Another master is at work; the life sign of a drive is missing; the bus has failed.
        """
        self.process_data.sync()
        self.life_sign.service()
        if trouble := self.life_sign.trouble:  # before any motion, a trip becomes a refusal
            raise DriveRefused(str(trouble)) if isinstance(trouble, Tripped) else trouble

    def beating_cycle(self) -> None:
        """Let a SYNC pass, even without life signs of drives."""
        self.process_data.sync()
        self.life_sign.beat()


@dataclass(frozen=True)
class UnpoweredDrives:
    """Drives before power-on or after power-off, without mutual supervision.

    Attributes
    ----------
    servers : tuple of RemoteDictionary
        Object dictionaries of the drives in joint order.
    communications : tuple of Communication
        Preferred communication.
    process_data : ProcessData
        Lets time pass; the drives send no process data.
    """

    servers: tuple[RemoteDictionary, ...]
    communications: tuple[Communication, ...]
    process_data: ProcessData

    def wait(self, duration: float) -> None:
        """Let time pass [s]."""
        ends = self.process_data.now() + duration
        while self.process_data.now() < ends:
            self.process_data.tick()


class Place(NamedTuple):
    """Address of a drive on its bus.

    Attributes
    ----------
    node : int
        Node number.
    name : str
        Name in messages.
    alias : int or None
        Alias that identifies the drive instead of the node number, on buses with aliases.
    within : InNode
        Axis within the node.
    """

    node: int
    name: str
    alias: int | None = None
    within: InNode = ALONE


def places_of(drives: Iterable[AxisDrive | FoundDrive]) -> tuple[Place, ...]:
    """Return the addresses of the drives in a file."""
    return tuple(Place(drive.node, drive.name, drive.alias, drive.within) for drive in drives)


class Fieldbus(ABC):
    """Open bus with drives, and a context manager that closes the bus.

    Attributes
    ----------
    rules : BusRules
        Rules of the bus for object dictionaries.
    lock_step : bool
        True if time is counted in SYNCs.
    keeps_time : bool
        True if SYNC is sent on time even if this process is late.
    recorded : bool
        True for a replay, which has no drives that could stay powered.
    """

    rules: BusRules
    lock_step: bool
    keeps_time: bool
    recorded: bool

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.shutdown()

    @abstractmethod
    def connect(
        self, drives: DrivesFile, period: float, *, feed_forward: bool = False
    ) -> Connection:
        """Build the services for a set of drives, without sending; after an error nothing remains.

        Parameters
        ----------
        drives : DrivesFile
            Axes in joint order.
        period : float
            Time between two SYNCs [s].
        feed_forward : bool
            True if the drives take offsets of velocity and torque.
        """

    @abstractmethod
    def unpowered(self, drives: DrivesFile) -> UnpoweredDrives:
        """Access drives before or after a session."""

    @abstractmethod
    def servers(self, places: Iterable[Place], timeout: float) -> tuple[RemoteDictionary, ...]:
        """Access drives, with `timeout` for an answer [s]."""

    @abstractmethod
    def scan(self, only: Collection[int] | None = None, *, besides: Collection[int] = ()) -> Scan:
        """Read the dictionaries of nodes in `only` (default: all), except `besides`; write nothing.

        Raises
        ------
        BusUnavailable
            The bus accepts no frames or has gone.
        """

    @abstractmethod
    def wait(self, timeout: float) -> object:
        """Wait as for the next SYNC, at most `timeout` [s]; received frames are dropped."""

    @abstractmethod
    def timed(self, drives: DrivesFile) -> AbstractContextManager[TimedFieldbus]:
        """Return a bus that measures response times, to be used in place of this one."""

    @abstractmethod
    def picture(self, drives: DrivesFile, *, inputs: bool = False) -> Picture:
        """Return a picture of the axes by listening; with `inputs`, also request 60FD."""

    @abstractmethod
    def load(self, drives: DrivesFile) -> tuple[float, float]:
        """Return the duration of a cycle on the bus [s], and the permitted share of the period."""

    @abstractmethod
    def shutdown(self) -> None:
        """Close the bus."""


class TimedFieldbus(Fieldbus):
    """Open bus with measured instants of SYNC and response times of the drives."""

    @abstractmethod
    def achievable_rate(self) -> tuple[float, float]:
        """Return the highest rate of SYNC [1/s] and the slowest answer [s], 0 if not measured."""

    @abstractmethod
    def jitter(self, period: float) -> float:
        """Return the deviation of SYNC from its period at the drives, 99th percentile [s].

        The result is 0 if not measured.
        """
