"""Map file: columns, units and files of a recording.

Messages about a recording caused by its map state the line of the map (`MapFile.wrong`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self

from pydantic import BeforeValidator, Field, field_validator, model_validator

from checked_files.yaml_file import FileError, FileModel, line_of, parse_yaml, place, read_text
from checked_files.yaml_text import quoted
from hil.imports.tables import NEEDS_GAIN, SECONDS, PositionUnit, TimeUnit, TorqueUnit, VelocityUnit
from hil.model.drive_train_file import UNKNOWN, Unknown
from hil.model.readers.urdf import read_urdf

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.model.robot import Robot

Check = Literal["range", "velocity", "friction", "shape", "still", "spikes"]
"""Plausibility checks that a map may overrule; `friction` is no longer used."""
_MOST_PER_COUNT = 1.001 * math.tau
"""Maximum size of a count [rad or m]: a turn of a direct drive, in the three digits of 6.28."""


class ColumnName(FileModel):
    """Column by number, from 1, or name; `file` names a file outside of `files`."""

    file: str | None = None
    column: int | str

    @field_validator("column", mode="before")
    @classmethod
    def _number_or_name(cls, value: object) -> object:
        if isinstance(value, bool) or not isinstance(value, int | str) or value == "":
            raise ValueError(f"{value!r} must be a column's number, from 1, or its name")
        if isinstance(value, int) and value < 1:
            raise ValueError(f"{value} must be at least 1: columns are numbered from 1")
        return value


def _column(value: object) -> object:
    return value if isinstance(value, dict) else {"column": value}


Column = Annotated[ColumnName, BeforeValidator(_column)]


class _Moved(FileModel):
    """Column of a joint's motion; a count is `per_unit` [rad or m]."""

    column: Column
    unit: str
    sign: Literal[1, -1] = 1
    per_unit: float | None = None

    @model_validator(mode="after")
    def _counts_are_worth_something(self) -> Self:
        counts = self.unit.startswith("counts")
        if counts and self.per_unit is None:
            raise ValueError("counts need per_unit: rad (or m) for one count; add it")
        if self.per_unit is None:
            return self
        if not counts:
            raise ValueError(f"per_unit is for counts, not for {self.unit}; remove it")
        if not 0 < self.per_unit <= _MOST_PER_COUNT:
            raise ValueError(
                f"per_unit {self.per_unit:g} must be in (0, 2 pi] rad (or m) for one count; if it"
                " is counts for one rad (or m), write its inverse"
            )
        return self


class Position(_Moved):
    """Positions of a joint: ``sign`` times the column, in SI, plus `offset` [rad or m]."""

    unit: PositionUnit
    offset: float = 0.0


class Velocity(_Moved):
    """Velocities of a joint: ``sign`` times the column, in SI."""

    unit: VelocityUnit


def _gain(value: object) -> object:
    if value == UNKNOWN:
        return value
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{value!r} must be a number, torque or force for one unit, or unknown")  # noqa: TRY004 - pydantic expects ValueError
    if not value > 0:
        raise ValueError(f"{value:g} must be positive; for a reversed direction state sign: -1")
    return value


class Torque(FileModel):
    """Torques or forces of a joint: ``sign`` times ``gain`` times the column [N m or N].

    An unknown gain is identified together with the parameters; until then, torques are in the
    column's unit.
    """

    column: Column
    unit: TorqueUnit
    sign: Literal[1, -1] = 1
    gain: Annotated[float | Unknown | None, BeforeValidator(_gain)] = None
    gain_uncertainty: float = Field(default=0.0, ge=0)

    @model_validator(mode="after")
    def _has_a_gain(self) -> Torque:
        if self.unit in NEEDS_GAIN and self.gain is None:
            raise ValueError(
                f"{self.unit} need a gain: N m (or N) for one unit; add gain, or gain: unknown"
            )
        if self.unknown and self.gain_uncertainty:
            raise ValueError(
                f"gain_uncertainty {self.gain_uncertainty:g} needs a stated gain; remove "
                "gain_uncertainty where the gain is unknown"
            )
        if not self.gain_uncertainty < 0.5 * self.gain_value:
            raise ValueError(
                f"gain_uncertainty {self.gain_uncertainty:g} must be below half the gain of"
                f" {self.gain_value:g}; it is one standard deviation, in the gain's unit"
            )
        return self

    @property
    def unknown(self) -> bool:
        """True if the gain is to be identified."""
        return self.gain == UNKNOWN

    @property
    def gain_value(self) -> float:
        """Gain; 1 if unknown or not needed."""
        return self.gain if isinstance(self.gain, float) else 1.0

    @property
    def factor(self) -> float:
        """SI units per unit of the column [N m or N]."""
        return self.sign * self.gain_value


