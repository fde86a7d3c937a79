"""Units in which recordings state times, positions, velocities and torques; all become SI.

A unit is angular or linear, so that millimetres of a joint that turns are refused. Counts and
currents have neither: what one of them is worth is stated in the map.
"""

from __future__ import annotations

import math
from typing import Literal

TimeUnit = Literal["s", "ms", "us", "ns", "min"]
PositionUnit = Literal["rad", "deg", "m", "mm", "counts"]
VelocityUnit = Literal["rad/s", "deg/s", "rpm", "m/s", "mm/s", "counts/s"]
TorqueUnit = Literal["N m", "N", "A", "V", "per mille"]

SECONDS: dict[TimeUnit, float] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
"""Of each unit of time [s]."""
LENGTHS: dict[str, float] = {"rad": 1.0, "deg": math.pi / 180, "m": 1.0, "mm": 1e-3}
"""Of each unit of position, and with /s of velocity [rad or m]; counts have none of their own."""
JOINT_TYPES: dict[str, str] = {
    **dict.fromkeys(("rad", "deg", "rad/s", "deg/s", "rpm", "N m"), "revolute"),
    **dict.fromkeys(("m", "mm", "m/s", "mm/s", "N"), "prismatic"),
}
"""Type of the joints that a unit suits, on the joint side; units that are not here suit both."""
NEEDS_GAIN = ("A", "V", "per mille")
"""Units of torque that are worth nothing without a gain."""


def position_factor(unit: str, per_unit: float | None) -> float:
    """SI units [rad or m, also per second] that one unit of a position or velocity is worth.

    Parameters
    ----------
    unit : str
        A `PositionUnit` or `VelocityUnit`.
    per_unit : float, optional
        Of a count [rad or m].
    """
    if unit.startswith("counts"):
        assert per_unit is not None  # noqa: S101 - the map is refused without it
        return per_unit
    return math.pi / 30 if unit == "rpm" else LENGTHS[unit.removesuffix("/s")]
