"""`drives.yaml`: assignment of drives to axes, and the meaning of the drives' numbers.

Drives agree on object indices and on little else: the current readback may be in mA or in per
mille of a rated value, rms or peak, in 6077, 6078 or an object of the maker; positions come in
increments or in parts of a degree, velocities in either or in revolutions. Hence each axis states
its units, nothing is guessed, and where the drive has objects for them (1018, 6075, 6076, 608F,
6091, 6092, 60A8 to 60AA) file and drive are compared before anything moves.

A prismatic axis's gear ratio is in rad of the motor per m of the axis; its limits and windows are
in m, m/s, m/s^2 and N.
"""

from __future__ import annotations

import math
from enum import Enum
from fractions import Fraction
from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import Field, PlainSerializer, PlainValidator, field_validator, model_validator

from checked_files.yaml_file import FileModel, load_yaml
from drivers import rate_units
from drivers.fieldbus import Entry
from drivers.in_node import AXES, PDOS, InNode
from drivers.rate_units import AccelerationUnit, Per, VelocityUnit
from drivers.remote_dictionary import axis_suffix

if TYPE_CHECKING:
    from pathlib import Path

Positive = Annotated[float, Field(gt=0)]
U32 = Annotated[int, Field(ge=0, le=0xFFFFFFFF)]
Words = Annotated[tuple[U32, ...], Field(min_length=1, max_length=8)]
I32_MAX = 2**31 - 1
PdoNumber = Annotated[int, Field(ge=1, le=512)]
FREE_IDENTIFIERS = range(0x680, 0x6E0)
"""Identifiers not assigned to a service by CiA 301."""
PDO_USES = ("TPDO 1", "TPDO 2", "RPDO 1", "RPDO 2", "RPDO 3")
"""All possible PDOs of an axis, in the order of their identifiers from `AxisDrive.cob_id` on."""
STATUS_WORD, POSITION_WORD = 0x60410010, 0x60640020


class Basis(Enum):
    """Meaning of one count of the current object."""

    MILLIAMPERE = "mA"
    RATED_CURRENT = "per mille of rated current"
    RATED_TORQUE = "per mille of rated torque"


class TorqueUnit(Enum):
    """Unit of the rated torque (6076): as standardised, or a thousandth."""

    MILLI = "mN m"
    MICRO = "uN m"


def _parse_counts(value: object) -> Fraction:
    """Parse a number or a ratio exactly, decimals included."""
    counts = rate_units.ratio(str(value))
    if counts > I32_MAX:
        raise ValueError(
            f"{value} must be at most {I32_MAX}; state the counts of 6064 in one motor revolution"
        )
    return counts


Counts = Annotated[Fraction, PlainValidator(_parse_counts), PlainSerializer(str)]


class Identity(FileModel):
    """Identity of the drive expected at a node (1018); omitted fields are not compared."""

    vendor: U32
    product: U32
    revision: U32 | None = None
    serial: U32 | None = None


class CurrentObject(FileModel):
    """Object with the motor current or torque, and its unit.

    Attributes
    ----------
    per_count : float
        Size of one count in units of `basis`: with basis mA, 10 for a drive that counts in 0.01 A,
        1000 for one that shows A (f32).
    sign : int
        -1 if the sign is opposite to the drive's position; `hil drives check` finds out.
    """

    index: Annotated[int, Field(ge=0x2000, le=0x9FFF)]
    subindex: Annotated[int, Field(ge=0, le=0xFF)] = 0
    type: Literal["i16", "i32", "f32"]
    basis: Basis
    per_count: Positive = 1.0
    amplitude: Literal["rms", "peak"] | None = None
    sign: Literal[-1, 1] = 1

    @property
    def entry(self) -> Entry:
        """Entry of the current object in the object dictionary."""
        return Entry(self.index, self.subindex, self.type, "current readback")


class AxisLimits(FileModel):
    """Limits of an axis [rad, rad/s, rad/s^2, N m; m and N if prismatic]."""

    q_min: float
    q_max: float
    velocity: Positive
    acceleration: Positive
    torque: Positive

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if self.q_min >= self.q_max:
            raise ValueError(
                f"q_min = {self.q_min:g} must be below q_max = {self.q_max:g}; exchange them"
            )
        return self


