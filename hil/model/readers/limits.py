"""Limits of joints in descriptions: known, or placeholders of an unknown limit.

Formats that require limits get placeholders from exporters and authors: zeros, one power of ten for
all joints, or numbers far beyond any joint. A placeholder is replaced by NaN, as unknown, and
named: motions then wait for the true limit, and recordings need none. Degrees or millimetres are
kept as positions, since the robot file refuses them with a remark on the unit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from hil.model.robot_file import MAX_RANGE, MAX_TORQUE, MAX_VELOCITY

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

FARTHEST = round(2 * math.tau, 3)
"""Range bound for a joint without range: two turns, in three digits [rad or m]."""
_FARTHEST_STATED = {"revolute": 720.0, "prismatic": 1e3 * MAX_RANGE["prismatic"]}
"""Maximum position in any unit: two turns in degrees, or the longest axis in millimetres."""
_UNITS = {
    "revolute": {"range": "rad", "velocity": "rad/s", "effort": "N m"},
    "prismatic": {"range": "m", "velocity": "m/s", "effort": "N"},
}


@dataclass(frozen=True, slots=True, eq=False)
class LimitedJoint:
    """Joint with limits; unknown limits are NaN.

    Attributes
    ----------
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


_Joint = TypeVar("_Joint", bound=LimitedJoint)


def drop_placeholders(joints: Sequence[_Joint]) -> tuple[tuple[_Joint, ...], tuple[str, ...]]:
    """Replace placeholders by NaN.

    Returns
    -------
    joints : tuple of LimitedJoint
    notes : tuple of str
        One sentence about all replaced limits, if any.
    """
    found: dict[tuple[str, str], list[str]] = {}
    kept = []
    # One effort for all joints that is a power of ten is no rating of motors: ratings have three
    # digits or so, and few are powers of ten, and the first joints of a chain carry the others.
    alike = {joint.effort for joint in joints if joint.effort > 0}
    if len(joints) == 1 or len(alike) != 1 or not math.log10(min(alike)).is_integer():
        alike = set()
    for joint in joints:
        unknown: dict[str, Any] = {}
        for keys, limit, reason in _placeholders(joint, alike):
            found.setdefault((limit, reason), []).append(joint.name)
            unknown |= dict.fromkeys(keys, math.nan)
        kept.append(replace(joint, **unknown))
    limits = (
        f"{limit} of {'all joints' if len(names) == len(joints) else ', '.join(names)} ({reason})"
        for (limit, reason), names in found.items()
    )
    return tuple(kept), (f"limits taken as unknown: {', '.join(limits)}",) if found else ()


def _placeholders(
    joint: LimitedJoint, efforts: set[float]
) -> Iterator[tuple[tuple[str, ...], str, str]]:
    """Yield keys, values and reason of the placeholders of a joint."""
    units, fastest = _UNITS[joint.type], MAX_VELOCITY[joint.type]
    fast = joint.velocity > fastest
    if joint.lower == joint.upper:
        at = f"range {joint.lower:g} to {joint.upper:g} {units['range']}"
        yield ("lower", "upper"), at, "allows no motion"
    farthest = _FARTHEST_STATED[joint.type]
    for key in ("lower", "upper"):
        if abs(value := getattr(joint, key)) > farthest:
            yield (key,), f"{key} {value:g}", f"exceeds {farthest:g}, the greatest in any unit"
    if fast:
        reason = f"no joint exceeds {fastest:g} {units['velocity']}: a placeholder or another unit"
        yield ("velocity",), f"velocity {joint.velocity:g} {units['velocity']}", reason
    effort = f"effort {joint.effort:g} {units['effort']}"
    if joint.effort > MAX_TORQUE:
        reason = f"no joint exceeds {MAX_TORQUE:g} {units['effort']}: a placeholder or another unit"
        yield ("effort",), effort, reason
    elif joint.effort in efforts or (fast and joint.effort == joint.velocity):
        yield ("effort",), effort, "a placeholder"
