"""What start-up will write to a drive, found out before anything is written.

The very code that configures drives (`commissioning`) runs on a layer over the object dictionary:
reading goes to the drive, what is written stays in the layer and is read from there. So the list of
what will change cannot part from what is done, but where a drive itself refuses a value.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from canopen.sdo.exceptions import SdoAbortedError

from drivers import objects
from drivers.commissioning import check_identity, commission
from drivers.communication import Communication
from drivers.effective_limits import effective_limits
from drivers.pdo_mapping import mapping_count
from drivers.sdo import Entry
from drivers.settings_reading import before

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.effective_limits import EffectiveLimits
    from drivers.sdo import SdoClient, SdoServer

Place = tuple[int, int]

LATER = (
    objects.INTERPOLATION_PERIOD,
    objects.INTERPOLATION_POWER,
    Entry(0x1801, 2, "u8", "transmission type of TPDO 2"),
    mapping_count(0x1A01),
)
"""What may be written beside: where a path is streamed, where TPDO 1 turns out to be fixed."""
_WRITE_ONLY = 0x06010001
_SHOWN_BY = {objects.MODE: objects.MODE_DISPLAY}


@dataclass(frozen=True, slots=True)
class Change:
    """One object that start-up overwrites with another value.

    Attributes
    ----------
    entry : Entry
        Where it stands.
    present : int or None
        Value on the drive; None where it cannot be read.
    value : int
        Value to be written.
    """

    entry: Entry
    present: int | None
    value: int


@dataclass(frozen=True, slots=True)
class Announcement:
    """What start-up will do to one drive.

    Attributes
    ----------
    limits : EffectiveLimits
        Which hold.
    found : mapping of Entry to int
        What the drive holds of all that will or may be written.
    changes : tuple of Change
        In the order in which they are first written.
    """

    limits: EffectiveLimits
    found: Mapping[Entry, int]
    changes: tuple[Change, ...]


def announce(
    server: SdoServer,
    axis: AxisDrive,
    drives: DrivesFile,
    period: float,
    find: Callable[[Entry], int | None] | None = None,
    later: Sequence[Entry] = (),
) -> Announcement:
    """Find out what start-up will write to a drive; nothing is written.

    Parameters
    ----------
    server : SdoServer
        The drive's object dictionary.
    axis, drives : AxisDrive, DrivesFile
        What the drives file states.
    period : float
        Time between two SYNCs [s].
    find : callable, optional
        What an object held before any of our writes; by default what it holds.
    later : sequence of Entry
        What will be written after start-up beside `LATER`.

    Raises
    ------
    DriveRefused, NodeSilent
        Why the drive cannot serve.
    """
    check_identity(server, axis)
    limits = effective_limits(find or server.find, axis, server.label)
    layers: list[_Layer] = []

    def layer(client: SdoClient) -> SdoClient:
        layers.append(_Layer(client))
        return layers[0]

    shown = server.seen_through(layer)
    found: dict[Entry, int] = {}
    entries: dict[Place, Entry] = {}

    def keep(entry: Entry) -> None:
        held = before(shown, entry)
        for each in (*held, entry):
            entries.setdefault((each.index, each.subindex), each)
        found.update(held)
        shown.saved.update(entries)

    shown.first_write = keep
    communication = Communication.predefined(axis, server.label)
    commission(shown, axis, drives, period, lambda holds, _: holds(), limits, communication)
    for entry in (*LATER, *later):
        found.update(before(shown, entry))
    changes = _changes(entries, found, layers[0].written)
    return Announcement(limits, found, tuple(changes))


def _changes(
    entries: Mapping[Place, Entry], found: Mapping[Entry, int], written: Mapping[Place, bytes]
) -> Iterator[Change]:
    held = {(entry.index, entry.subindex): value for entry, value in found.items()}
    for place, data in written.items():
        entry = entries[place]
        value = int.from_bytes(data, "little", signed=entry.signed)
        if held.get(place) != value:
            yield Change(entry, held.get(place), value)


class _Layer:
    """A client that keeps to itself what is written, and asks the drive for each object once."""

    def __init__(self, drive: SdoClient) -> None:
        self.written: dict[Place, bytes] = {}
        self._drive = drive
        self._answers: dict[Place, bytes | SdoAbortedError] = {}
        self._shown = {(by.index, by.subindex): what for what, by in _SHOWN_BY.items()}

    def upload_number(self, index: int, subindex: int, size: int) -> bytes:
        """Read an object: what was written to it, else what the drive holds."""
        source = self._shown.get((index, subindex))
        place = (source.index, source.subindex) if source else (index, subindex)
        if place in self.written:
            return self.written[place]
        return self._ask(index, subindex, size)

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Keep a value; raise as the drive would where it lacks the object."""
        try:
            self._ask(index, subindex, len(data))
        except SdoAbortedError as error:
            if error.code != _WRITE_ONLY:
                raise
        self.written[index, subindex] = data

    def _ask(self, index: int, subindex: int, size: int) -> bytes:
        place = index, subindex
        if place not in self._answers:
            try:
                self._answers[place] = self._drive.upload_number(index, subindex, size)
            except SdoAbortedError as error:
                self._answers[place] = error
        answer = self._answers[place]
        if isinstance(answer, SdoAbortedError):
            raise answer
        return answer
