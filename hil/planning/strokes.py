"""An axis that goes back and forth about a configuration: what most kinds of measurement share.

After section 6.3 of Grotjahn, Daemi and Heimann (2001): `cycles` times from
``q[axis] - stroke/2`` to ``q[axis] + stroke/2`` and back, each stroke a trapezoid of its own.
`Strokes` answers what the stages ask of such a measurement; a kind (`hil.planning.measurement`)
overrides what is special about it.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import accumulate
from typing import TYPE_CHECKING, ClassVar, Literal, NamedTuple

from pydantic import Field, model_validator

from checked_files.yaml_file import FileModel
from hil.planning import CYCLES_MAX
from hil.planning.plan_values import Name, Positive, Real
from hil.planning.trapezoid import Trapezoid

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Self

REST = 0.3
"""Time at rest recorded before the motion and after it, padding for filters [s]."""
TURN = 0.03
"""Expected time between the end of one stroke's profile and the start of the next [s]."""
SETTLED = 0.2
"""Time after the creeping axis's ramp before its partner may start [s]."""
PARTNER_TURN = 2 * TURN
"""Time for handshake and settling between a partner's profile and its next one [s]."""
MARGIN = 0.1
"""Time after a ramp that does not count as constant velocity yet [s]."""
SHORTEST_WINDOW = 0.15
"""Least duration of constant velocity in a stroke [s]."""


class Cruise(NamedTuple):
    """How long a stroke must last at constant velocity [s], and what that time is."""

    duration: float
    purpose: str


class Partner(FileModel):
    """The axis that accelerates back and forth while another one creeps."""

    axis: int = Field(ge=1)
    stroke: Positive
    velocity: Positive
    acceleration: Positive

    @property
    def index(self) -> int:
        """Joint index, from 0."""
        return self.axis - 1

    def profile(self, q: Sequence[float], stroke: int) -> Trapezoid:
        """Profile of stroke number `stroke` about `q`; even numbers go forward."""
        middle, half = q[self.index], self.stroke / 2
        return _stroke(middle - half, middle + half, self.velocity, self.acceleration, stroke)


class Strokes(FileModel):
    """An axis going back and forth about a configuration."""

    streamed: ClassVar[Literal[False]] = False
    """Whether set-points are streamed; if not, drives are given the ends of strokes."""

    id: Name
    axis: int = Field(ge=1)
    q: tuple[Real, ...] = Field(min_length=1)
    stroke: Positive
    velocity: Positive
    acceleration: Positive
    cycles: int = Field(default=1, ge=1, le=CYCLES_MAX)

    @model_validator(mode="after")
    def _axis_exists(self) -> Self:
        if self.axis > len(self.q):
            raise ValueError(
                f"axis {self.axis} must be one of the {len(self.q)} joints that q names"
            )
        return self

    @property
    def index(self) -> int:
        """Joint index of the axis whose torque is read, from 0."""
        return self.axis - 1

    @property
    def partners(self) -> tuple[Partner, ...]:
        """Axes that accelerate back and forth meanwhile."""
        return ()

    @property
    def read(self) -> tuple[int, ...]:
        """Joint indices of the axes whose torque is read, from 0."""
        return (self.index,)

    @property
    def moved(self) -> tuple[int, ...]:
        """Joint indices of all axes that move on purpose, from 0."""
        return (self.index, *(partner.index for partner in self.partners))

    @property
    def axes_in_words(self) -> str:
        """The axes that move, for readers."""
        return f"axis {self.axis}" + "".join(f" with partner {p.axis}" for p in self.partners)

    @property
    def unit_acceleration(self) -> tuple[float, ...]:
        """Accelerations of all joints to which the torque that is read is due, as a unit vector.

        Zero where it is read at constant velocity.
        """
        return (0.0,) * len(self.q)

    @property
    def torque_per_element(self) -> float:
        """What the element of g(q) or M(q) is multiplied with in the torque that is read.

        1 for gravity, the acceleration [rad/s^2] for an inertia.
        """
        return 1.0

    @property
    def highest_acceleration(self) -> float:
        """Of any axis [rad/s^2]."""
        return max([self.acceleration, *(partner.acceleration for partner in self.partners)])

    @property
    def cruise(self) -> Cruise | None:
        """Constant velocity that every stroke needs; None where nothing is read from it."""
        return Cruise(MARGIN + SHORTEST_WINDOW, "constant velocity")

    @property
    def lacking(self) -> float:
        """Time by which a stroke falls short of the constant velocity that it needs, or 0 [s]."""
        if self.cruise is None:
            return 0.0
        begin, end = self.profile(0).window
        return max(self.cruise.duration - (end - begin), 0.0)

    @property
    def n_strokes(self) -> int:
        """Strokes in all; even numbers go forward, odd ones back."""
        return 2 * self.cycles

    @property
    def start(self) -> tuple[float, ...]:
        """Configuration where the first strokes of all axes begin and the last ones end [rad]."""
        return self._at_end(-1)

    @property
    def end(self) -> tuple[float, ...]:
        """Configuration where the forward strokes of all axes end [rad]."""
        return self._at_end(1)

    def profile(self, stroke: int) -> Trapezoid:
        """Profile of stroke number `stroke` (from 0) of the axis."""
        low, high = self.start[self.index], self.end[self.index]
        return _stroke(low, high, self.velocity, self.acceleration, stroke)

    @property
    def preparation(self) -> float:
        """Time of rest and exercise before the recording [s]."""
        return 0.0

    @property
    def exercised(self) -> float:
        """How long the same strokes go on before the recording [s]."""
        return 0.0

    @property
    def duration(self) -> float:
        """Expected time from rest at the start to rest after the last stroke, preparation too."""
        return self.preparation + self.beginnings[-1] + REST

    @property
    def beginnings(self) -> tuple[float, ...]:
        """When each stroke is expected to begin, and the rest after the last one [s]."""
        durations = (self.profile(number).duration + TURN for number in range(self.n_strokes))
        return tuple(accumulate(durations, initial=REST))

    def _at_end(self, sign: int) -> tuple[float, ...]:
        q = list(self.q)
        q[self.index] += sign * self.stroke / 2
        for partner in self.partners:
            q[partner.index] += sign * partner.stroke / 2
        return tuple(q)


@lru_cache(maxsize=64)
def _stroke(
    low: float, high: float, velocity: float, acceleration: float, stroke: int
) -> Trapezoid:
    ends = (low, high) if stroke % 2 == 0 else (high, low)
    return Trapezoid(*ends, velocity, acceleration)