class Trip(FileModel):
    """Thresholds at which the driver stops the axes.

    Attributes
    ----------
    torque, torque_time : float
        Torque, and its longest duration [N m or N, s]; by default 95 % of the torque limit, needed
        for long only by a blocked axis.
    velocity : float
        Speed at the encoder [rad/s or m/s]; by default 130 % of the limit.
    """

    torque: Positive | None = None
    torque_time: Annotated[float, Field(gt=0, le=60)] = 0.5
    velocity: Positive | None = None


class Homing(FileModel):
    """Homing by the drive (mode 6), for `hil drives home`.

    Attributes
    ----------
    method : int
        6098: 37 takes the present position, other methods search a switch or an index pulse.
    position : float
        Joint coordinate of the home position [rad or m].
    velocity, creep : float
        Speed towards the switch and away from it [rad/s or m/s].
    acceleration : float
        Homing acceleration [rad/s^2 or m/s^2].
    """

    method: Annotated[int, Field(ge=-128, le=37)]
    position: float
    velocity: Positive
    creep: Positive
    acceleration: Positive


class AxisDrive(FileModel):
    """Axis and drive, as stated in the drives file.

    Attributes
    ----------
    node : int
        Node number; on EtherCAT the position on the line, from 1, unless an alias is stated.
    gear_ratio : float
        Motor angle over joint coordinate [-, or rad/m if prismatic], positive.
    sign : int
        +1 if the motor turns with q, -1 if against.
    increments_per_revolution : Fraction
        Counts of 6064 per motor revolution, in the position unit of the drive: an integer, or a
        ratio such as 360000/101 (0.001 degree after a gear of 101).
    zero : int
        Position of the drive at q = 0 [counts].
    velocity_unit, acceleration_unit : str
        Units of 6081 and 607F, of 6083 to 6085 (see `drivers.rate_units`).
    rated_current, rated_torque : float
        Reference of the drive's per mille [A, N m of the motor]; compared with 6075 and 6076.
    rated_torque_unit : TorqueUnit
        Unit of 6076: mN m by the standard, uN m with some makers.
    torque_constant : float
        Motor torque over current [N m/A], for the amplitude `torque_constant_amplitude`.
    following_error_window, following_error_time : float
        Largest following error [rad or m] and its longest duration [s].
    position_lag : float
        Delay of the axis after its demand at constant speed [s]: one over the gain of the position
        loop, or 0 for a drive with velocity feed-forward.
    position_window, position_window_time : float
        Largest deviation from the target [rad or m] and its duration [s] for `target reached`.
    homing : Homing, optional
        Homing parameters, for drives that home themselves.
    trip : Trip
        Thresholds at which the driver stops all axes.
    quick_stop_deceleration : float, optional
        Quick stop deceleration [rad/s^2 or m/s^2] of a drive whose ramp cannot be set (no 6085) and
        differs from `limits.acceleration`.
    brake_delay : float
        Time from standstill to power-off, for the brake to close [s].
    allow_no_heartbeat : str, optional
        Other means that stop the axis when our process dies, for a drive that cannot supervise our
        heartbeat (neither 1016 nor 100C and 100D); without this reason such a drive is refused.
    acknowledge : {"taken", "reached"}
        End of the set-point acknowledge (6041 bit 12): once the set-point is taken, or once the
        target is reached; in the second case no set-point is sent while another is under way.
    acknowledge_timeout : float
        Longest time until the acknowledge [s].
    tpdos : tuple of tuple of int, optional
        Mappings of TPDO 1 and, if used, TPDO 2, as in 1A00 and 1A01; by default status, position
        and current in one TPDO (in two for a current of 32 bits). Used by passive listeners; the
        driver itself reads the mappings from the drive.
    axis : int
        Number of the axis in a multi-axis drive (CiA 402: objects 800h apart), from 1.
    pdos : tuple of int
        Numbers of the first and last PDO in a multi-axis drive; by default 1 to 4, 5 to 8, ...
    cob_id : int, optional
        First of five identifiers for PDOs after the fourth, which have no predefined identifiers;
        by default from 680h on, a range without services.
    alias : int, optional
        Alias of a drive on EtherCAT (register 0012h), valid at any position on the line.
    """

    name: Annotated[str, Field(min_length=1)]
    node: Annotated[int, Field(ge=1, le=126)]
    identity: Identity
    joint: Literal["revolute", "prismatic"] = "revolute"
    gear_ratio: Positive
    sign: Literal[-1, 1]
    increments_per_revolution: Counts
    zero: Annotated[int, Field(ge=-I32_MAX, le=I32_MAX)]
    velocity_unit: VelocityUnit
    acceleration_unit: AccelerationUnit
    current: CurrentObject
    rated_current: Positive
    rated_torque: Positive
    rated_torque_unit: TorqueUnit = TorqueUnit.MILLI
    torque_constant: Positive | None = None
    torque_constant_amplitude: Literal["rms", "peak"] | None = None
    limits: AxisLimits
    following_error_window: Positive
    following_error_time: Annotated[float, Field(gt=0, le=65.535)]
    position_lag: Annotated[float, Field(ge=0, le=1)] = 0.0
    position_window: Positive
    position_window_time: Annotated[float, Field(gt=0, le=65.535)]
    homing: Homing | None = None
    trip: Trip = Trip()
    quick_stop_deceleration: Positive | None = None
    brake_delay: Annotated[float, Field(ge=0, le=10)] = 0.0
    allow_no_heartbeat: Annotated[str, Field(min_length=10)] | None = None
    acknowledge: Literal["taken", "reached"] = "taken"
    acknowledge_timeout: Annotated[float, Field(gt=0, le=60)] = 0.5
    tpdos: Annotated[tuple[Words, ...], Field(min_length=1, max_length=2)] | None = None
    axis: Annotated[int, Field(ge=1, le=AXES)] = 1
    pdos: tuple[PdoNumber, PdoNumber] | None = None
    cob_id: Annotated[int, Field(ge=FREE_IDENTIFIERS.start, lt=FREE_IDENTIFIERS.stop)] | None = None
    alias: Annotated[int, Field(ge=1, le=0xFFFF)] | None = None

    @property
    def within(self) -> InNode:
        """Axis and PDOs within the node."""
        last = PDOS * self.axis
        return InNode(self.axis, self.pdos or (last - PDOS + 1, last))

    @property
    def unit(self) -> str:
        """Unit of the joint coordinate."""
        return "rad" if self.joint == "revolute" else "m"

    @property
    def effort_unit(self) -> str:
        """Unit of torque or force."""
        return "N m" if self.joint == "revolute" else "N"

    @property
    def label(self) -> str:
        """Name of the axis in messages."""
        return f"{self.name} (node {self.node}{axis_suffix(self.axis)})"

    @model_validator(mode="after")
    def _check_current(self) -> Self:
        stated = {
            "torque_constant": self.torque_constant,
            "torque_constant_amplitude": self.torque_constant_amplitude,
            "current.amplitude": self.current.amplitude,
        }
        if self.current.basis is not Basis.RATED_TORQUE:
            for key, value in stated.items():
                if value is None:
                    basis = self.current.basis.value
                    raise ValueError(
                        f"{key} is missing, needed to turn {basis} into torque; add it"
                    )
        return self

    @model_validator(mode="after")
    def _check_tpdos(self) -> Self:
        if self.tpdos is None:
            return self
        carried = {word for words in self.tpdos for word in words}
        for needed in (STATUS_WORD, POSITION_WORD, self.current.entry.word):
            if needed not in carried:
                raise ValueError(
                    f"tpdos: 0x{needed:08X} is missing; state what 1A00 and 1A01 of the drive hold"
                )
        for number, words in enumerate(self.tpdos, start=1):
            bits = [word & 0xFF for word in words]
            if sum(bits) > 64 or any(size == 0 or size % 8 for size in bits):
                raise ValueError(
                    f"tpdos: TPDO {number} has objects of {bits} bits; they must be whole bytes, "
                    "64 bits together at most"
                )
        return self

    @model_validator(mode="after")
    def _check_range(self) -> Self:
        per_unit = self.gear_ratio * float(self.increments_per_revolution) / (2 * math.pi)
        for key, q in (("q_min", self.limits.q_min), ("q_max", self.limits.q_max)):
            if abs(q) * per_unit + abs(self.zero) > I32_MAX:
                raise ValueError(
                    f"limits.{key} = {q:g} is beyond 32 bits of increments; "
                    "check gear_ratio, increments_per_revolution and zero"
                )
        return self

    @model_validator(mode="after")
    def _check_rate_units(self) -> Self:
        for key in ("velocity_unit", "acceleration_unit"):
            text = getattr(self, key)
            if getattr(rate_units, key)(text).of is Per.METRE and self.joint == "revolute":
                raise ValueError(
                    f"{key}: {text} is a unit of lengths and the joint is revolute; state one of "
                    "revolutions, angles or position units"
                )
        return self


