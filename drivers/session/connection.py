"""What a session stands on, whichever bus it is: connections to drives, and the open bus itself."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from drivers.cia402.power import Power
from drivers.cia402.supervision import Supervision
from drivers.in_node import ALONE, InNode

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence
    from contextlib import AbstractContextManager
    from typing import Self

    from drivers.cia402.picture import Picture
    from drivers.commissioning.communication import Communication
    from drivers.cycle_data import ProcessData
    from drivers.dictionary.bus_rules import BusRules
    from drivers.dictionary.found_nodes import Scan
    from drivers.drive_bus import DriveRefused
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import LifeSign
    from drivers.found_settings.settings_file import FoundDrive
    from drivers.remote_dictionary import RemoteDictionary


class Connection(ABC):
    """The services of all drives on one bus, in joint order; each bus makes its own.

    Parameters
    ----------
    servers : tuple of RemoteDictionary
        The drives' object dictionaries.
    communications : tuple of Communication
        How each drive communicates; what is found is put in.
    process_data : ProcessData
        Of all axes.
    life_sign : LifeSign
        Ours and theirs.

    Attributes
    ----------
    silence, wiring : str
        What stays away for so many SYNCs, in words, and what to check of the bus then.
    doubling : str
        What DOUBLED samples for so many SYNCs mean, in words, with the remedy.
    supervision : Supervision
        Judges statuswords and emergencies.
    power : Power
        Switches drives on and off.
    written : list of RemoteDictionary
        Drives to which something may have been written; grows.
    """

    silence: str
    wiring: str
    doubling: str

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

    def remarks(self) -> Sequence[str]:
        """State what is to be known of the bus itself after a while, and stops nothing."""
        return ()

    def conflicts(self) -> Sequence[DriveRefused]:
        """Return which drives cannot share the bus, once all are configured."""
        return ()

    @abstractmethod
    def start(self) -> None:
        """Expect what each drive sends as it has been set up, and command all to send it."""

    @abstractmethod
    def await_answers(self) -> None:
        """Watch drives that have just been commanded to start, until each answers SYNC.

        Raises
        ------
        NodeSilent
            Which do not, or whose life sign stays away.
        """

    @abstractmethod
    def refuse_unwatched(self) -> None:
        """Refuse drives whose watch on us is not as it was set, right before power-on.

        Raises
        ------
        DriveRefused
            Another master may be at work.
        """

    def look_at_limits(self) -> None:  # noqa: B027 - most buses hear it
        """Read back a limit of each drive, where nobody hears that somebody else writes it.

        Raises
        ------
        Tripped
            It is no longer what start-up wrote.
        """

    @abstractmethod
    def collect_late(self) -> None:
        """Take telegrams off the bus that are merely late."""

    @abstractmethod
    def close(self) -> None:
        """Take away what was put on the bus, which stays open."""

    def cycle(self) -> None:
        """Let one SYNC pass.

        Raises
        ------
        NodeSilent, BusUnavailable
            A drive's life sign stays away; the bus does not serve any more.
        """
        self.process_data.sync()
        self.life_sign.service()
        if self.life_sign.trouble:
            raise self.life_sign.trouble

    def beating_cycle(self) -> None:
        """Let one SYNC pass, whoever's life sign stays away."""
        self.process_data.sync()
        self.life_sign.beat()


@dataclass(frozen=True)
class UnpoweredDrives:
    """Drives that are asked what they are, or watched when they are off; nothing watches them.

    Attributes
    ----------
    servers : tuple of RemoteDictionary
        The drives' object dictionaries in joint order.
    communications : tuple of Communication
        How they would communicate.
    process_data : ProcessData
        Lets time pass; the drives send none.
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
    """Where a drive is on its bus.

    Attributes
    ----------
    node : int
        Its number.
    name : str
        For messages.
    alias : int or None
        By which it is found in place of its number, on buses that have such.
    within : InNode
        Which of several axes of its node.
    """

    node: int
    name: str
    alias: int | None = None
    within: InNode = ALONE


def places_of(drives: Iterable[AxisDrive | FoundDrive]) -> tuple[Place, ...]:
    """Return where drives are that a file names."""
    return tuple(Place(drive.node, drive.name, drive.alias, drive.within) for drive in drives)


class Fieldbus(ABC):
    """An open bus with drives on it, and a context manager that closes it.

    Attributes
    ----------
    rules : BusRules
        Its own in their object dictionaries.
    lock_step : bool
        Time is counted in SYNCs, which wait for nobody.
    keeps_time : bool
        SYNC comes by itself, however late this process is.
    recorded : bool
        No drives are behind it that could be left switched on.
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
        """Build all that is needed to talk to drives, or nothing; nothing is sent.

        Parameters
        ----------
        drives : DrivesFile
            The axes in joint order.
        period : float
            Time between two SYNCs [s].
        feed_forward : bool
            The drives are to take offsets of velocity and torque.
        """

    @abstractmethod
    def unpowered(self, drives: DrivesFile) -> UnpoweredDrives:
        """Reach drives as they are before or after a session."""

    @abstractmethod
    def servers(self, places: Iterable[Place], timeout: float) -> tuple[RemoteDictionary, ...]:
        """Reach drives, which may take `timeout` to answer [s]."""

    @abstractmethod
    def scan(self, only: Collection[int] | None = None, *, besides: Collection[int] = ()) -> Scan:
        """Find the nodes of some numbers (by default all) and what they offer, writing nothing.

        Raises
        ------
        BusUnavailable
            The bus takes no frames or has gone.
        """

    @abstractmethod
    def wait(self, timeout: float) -> object:
        """Wait as for the next SYNC, for so long at most [s]; what is received is dropped."""

    @abstractmethod
    def timed(self, drives: DrivesFile) -> AbstractContextManager[TimedFieldbus]:
        """Stand in for this bus and note how long drives take to answer."""

    @abstractmethod
    def picture(self, drives: DrivesFile, *, inputs: bool = False) -> Picture:
        """Show what is seen by listening alone, and digital inputs (60FD) by asking for them."""

    @abstractmethod
    def load(self, drives: DrivesFile) -> tuple[float, float]:
        """Return the time of a cycle on the bus [s], and the share of the period it may take."""

    @abstractmethod
    def shutdown(self) -> None:
        """Close it."""


class TimedFieldbus(Fieldbus):
    """An open bus that notes when SYNC was sent and how long drives take to answer."""

    @abstractmethod
    def achievable_rate(self) -> tuple[float, float]:
        """Return the highest rate of SYNC [1/s], and the slowest answer [s], 0 if not timed."""

    @abstractmethod
    def jitter(self, period: float) -> float:
        """Return how far SYNC was off its period [s] where it acts, but for one in a hundred [s].

        0 where it is not timed.
        """
