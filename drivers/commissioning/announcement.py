"""What start-up will write to a drive, found out before anything is written.

The very code that configures drives (`commissioning`) runs on a layer over the object dictionary:
reading goes to the drive, what is written stays in the layer and is read from there. So the list of
what will change cannot part from what is done, but where a drive itself refuses a value. Only such
a refusal shows that TPDO 1 takes two objects at most, so what is done then is found out too.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from canopen.sdo.exceptions import SdoAbortedError

from drivers.canopen.communication import Communication
from drivers.canopen.pdo_mapping import arrangements, mapping_count
from drivers.canopen.pdo_set_up import set_up_pdos
from drivers.canopen.vendor_objects import own_feed_forward
from drivers.cia402 import objects
from drivers.commissioning.configure import check_identity, commission
from drivers.commissioning.consistency import compare_statements
from drivers.commissioning.effective_limits import effective_limits
from drivers.commissioning.held_values import before
from drivers.drive_bus import DriveRefused
from drivers.fieldbus import Entry

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from drivers.canopen.sdo import RemoteDictionary, SdoClient
    from drivers.commissioning.effective_limits import EffectiveLimits
    from drivers.drives_file import AxisDrive, DrivesFile

Address = tuple[int, int]

LATER = (
    *objects.INTERPOLATION,
    Entry(0x1801, 2, "u8", "transmission type of TPDO 2"),
    mapping_count(0x1A01),
)
"""What may be written beside: where a path is streamed, where TPDO 1 turns out to be fixed."""
FURTHEST: Address = (0x1A00, 3)
"""The entry of TPDO 1 that drives with room for two objects refuse."""
IF_SHORT = "if TPDO 1 takes fewer objects"
_NO_ENTRY = 0x06090011
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

    def only(self, condition: str) -> Change:
        """Return the same with the condition under which it is made."""
        named = replace(self.entry, name=f"{self.entry.name}, {condition}")
        return replace(self, entry=named)


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
        In the order in which they are first written; then those of a drive whose TPDO 1 turns out
        to take fewer objects.
    """

    limits: EffectiveLimits
    found: Mapping[Entry, int]
    changes: tuple[Change, ...]


def announce(
    server: RemoteDictionary,
    axis: AxisDrive,
    drives: DrivesFile,
    period: float,
    find: Callable[[Entry], int | None] | None = None,
    later: Sequence[Entry] = (),
    *,
    feed_forward: bool = False,
) -> Announcement:
    """Find out what start-up will write to a drive; nothing is written.

    Parameters
    ----------
    server : RemoteDictionary
        The drive's object dictionary.
    axis, drives : AxisDrive, DrivesFile
        What the drives file states.
    period : float
        Time between two SYNCs [s].
    find : callable, optional
        What an object held before any of our writes; by default what it holds.
    later : sequence of Entry
        What will be written after start-up beside `LATER`.
    feed_forward : bool
        Velocity and torque will be fed forward.

    Raises
    ------
    DriveRefused, NodeSilent
        Why the drive cannot serve.
    """
    check_identity(server, axis)
    usual = _Rehearsal(server, _Layer)
    compare_statements(usual.shown, axis)  # a limit in a wrong unit says nothing
    limits = effective_limits(find or server.find, axis, server.label)
    communication = Communication.predefined(axis, server.label, feed_forward=feed_forward)
    commission(usual.shown, axis, drives, period, lambda holds, _: holds(), limits, communication)
    own = own_feed_forward(axis) if feed_forward else ()
    for entry in (*LATER, *later, *own):
        usual.found.update(before(usual.shown, entry))
    changes = list(usual.changes())
    if FURTHEST in usual.written and len(arrangements(axis)) > 1:
        shorter = _Rehearsal(server, usual.layer.shorter)
        with suppress(DriveRefused):  # without it there is no other arrangement
            set_up_pdos(shorter.shown, axis, feed_forward=feed_forward)
            changes += [each.only(IF_SHORT) for each in shorter.changes(besides=usual.written)]
        usual.found.update({e: v for e, v in shorter.found.items() if e not in usual.found})
    return Announcement(limits, usual.found, tuple(changes))


class _Rehearsal:
    """What is written to a drive behind a layer, and what the drive holds of it."""

    def __init__(self, server: RemoteDictionary, layer: Callable[[SdoClient], _Layer]) -> None:
        self.found: dict[Entry, int] = {}
        self._entries: dict[Address, Entry] = {}

        def behind(client: SdoClient) -> SdoClient:
            self.layer = layer(client)
            return self.layer

        self.shown = server.seen_through(behind)
        self.shown.first_write = self._keep

    @property
    def written(self) -> Mapping[Address, bytes]:
        """What the layer keeps to itself."""
        return self.layer.written

    def changes(self, besides: Mapping[Address, bytes] | None = None) -> Iterator[Change]:
        """Yield what would be another value on the drive, but what is in `besides`."""
        held = {(entry.index, entry.subindex): value for entry, value in self.found.items()}
        for place, data in self.written.items():
            entry = self._entries[place]
            value = int.from_bytes(data, "little", signed=entry.signed)
            if held.get(place) != value and (besides or {}).get(place) != data:
                yield Change(entry, held.get(place), value)

    def _keep(self, entry: Entry) -> None:
        held = before(self.shown, entry)
        for each in (*held, entry):
            self._entries.setdefault((each.index, each.subindex), each)
        self.found.update(held)
        self.shown.saved.update(self._entries)


class _Layer:
    """A client that keeps to itself what is written, and asks the drive for each object once."""

    def __init__(self, drive: SdoClient) -> None:
        self.written: dict[Address, bytes] = {}
        self._drive = drive
        self._answers: dict[Address, bytes | SdoAbortedError] = {}
        self._shown = {(by.index, by.subindex): what for what, by in _SHOWN_BY.items()}
        self._lacks: frozenset[Address] = frozenset()

    def shorter(self, _: SdoClient) -> _Layer:
        """Return another one over the same drive, if its TPDO 1 took two objects only."""
        other = _Layer(self._drive)
        other._answers, other._lacks = self._answers, frozenset({FURTHEST})
        return other

    def upload_number(self, index: int, subindex: int, size: int) -> bytes:
        """Read an object: what was written to it, else what the drive holds."""
        source = self._shown.get((index, subindex))
        place = (source.index, source.subindex) if source else (index, subindex)
        if place in self.written:
            return self.written[place]
        return self._ask(index, subindex, size)

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Keep a value; raise as the drive would where it lacks the object."""
        if (index, subindex) in self._lacks:
            raise SdoAbortedError(_NO_ENTRY)
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
