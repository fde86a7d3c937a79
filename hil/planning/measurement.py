"""Kinds of measurement, as data: models, and a table of properties for the stages.

All but the trajectory (`hil.planning.trajectory`) follow section 6.3 of Grotjahn, Daemi and Heimann
(2001): an axis goes back and forth (`hil.planning.strokes`).

gravity
    long windows of constant velocity: half the sum of both directions is g_i(q), eq. (14);
inertia
    a large share of acceleration: M_ii(q) by eq. (19) and (20);
coupling
    the read axis creeps, so that it never sticks, while a partner accelerates back and forth:
    M_ij(q) by eq. (21);
friction
    constant velocity at any speed of the axis, with a defined history of standstill and motion
    just before (section 3).

A new kind is a model and a row of `KINDS` here, and an entry in each stage with functions by kind:
motion (`hil.measuring.sequencer`), checks of recordings (`hil.measuring.checks.recording_checks`),
local estimates (`hil.estimation.local_fits`) and, if `hil plan` chooses it, configurations
(`hil.planning.design.measurable_elements`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Literal, TypeGuard, TypeVar, overload

from pydantic import Field, model_validator

from hil.model.dependencies import DIAGONAL, GRAVITY, OFF_DIAGONAL
from hil.planning.free_motion import FreeMotion
from hil.planning.halton import GOLDEN
from hil.planning.plan_values import Positive
from hil.planning.strokes import PARTNER_TURN, SETTLED, Cruise, Partner, Strokes
from hil.planning.trajectory import Trajectory

if TYPE_CHECKING:
    from collections.abc import Iterable
    from typing import Self

    from hil.model.robot import Robot
    from hil.planning.trapezoid import Trapezoid


FOR_A_LAW = 3
"""Minimum number of measurements of an axis, or periods of trajectories, to choose a friction law.

Each counts as one sample of the friction level; three leave two degrees of freedom for its scatter.
"""


class Gravity(Strokes):
    """Measurement of gravity: constant velocity back and forth about q."""

    kind: Literal["gravity"] = "gravity"


class Inertia(Strokes):
    """Measurement of a diagonal element of the mass matrix: acceleration back and forth about q.

    Attributes
    ----------
    spread : float, optional
        Time range over which the ends of the cycles' first ramps are spread, by reduced
        acceleration [s]. Equal cycles would repeat the same encoder error instead of averaging it.
    """

    kind: Literal["inertia"] = "inertia"
    spread: Positive | None = None

    def profile(self, stroke: int) -> Trapezoid:
        """Return the profile of a stroke, from 0; both strokes of a cycle accelerate alike."""
        stated = super().profile(stroke)
        if self.spread is None:
            return stated
        later = self.spread * (stroke // 2 * GOLDEN % 1.0)
        ramp = self.velocity / self.acceleration + later
        return replace(stated, acceleration=self.velocity / ramp)

    @property
    def unit_acceleration(self) -> tuple[float, ...]:
        """Unit acceleration of the axis."""
        return _unit(self.index, len(self.q))

    @property
    def torque_per_element(self) -> float:
        """Acceleration of the axis."""
        return self.acceleration

    @property
    def cruise(self) -> Cruise | None:
        """None, since the torque is read on the ramps."""
        return None


class Coupling(Strokes):
    """Measurement of an off-diagonal mass matrix element: creeping axis, accelerating partner."""

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
    def partners(self) -> tuple[Partner, ...]:
        """The accelerating partner."""
        return (self.partner,)

    @property
    def unit_acceleration(self) -> tuple[float, ...]:
        """Unit acceleration of the partner."""
        return _unit(self.partner.index, len(self.q))

    @property
    def torque_per_element(self) -> float:
        """Acceleration of the partner."""
        return self.partner.acceleration

    @property
    def cruise(self) -> Cruise | None:
        """Constant velocity needed for two strokes of the partner."""
        there_and_back = 2 * (self.partner.profile(self.q, 0).duration + PARTNER_TURN)
        return Cruise(SETTLED + there_and_back, "creep, needed for two strokes of the partner")


class Friction(Strokes):
    """Measurement of friction at a speed: constant velocity back and forth.

    Attributes
    ----------
    rest : float, optional
        Standstill of all axes before the recording [s].
    exercise : float, optional
        Duration of unrecorded strokes before the recording, after the rest [s].
    """

    kind: Literal["friction"] = "friction"
    rest: Positive | None = None
    exercise: Positive | None = None

    @property
    def preparation(self) -> float:
        """Time of rest and exercise before the recording [s]."""
        return (self.rest or 0.0) + self.exercised

    @property
    def exercised(self) -> float:
        """Duration of the strokes before the recording [s]."""
        return self.exercise or 0.0


ElementMeasurement = Gravity | Inertia | Coupling
"""Measurements of one element of g(q) or M(q)."""
Measurement = Annotated[
    Gravity | Inertia | Coupling | Friction | Trajectory, Field(discriminator="kind")
]
RecordedMotion = Annotated[
    Gravity | Inertia | Coupling | Friction | Trajectory | FreeMotion, Field(discriminator="kind")
]
"""Content of a recording: a measurement, or a motion recorded by another system."""
ParameterMeasurement = ElementMeasurement | Trajectory
"""Measurements used to estimate base parameters: all but friction measurements."""
ParameterMotion = ParameterMeasurement | FreeMotion
"""`ParameterMeasurement`, and motions recorded by another system."""
M = TypeVar("M", bound=Strokes | Trajectory | FreeMotion)
T = TypeVar("T")

KEYS = (
    *("id", "kind", "axis", "q", "stroke", "velocity", "acceleration", "partner", "cycles"),
    *("spread", "rest", "exercise", "period", "sine", "cosine"),
)
"""Keys of all kinds, in the order of a plan's file."""


