"""Personalities: deviations of a drive from the plant's EDS.

Real drives agree on the profile and differ in nearly everything else: missing, read-only or
narrower objects, another current readback, other units, delayed bits. A personality states such
deviations as data. Deviations of the object dictionary become the drive's own EDS
(`canopen.eds_variant`), and the drive serves exactly this EDS; deviations of behaviour are read by
the firmware (`drive`). A hidden object keeps its value after power-on inside the firmware, as in a
real drive.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import Field, model_validator

from checked_files.yaml_file import FileError, FileModel, load_yaml

if TYPE_CHECKING:
    from collections.abc import Sequence

Index = Annotated[int, Field(ge=0x1000, le=0x9FFF)]
Subindex = Annotated[int, Field(ge=0, le=0xFF)]
Seconds = Annotated[float, Field(ge=0, le=10)]

FOLDER = Path(__file__).with_name("personalities")


class ObjectChange(FileModel):
    """Changed declaration of an entry of the dictionary; omitted keys keep the EDS."""

    index: Index
    subindex: Subindex = 0
    access: Literal["ro", "rw", "rww", "const"] | None = None
    type: Literal["i8", "i16", "i32", "u8", "u16", "u32"] | None = None
    default: int | None = None
    """Value after power-on, which overrides the plant file."""
    plus_node: bool = False
    """Add the node number to `default`, as in identifiers."""
    low: int | None = None
    high: int | None = None
    step: Annotated[int, Field(ge=2)] | None = None
    """Step of stored values: the drive rounds to the nearest multiple without an abort."""
    clip: bool = False
    """Clip values to `low` and `high` instead of refusing them."""


class CurrentReadback(FileModel):
    """Object and unit of a drive's motor current."""

    index: Index = 0x6078
    subindex: Subindex = 0
    type: Literal["i16", "i32", "f32"] = "i16"
    unit: Literal["mA", "0.01 A", "A", "per mille of rated current"] = "per mille of rated current"

    @property
    def milliampere(self) -> int | None:
        """Size of a count [mA], None for per mille of rated current; 1 for A, shown as a float."""
        return {"mA": 1, "0.01 A": 10, "A": 1}.get(self.unit)


class Personality(FileModel):
    """Deviations of a drive.

    Attributes
    ----------
    name, about : str
        Name, and description of the modelled drive.
    missing : tuple of int
        Indices that the drive does not have.
    objects : tuple of ObjectChange
        Entries declared in another way.
    current : CurrentReadback or None
        None: the drive does not show its current (it may still show its torque, 6077h).
    counts_per_turn : int or None
        Counts of 6064h per revolution of the gear's output (6092h over 6091h), the unit of all
        positions; None: one count is one increment of the motor's encoder.
    position_range : tuple of int or None
        607Bh: shown positions are within this range and wrap around at its ends. A target means the
        position in the present turn, but in cyclic position mode the nearest position.
    velocity_unit, acceleration_unit : str
        Units of 6081h, 607Fh and 606Ch; of 6083h to 6085h, 60C5h and 60C6h; "inc" is a count.
    sdo_states_size : bool
        True if expedited uploads state the number of valid bytes; otherwise they begin with 42h.
    mapping_arrays : bool
        The EDS declares PDO mappings as ARRAY instead of RECORD.
    mapping_entries : int
        Maximum number of objects in a PDO.
    start_lag : float
        Time from NMT start to OPERATIONAL [s].
    mode_display_lag : float
        Duration of -1 in 6061h after a write to 6060h [s].
    mode_locked_by_halt : bool
        6060h cannot be written while controlword bit 8 is set.
    acknowledge_lag : float
        Delay of statusword bit 12 [s].
    acknowledge_until_reached : bool
        Bit 12 stays set until the target is reached or halt breaks the motion off; meanwhile no
        set-point is taken.
    target_reached_lag : float
        Duration of bit 10 after a new set-point has been accepted [s].
    rpdo_at_once : bool
        An RPDO of a synchronous type takes effect when it comes, not at the next SYNC.
    """

    name: Annotated[str, Field(min_length=1)]
    about: str = ""
    missing: tuple[Index, ...] = ()
    objects: tuple[ObjectChange, ...] = ()
    current: CurrentReadback | None = CurrentReadback()
    counts_per_turn: Annotated[int, Field(gt=0, lt=2**31)] | None = None
    position_range: tuple[int, int] | None = None
    velocity_unit: Literal["inc/s", "rpm", "0.1 rpm"] = "inc/s"
    acceleration_unit: Literal["inc/s^2", "rpm/s", "0.1 rpm/s"] = "inc/s^2"
    sdo_states_size: bool = True
    mapping_arrays: bool = False
    mapping_entries: Annotated[int, Field(ge=1, le=8)] = 8
    start_lag: Seconds = 0.0
    mode_display_lag: Seconds = 0.0
    mode_locked_by_halt: bool = False
    acknowledge_lag: Seconds = 0.0
    acknowledge_until_reached: bool = False
    target_reached_lag: Seconds = 0.0
    rpdo_at_once: bool = False

    @model_validator(mode="after")
    def _range_ordered(self) -> Self:
        if self.position_range is not None and self.position_range[0] >= self.position_range[1]:
            raise ValueError(f"position_range {self.position_range} must begin below its end")
        return self


PLAIN = Personality(name="plain", about="All that the plant's EDS declares, by the standard.")


def packaged_personalities() -> Sequence[str]:
    """Return the names of the packaged personalities."""
    return sorted(path.stem for path in FOLDER.glob("*.yaml"))


def load_personality(name_or_path: str) -> Personality:
    """Read a packaged personality by name, or the file at a path.

    Raises
    ------
    FileError
        No such personality, or a file that does not fit.
    """
    packaged = FOLDER / f"{name_or_path}.yaml"
    path = packaged if packaged.is_file() else Path(name_or_path)
    if not path.is_file():
        raise FileError(
            f"{name_or_path}: neither a packaged personality "
            f"({', '.join(packaged_personalities())}) nor the path of a personality file"
        )
    return load_yaml(path, Personality)
