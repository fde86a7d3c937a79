"""What start-up will write to a drive, found out before anything is written.

The very code that configures drives (`commissioning`) runs on a layer over the object dictionary:
reading goes to the drive, what is written stays in the layer and is read from there. So the list of
what will change cannot part from what is done, but where a drive itself refuses a value. Only such
a refusal shows that process data must go another way, so what is done then is found out too.
"""

from __future__ import annotations

from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.cia402.vendor_objects import own_feed_forward
from drivers.commissioning.configure import check_identity, commission
from drivers.commissioning.consistency import compare_statements
from drivers.commissioning.effective_limits import effective_limits
from drivers.commissioning.held_values import before
from drivers.drive_bus import DriveRefused
from drivers.remote_dictionary import AccessRefused

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from drivers.commissioning.communication import Communication
    from drivers.commissioning.effective_limits import EffectiveLimits
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import Entry
    from drivers.remote_dictionary import Access, RemoteDictionary

Address = tuple[int, int]

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
        In the order in which they are first written; then those of a drive that turns out to refuse
        what its bus names as refusable.
    """

    limits: EffectiveLimits
    found: Mapping[Entry, int]
    changes: tuple[Change, ...]


def announce(
    server: RemoteDictionary,
    axis: AxisDrive,
    drives: DrivesFile,
    period: float,
    communication: Communication,
    find: Callable[[Entry], int | None] | None = None,
    later: Sequence[Entry] = (),
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
    communication : Communication
        How it will communicate; left as it is.
    find : callable, optional
        What an object held before any of our writes; by default what it holds.
    later : sequence of Entry
        What else will be written after start-up.

    Raises
    ------
    DriveRefused, NodeSilent
        Why the drive cannot serve.
    """
    check_identity(server, axis)
    usual = _Rehearsal(server, _Layer)
    compare_statements(usual.shown, axis)  # a limit in a wrong unit says nothing
    limits = effective_limits(find or server.find, axis, server.label)
    communicating = copy(communication)
    commission(usual.shown, axis, drives, period, lambda holds, _: holds(), limits, communicating)
    own = own_feed_forward(axis) if communication.feed_forward else ()
    for entry in (*objects.INTERPOLATION, *communication.later, *later, *own):
        usual.found.update(before(usual.shown, entry))
    changes = list(usual.changes())
    refusable = communication.refusable(axis)
    if refusable is not None and refusable.place in usual.written:
        other = _Rehearsal(server, partial(usual.layer.refusing, refusable.place))
        with suppress(DriveRefused):  # without it there is no other course
            copy(communication).set_up_process_data(other.shown, axis)
            more = other.changes(besides=usual.written)
            changes += [each.only(refusable.condition) for each in more]
        usual.found.update({e: v for e, v in other.found.items() if e not in usual.found})
    return Announcement(limits, usual.found, tuple(changes))


class _Rehearsal:
    """What is written to a drive behind a layer, and what the drive holds of it."""

    def __init__(self, server: RemoteDictionary, layer: Callable[[Access], _Layer]) -> None:
        self.found: dict[Entry, int] = {}
        self._entries: dict[Address, Entry] = {}

        def behind(access: Access) -> Access:
            self.layer = layer(access)
            return self.layer

        self.shown = server.copy_through(behind)
        self.shown.first_write = self._keep

    @property
    def written(self) -> Mapping[Address, bytes]:
        """What the layer keeps to itself."""
        return self.layer.written

    def changes(self, besides: Mapping[Address, bytes] | None = None) -> Iterator[Change]:
        """Yield what would be another value on the drive, but what is in `besides`."""
        held = {entry.key: value for entry, value in self.found.items()}
        for place, data in self.written.items():
            entry = self._entries[place]
            value = int.from_bytes(data, "little", signed=entry.signed)
            if held.get(place) != value and (besides or {}).get(place) != data:
                yield Change(entry, held.get(place), value)

    def _keep(self, entry: Entry) -> None:
        held = before(self.shown, entry)
        for each in (*held, entry):
            self._entries.setdefault(each.key, each)
        self.found.update(held)
        self.shown.saved.update(self._entries)


class _Layer:
    """An access that keeps to itself what is written, and asks the drive for each object once."""

    def __init__(self, drive: Access) -> None:
        self.written: dict[Address, bytes] = {}
        self._drive = drive
        self._answers: dict[Address, bytes | AccessRefused] = {}
        self._shown = {by.key: what for what, by in _SHOWN_BY.items()}
        self._lacks: frozenset[Address] = frozenset()

    def refusing(self, place: Address, _: Access) -> _Layer:
        """Return another one over the same drive, if that lacked an object."""
        other = _Layer(self._drive)
        other._answers, other._lacks = self._answers, frozenset({place})
        return other

    def read(self, index: int, subindex: int, size: int | None = None) -> bytes:
        """Read an object: what was written to it, else what the drive holds."""
        source = self._shown.get((index, subindex))
        place = source.key if source else (index, subindex)
        if place in self.written:
            return self.written[place]
        return self._ask(index, subindex, size)

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """Keep a value; raise as the drive would where it lacks the object."""
        if (index, subindex) in self._lacks:
            raise AccessRefused(_NO_ENTRY)
        try:
            self._ask(index, subindex, len(data))
        except AccessRefused as error:
            if error.code != _WRITE_ONLY:
                raise
        self.written[index, subindex] = data

    def order(self, index: int, subindex: int, data: bytes) -> None:
        """Keep a value."""
        self.written[index, subindex] = data

    def go_operational(self) -> None:
        """Do nothing, since nothing is sent."""

    def leave_operational(self) -> None:
        """Do nothing."""

    def _ask(self, index: int, subindex: int, size: int | None) -> bytes:
        place = index, subindex
        if place not in self._answers:
            try:
                self._answers[place] = self._drive.read(index, subindex, size)
            except AccessRefused as error:
                self._answers[place] = error
        answer = self._answers[place]
        if isinstance(answer, AccessRefused):
            raise answer
        return answer