@dataclass(frozen=True, slots=True)
class Kind:
    """Properties of a kind of measurement, independent of a single measurement.

    Attributes
    ----------
    seen : str
        Visible motion, for `str.format` with `axis` and `partner`, from 1.
    shows : str
        Content of the torques, for readers unfamiliar with base parameters.
    """

    model: type[Strokes | Trajectory]
    seen: str
    shows: str

    @property
    def name(self) -> str:
        """Name of the kind in plans."""
        return str(self.model.model_fields["kind"].default)


@dataclass(frozen=True, slots=True)
class ElementKind(Kind):
    """Kind of measurement of an element of g(q) or M(q).

    Attributes
    ----------
    group : str
        Group of base parameters shown by the kind (`hil.model.dependencies`).
    letter : str
        First letter of ids in `hil plan`.
    count : int
        Default number of measurements in a plan by counts. Section 8 has 64, 92 and 9; the last was
        too few for the off-diagonal group.
    symbol : {"g", "M"}
        Vector or matrix of the element.
    quantity, unit : str
        Quantity and unit, for revolute joints.
    pair : bool
        True for an element of two axes: one creeps and is read, the other accelerates.
    colour, marker : str
        Colour and marker in plots.
    elements, figure, caption : str
        Texts of the report: the elements as a phrase, the paper's figure, caption.
    """

    group: str
    letter: str
    count: int
    symbol: Literal["g", "M"]
    quantity: str
    unit: str
    pair: bool
    colour: str
    marker: Literal["o", "s", "^"]
    elements: str
    figure: str
    caption: str

    def unit_of(self, robot: Robot, axis: int, partner: int) -> str:
        """Return the unit of an element for revolute or prismatic joints (from 0)."""
        if self.symbol == "g":
            return robot.torque_unit(axis)
        return ("kg", "kg m", "kg m²")[int(robot.revolute[axis]) + int(robot.revolute[partner])]

    def element(self, axis: int, partner: int) -> str:
        """Format an element as a formula; joint indices from 0."""
        index = f"{axis + 1}" if self.symbol == "g" else f"{axis + 1}{partner + 1}"
        return f"{self.symbol}_{{{index}}}"


