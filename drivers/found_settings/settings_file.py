"""`found-settings.yaml`: values held by drives before the driver wrote to them.

A drive is left as it was found. Hence each value is read before it is first overwritten, and all
values are on the disk before anything is written: after a crash the file is their only copy. It
identifies each drive, since values of another drive must never be written. The file cannot make
more objects writable than a session changes itself: an object not in `SETTINGS` is refused.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from checked_files.foreign_text import one_line
from checked_files.names import ShownName
from checked_files.yaml_file import FileModel, load_yaml
from checked_files.yaml_text import quoted
from drivers.cia402 import objects
from drivers.cia402.objects import VELOCITY_FEED_FORWARDS
from drivers.commissioning.held_values import ASSIGNMENTS, COMMANDS
from drivers.commissioning.requirements import REQUIREMENTS, Use
from drivers.drives_file import U32, PdoNumber
from drivers.fieldbus import Entry
from drivers.in_node import ALONE, AXES, PDOS, InNode

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Sequence
    from pathlib import Path

    from drivers.remote_dictionary import RemoteDictionary

NAME = "found-settings.yaml"
"""Name of the file in the folder of a run."""

_COMMUNICATION = frozenset({0x1005, 0x1006, 0x100C, 0x100D, 0x1016, 0x1017, 0x1019})
"""Index of the communication objects written by sessions on CANopen, besides PDOs."""
_COE = frozenset({0x1C32, 0x1C33, *ASSIGNMENTS})
"""Index of the communication objects written by sessions on EtherCAT."""
_PDOS = range(0x1400, 0x1C00)
_SET = [
    row for row in REQUIREMENTS.values() if Use.WRITE in row.use and row.entry.index not in COMMANDS
]
SETTINGS = frozenset(
    {
        *(row.entry.index for row in _SET),
        *_COMMUNICATION,
        *_COE,
        *_PDOS,
        *(entry.index for entry in (*objects.HOMING, *objects.INTERPOLATION)),
        *(entry.index for entry in VELOCITY_FEED_FORWARDS.values()),
    }
)
"""Index of the objects written by start-up, motions, streaming or homing, except commands."""

WRITTEN_ONCE = frozenset(
    row.entry.index for row in _SET if Use.VARY not in row.use and row.entry.index > _PDOS.stop
)
"""Index of profile objects with one value during a session, from start-up to its end."""


def _clean_name(text: object) -> object:
    return one_line(text) if isinstance(text, str) else text


Name = Annotated[str, BeforeValidator(_clean_name)]
BusName = Annotated[ShownName, Field(max_length=4096)]
"""Name of an interface or a channel, without control characters for a terminal."""


class FoundObject(FileModel):
    """Object of a drive, and the value found.

    Attributes
    ----------
    written : int or None
        Value in the drive after start-up of the session (until then the planned value); None for
        objects that a session changes repeatedly. A drive with neither this value nor `value` was
        configured after the session.
    refused : bool
        True if the drive refused the value, which has been reported.
    """

    index: int
    subindex: Annotated[int, Field(ge=0, le=0xFF)]
    type: Literal["u8", "u16", "u32", "i8", "i16", "i32"]
    value: int
    name: Name = ""
    written: int | None = None
    refused: bool = False

    @model_validator(mode="after")
    def _check_setting(self) -> Self:
        if self.index not in SETTINGS:
            raise ValueError(
                f"index {self.index:04X}h is not a setting changed by runs; remove this object"
            )
        low, high = self.entry.bounds
        for value in (self.value, self.value if self.written is None else self.written):
            if not low <= value <= high:
                raise ValueError(
                    f"value {value} must be in [{low}, {high}] of a {self.type}; correct either"
                )
        return self

    @property
    def entry(self) -> Entry:
        """Entry of the object in the object dictionary."""
        return Entry(self.index, self.subindex, self.type, self.name)

    def was_changed(self, present: int | None) -> bool:
        """Return True if another tool wrote the value `present` after the session."""
        return self.written is not None and present not in {None, self.value, self.written}

    def comparison(self, present: int) -> str:
        """Describe the values: found, written and present."""
        return (
            f"object {self.entry} held {self.value} before and {self.written} in an interrupted "
            f"session; now it holds {present}: it has been set up anew since"
        )

    @property
    def key(self) -> tuple[int, int]:
        """Index and sub-index."""
        return self.index, self.subindex


class FoundIdentity(FileModel):
    """Identity of the drive (1018); None for missing numbers."""

    vendor: U32 | None = None
    product: U32 | None = None
    revision: U32 | None = None
    serial: U32 | None = None


IDENTITY = dict(zip(FoundIdentity.model_fields, objects.IDENTITY, strict=True))


class FoundDrive(FileModel):
    """Drive and the values found.

    Attributes
    ----------
    name : str
        Name of the axis.
    alias : int or None
        Alias that identifies the drive instead of the node number.
    axis, pdos
        Axis of a multi-axis node (see `drivers.drives_file.AxisDrive`).
    restored : bool
        True if the drive holds its values again, except refused ones.
    objects : tuple of FoundObject
        Objects in the order of first writing.
    """

    name: Annotated[Name, Field(min_length=1)]
    node: Annotated[int, Field(ge=1, le=127)]
    alias: Annotated[int, Field(ge=1, le=0xFFFF)] | None = None
    axis: Annotated[int, Field(ge=1, le=AXES)] = 1
    pdos: tuple[PdoNumber, PdoNumber] = (1, PDOS)
    identity: FoundIdentity
    restored: bool = False
    objects: tuple[FoundObject, ...] = ()

    @property
    def within(self) -> InNode:
        """Axis and PDOs within the node."""
        return InNode(self.axis, self.pdos)

    @property
    def place(self) -> tuple[int, int]:
        """Node and axis."""
        return self.node, self.axis

    def finish(self, refused: Collection[tuple[int, int]] = ()) -> FoundDrive:
        """Return this drive as restored, except for refused objects."""
        objects = tuple(
            each.model_copy(update={"written": None, "refused": each.key in refused})
            for each in self.objects
        )
        return self.model_copy(update={"restored": True, "objects": objects})

    def hold(self, held: Callable[[FoundObject], int | None]) -> FoundDrive:
        """Return this drive with `written` by `held`, for objects written at start-up only."""
        objects = tuple(
            each.model_copy(update={"written": held(each)}) if each.index in WRITTEN_ONCE else each
            for each in self.objects
        )
        return self.model_copy(update={"objects": objects})

    @property
    def doubt(self) -> str:
        """Reason why this may be another drive in spite of its identity; empty without doubt."""
        if self.identity.serial:
            return ""
        return (
            "has no serial number (1018:04), so a swapped drive of the same type is"
            " not recognised; make sure that no drives were swapped"
        )

    @property
    def refused(self) -> tuple[Entry, ...]:
        """Objects refused by the drive."""
        return tuple(each.entry for each in self.objects if each.refused)

    @model_validator(mode="after")
    def _check_objects(self) -> Self:
        places = [each.key for each in self.objects]
        for index, subindex in places:
            if places.count((index, subindex)) > 1:
                raise ValueError(f"object {index:04X}:{subindex:02X} is stated twice; remove one")
        return self


class FoundSettings(FileModel):
    """Content of the file.

    Attributes
    ----------
    restored : bool
        True if every drive holds its values again.
    bitrate : int
        Bit rate of the bus [bit/s].
    sdo_timeout : float
        Longest response time of a drive [s].
    interface, channel : str or None
        Bus of the drives, as in python-can; None if not stated.
    """

    format: Literal[1] = 1
    restored: bool = False
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000)]
    sdo_timeout: Annotated[float, Field(ge=0.01, le=30)] = 0.5
    interface: BusName | None = None
    channel: BusName | None = None
    drives: tuple[FoundDrive, ...] = ()

    @model_validator(mode="after")
    def _check_drives(self) -> Self:
        places = [drive.place for drive in self.drives]
        for place in places:
            if places.count(place) > 1:
                raise ValueError(f"node {place[0]} is stated twice; remove one of the drives")
        if self.restored and not all(drive.restored for drive in self.drives):
            raise ValueError("restored: true, but not of all drives; write false")
        return self

    @property
    def unrestored(self) -> tuple[FoundDrive, ...]:
        """Drives that may still hold values of a session."""
        return tuple(drive for drive in self.drives if not drive.restored)

    def update_drives(self, drives: Iterable[FoundDrive]) -> FoundSettings:
        """Return the settings with these drives added or replaced, by node number."""
        changed = {drive.place: drive for drive in drives}
        kept = {drive.place: drive for drive in self.drives} | changed
        everything = tuple(kept.values())
        restored = all(drive.restored for drive in everything)
        return self.model_copy(update={"drives": everything, "restored": restored})


def load_found_settings(path: Path | str) -> FoundSettings:
    """Read the file.

    Raises
    ------
    FileError
        The file is missing or of another kind.
    """
    return load_yaml(path, FoundSettings)


def dump_found_settings(settings: FoundSettings) -> str:
    """Return the text of the file, for `load_found_settings`."""
    lines = [
        "# Settings of the drives before a session. To restore them after a crash, with",
        "# the drives powered but off: hil drives restore FILE",
        f"format: {settings.format}",
        f"restored: {_shown(settings.restored)}",
        f"bitrate: {settings.bitrate} # bit/s",
        f"sdo_timeout: {settings.sdo_timeout!r} # s",
        *(
            f"{key}: {quoted(value)}"
            for key, value in (("interface", settings.interface), ("channel", settings.channel))
            if value is not None
        ),
        "drives:" if settings.drives else "drives: []",
    ]
    for drive in settings.drives:
        lines += _drive_lines(drive)
    return "\n".join(lines) + "\n"


def read_identity(server: RemoteDictionary) -> FoundIdentity:
    """Read the identity of a drive.

    Raises
    ------
    NodeSilent, DriveRefused
        The drive does not answer.
    """
    return FoundIdentity(**{key: server.find(entry) for key, entry in IDENTITY.items()})


def difference(found: FoundIdentity, present: FoundIdentity) -> str:
    """Describe the first difference of two identities, with both values; empty if none."""
    for key, entry in IDENTITY.items():
        then, now = getattr(found, key), getattr(present, key)
        if then != now:
            return f"{entry} was {_hex(then)}, now it is {_hex(now)}"
    return ""


def _drive_lines(drive: FoundDrive) -> Sequence[str]:
    identity = ", ".join(f"{key}: {_shown(getattr(drive.identity, key))}" for key in IDENTITY)
    return [
        f"- name: {quoted(drive.name)}",
        f"  node: {drive.node}",
        *([] if drive.alias is None else [f"  alias: {drive.alias}"]),
        *(
            []
            if drive.within == ALONE
            else [f"  axis: {drive.axis}", f"  pdos: {list(drive.pdos)}"]
        ),
        f"  identity: {{{identity}}}",
        f"  restored: {_shown(drive.restored)}",
        "  objects:" if drive.objects else "  objects: []",
        *map(_object_line, drive.objects),
    ]


def _object_line(each: FoundObject) -> str:
    written = "" if each.written is None else f", written: {each.written}"
    refused = ", refused: true" if each.refused else ""
    return (
        f"  - {{index: 0x{each.index:04X}, subindex: {each.subindex}, type: {each.type},"
        f" value: {each.value}{written}{refused}, name: {quoted(each.name)}}}"
    )


def _shown(value: bool | int | None) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return "null" if value is None else f"0x{value:X}"


def _hex(value: int | None) -> str:
    return "missing" if value is None else f"{value:08X}h"
