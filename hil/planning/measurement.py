"""The kinds of measurement, as data.

All but the trajectory (`hil.planning.trajectory`) follow section 6.3 of Grotjahn, Daemi and Heimann
(2001): an axis goes back and forth about a configuration `q`, `cycles` times, from
``q[axis] - stroke/2`` to ``q[axis] + stroke/2`` and back.

gravity
    long windows of constant velocity: half the sum of both directions is g_i(q), eq. (14);
inertia
    a large share of acceleration: M_ii(q) by eq. (19) and (20);
coupling
    the axis whose torque is read creeps, so that it never sticks, while a partner accelerates back
    and forth: M_ij(q) by eq. (21);
friction
    constant velocity again, at any speed of the axis, with the history that friction depends on:
    how long the axis stood still, and how long it was kept in motion, just before (section 3).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, model_validator

from checked_files.yaml_file import FileModel
from hil.planning.plan_values import Name, Positive, Real
from hil.planning.trajectory import Trajectory
from hil.planning.trapezoid import Trapezoid

if TYPE_CHECKING:
    from typing import Self

REST = 0.3
"""Time at rest recorded before the first stroke and after the last, padding for filters [s]."""
TURN = 0.03
"""Expected time between the end of one stroke's profile and the start of the next [s]."""
SETTLED = 0.2
"""Time after the creeping axis's ramp before its partner may start [s]."""
PARTNER_TURN = 0.06
"""Time for handshake and settling between a partner's profile and its next one [s]."""
MARGIN = 0.1
"""Time after a ramp that does not count as constant velocity yet [s]."""
SHORTEST_WINDOW = 0.15
"""Least duration of constant velocity in a stroke [s]."""


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


class _Strokes(FileModel):
    """What all kinds share: an axis going back and forth about a configuration."""

    id: Name
    axis: int = Field(ge=1)
    q: tuple[Real, ...] = Field(min_length=1)
    stroke: Positive
    velocity: Positive
    acceleration: Positive
    cycles: int = Field(default=1, ge=1)

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
    def moved(self) -> tuple[int, ...]:
        """Joint indices of all axes that move on purpose, from 0."""
        return (self.index,)

    @property
    def n_strokes(self) -> int:
        """Strokes in all; even numbers go forward, odd ones back."""
        return 2 * self.cycles

    @property
    def start(self) -> tuple[float, ...]:
        """Configuration where the first stroke begins and the last one ends [rad]."""
        return _moved(self.q, self.index, -self.stroke / 2)

    @property
    def end(self) -> tuple[float, ...]:
        """Configuration where the forward strokes end [rad]."""
        return _moved(self.q, self.index, self.stroke / 2)

    def profile(self, stroke: int) -> Trapezoid:
        """Profile of stroke number `stroke` (from 0) of the axis."""
        ends = (self.start[self.index], self.end[self.index])
        begin, end = ends if stroke % 2 == 0 else ends[::-1]
        return Trapezoid(begin, end, self.velocity, self.acceleration)

    @property
    def duration(self) -> float:
        """Expected time from rest at the start to rest after the last stroke [s]."""
        return 2 * REST + self.n_strokes * (self.profile(0).duration + TURN)


class Gravity(_Strokes):
    """Constant velocity back and forth: gravity torque of the axis at q."""

    kind: Literal["gravity"] = "gravity"


class Inertia(_Strokes):
    """Acceleration back and forth: diagonal element of the mass matrix at q."""

    kind: Literal["inertia"] = "inertia"


class Coupling(_Strokes):
    """The axis creeps, its partner accelerates: off-diagonal element of the mass matrix at q."""

    kind: Literal["coupling"] = "coupling"
    partner: Partner

    @model_validator(mode="after")
    def _partner_differs(self) -> Self:
        if self.partner.axis == self.axis:
            raise ValueError(f"partner.axis {self.partner.axis} must differ from axis {self.axis}")
        if self.partner.axis > len(self.q):
            raise ValueError(
                f"partner.axis {self.partner.axis} must be one of the {len(self.q)} joints"
                " that q names"
            )
        return self

    @property
    def moved(self) -> tuple[int, ...]:
        """Joint indices of the axis and its partner, from 0."""
        return self.index, self.partner.index

    @property
    def start(self) -> tuple[float, ...]:
        """Configuration where the first strokes of both axes begin [rad]."""
        return _moved(super().start, self.partner.index, -self.partner.stroke / 2)

    @property
    def end(self) -> tuple[float, ...]:
        """Configuration of both axes at the far end of their strokes [rad]."""
        return _moved(super().end, self.partner.index, self.partner.stroke / 2)

    def partner_profile(self, stroke: int) -> Trapezoid:
        """Profile of the partner's stroke number `stroke`; even numbers go forward."""
        index = self.partner.index
        ends = (self.start[index], self.end[index])
        begin, end = ends if stroke % 2 == 0 else ends[::-1]
        return Trapezoid(begin, end, self.partner.velocity, self.partner.acceleration)


class Friction(_Strokes):
    """Constant velocity back and forth: friction torque of the axis at one speed.

    Attributes
    ----------
    rest : float, optional
        How long all axes stand still beforehand [s].
    exercise : float, optional
        How long the same strokes go on beforehand, after the rest, without a recording [s].
    """

    kind: Literal["friction"] = "friction"
    rest: Positive | None = None
    exercise: Positive | None = None

    @property
    def preparation(self) -> float:
        """Time of rest and exercise before the recording [s]."""
        return (self.rest or 0.0) + (self.exercise or 0.0)

    @property
    def duration(self) -> float:
        """Expected time with the preparation [s]."""
        return self.preparation + super().duration


Element = Gravity | Inertia | Coupling
"""Measurements of one element of g(q) or M(q)."""
Strokes = Gravity | Inertia | Coupling | Friction
"""Measurements in which an axis goes back and forth."""
Measurement = Annotated[Strokes | Trajectory, Field(discriminator="kind")]


def _moved(q: tuple[float, ...], index: int, by: float) -> tuple[float, ...]:
    return tuple(value + by if i == index else value for i, value in enumerate(q))
