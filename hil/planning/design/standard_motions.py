"""Standard motions of each kind of measurement, as shares of the robot's limits.

Gravity is measured at a low constant velocity. A window lasts a second, because friction drifts
between forward and backward motion. A slow axis gets a longer window, to cover `GRAVITY_STROKE`, a
distance over which torque ripple and encoder error average out. Inertias are measured with the
largest acceleration that leaves room for the load; couplings with a creeping axis while its partner
accelerates. Ramps shorter than `INERTIA_RAMP` hold too few samples at slow SYNC.

In a short range an axis moves slowly enough for ramps and constant velocity to fit. Below `SLOWEST`
of its velocity limit the estimator uses no samples, so a slower motion is refused.

Measurements of the same axis differ slightly in stroke and acceleration, so that the corners of
their profiles fall anywhere between two samples. Strokes begin with a SYNC. With equal profiles
every corner would come at the same instant after a SYNC, and the sampling error would bias the
delay of the torque, by 0.08 ms of 4 ms, instead of averaging out.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from hil.friction.equation import SLOW
from hil.planning.strokes import MARGIN, SHORTEST_WINDOW, Partner

if TYPE_CHECKING:
    from hil.model.robot import Robot

GRAVITY_SPEED, GRAVITY_TIME, GRAVITY_STROKE = 0.10, (1.0, 2.0), 0.3
"""Share of the speed limit; shortest and longest window [s]; minimum distance covered in a window
[rad].
"""
INERTIA_SPEED, INERTIA_ACCELERATION, INERTIA_RAMP, INERTIA_CYCLES = 0.9, 0.6, 0.15, 6
"""Shares of the limits, shortest ramp [s], and cycles."""
RAMPS = 3
"""Stroke of an inertia measurement in ramp lengths: two ramps and constant velocity."""
LONGEST_STROKE = 1.0
"""Longest stroke, so that a measurement stays close to its configuration [rad]."""
SLOWEST = 1.1 * SLOW
"""Lowest speed of a reading, as share of the speed limit."""
CREEP_SPEED, CREEP_TIME, CREEP_CYCLES = 0.08, 7.0, 2
"""Share of the speed limit (unless the range is short), duration [s], cycles."""
RAMP_OF_CREEP = 0.2
"""Duration of a ramp to constant velocity, unless the acceleration limit prolongs it [s]."""
STEEPEST = 0.99
"""Maximum share of the acceleration limit in a ramp to constant velocity; plans round numbers."""
SHORTEST_CRUISE = 1.2 * (MARGIN + SHORTEST_WINDOW)
"""Minimum duration of constant velocity for short ranges [s]."""
SPREAD = 0.012
"""Time over which the profiles' corners are spread between measurements and cycles [s]: the longest
usual SYNC period."""
_PLASTIC = sum(((9 + sign * math.sqrt(69)) / 18) ** (1 / 3) for sign in (1, -1))  # x^3 = x + 1
SEQUENCE = (1 / _PLASTIC, 1 / _PLASTIC**2)
"""Steps of Roberts's two-dimensional low-discrepancy sequence: acceleration, stroke."""


def gravity_motion(robot: Robot, axis: int) -> dict[str, Any]:
    """Return stroke, velocity, acceleration and cycles of a gravity measurement; `axis` from 0.

    Raises
    ------
    ValueError
        The range is too short for constant velocity.
    """
    limit, room = float(robot.velocity_limit[axis]), _room(robot, axis)
    velocity = GRAVITY_SPEED * limit
    shortest, longest = GRAVITY_TIME
    window = min(max(GRAVITY_STROKE / velocity, shortest), longest)
    longer = _ramp(robot, axis, velocity) - RAMP_OF_CREEP
    stroke = min(velocity * (window + longer), max(LONGEST_STROKE, velocity * longer), room)
    velocity = min(velocity, _cruising(robot, axis, stroke))
    _refuse_slow(robot, axis, velocity, f"gravity, in strokes of {stroke:.3g}")
    return {
        "stroke": stroke,
        "velocity": velocity,
        "acceleration": velocity / _ramp(robot, axis, velocity),
        # total window per direction of at least 5 s
        "cycles": math.ceil(5.0 / window),
    }


