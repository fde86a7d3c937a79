"""Conversion between drive units and SI: counts to radians, per mille to newton metres.

A drive reports counts of its encoder or parts of a degree, and per mille of a rated value or
milliamperes; the framework uses SI on the joint side. With counts c of 6064, counts per motor
revolution R (a ratio of integers), gear ratio N (motor angle over joint coordinate), direction
s = +-1, position c0 at q = 0, and sign sc = +-1 of the current relative to the drive's position::

    q   = s (c - c0) 2 pi / (R N)                                                  [rad or m]
    tau = s sc N kt a i     i = mA / 1000  or  per mille / 1000 of rated current   [N m or N]
    tau = s sc N T per mille / 1000                    per mille of rated torque T

A count may be several mA or per mille (`per_count`). The factor a converts the amplitude of the
current's readback (rms or peak) to that of the torque constant kt. For a prismatic axis N is in
rad of the motor per m.

Positions of a drive that wrap around (`Wrap`) become places, the unwrapped positions: received
positions are unwrapped and sent targets wrapped, only here, so that other modules see no ends.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar, cast

from drivers.drive_bus import AxisInfo
from drivers.drives_file import Basis
from drivers.rate_units import RateUnit, acceleration_unit, motor_turns, velocity_unit

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from drivers.cycle_data import ProcessData
    from drivers.drives_file import AxisDrive
    from drivers.remote_dictionary import RemoteDictionary

FINEST = 2.0**-24
"""Relative rounding error of a 32-bit floating-point number (IEEE 754)."""
Number = TypeVar("Number", float, "NDArray[np.float64]")


@dataclass(frozen=True, slots=True)
class AxisScale:
    """Conversion factors between drive units and SI on the joint side.

    Attributes
    ----------
    position : float
        Joint coordinate per count, with the sign [rad or m].
    zero : int
        Position at q = 0 [counts].
    torque : float
        Joint torque per count of the current object, with the sign [N m or N].
    velocity, acceleration : float
        Joint velocity and acceleration per unit of the drive, positive.
    torque_limit : float
        Joint torque per unit of 6072 (per mille of rated torque), positive [N m or N].
    torque_step : float
        Resolution of the joint torque in the current object, positive [N m or N].
    """

    position: float
    zero: int
    torque: float
    velocity: float
    acceleration: float
    torque_limit: float
    torque_step: float

    @classmethod
    def derive(cls, axis: AxisDrive) -> AxisScale:
        """Derive the conversion factors from an axis of the drives file."""
        increment = 2 * math.pi / float(axis.increments_per_revolution) / axis.gear_ratio
        motor_torque = motor_torque_per_count(axis, axis.current.basis)
        assert motor_torque is not None  # noqa: S101 - the validator of the file saw to it
        torque = axis.sign * axis.current.sign * axis.gear_ratio * motor_torque
        real = axis.current.type == "f32"
        return cls(
            position=axis.sign * increment,
            zero=axis.zero,
            torque=torque,
            velocity=_rate(velocity_unit(axis.velocity_unit), axis),
            acceleration=_rate(acceleration_unit(axis.acceleration_unit), axis),
            torque_limit=axis.gear_ratio * axis.rated_torque / 1000,
            torque_step=FINEST * axis.limits.torque if real else abs(torque),
        )

    def position_from_counts(self, counts: Number) -> Number:
        """Convert a position of the drive (6064), scalar or array, to a coordinate [rad or m]."""
        return (counts - self.zero) * self.position

    def position_to_counts(self, q: float) -> int:
        """Convert a joint coordinate to the nearest position of the drive (607A) [increments]."""
        return round(q / self.position) + self.zero

    def torque_from_counts(self, counts: Number) -> Number:
        """Convert a value of the current object, scalar or array, to a joint torque [N m or N]."""
        return counts * self.torque

    def velocity_to_counts(self, velocity: float) -> int:
        """Convert a joint velocity to the unit of the drive (6081, 607F), rounded down."""
        return _floor(velocity / self.velocity)

    def acceleration_to_counts(self, acceleration: float) -> int:
        """Convert a joint acceleration to the unit of the drive (6083..6085), rounded down."""
        return _floor(acceleration / self.acceleration)

    def velocity_offset_to_counts(self, velocity: Number) -> Number:
        """Convert a joint velocity to unit and direction of the drive (60B1), not rounded."""
        return velocity / math.copysign(self.velocity, self.position)

    def torque_offset_to_counts(self, torque: Number) -> Number:
        """Convert a joint torque to signed per mille of rated torque (60B2), not rounded."""
        return torque / math.copysign(self.torque_limit, self.position)

    def torque_limit_to_counts(self, torque: float) -> int:
        """Convert a torque limit to per mille of rated torque (6072), rounded down."""
        return _floor(torque / self.torque_limit)


@dataclass(frozen=True, slots=True)
class Wrap:
    """Wrap-around of a drive's positions at the ends of a range (607B).

    A place is an unwrapped position. The range is wider than the travel of the axis, so each
    position of the drive belongs to one place.

    Attributes
    ----------
    low, size : int
        Lowest position of the drive, and number of positions [increments]. Some drives show the
        lowest or the highest position at the same place; both count as one.
    first : int
        First place on the axis [increments].
    """

    low: int
    size: int
    first: int

    def unwrap(self, position: int) -> int:
        """Return the place of the axis for a position of the drive [increments]."""
        return self.first + (position - self.first) % self.size

    def wrap(self, place: int) -> int:
        """Return the position of the drive for a place of the axis [increments]."""
        return self.low + (place - self.low) % self.size


@dataclass(frozen=True, eq=False)
class Axis:
    """Axis of a session: drive, limits in force, units and object dictionary.

    Attributes
    ----------
    index : int
        Joint index, from 0.
    stated : AxisDrive
        Axis as stated in the drives file.
    drive : AxisDrive
        Axis as stated, with the limits in force.
    server : RemoteDictionary
    own : mapping of str to str
        Limits set by the drive rather than the file: field, and the object that sets the limit.
    stop_deceleration : float or None
        Quick stop deceleration of the drive (6085) [rad/s^2 or m/s^2]; None where the object is
        absent and the ramp unknown.
    identity : str
        Identity of the drive (1018), in words.
    planned : bool
        True if the driver plans the path, since the drive has no profile position mode or its
        positions wrap around.
    wrap : Wrap or None
        Wrap-around of the positions.
    """

    index: int
    stated: AxisDrive
    drive: AxisDrive
    server: RemoteDictionary
    own: Mapping[str, str] = field(default_factory=dict)
    stop_deceleration: float | None = None
    identity: str = ""
    planned: bool = False
    wrap: Wrap | None = None

    @classmethod
    def all(
        cls, drives: Sequence[AxisDrive], servers: Sequence[RemoteDictionary]
    ) -> tuple[Axis, ...]:
        """Return axes with the limits of the drives file."""
        pairs = enumerate(zip(drives, servers, strict=True))
        return tuple(cls(index, drive, drive, server) for index, (drive, server) in pairs)

    @property
    def label(self) -> str:
        """Name of the axis in messages."""
        return self.server.label

    @property
    def info(self) -> AxisInfo:
        """Description of the axis for the provenance."""
        limits = self.drive.limits
        return AxisInfo(
            name=self.drive.name,
            identity=self.identity,
            q_min=limits.q_min,
            q_max=limits.q_max,
            velocity_max=limits.velocity,
            acceleration_max=limits.acceleration,
            torque_resolution=self.scale.torque_step,
            position_resolution=self.per_count,
            own_limits=self.own,
            unit=self.drive.unit,
        )

    @cached_property
    def scale(self) -> AxisScale:
        """Conversion factors between the units of the drive and SI."""
        return AxisScale.derive(self.drive)

    @cached_property
    def per_count(self) -> float:
        """Size of an increment [rad or m], positive."""
        return abs(self.scale.position)

    @cached_property
    def window(self) -> float:
        """Following error window [increments]."""
        return self.drive.following_error_window / self.per_count

    @cached_property
    def band(self) -> float:
        """Position window [increments]."""
        return self.drive.position_window / self.per_count


def _rate(unit: RateUnit, axis: AxisDrive) -> float:
    """Convert a unit of velocity or acceleration to the joint side, positive."""
    turns = motor_turns(unit, axis.increments_per_revolution, axis.gear_ratio)
    return 2 * math.pi * float(turns) / axis.gear_ratio


def _floor(value: float) -> int:
    return math.floor(value * (1 + 1e-9))


def motor_torque_per_count(axis: AxisDrive, basis: Basis) -> float | None:
    """Return the motor torque per count of the current object, read in `basis` [N m].

    None for currents if the drives file states no torque constant.
    """
    counted = axis.current.per_count if basis is axis.current.basis else 1.0
    if basis is Basis.RATED_TORQUE:
        return axis.rated_torque / 1000 * counted
    if axis.torque_constant is None:
        return None
    ampere = 0.001 if basis is Basis.MILLIAMPERE else axis.rated_current / 1000
    # sinusoidal currents: the peak is sqrt(2) times the rms value
    peaks = (axis.torque_constant_amplitude == "peak") - (axis.current.amplitude == "peak")
    return axis.torque_constant * ampere * math.sqrt(2) ** peaks * counted


def unwrap_positions(process_data: ProcessData, axes: Sequence[Axis]) -> ProcessData:
    """Return process data in places of the axes; unchanged where no positions wrap around."""
    if not any(axis.wrap for axis in axes):
        return process_data
    return cast("ProcessData", _Unwrapped(process_data, axes))


class _Unwrapped:
    """Process data with positions and targets converted, and other members passed on."""

    looks_ahead = False

    def __init__(self, process_data: ProcessData, axes: Sequence[Axis]) -> None:
        self.__dict__.update(_inner=process_data, _wraps=[axis.wrap for axis in axes])

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)

    def __setattr__(self, name: str, value: object) -> None:
        setattr(self._inner, name, value)

    @property
    def positions(self) -> tuple[int, ...]:
        """Places of the axes [increments]."""
        pairs = zip(self._wraps, self._inner.positions, strict=True)
        return tuple(wrap.unwrap(position) if wrap else position for wrap, position in pairs)

    def command(self, axis: int, target: int, controlword: int) -> None:
        """Send a place [increments] and controlword to an axis."""
        self._inner.command(axis, self._wrap(axis, target), controlword)

    def lead(self, axis: int, target: int) -> None:
        """Send a streamed set-point to an axis [increments]."""
        self._inner.lead(axis, self._wrap(axis, target))

    def _wrap(self, axis: int, target: int) -> int:
        wrap = self._wraps[axis]
        return wrap.wrap(target) if wrap else target
