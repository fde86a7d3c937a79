"""What a run says about friction, as data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hil.estimation.friction.drift import Drift
    from hil.estimation.friction.history import History
    from hil.estimation.friction.model_choice import AxisFriction
    from hil.estimation.friction.points import FrictionPoint
    from hil.estimation.friction.symmetry import Symmetry
    from hil.model.robot import Robot
    from hil.planning.measurement import Friction


@dataclass(frozen=True, slots=True, eq=False)
class FrictionResult:
    """Everything that a run says about friction.

    Attributes
    ----------
    robot : Robot
    planned : dict
        Friction measurements by id.
    points : tuple of FrictionPoint
        In the order of the plan.
    axes : tuple of AxisFriction
        Axes with enough speeds for models.
    symmetry : tuple of Symmetry
        Axes whose gravity torque is known.
    drifts : tuple of Drift
        Axes with enough levels over time.
    history : History
    left_out : tuple of str
    model_folder : str, optional
        Run whose model compensated gravity.
    """

    robot: Robot
    planned: dict[str, Friction]
    points: tuple[FrictionPoint, ...]
    axes: tuple[AxisFriction, ...]
    symmetry: tuple[Symmetry, ...]
    drifts: tuple[Drift, ...]
    history: History
    left_out: tuple[str, ...]
    model_folder: str | None

    @property
    def gravity(self) -> str:
        """How gravity was compensated."""
        return f"model of {self.model_folder}" if self.model_folder else "half-differences"

    def of_axis(self, axis: int) -> list[FrictionPoint]:
        """Points of one axis (index from 0)."""
        return [point for point in self.points if point.axis == axis]
