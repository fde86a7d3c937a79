"""What drives held before the driver wrote to them, as a file: `found-settings.yaml`.

A drive that was only borrowed is left as it was found. So each value is read before it is first
overwritten, and all of them are on the disk before anything is written: after a crash the file is
the only place where they stand. It names each drive by its identity, since values of another drive
must never be written. Nor does a file make more of a drive's dictionary writable than a session
changes itself: an object that is not in `SETTINGS` is refused.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from checked_files.foreign_text import one_line
from checked_files.names import ShownName
from checked_files.yaml_file import FileModel, load_yaml
from checked_files.yaml_text import quoted
from drivers.cia402 import objects
from drivers.cia402.vendor_objects import VELOCITY_FEED_FORWARDS
from drivers.commissioning.held_values import ASSIGNMENTS, COMMANDS
from drivers.commissioning.requirement import Use
from drivers.commissioning.requirements import REQUIREMENTS
from drivers.drives_file import U32, PdoNumber
from drivers.fieldbus import Entry
from drivers.in_node import ALONE, AXES, PDOS, InNode

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Sequence
    from pathlib import Path

    from drivers.remote_dictionary import RemoteDictionary

NAME = "found-settings.yaml"
"""How the file is called in the folder of a run."""

_COMMUNICATION = frozenset({0x1005, 0x1006, 0x100C, 0x100D, 0x1016, 0x1017, 0x1019})
"""Index of what sessions write of CANopen's own objects, beside PDOs."""
_COE = frozenset({0x1C32, 0x1C33, *ASSIGNMENTS})
"""The same of CANopen over EtherCAT."""
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
"""Index of every object that start-up, motions, streaming or homing write, beside commands."""

WRITTEN_ONCE = frozenset(
    row.entry.index for row in _SET if Use.VARY not in row.use and row.entry.index > _PDOS.stop
)
"""Those of the profile of which a session holds one value from the end of start-up to its own."""


def _shown_name(text: object) -> object:
    return one_line(text) if isinstance(text, str) else text


Name = Annotated[str, BeforeValidator(_shown_name)]


BusName = Annotated[ShownName, Field(max_length=4096)]
"""Name of an interface or a channel: of such characters as a terminal does not obey."""


