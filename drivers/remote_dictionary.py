"""Typed access to a drive's object dictionary, with errors that state the remedy.

A `RemoteDictionary` reads and writes numbers of one drive, through the access of its bus. Errors
name drive, object, abort code and remedy; the codes are those of CiA 301, common to every fieldbus
of the profile. `set` writes and reads back, since a drive may round, clip or ignore a value;
`Judge` decides whether a different value is accepted. A missing optional object is noted instead
of refused.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeAlias

from drivers.drive_bus import DriveError, DriveRefused, NodeSilent

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Container, Iterable, Mapping, Sequence

    from drivers.fieldbus import Entry

READ_ONLY = 0x06010002
ABSENT = frozenset({0x06020000, 0x06090011})
"""Abort codes for an object that does not exist."""
_STATE_CODES = frozenset({0x08000022, 0x08000021, 0x06010000})
RANGE_CODES = frozenset({0x06090030, 0x06090031, 0x06090032, 0x06040043})
FIXED_CODES = RANGE_CODES | {READ_ONLY}
"""Abort codes for a value that cannot be changed: read-only, or written outside the range."""


Judge: TypeAlias = "Callable[[Entry, int, int], tuple[bool, str]]"
"""Judge of a value kept by the drive instead of the written one (entry, written, kept): True if
acceptable, and both values in SI units as the end of a message, or empty."""


class AccessRefused(Exception):
    """A drive answered an access with an abort code; the text explains known codes."""

    def __init__(self, code: int, words: str = "") -> None:
        super().__init__(words)
        self.code = code


class NoAnswer(Exception):
    """A drive gave no intelligible answer to an access; `where` names the place to check."""

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
        """True if the object does not exist in this drive."""
        return self.code in ABSENT


@dataclass(frozen=True, slots=True)
class Note:
    """Remark about a drive for the operator.

    Attributes
    ----------
    place : str
        Name of the drive in messages.
    text : str
        The remark.
    lack : bool
        True for a missing object or value, which is visible without power.
    """

    place: str
    text: str
    lack: bool = False

    def __str__(self) -> str:
        return f"{self.place}: {self.text}"


class Access(Protocol):
    """Access of a bus to the objects of a drive; raises `AccessRefused` and `NoAnswer`."""

    def read(self, index: int, subindex: int, size: int | None = None) -> bytes:
        """Read an object with a length of `size` [bytes], or of any length."""

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object."""

    def order(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object without waiting for an answer."""

    def go_operational(self) -> None:
        """Command the drive to start the exchange of process data."""

    def leave_operational(self) -> None:
        """Command the drive to stop the exchange of process data."""


class RemoteDictionary:
    """Object dictionary of a drive, the SDO server (hence `server` in other modules).

    Parameters
    ----------
    access : Access
        Access to the drive through its bus.
    node : int
        Node number.
    name : str
        Name of the axis in messages.
    axis : int
        Number of the axis in the node.

    Attributes
    ----------
    place : tuple of int
        Node and axis.
    label : str
        Name of the drive in messages.
    missing : set of Entry
        Optional objects that the drive lacks or cannot change.
    notes : list of Note
        Consequences of missing objects, and other remarks.
    kept : dict of Entry to int
        Values in the drive of objects written by `set`, which may differ from those written.
    judge : Judge
        Decides which different values are accepted; initially none.
    saved : set of (int, int)
        Index and sub-index of objects whose old values are saved already.
    first_write : callable, optional
        Called with an `Entry` not in `saved` before the object is written; may add to `saved`.
    """

    def __init__(self, access: Access, node: int, name: str, axis: int = 1) -> None:
        self.node, self.place = node, (node, axis)
        self.label = f"{name} (node {node}{axis_suffix(axis)})"
        self.missing: set[Entry] = set()
        self.notes: list[Note] = []
        self.kept: dict[Entry, int] = {}
        self.judge: Judge = lambda _, written, kept: (kept == written, "")
        self.saved: set[tuple[int, int]] = set()
        self.first_write: Callable[[Entry], None] | None = None
        self.access = access

    def copy_through(self, layer: Callable[[Access], Access]) -> RemoteDictionary:
        """Return a copy of this dictionary with `layer` over the access, and with empty notes.

        Parameters
        ----------
        layer : callable
            Wraps the access to the drive; may withhold writes.
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
            An abort code, or a length that differs from that of the type.
        """
        return int(self.measure(entry))

    def measure(self, entry: Entry) -> float:
        """Read a number of any type, integer or real (errors as in `get`)."""
        try:
            data = self.access.read(entry.index, entry.subindex, entry.size)
        except (AccessRefused, NoAnswer) as error:
            raise self._explain(error, entry, "read") from error
        if len(data) != entry.size:
            raise DriveRefused(
                f"{self.label}: object {entry} has {len(data)} bytes, expected {entry.size} "
                f"({entry.type}); correct its type in the drives file or the drive's firmware"
            )
        return entry.number(data)

    def find(self, entry: Entry) -> int | None:
        """Read a number from an optional object; return None if the object is missing."""
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
            raise self._explain(error, entry, f"write {value} to") from error

    def order(self, entry: Entry, value: int) -> None:
        """Write a number without waiting for an answer and without saving the old value.

        Raises
        ------
        BusUnavailable
            The bus does not accept the frame.
        """
        self.access.order(entry.index, entry.subindex, entry.data(value))

    def set(self, entry: Entry, value: int) -> None:
        """Write a number and read it back; note a different value if accepted.

        Raises
        ------
        NodeSilent, DriveRefused
            As in `get`, and if the drive keeps a value that is not accepted.
        """
        self._settle(entry, value, self._write_and_read(entry, value))

    def set_unless_fixed(self, entry: Entry, value: int) -> bool:
        """Write as `set` does; return False if the drive refuses to change the object."""
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
        """Write as `set` does; if the object is missing, note the consequence.

        The consequence is also noted if the drive keeps a value in `also` instead of `value`.
        """
        if self.find(entry) is None:
            self.do_without((entry,), consequence)
            return
        try:
            kept = self._write_and_read(entry, value)
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
        """Write those objects that are present, as `set` does; return True if any is present."""
        present = {entry: value for entry, value in values.items() if self.find(entry) is not None}
        self.missing.update(entry for entry in values if entry not in present)
        for entry, value in present.items():
            self.set(entry, value)
        return bool(present)

    def held(self, indices: Collection[int]) -> list[Entry]:
        """Return the objects with these indices that were written and read back."""
        return [entry for entry in self.kept if entry.index in indices]

    def refuse_changed(self, entries: Iterable[Entry], refusal: type[DriveError]) -> None:
        """Raise `refusal` for an object without the value that was read back after its write."""
        for entry in entries:
            if (present := self.get(entry)) != self.kept[entry]:
                raise refusal(
                    f"{self.label}: {entry} is {present}, {self.kept[entry]} was written: "
                    "another master or tool changed it; stop it first"
                )

    def do_without(self, entries: Sequence[Entry], consequence: str) -> None:
        """Note the consequence of missing objects."""
        self.missing.update(entries)
        self.note(f"no object {' nor '.join(map(str, entries))}: {consequence}", lack=True)

    def note(self, text: str, *, lack: bool = False) -> None:
        """Add a note on this drive (see `Note`)."""
        self.notes.append(Note(self.label, text, lack))

    def _write_and_read(self, entry: Entry, value: int) -> int:
        """Write a number; return the value kept by the drive."""
        self.put(entry, value)
        kept = self.kept[entry] = self.get(entry)
        return kept

    def _settle(self, entry: Entry, value: int, kept: int) -> None:
        """Note or refuse a value kept by the drive that differs from the one written."""
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

    def _explain(
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


def axis_suffix(axis: int) -> str:
    """Return the suffix of a node number in messages; empty for the first axis."""
    return f", axis {axis}" if axis > 1 else ""


def labels_by_node(servers: Iterable[RemoteDictionary]) -> dict[int, str]:
    """Return labels by node number: the joined labels of the node's axes."""
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