_ABSENT = "absent"


def _torque(value: object) -> object:
    if value == _ABSENT:
        raise ValueError("missing; add this key, or torque: 0 for a joint without motor")
    return None if value == 0 and not isinstance(value, bool) else value


class MappedJoint(FileModel):
    """Columns of a joint; the torque of a joint without motor is 0, without a column."""

    position: Position
    velocity: Velocity | None = None
    torque: Annotated[Torque | None, BeforeValidator(_torque)] = Field(
        default=_ABSENT, validate_default=True
    )


class Format(FileModel):
    """Layout of a file, where it cannot be detected.

    Attributes
    ----------
    header : bool, optional
        True if a text file names its columns.
    delimiter, decimal, comment : str, optional
        Characters of a text file; a single space as delimiter means any number of blanks.
    skip : int
        Lines of a text file before its header, or before its numbers.
    topic : str, optional
        Topic of the joint states in a file of messages.
    """

    header: bool | None = None
    delimiter: Annotated[str, Field(min_length=1, max_length=1)] | None = None
    decimal: Literal[".", ","] | None = None
    comment: Annotated[str, Field(min_length=1, max_length=1)] = "#"
    skip: int = Field(default=0, ge=0)
    topic: str | None = None


class TimeColumn(FileModel):
    """Column of time stamps, or of a part of the stamps."""

    column: Column
    unit: TimeUnit = "s"


class Time(FileModel):
    """Time stamps as a column or the sum of two columns, or an even rate [Hz] without stamps."""

    column: Column | None = None
    unit: TimeUnit = "s"
    plus: TimeColumn | None = None
    rate: Annotated[float, Field(gt=0, le=1e6)] | None = None

    @model_validator(mode="after")
    def _either(self) -> Time:
        if (self.column is None) == (self.rate is None):
            raise ValueError("needs either a column, or a rate in Hz")
        if self.plus is not None and self.column is None:
            raise ValueError("plus belongs to a column of time, not to a rate; remove it")
        if self.plus is not None and SECONDS[self.plus.unit] >= SECONDS[self.unit]:
            raise ValueError(
                f"unit of plus, {self.plus.unit}, must be smaller than the column's unit, "
                f"{self.unit}: plus is the fraction of a stamp; exchange the two columns"
            )
        return self


class MappedRobot(FileModel):
    """Robot by name or file, or the chain between two links of a URDF."""

    name: str | None = None
    urdf: str | None = None
    base: str | None = Field(default=None, alias="from")
    tip: str | None = Field(default=None, alias="to")
    gravity: tuple[float, float, float] | None = None

    @model_validator(mode="after")
    def _either(self) -> MappedRobot:
        if (self.name is None) == (self.urdf is None):
            raise ValueError("must be a robot's name or file, or {urdf: FILE, from: ..., to: ...}")
        return self

    def renamed(self, name: str) -> MappedRobot:
        """Return the robot with another name of the file."""
        return self.model_copy(update={"name" if self.urdf is None else "urdf": name})

    def ended(self, robot: Robot, n: int) -> MappedRobot | None:
        """Return the chain of the first `n` joints of a robot; None unless the URDF has more.

        Raises
        ------
        FileError
            The URDF cannot be read.
        """
        if not (0 < n < robot.n_joints and robot.is_chain and robot.source.endswith(".urdf")):
            return None
        link = read_urdf(robot.source, self.base, self.tip).joints[n - 1].link
        return self.model_copy(update={"name": None, "urdf": self.urdf or self.name, "tip": link})

    def __str__(self) -> str:
        """Return the robot as in a map."""
        if self.urdf is None:
            return quoted(self.name or "")
        stated = self.model_dump(mode="json", by_alias=True, exclude_none=True)
        pairs = {k: quoted(v) if isinstance(v, str) else v for k, v in stated.items()}
        return f"{{{', '.join(f'{key}: {value}' for key, value in pairs.items())}}}"


def _pairs(value: object) -> object:
    """Return a list of pairs, also for a single pair."""
    if not isinstance(value, list | tuple) or len(value) != 2:
        return value
    return value if any(isinstance(v, list | tuple) for v in value) else [value]


def _alone(value: object) -> object:
    if value == "free":
        return None
    if isinstance(value, dict) and list(value) == ["back_and_forth"]:
        axis = value["back_and_forth"]
        if isinstance(axis, int) and not isinstance(axis, bool) and axis >= 1:
            return axis
        raise ValueError(f"back_and_forth {axis!r} must be the number of a joint, from 1")
    raise ValueError(f"{value!r} must be free, or {{back_and_forth: JOINT}}")