class DrivesFile(FileModel):
    """`drives.yaml`: the axes in joint order, and their common settings.

    Attributes
    ----------
    bitrate : int
        Bit rate of the bus [bit/s].
    sync_period : float
        Time between two SYNCs [s].
    master_node : int
        Our node number; drives supervise its heartbeat.
    heartbeat_period, heartbeat_timeout : float
        Period of heartbeats, and longest time without one [s], in both directions.
    sdo_timeout : float
        Longest response time to an SDO request [s].
    distributed_clock : bool
        Drives on EtherCAT act and latch at SYNC0 if able; otherwise when frames arrive.
    quick_stop_option : int
        605A: 2 = quick stop ramp, then off; 6 = quick stop ramp, then QUICK STOP ACTIVE.
    """

    axes: Annotated[tuple[AxisDrive, ...], Field(min_length=1)]
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000)]
    sync_period: Annotated[float, Field(ge=0.0005, le=1.0)] = 0.004
    master_node: Annotated[int, Field(ge=1, le=127)] = 127
    heartbeat_period: Annotated[float, Field(ge=0.001, le=10)] = 0.1
    heartbeat_timeout: Annotated[float, Field(ge=0.002, le=65)] = 0.5
    sdo_timeout: Annotated[float, Field(ge=0.01, le=30)] = 0.5
    distributed_clock: bool = True
    quick_stop_option: Literal[2, 6] = 2

    @field_validator("axes")
    @classmethod
    def _assign_identifiers(cls, axes: tuple[AxisDrive, ...]) -> tuple[AxisDrive, ...]:
        """Assign free identifiers to PDOs without predefined ones."""
        stated = {axis.cob_id for axis in axes}
        free = (each for each in FREE_IDENTIFIERS[:: len(PDO_USES)] if each not in stated)
        given = []
        for axis in axes:
            wants = axis.cob_id is None and axis.within.pdos[1] > PDOS
            identifier = next(free, None) if wants else axis.cob_id
            if wants and identifier is None:
                raise ValueError(
                    f"{axis.label}: no identifiers are left for its PDOs among"
                    f" {FREE_IDENTIFIERS.start:X}h to {FREE_IDENTIFIERS.stop - 1:X}h; put drives on"
                    " a second bus, or have axes share the first four PDOs of their node (pdos)"
                )
            given.append(axis.model_copy(update={"cob_id": identifier}))
        return tuple(given)

    @model_validator(mode="after")
    def _check_nodes(self) -> Self:
        taken: dict[tuple[int, int], str] = {}
        for axis in self.axes:
            ours = axis.node == self.master_node
            place, pdos = (axis.node, axis.axis), axis.within.pdos
            other = "the master (master_node)" if ours else taken.get(place)
            if other is not None:
                raise ValueError(
                    f"node {axis.node}{axis_suffix(axis.axis)} of {axis.name!r} is also that of"
                    f" {other}; give each its own, or number the axes of one drive (axis: 2)"
                )
            used = {
                number
                for earlier in self.axes
                if earlier.node == axis.node and (earlier.node, earlier.axis) in taken
                for number in range(earlier.within.pdos[0], earlier.within.pdos[1] + 1)
            }
            if pdos[0] > pdos[1] or used.intersection(range(pdos[0], pdos[1] + 1)):
                raise ValueError(
                    f"{axis.label}: pdos = {list(pdos)} must be the first and the last number of"
                    " PDOs that no other axis of the drive uses; state others"
                )
            taken[place] = repr(axis.name)
        if self.heartbeat_timeout < 2 * self.heartbeat_period:
            raise ValueError(
                f"heartbeat_timeout = {self.heartbeat_timeout:g} s must be at least twice "
                f"heartbeat_period = {self.heartbeat_period:g} s"
            )
        return self


def load_drives(path: Path | str) -> DrivesFile:
    """Read a drives file; errors (`checked_files.yaml_file.FileError`) state line and remedy."""
    return load_yaml(path, DrivesFile)