class FoundObject(FileModel):
    """One object of a drive, and the value that it held.

    Attributes
    ----------
    written : int or None
        What the drive held once a session had written to it. A drive that holds neither this nor
        `value` has been set up anew since. None where no session got that far, and for what a
        session goes on changing.
    refused : bool
        The drive did not take it back, which has been reported.
    """

    index: int
    subindex: Annotated[int, Field(ge=0, le=0xFF)]
    type: Literal["u8", "u16", "u32", "i8", "i16", "i32"]
    value: int
    name: Name = ""
    written: int | None = None
    refused: bool = False

    @model_validator(mode="after")
    def _a_setting(self) -> Self:
        if self.index not in SETTINGS:
            raise ValueError(
                f"index {self.index:04X}h is no setting that a run changes; remove this object"
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
        """Where it stands in the drive's object dictionary."""
        return Entry(self.index, self.subindex, self.type, self.name)

    def set_anew(self, present: int | None) -> bool:
        """Whether a drive that holds `present` has been given it by somebody else since."""
        return self.written is not None and present not in {None, self.value, self.written}

    def comparison(self, present: int) -> str:
        """State what was found, what was written, and what is there."""
        return (
            f"object {self.entry} held {self.value} when it was found and {self.written} in a"
            f" session that was ended; it holds {present}, so it has been set up anew since"
        )

    @property
    def key(self) -> tuple[int, int]:
        """Index and sub-index."""
        return self.index, self.subindex


class FoundIdentity(FileModel):
    """Which drive it was (1018); None for what it lacks."""

    vendor: U32 | None = None
    product: U32 | None = None
    revision: U32 | None = None
    serial: U32 | None = None


IDENTITY = dict(zip(FoundIdentity.model_fields, objects.IDENTITY, strict=True))


class FoundDrive(FileModel):
    """One drive and the values that it held.

    Attributes
    ----------
    name : str
        Of its axis.
    alias : int or None
        By which it is found in place of its number.
    axis, pdos
        Which of several axes of its node (see `drivers.drives_file.AxisDrive`).
    restored : bool
        The drive holds all of them again that it takes back.
    objects : tuple of FoundObject
        In the order in which they were first written.
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
        """Which of several axes of its node it is."""
        return InNode(self.axis, self.pdos)

    @property
    def place(self) -> tuple[int, int]:
        """Node and axis."""
        return self.node, self.axis

    def done(self, refused: Collection[tuple[int, int]] = ()) -> FoundDrive:
        """Return this drive as one that holds everything again but what it did not take back."""
        objects = tuple(
            each.model_copy(update={"written": None, "refused": each.key in refused})
            for each in self.objects
        )
        return self.model_copy(update={"restored": True, "objects": objects})

    def holding(self, held: Callable[[FoundObject], int | None]) -> FoundDrive:
        """Return this drive with what it holds by now, or will, of what a session writes once."""
        objects = tuple(
            each.model_copy(update={"written": held(each)}) if each.index in WRITTEN_ONCE else each
            for each in self.objects
        )
        return self.model_copy(update={"objects": objects})

    @property
    def doubt(self) -> str:
        """Why this may be another drive in spite of its identity, in words; empty if it is not."""
        if self.identity.serial:
            return ""
        return (
            "has no serial number (1018:04), so its values cannot"
            " be kept from another drive of its type; make sure that no drives were swapped"
        )

    @property
    def refused(self) -> tuple[Entry, ...]:
        """What the drive did not take back."""
        return tuple(each.entry for each in self.objects if each.refused)

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        places = [each.key for each in self.objects]
        for index, subindex in places:
            if places.count((index, subindex)) > 1:
                raise ValueError(f"object {index:04X}:{subindex:02X} stands twice; remove one")
        return self


class FoundSettings(FileModel):
    """Content of the file.

    Attributes
    ----------
    restored : bool
        All drives hold again what they held.
    bitrate : int
        Of the bus [bit/s].
    sdo_timeout : float
        How long a drive may take to answer [s].
    interface, channel : str or None
        The bus that the drives are on, as python-can names it; None where that is not stated.
    """

    format: Literal[1] = 1
    restored: bool = False
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000)]
    sdo_timeout: Annotated[float, Field(ge=0.01, le=30)] = 0.5
    interface: BusName | None = None
    channel: BusName | None = None
    drives: tuple[FoundDrive, ...] = ()

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        places = [drive.place for drive in self.drives]
        for place in places:
            if places.count(place) > 1:
                raise ValueError(f"node {place[0]} stands twice; remove one of the drives")
        if self.restored and not all(drive.restored for drive in self.drives):
            raise ValueError("restored: true, but not of all drives; write false")
        return self

    @property
    def unrestored(self) -> tuple[FoundDrive, ...]:
        """Drives that may still hold values of ours."""
        return tuple(drive for drive in self.drives if not drive.restored)

    def with_drives(self, drives: Iterable[FoundDrive]) -> FoundSettings:
        """Return the settings with these drives in place of those with their node numbers."""
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
        It is missing, or not such a file.
    """
    return load_yaml(path, FoundSettings)


def dump_found_settings(settings: FoundSettings) -> str:
    """Return the file's text; `load_found_settings` reads the same settings from it."""
    lines = [
        "# What the drives held before they were written to. To put it back after a crash, with",
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
    """Ask a drive for its identity.

    Raises
    ------
    NodeSilent, DriveRefused
        It does not answer.
    """
    return FoundIdentity(**{key: server.find(entry) for key, entry in IDENTITY.items()})


def difference(found: FoundIdentity, present: FoundIdentity) -> str:
    """Name the first object in which two identities differ, with both values; empty if none."""
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
