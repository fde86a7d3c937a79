"""A joint as far as a URDF or a table knows it: its name, type and limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class LimitedJoint:
    """A joint; NaN is what is not known.

    Attributes
    ----------
    name : str
    type : {"revolute", "prismatic"}
    lower, upper : float
        Range [rad or m].
    velocity, acceleration, effort : float
        Greatest magnitudes [rad/s, rad/s^2, N m, or m/s, m/s^2, N].
    """

    name: str
    type: Literal["revolute", "prismatic"]
    lower: float
    upper: float
    velocity: float
    acceleration: float
    effort: float