class RecordingMap(FileModel):
    """Map of a recording, with the keys described in docs/reference/recordings.md."""

    robot: Annotated[
        MappedRobot, BeforeValidator(lambda v: v if isinstance(v, dict) else {"name": v})
    ]
    files: Annotated[tuple[str, ...], Field(min_length=1)]
    format: Format = Format()
    rows: Annotated[tuple[tuple[int, int], ...] | None, BeforeValidator(_pairs)] = None
    time_range: Annotated[tuple[tuple[float, float], ...] | None, BeforeValidator(_pairs)] = None
    time: Time | None = None
    joints: Annotated[tuple[MappedJoint, ...], Field(min_length=1)]
    position_side: Literal["joint", "motor"] = "joint"
    torque_side: Literal["joint", "motor"] = "joint"
    cut_off: Annotated[float, Field(gt=0, le=1e4)] | None = None
    kind: Annotated[int | None, BeforeValidator(_alone)] = None
    accept: tuple[Check, ...] = ()

    @field_validator("rows", "time_range")
    @classmethod
    def _check_order(
        cls, value: tuple[tuple[float, float], ...] | None
    ) -> tuple[tuple[float, float], ...] | None:
        for first, last in value or ():
            if not first < last:
                raise ValueError(f"[{first:g}, {last:g}] must rise: first, then last")
        for (_, last), (first, _) in zip(value or (), (value or ())[1:], strict=False):
            if first <= last:
                raise ValueError(f"{first:g} follows {last:g}: segments must rise and not overlap")
        return value

    @field_validator("rows")
    @classmethod
    def _check_first(cls, value: tuple[tuple[int, int], ...] | None) -> object:
        if value and value[0][0] < 1:
            raise ValueError(f"{value[0][0]} must be at least 1: rows are numbered from 1")
        return value

    @model_validator(mode="after")
    def _joint_exists(self) -> RecordingMap:
        if self.kind is not None and self.kind > len(self.joints):
            raise ValueError(
                f"kind: back_and_forth {self.kind} must be one of the {len(self.joints)} joints"
            )
        if self.rows is not None and self.time_range is not None:
            raise ValueError("rows and time_range exclude each other; remove one")
        return self


@dataclass(frozen=True)
class MapFile:
    """Map with its text.

    Attributes
    ----------
    allowed : tuple of Path
        Permitted files and folders outside of the map's folder.
    """

    path: Path
    text: str
    content: RecordingMap
    allowed: tuple[Path, ...] = ()
    accepting: ClassVar[str] = "write accept: [{}]"
    """Words for accepting a suspicion in the map."""

    def named(self, location: tuple[str | int, ...]) -> str:
        """Return the name of a place in the map."""
        return place(location)

    def worded(self, message: str) -> str:
        """Return a message with the words for maps."""
        return message

    def wrong(self, location: tuple[str | int, ...], message: str) -> FileError:
        """Return the error for a place in the map."""
        line = line_of(self.text, location)
        return FileError(f"{self.path}:{line}: {self.named(location)}: {self.worded(message)}")

    def resolve(self, name: str, at: tuple[str | int, ...]) -> Path:
        """Return the path of a file named in the map.

        Raises
        ------
        FileError
            The file is outside of the map's folder and of all permitted folders.
        """
        path = self.path.parent / name
        try:
            found = path.resolve()
        except (OSError, ValueError, RuntimeError):
            return path  # such a file cannot be opened either
        if any(found.is_relative_to(each.resolve()) for each in (self.path.parent, *self.allowed)):
            return path
        raise self.wrong(
            at,
            f"{path} is outside of the map's folder, and its content would become part of the run;"
            f" if you trust the map, allow it with --files {found.parent}, in Python with files=",
        )

    @property
    def unknown_gains(self) -> tuple[int, ...]:
        """Joints, from 0, with a gain to be identified."""
        joints = enumerate(self.content.joints)
        return tuple(number for number, joint in joints if joint.torque and joint.torque.unknown)

    @property
    def passive(self) -> tuple[int, ...]:
        """Joints, from 0, without motor."""
        joints = enumerate(self.content.joints)
        return tuple(number for number, joint in joints if joint.torque is None)


def load_map(path: Path | str, allowed: Sequence[Path | str] = ()) -> MapFile:
    """Read a map; `allowed` are permitted files and folders outside of the map's folder.

    Raises
    ------
    FileError
        The map cannot be read or used; the message has one line per problem, with its place.
    """
    text = read_text(path)
    content = parse_yaml(text, RecordingMap, str(path))
    return MapFile(Path(path), text, content, tuple(map(Path, allowed)))
