"""Strokes of an axis back and forth about a configuration: base of most kinds of measurement.

After section 6.3 of Grotjahn, Daemi and Heimann (2001): `cycles` times from ``q[axis] - stroke/2``
to ``q[axis] + stroke/2`` and back, each stroke with a separate trapezoid of velocity. `Strokes` has
the properties of a measurement needed in all stages; a kind (`hil.planning.measurement`) overrides
some of them.
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
"""Rest before and after the motion in a recording, padding for filters [s]."""
TURN = 0.03
"""Expected time between the end of one stroke's profile and the start of the next [s]."""
SETTLED = 0.2
"""Time after the creeping axis's ramp before its partner may start [s]."""
PARTNER_TURN = 2 * TURN
"""Expected time for handshake and settling between two strokes of a partner [s]."""
MARGIN = 0.1
"""Time after a ramp excluded from constant velocity [s]."""
SHORTEST_WINDOW = 0.15
"""Least duration of constant velocity in a stroke [s]."""


class Cruise(NamedTuple):
    """Required duration of constant velocity in a stroke [s], and the purpose."""

    duration: float
    purpose: str


class Partner(FileModel):
    """Partner: axis that accelerates back and forth while the read axis creeps."""

    axis: int = Field(ge=1)
    stroke: Positive
    velocity: Positive
    acceleration: Positive

    @property
    def index(self) -> int:
        """Joint index of the axis, from 0."""
        return self.axis - 1

    def profile(self, q: Sequence[float], stroke: int) -> Trapezoid:
        """Return the profile of a stroke about `q`; even numbers go forward."""
        middle, half = q[self.index], self.stroke / 2
        return _stroke(middle - half, middle + half, self.velocity, self.acceleration, stroke)


class Strokes(FileModel):
    """Axis moving back and forth about a configuration."""

    streamed: ClassVar[Literal[False]] = False
    """False: drives receive the ends of strokes, not a stream of set-points."""

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
        """Joint index of the read axis, from 0."""
        return self.axis - 1

    @property
    def partners(self) -> tuple[Partner, ...]:
        """Axes that accelerate back and forth in the same measurement."""
        return ()

    @property
    def read(self) -> tuple[int, ...]:
        """Joint indices of the read axes, from 0."""
        return (self.index,)

    @property
    def moved(self) -> tuple[int, ...]:
        """Joint indices of the moving axes, from 0."""
        return (self.index, *(partner.index for partner in self.partners))

    @property
    def axes_in_words(self) -> str:
        """Moving axes in words."""
        return f"axis {self.axis}" + "".join(f" with partner {p.axis}" for p in self.partners)

    @property
    def unit_acceleration(self) -> tuple[float, ...]:
        """Unit acceleration of the joints measured by the torque.

        Zero if the torque is read at constant velocity.
        """
        return (0.0,) * len(self.q)

    @property
    def torque_per_element(self) -> float:
        """Factor of the element of g(q) or M(q) in the measured torque.

        1 for gravity, the acceleration [rad/s^2] for an inertia.
        """
        return 1.0

    @property
    def highest_acceleration(self) -> float:
        """Highest acceleration of any axis [rad/s^2]."""
        return max([self.acceleration, *(partner.acceleration for partner in self.partners)])

    @property
    def cruise(self) -> Cruise | None:
        """Constant velocity needed in every stroke; None if the torque is read on the ramps."""
        return Cruise(MARGIN + SHORTEST_WINDOW, "constant velocity")

    @property
    def lacking(self) -> float:
        """Time missing from a stroke's required constant velocity, or 0 [s]."""
        if self.cruise is None:
            return 0.0
        begin, end = self.profile(0).window
        return max(self.cruise.duration - (end - begin), 0.0)

    @property
    def n_strokes(self) -> int:
        """Number of strokes; even numbers go forward, odd ones back."""
        return 2 * self.cycles

    @property
    def start(self) -> tuple[float, ...]:
        """Configuration at the beginning of the first strokes and the end of the last [rad]."""
        return self._end_configuration(-1)

    @property
    def end(self) -> tuple[float, ...]:
        """Configuration at the end of forward strokes [rad]."""
        return self._end_configuration(1)

    def profile(self, stroke: int) -> Trapezoid:
        """Return the profile of a stroke of the axis, numbered from 0."""
        low, high = self.start[self.index], self.end[self.index]
        return _stroke(low, high, self.velocity, self.acceleration, stroke)

    @property
    def preparation(self) -> float:
        """Time of rest and exercise before the recording [s]."""
        return 0.0

    @property
    def exercised(self) -> float:
        """Duration of the strokes before the recording [s]."""
        return 0.0

    @property
    def duration(self) -> float:
        """Expected time from preparation to rest after the last stroke [s]."""
        return self.preparation + self.beginnings[-1] + REST

    @property
    def beginnings(self) -> tuple[float, ...]:
        """Expected start of every stroke, and of the rest after the last [s]."""
        durations = (self.profile(number).duration + TURN for number in range(self.n_strokes))
        return tuple(accumulate(durations, initial=REST))

    def _end_configuration(self, sign: int) -> tuple[float, ...]:
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