def inertia_motion(robot: Robot, axis: int, number: int = 0) -> dict[str, Any]:
    """Return the motion of inertia measurement `number` of an axis; 0 has the longest stroke.

    Raises
    ------
    ValueError
        The range is too short for ramps.
    """
    velocity = INERTIA_SPEED * float(robot.velocity_limit[axis])
    limit, room = INERTIA_ACCELERATION * float(robot.acceleration_limit[axis]), _room(robot, axis)
    if room < min(RAMPS * velocity * max(velocity / limit, INERTIA_RAMP) / 2, LONGEST_STROKE):
        shared = room / RAMPS
        velocity = min(velocity, math.sqrt(2 * limit * shared), 2 * shared / INERTIA_RAMP)
        _refuse_slow(robot, axis, velocity / 2, f"an inertia, in strokes of {room:.3g}")
    acceleration = min(limit, velocity / INERTIA_RAMP)
    ramp = velocity**2 / (2 * acceleration)
    # the first corner is up to SPREAD later, the second up to SPREAD earlier
    later, earlier = (SPREAD * (number * step % 1.0) for step in SEQUENCE)
    return {
        "stroke": min(RAMPS * ramp, LONGEST_STROKE, room) - velocity * earlier,
        "velocity": velocity,
        "acceleration": velocity / (velocity / acceleration + later),
        "cycles": INERTIA_CYCLES,
        "spread": SPREAD,
    }


def creep_motion(robot: Robot, axis: int) -> dict[str, Any]:
    """Return the motion of the creeping axis in a coupling measurement."""
    limit, room = float(robot.velocity_limit[axis]), _room(robot, axis)
    velocity = min(max(room / CREEP_TIME, SLOWEST * limit), CREEP_SPEED * limit)
    return {
        "stroke": min(velocity * CREEP_TIME, 1.7, room),  # 1.7 rad at most
        "velocity": velocity,
        "acceleration": velocity / _ramp(robot, axis, velocity),
        "cycles": CREEP_CYCLES,
    }


def partner_motion(robot: Robot, axis: int, number: int = 0) -> Partner:
    """Return the motion of the partner in coupling measurement `number` of a pair."""
    motion = inertia_motion(robot, axis, number)
    return Partner(
        axis=axis + 1,
        stroke=motion["stroke"],
        velocity=motion["velocity"],
        acceleration=motion["acceleration"],
    )


def _ramp(robot: Robot, axis: int, velocity: float) -> float:
    """Return the duration of a ramp to constant velocity [s]."""
    return max(velocity / (STEEPEST * float(robot.acceleration_limit[axis])), RAMP_OF_CREEP)


def _cruising(robot: Robot, axis: int, stroke: float) -> float:
    """Compute the highest velocity held for `SHORTEST_CRUISE` in a stroke."""
    limit = STEEPEST * float(robot.acceleration_limit[axis])
    steep = SHORTEST_CRUISE * limit / 2
    # stroke = velocity (cruise + ramp); the ramp lasts velocity / limit or RAMP_OF_CREEP
    return min(
        math.sqrt(steep**2 + limit * stroke) - steep, stroke / (SHORTEST_CRUISE + RAMP_OF_CREEP)
    )


def _refuse_slow(robot: Robot, axis: int, velocity: float, what: str) -> None:
    """Refuse motions too slow for the estimator to use any sample.

    Raises
    ------
    ValueError
    """
    unit, least = robot.position_unit(axis), SLOWEST * float(robot.velocity_limit[axis])
    if velocity < least:
        raise ValueError(
            f"axis {axis + 1} reaches {velocity:.2g} {unit}/s in its range for {what} {unit}; it"
            f" must be at least {least:.2g} {unit}/s, {SLOWEST:.2g} of its velocity limit: widen"
            " the range, lower velocity_limit in the robot file, or plan a trajectory (hil plan"
            " --kind trajectory)"
        )


def _room(robot: Robot, axis: int) -> float:
    # at most half of a joint's range; the rest is for the choice of configurations
    return 0.5 * float(robot.q_max[axis] - robot.q_min[axis])