_TABLE = (
    ElementKind(
        Gravity,
        "Axis {axis} goes back and forth at constant speed",
        "Half the sum of forward and backward torque is gravity, half the difference friction.",
        GRAVITY, "g", 56, "g", "torque", "N m", pair=False, colour="#1f5fa8", marker="o",
        elements="gravity torques",
        figure="the paper's Fig. 5",
        caption="Gravity torques (the paper's Fig. 5): half-sums of both directions at constant"
        " velocity, eq. (14), against g(q) of the model.",
    ),
    ElementKind(
        Inertia,
        "Axis {axis} accelerates back and forth",
        "Torque per acceleration is the moment of inertia about the axis.",
        DIAGONAL, "i", 80, "M", "inertia", "kg m²", pair=False, colour="#8a5fb0",
        marker="s",
        elements="moments of inertia",
        figure="Fig. 6",
        caption="Moments of inertia (Fig. 6): diagonal elements of M(q) by eq. (19) and (20), motor"
        " inertias and gravity compensated, against the model.",
    ),
    ElementKind(
        Coupling,
        "Axis {axis} creeps while axis {partner} accelerates back and forth",
        "Torque on the creeping axis per acceleration of the partner is the coupling inertia.",
        OFF_DIAGONAL, "c", 16, "M", "inertia", "kg m²", pair=True, colour="#3f8f5f",
        marker="^",
        elements="coupling inertias",
        figure="",
        caption="Couplings: off-diagonal elements of M(q) by eq. (21), measured on the creeping "
                "axis while the partner accelerates.",
    ),
    Kind(
        Friction,
        "Axis {axis} goes back and forth at one speed",
        "Half the difference of forward and backward torque is friction at this speed.",
    ),
    Kind(
        Trajectory,
        "The axes follow one smooth path together",
        "Torques of all axes at once, by all inertias, gravity and friction.",
    ),
)  # fmt: skip
KINDS: dict[str, Kind] = {kind.name: kind for kind in _TABLE}
"""All kinds by their name in plans, in the order of tables and plots."""
ELEMENT_KINDS: dict[str, ElementKind] = {
    name: kind for name, kind in KINDS.items() if isinstance(kind, ElementKind)
}
"""Kinds that show elements of g(q) or M(q)."""


def shows_element(measurement: RecordedMotion) -> TypeGuard[ElementMeasurement]:
    """Return True if a measurement shows an element of g(q) or M(q)."""
    return measurement.kind in ELEMENT_KINDS


@overload
def shows_parameters(measurement: Measurement) -> TypeGuard[ParameterMeasurement]: ...
@overload
def shows_parameters(measurement: RecordedMotion) -> TypeGuard[ParameterMotion]: ...
def shows_parameters(measurement: RecordedMotion) -> bool:
    """Return True if a measurement serves to estimate base parameters."""
    return not isinstance(measurement, Friction)


def axes_lacking_law(measurements: Iterable[RecordedMotion], n_joints: int) -> dict[int, int]:
    """Find axes (from 0) with too few measurements for a friction law; return the counts."""
    found = dict.fromkeys(range(n_joints), 0)
    for each in measurements:
        for axis in each.moved if shows_parameters(each) else ():
            found[axis] += each.cycles if each.streamed else 1
    return {axis: count for axis, count in found.items() if count < FOR_A_LAW}


def element_measurements(measurements: Iterable[RecordedMotion]) -> list[ElementMeasurement]:
    """Return the measurements of an element of g(q) or M(q)."""
    return [m for m in measurements if shows_element(m)]


def select_kind(model: type[M], recorded: Iterable[tuple[RecordedMotion, T]]) -> list[tuple[M, T]]:
    """Return the measurements of a kind with recordings."""
    return [(m, recording) for m, recording in recorded if isinstance(m, model)]


def _unit(index: int, n: int) -> tuple[float, ...]:
    return tuple(float(i == index) for i in range(n))
