"""Announcement of the values that start-up will write to a drive, before anything is written.

The code that configures drives (`commissioning`) runs on a layer over the object dictionary: reads
go to the drive, written values stay in the layer and are read from there. So announcement and
start-up differ only if a drive refuses a value. Such a refusal makes the process data use another
mapping, so the consequence is announced too.
"""

from __future__ import annotations

from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.cia402.objects import own_feed_forward
from drivers.commissioning.configure import check_identity, commission
from drivers.commissioning.consistency import compare_statements
from drivers.commissioning.effective_limits import effective_limits
from drivers.commissioning.held_values import read_before_write
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
    """Object that start-up overwrites with another value.

    Attributes
    ----------
    entry : Entry
        The object.
    present : int or None
        Value in the drive; None if it cannot be read.
    value : int
        Value to be written.
    """

    entry: Entry
    present: int | None
    value: int

    def add_condition(self, condition: str) -> Change:
        """Return the change with a condition in its name."""
        named = replace(self.entry, name=f"{self.entry.name}, {condition}")
        return replace(self, entry=named)


@dataclass(frozen=True, slots=True)
class Announcement:
    """Changes that start-up will make to a drive.

    Attributes
    ----------
    limits : EffectiveLimits
        Limits in force.
    found : mapping of Entry to int
        Present values of objects that will or may be written.
    changes : tuple of Change
        Changes in the order of first writing; then those of a drive that refuses the object named
        by its bus as refusable.
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
    """Return what start-up will write to a drive; nothing is written.

    Parameters
    ----------
    server : RemoteDictionary
    axis, drives : AxisDrive, DrivesFile
    period : float
        Time between two SYNCs [s].
    communication : Communication
        Communication of the drive; not changed.
    find : callable, optional
        Returns the value of an object before any of our writes; by default the present value.
    later : sequence of Entry
        Further objects to be written after start-up.

    Raises
    ------
    DriveRefused, NodeSilent
        The drive is unsuitable.
    """
    check_identity(server, axis)
    usual = _Rehearsal(server, _Layer)
    compare_statements(usual.shown, axis)  # a limit in a wrong unit is meaningless
    limits = effective_limits(find or server.find, axis, server.label)
    communicating = copy(communication)
    commission(usual.shown, axis, drives, period, lambda holds, _: holds(), limits, communicating)
    own = own_feed_forward(axis) if communication.feed_forward else ()
    for entry in (*objects.INTERPOLATION, *communication.later, *later, *own):
        usual.found.update(read_before_write(usual.shown, entry))
    changes = list(usual.changes())
    refusable = communication.refusable(axis)
    if refusable is not None and refusable.place in usual.written:
        other = _Rehearsal(server, partial(usual.layer.refusing, refusable.place))
        with suppress(DriveRefused):  # then there is no alternative
            copy(communication).set_up_process_data(other.shown, axis)
            more = other.changes(besides=usual.written)
            changes += [each.add_condition(refusable.condition) for each in more]
        usual.found.update({e: v for e, v in other.found.items() if e not in usual.found})
    return Announcement(limits, usual.found, tuple(changes))


class _Rehearsal:
    """Set-up of a drive behind a layer: written values, and values held by the drive."""

    def __init__(self, server: RemoteDictionary, layer: Callable[[Access], _Layer]) -> None:
        self.found: dict[Entry, int] = {}
        self._entries: dict[Address, Entry] = {}

        def put_layer(access: Access) -> Access:
            self.layer = layer(access)
            return self.layer

        self.shown = server.copy_through(put_layer)
        self.shown.first_write = self._keep

    @property
    def written(self) -> Mapping[Address, bytes]:
        """Values kept in the layer."""
        return self.layer.written

    def changes(self, besides: Mapping[Address, bytes] | None = None) -> Iterator[Change]:
        """Yield values that differ from the drive's, except those in `besides`."""
        held = {entry.key: value for entry, value in self.found.items()}
        for place, data in self.written.items():
            entry = self._entries[place]
            value = int.from_bytes(data, "little", signed=entry.signed)
            if held.get(place) != value and (besides or {}).get(place) != data:
                yield Change(entry, held.get(place), value)

    def _keep(self, entry: Entry) -> None:
        held = read_before_write(self.shown, entry)
        for each in (*held, entry):
            self._entries.setdefault(each.key, each)
        self.found.update(held)
        self.shown.saved.update(self._entries)


class _Layer:
    """Access that keeps written values, and reads each object of the drive once."""

    def __init__(self, drive: Access) -> None:
        self.written: dict[Address, bytes] = {}
        self._drive = drive
        self._answers: dict[Address, bytes | AccessRefused] = {}
        self._shown = {by.key: what for what, by in _SHOWN_BY.items()}
        self._lacks: frozenset[Address] = frozenset()

    def refusing(self, place: Address, _: Access) -> _Layer:
        """Return another layer over the drive, in which the object `place` is missing."""
        other = _Layer(self._drive)
        other._answers, other._lacks = self._answers, frozenset({place})
        return other

    def read(self, index: int, subindex: int, size: int | None = None) -> bytes:
        """Read an object: the written value, otherwise the drive's."""
        source = self._shown.get((index, subindex))
        place = source.key if source else (index, subindex)
        if place in self.written:
            return self.written[place]
        return self._ask(index, subindex, size)

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """Keep a value; raise like the drive if it lacks the object."""
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
        """Do nothing: nothing is sent."""

    def leave_operational(self) -> None:
        """Do nothing: nothing is sent."""

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
