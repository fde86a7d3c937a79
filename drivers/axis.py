"""Counts to radians and per mille to newton metres, from what the drives file states.

A drive speaks in counts of its encoder or in parts of a degree, in per mille of a rated value or in
milliamperes; we speak SI on the joint side. An `Axis` is one of a session, and what all who move or
watch it need to know of it. With counts c of 6064, counts per motor revolution R (a
ratio of integers), gear ratio N (motor angle over joint coordinate), direction s = +-1, zero c0 and
sign of the current's count against the drive's position sc = +-1::

    q   = s (c - c0) 2 pi / (R N)                                                  [rad or m]
    tau = s sc N kt a i     i = mA / 1000  or  per mille / 1000 of rated current   [N m or N]
    tau = s sc N T per mille / 1000                    per mille of rated torque T

where a count may be several mA or per mille (`per_count`), and a turns the amplitude of the
current's readback (rms or peak) into that of the torque constant kt. For a prismatic axis N is in
rad of the motor per m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

from drivers.drive_bus import AxisInfo
from drivers.drives_file import Basis
from drivers.rate_units import RateUnit, acceleration_unit, motor_turns, velocity_unit

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from drivers.drives_file import AxisDrive
    from drivers.remote_dictionary import RemoteDictionary

FINEST = 2.0**-24
"""Share of a number by which it is rounded in 32 bits (IEEE 754)."""
Number = TypeVar("Number", float, "NDArray[np.float64]")


@dataclass(frozen=True, slots=True)
class AxisScale:
    """Factors between a drive's counts and SI on the joint side.

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
        Smallest step of joint torques that the current object shows, positive [N m or N].
    """

    position: float
    zero: int
    torque: float
    velocity: float
    acceleration: float
    torque_limit: float
    torque_step: float

    @classmethod
    def of(cls, axis: AxisDrive) -> AxisScale:
        """Derive the factors from an axis of the drives file."""
        increment = 2 * math.pi / float(axis.increments_per_revolution) / axis.gear_ratio
        per_mille = axis.gear_ratio * axis.rated_torque / 1000
        torque = axis.sign * axis.current.sign * axis.gear_ratio * _motor_torque(axis)
        real = axis.current.type == "f32"
        return cls(
            position=axis.sign * increment,
            zero=axis.zero,
            torque=torque,
            velocity=_rate(velocity_unit(axis.velocity_unit), axis),
            acceleration=_rate(acceleration_unit(axis.acceleration_unit), axis),
            torque_limit=per_mille,
            torque_step=FINEST * axis.limits.torque if real else abs(torque),
        )

    def position_from_counts(self, counts: Number) -> Number:
        """Joint coordinate of a drive's position (6064), scalar or array [rad or m]."""
        return (counts - self.zero) * self.position

    def position_to_counts(self, q: float) -> int:
        """Drive's position (607A) nearest to a joint coordinate [increments]."""
        return round(q / self.position) + self.zero

    def torque_from_counts(self, counts: Number) -> Number:
        """Joint torque from the current object, scalar or array [N m or N]."""
        return counts * self.torque

    def velocity_to_counts(self, velocity: float) -> int:
        """Velocity in the drive's unit (6081, 607F), never above the one that is asked for."""
        return _floor(velocity / self.velocity)

    def acceleration_to_counts(self, acceleration: float) -> int:
        """Acceleration in the drive's unit (6083..6085), never above the one asked for."""
        return _floor(acceleration / self.acceleration)

    def velocity_offset_to_counts(self, velocity: Number) -> Number:
        """Joint velocity in the drive's unit and direction (60B1), not rounded."""
        return velocity / math.copysign(self.velocity, self.position)

    def torque_offset_to_counts(self, torque: Number) -> Number:
        """Joint torque in per mille of rated torque, in the drive's direction (60B2), unrounded."""
        return torque / math.copysign(self.torque_limit, self.position)

    def torque_limit_to_counts(self, torque: float) -> int:
        """Torque limit in per mille of rated torque (6072), never above the one asked for."""
        return _floor(torque / self.torque_limit)


@dataclass(frozen=True, slots=True)
class Wrap:
    """Positions of a drive that wrap around at the ends of a range (607B).

    The range is wider than an axis's way, so each of them is one place of the axis.

    Attributes
    ----------
    low, size : int
        The lowest position that the drive shows, and how many there are: the highest may follow
        upon itself in some drives, which makes one count.
    first : int
        From which place on the axis is counted [increments].
    """

    low: int
    size: int
    first: int

    def unwrapped(self, position: int) -> int:
        """Return the place of the axis that the drive shows as `position`."""
        return self.first + (position - self.first) % self.size

    def wrapped(self, place: int) -> int:
        """Return how the drive shows a place."""
        return self.low + (place - self.low) % self.size


@dataclass(frozen=True, eq=False)
class Axis:
    """One axis of a session.

    Attributes
    ----------
    index : int
        In joint order, from 0.
    stated : AxisDrive
        What the drives file states of it.
    drive : AxisDrive
        The same with the limits that hold.
    server : RemoteDictionary
        Its drive's object dictionary.
    own : mapping of str to str
        Which of these limits are the drive's own: field, and the object that sets it.
    stop_deceleration : float or None
        Of a quick stop, as it stands in the drive [rad/s^2 or m/s^2]; None where it has no 6085 and
        its ramp is the maker's.
    identity : str
        Identity of the drive (1018), in words.
    planned : bool
        The driver plans its ways, since its drive has no profile position or its positions wrap.
    wrap : Wrap or None
        How they do.
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
        """How messages name it."""
        return self.server.label

    @property
    def info(self) -> AxisInfo:
        """What is known of it for the provenance."""
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
        """Its drive's units."""
        return AxisScale.of(self.drive)

    @cached_property
    def per_count(self) -> float:
        """What one increment is [rad or m], positive."""
        return abs(self.scale.position)

    @cached_property
    def window(self) -> float:
        """Its following error window [increments]."""
        return self.drive.following_error_window / self.per_count

    @cached_property
    def band(self) -> float:
        """Its position window [increments]."""
        return self.drive.position_window / self.per_count


def _rate(unit: RateUnit, axis: AxisDrive) -> float:
    """Joint side of one unit of velocity or acceleration, positive."""
    turns = motor_turns(unit, axis.increments_per_revolution, axis.gear_ratio)
    return 2 * math.pi * float(turns) / axis.gear_ratio


def _floor(value: float) -> int:
    return math.floor(value * (1 + 1e-9))


def motor_torque_per_count(axis: AxisDrive, basis: Basis) -> float | None:
    """Return the motor's torque per count of the current object, were it in `basis` [N m].

    None where the drives file states no torque constant, which currents need.
    """
    counted = axis.current.per_count if basis is axis.current.basis else 1.0
    if basis is Basis.RATED_TORQUE:
        return axis.rated_torque / 1000 * counted
    if axis.torque_constant is None:
        return None
    ampere = 0.001 if basis is Basis.MILLIAMPERE else axis.rated_current / 1000
    return axis.torque_constant * ampere * _amplitude_factor(axis) * counted


def _motor_torque(axis: AxisDrive) -> float:
    per_count = motor_torque_per_count(axis, axis.current.basis)
    assert per_count is not None  # noqa: S101 - the file's validator saw to it
    return per_count


def _amplitude_factor(axis: AxisDrive) -> float:
    match axis.current.amplitude, axis.torque_constant_amplitude:
        case "rms", "peak":
            return math.sqrt(2)
        case "peak", "rms":
            return math.sqrt(0.5)
    return 1.0
