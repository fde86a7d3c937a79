"""Typed access to a drive's object dictionary, with errors that state the remedy.

A `RemoteDictionary` reads and writes numbers of one drive, through whatever access its bus gives to
them. What goes wrong names drive, object, abort code and remedy; the codes are those of CiA 301,
which every fieldbus of the profile has. `set` writes and reads back, since a drive may
round a value, clip it or ignore it; what it keeps instead is accepted where `Judge` says so. Where
the object is optional and missing, that is noted instead of refused.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeAlias

from drivers.drive_bus import DriveRefused, NodeSilent

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Iterable, Mapping, Sequence

    from drivers.fieldbus import Entry

READ_ONLY = 0x06010002
ABSENT = frozenset({0x06020000, 0x06090011})
"""A drive says so that it does not have an object."""
_STATE_CODES = frozenset({0x08000022, 0x08000021, 0x06010000})
RANGE_CODES = frozenset({0x06090030, 0x06090031, 0x06090032, 0x06040043})
FIXED_CODES = RANGE_CODES | {READ_ONLY}
"""A drive keeps its value: the object is read-only, or ours is outside its range."""


Judge: TypeAlias = "Callable[[Entry, int, int], tuple[bool, str]]"
"""Judges what a drive keeps of an object after a value was written (entry, written, kept): whether
it will do, and " (... instead of ...)" in SI; empty where the numbers say it all."""


class AccessRefused(Exception):
    """A drive answered an access with an abort code, in words where it is known."""

    def __init__(self, code: int, words: str = "") -> None:
        super().__init__(words)
        self.code = code


class NoAnswer(Exception):
    """A drive did not answer an access, or not so that it can be understood; `where` to look."""

    def __init__(self, words: str, where: str) -> None:
        super().__init__(words)
        self.where = where


class Aborted(DriveRefused):
    """A drive answered an access with an abort code.

    Attributes
    ----------
    code : int
        The abort code.
    """

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code

    @property
    def missing(self) -> bool:
        """The object does not exist in this drive."""
        return self.code in ABSENT


@dataclass(frozen=True, slots=True)
class Note:
    """Something about a drive that its operator should see.

    Attributes
    ----------
    place : str
        The drive, as messages name it.
    text : str
        What there is to say.
    lack : bool
        Of what the drive does not have or does not say, which shows without power as well.
    """

    place: str
    text: str
    lack: bool = False

    def __str__(self) -> str:
        return f"{self.place}: {self.text}"


class Access(Protocol):
    """How a bus reaches the objects of one drive; raises `AccessRefused` and `NoAnswer`."""

    def read(self, index: int, subindex: int, size: int | None = None) -> bytes:
        """Read an object whose length is `size` [bytes], or any."""

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object."""

    def order(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object and await no answer."""

    def go_operational(self) -> None:
        """Command the drive to exchange process data."""

    def leave_operational(self) -> None:
        """Command the drive to exchange none."""


class RemoteDictionary:
    """The object dictionary of one drive, which serves it (hence `server` wherever one is meant).

    Parameters
    ----------
    access : Access
        To the drive, which the bus that it is on gives.
    node : int
        Its number on the bus.
    name : str
        The axis's name, for messages.
    axis : int
        Which axis of the node.

    Attributes
    ----------
    place : tuple of int
        Node and axis.
    label : str
        How messages name the drive.
    missing : set of Entry
        Optional objects that the drive lacks, or keeps as they are.
    notes : list of Note
        What that means, and what else was noted.
    kept : dict of Entry to int
        What the drive holds of all that `set` has written, which may be another value.
    judge : Judge
        Decides which other values are accepted; at first none.
    saved : set of (int, int)
        Index and sub-index of objects that are written without `first_write`.
    first_write : callable, optional
        Called with every other `Entry` before it is written; may add to `saved`.
    """

    def __init__(self, access: Access, node: int, name: str, axis: int = 1) -> None:
        self.node, self.place = node, (node, axis)
        self.label = f"{name} (node {node}{in_words(axis)})"
        self.missing: set[Entry] = set()
        self.notes: list[Note] = []
        self.kept: dict[Entry, int] = {}
        self.judge: Judge = lambda _, written, kept: (kept == written, "")
        self.saved: set[tuple[int, int]] = set()
        self.first_write: Callable[[Entry], None] | None = None
        self.access = access

    def seen_through(self, layer: Callable[[Access], Access]) -> RemoteDictionary:
        """Return this drive's dictionary as `layer` shows it, with notes of its own.

        Parameters
        ----------
        layer : callable
            Turns the access to the drive into one that need not hand writes on.
        """
        other = copy(self)
        other.missing, other.notes, other.kept, other.saved = set(), [], {}, set()
        other.first_write = None
        other.access = layer(self.access)
        return other

    def get(self, entry: Entry) -> int:
        """Read a number.

        Raises
        ------
        NodeSilent
            No answer.
        DriveRefused
            An abort code, or a length that does not fit the type.
        """
        return int(self.measure(entry))

    def measure(self, entry: Entry) -> float:
        """Read a number that need not be an integer (errors as in `get`)."""
        try:
            data = self.access.read(entry.index, entry.subindex, entry.size)
        except (AccessRefused, NoAnswer) as error:
            raise self._explained(error, entry, "read") from error
        if len(data) != entry.size:
            raise DriveRefused(
                f"{self.label}: object {entry} has {len(data)} bytes, expected {entry.size} "
                f"({entry.type}); correct its type in the drives file or the drive's firmware"
            )
        return entry.number(data)

    def find(self, entry: Entry) -> int | None:
        """Read a number that not every drive has; None where it is missing."""
        try:
            return self.get(entry)
        except Aborted as error:
            if error.missing:
                return None
            raise

    def put(self, entry: Entry, value: int) -> None:
        """Write a number (errors as in `get`)."""
        low, high = entry.bounds
        if not low <= value <= high:
            raise DriveRefused(
                f"{self.label}: {value} does not fit {entry}, an {entry.type} of "
                f"[{low}, {high}]; check limits, gear ratio and units in the drives file"
            )
        if self.first_write is not None and entry.key not in self.saved:
            self.first_write(entry)
        try:
            self.access.write(entry.index, entry.subindex, entry.data(value))
        except (AccessRefused, NoAnswer) as error:
            raise self._explained(error, entry, f"write {value} to") from error

    def order(self, entry: Entry, value: int) -> None:
        """Write a number at once, await no answer and keep nothing of what was there.

        Raises
        ------
        BusUnavailable
            The bus does not take it.
        """
        self.access.order(entry.index, entry.subindex, entry.data(value))

    def set(self, entry: Entry, value: int) -> None:
        """Write a number and read it back; note another value that is accepted.

        Raises
        ------
        NodeSilent, DriveRefused
            As in `get`, and where the drive keeps a value that is not accepted.
        """
        self._settle(entry, value, self._written(entry, value))

    def set_unless_fixed(self, entry: Entry, value: int) -> bool:
        """Do as `set`; return False where the drive refuses to change the object."""
        try:
            self.set(entry, value)
        except Aborted as error:
            if error.code not in FIXED_CODES:
                raise
            self.kept[entry] = self.get(entry)
            return False
        return True

    def set_if_present(
        self, entry: Entry, value: int, consequence: str, also: Container[int] = ()
    ) -> None:
        """Do as `set`; where the object is missing, note what follows from that.

        So too where the drive does not take the value and keeps one that is in `also`.
        """
        if self.find(entry) is None:
            self.do_without((entry,), consequence)
            return
        try:
            kept = self._written(entry, value)
        except Aborted as error:
            kept = self.get(entry)
            if error.code not in FIXED_CODES or not (kept == value or kept in also):
                raise
            self.kept[entry] = kept
        if kept != value and kept in also:
            self.missing.add(entry)
            self.note(f"{kept} instead of {value} in object {entry}: {consequence}")
        else:
            self._settle(entry, value, kept)

    def set_any(self, values: Mapping[Entry, int]) -> bool:
        """Do as `set` with each of several objects that is present; return whether any is."""
        present = {entry: value for entry, value in values.items() if self.find(entry) is not None}
        self.missing.update(entry for entry in values if entry not in present)
        for entry, value in present.items():
            self.set(entry, value)
        return bool(present)

    def do_without(self, entries: Sequence[Entry], consequence: str) -> None:
        """Note what follows from objects that are missing."""
        self.missing.update(entries)
        self.note(f"no object {' nor '.join(map(str, entries))}: {consequence}", lack=True)

    def note(self, text: str, *, lack: bool = False) -> None:
        """Add a note on this drive (see `Note`)."""
        self.notes.append(Note(self.label, text, lack))

    def _written(self, entry: Entry, value: int) -> int:
        """Write a number; return what the drive keeps."""
        self.put(entry, value)
        kept = self.kept[entry] = self.get(entry)
        return kept

    def _settle(self, entry: Entry, value: int, kept: int) -> None:
        """Note that a drive keeps another value, or refuse it."""
        if kept == value:
            return
        accepted, compared = self.judge(entry, value, kept)
        if not accepted:
            raise DriveRefused(
                f"{self.label}: object {entry} reads back {kept} after {value} was written"
                f"{compared}; the drive limits or ignores it: choose a value that it takes, or "
                "unlock the parameter"
            )
        self.note(
            f"{kept} instead of {value} in object {entry}: the drive rounds or limits it{compared}"
        )

    def _explained(
        self, error: AccessRefused | NoAnswer, entry: Entry, what: str
    ) -> DriveRefused | NodeSilent:
        if isinstance(error, AccessRefused):
            return Aborted(
                f"{self.label}: cannot {what} object {entry}: abort {error.code:08X} ({error});"
                f" {_remedy(error.code)}",
                error.code,
            )
        return NodeSilent(
            f"{self.label}: no answer when trying to {what} object {entry} ({error}); check that "
            f"the drive has power, {error.where}"
        )


def in_words(axis: int) -> str:
    """Return what messages add to the number of a node; empty for its first axis."""
    return f", axis {axis}" if axis > 1 else ""


def labels_by_node(servers: Iterable[RemoteDictionary]) -> dict[int, str]:
    """Return how messages name each node: the drive of all its axes."""
    labels: dict[int, str] = {}
    for server in servers:
        first = labels.get(server.node)
        labels[server.node] = server.label if first is None else f"{first}, {server.label}"
    return labels


def _remedy(code: int) -> str:
    if code in ABSENT:
        return "this drive lacks the object: use another drive or firmware"
    if code == READ_ONLY:
        return "set it with the maker's commissioning tool"
    if code in _STATE_CODES:
        return "the drive does not allow it in its present state: switch it off and on again"
    if code in RANGE_CODES:
        return "choose a value that the drive takes"
    return "see the drive's manual"
