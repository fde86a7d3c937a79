"""Measurable elements of g(q) and M(q), with configurations and motions to measure them.

A measurement determines one row: of the axis's gravity torque (and of a torque offset,
distinguishable only by configurations of different gravity), of its moment of inertia, or of the
coupling inertia with its partner. The rows depend on few joints, found by moving one joint at a
time. Candidates spread these joints over their ranges by a low-discrepancy sequence and leave the
others at mid-range. In a guarded workspace only candidates with clear strokes count.

Successive measurements of an axis start at motor angles spread by the golden ratio: torque ripple
then averages out over the configurations instead of biasing all of them alike. The corners of the
motion profiles fall at different instants between two samples for the same reason.

Motions are shares of the robot's limits. Gravity is measured at a low constant velocity. A window
lasts a second, because friction drifts between forward and backward motion. A slow axis gets a
longer window, to cover `GRAVITY_STROKE`, a distance over which torque ripple and encoder error
average out. Inertias are measured with the largest acceleration that leaves room for the load;
couplings with a creeping axis while its partner accelerates. Ramps shorter than `INERTIA_RAMP` hold
too few samples at slow SYNC.

In a short range an axis moves slowly enough for ramps and constant velocity to fit. Below `SLOWEST`
of its velocity limit the estimator uses no samples, so a slower motion is refused.

Measurements of the same axis differ slightly in stroke and acceleration, so that the corners of
their profiles fall anywhere between two samples. Strokes begin with a SYNC. With equal profiles
every corner would come at the same instant after a SYNC, and the sampling error would bias the
delay of the torque, by 0.08 ms of 4 ms, instead of averaging out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.friction.equation import SLOW
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import regressor
from hil.planning.halton import GOLDEN, halton
from hil.planning.measurement import Coupling, Gravity, Inertia
from hil.planning.strokes import MARGIN, SHORTEST_WINDOW, Partner
from hil.planning.timetable import JointBoxes
from hil.planning.workspace import are_clear

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.measurement import ElementMeasurement
    from hil.planning.workspace import Workspace

    Row = Callable[[Array], Array]
    """Function from configurations (n, n_joints) to rows (n, n_parameters)."""


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
    # the highest velocity held for SHORTEST_CRUISE in a stroke
    limit = STEEPEST * float(robot.acceleration_limit[axis])
    steep = SHORTEST_CRUISE * limit / 2
    # stroke = velocity (cruise + ramp); the ramp lasts velocity / limit or RAMP_OF_CREEP
    held = math.sqrt(steep**2 + limit * stroke) - steep, stroke / (SHORTEST_CRUISE + RAMP_OF_CREEP)
    velocity = min(velocity, *held)
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
    return max(velocity / (STEEPEST * float(robot.acceleration_limit[axis])), RAMP_OF_CREEP)


def _refuse_slow(robot: Robot, axis: int, velocity: float, what: str) -> None:
    """Refuse motions too slow for the estimator to use any sample."""
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


CANDIDATES = 512
RANGE = 0.95
"""Share of each joint's range used for configurations."""


@dataclass(frozen=True, eq=False)
class Element:
    """Element of g(q) or M(q) that shows parameters of a group.

    Attributes
    ----------
    axis, accelerated : int
        Axis whose torque is read, and accelerated axis, from 0; equal except for coupling.
    strokes : dict
        Distance of each moving axis [rad].
    row : callable
        Function from configurations to rows over the group's parameters.
    measure : callable
        Function from id, configuration and number (from 1) to a measurement of this element.
    """

    axis: int
    accelerated: int
    strokes: dict[int, float]
    row: Row
    measure: Callable[[str, Sequence[float], int], ElementMeasurement]
    like_offset: bool = False
    """True for a constant element, which cannot be distinguished from a torque offset."""

    @property
    def axes(self) -> tuple[int, int]:
        """Read axis and accelerated axis."""
        return self.axis, self.accelerated

    def turn_motors(self, robot: Robot, q: Array, number: int) -> list[float]:
        """Return configuration `q` for measurement `number` (from 1), with shifted motor angles."""
        moved = q.copy()
        for i in set(self.axes):
            moved[i] += (number * GOLDEN % 1.0 - 0.5) * _turn(robot, i)
        found: list[float] = moved.tolist()
        return found


def gravity_elements(robot: Robot, columns: list[int]) -> list[Element]:
    """Return axes whose gravity torque shows the base parameters `columns`."""
    if not columns:
        return []
    axes = np.flatnonzero(base_parameters(robot).dependencies.gravity.any(axis=1)).tolist()

    def element(i: int) -> Element:
        motion = gravity_motion(robot, i)

        def row(q: Array) -> Array:
            """Return rows of the gravity torque, with columns for the torque offset per axis."""
            still = np.zeros_like(q)
            gravity = regressor(robot, q, still, still, joints=[i])[:, 0, columns]
            offsets = np.zeros((len(q), len(axes)))
            offsets[:, axes.index(i)] = robot.torque_limit[i]
            return np.column_stack([gravity, offsets])

        return Element(
            i, i, {i: motion["stroke"]}, row,
            lambda name, q, _: Gravity(id=name, axis=i + 1, q=tuple(q), **motion),
            like_offset=True,
        )  # fmt: skip

    return [element(i) for i in axes]


def inertia_elements(robot: Robot, columns: list[int]) -> list[Element]:
    """Return diagonal elements of M that show the base parameters `columns`."""
    mass = base_parameters(robot).dependencies.mass

    def element(i: int) -> Element:
        motion = inertia_motion(robot, i)
        return Element(
            i, i, {i: motion["stroke"]}, _inertia_row(robot, i, i, columns),
            lambda name, q, number: Inertia(
                id=name, axis=i + 1, q=tuple(q), **inertia_motion(robot, i, number)
            ),
        )  # fmt: skip

    return [element(i) for i in range(robot.n_joints) if mass[i, i, columns].any()]


def _coupling_elements(robot: Robot, columns: list[int]) -> list[Element]:
    """Return an off-diagonal element of M per base parameter in `columns`; refuse short ranges."""
    middle = (robot.q_min + robot.q_max) / 2

    def element(j: int, i: int) -> Element:
        creep, partner = creep_motion(robot, j), partner_motion(robot, i)

        def measure(name: str, q: Sequence[float], number: int) -> Coupling:
            other = partner_motion(robot, i, number)
            return Coupling(id=name, axis=j + 1, q=tuple(q), partner=other, **creep)

        tried = measure("c", middle.tolist(), 0)
        if tried.cruise and tried.lacking:
            left = tried.cruise.duration - tried.lacking
            unit = robot.position_unit(j)
            raise ValueError(
                f"axis {j + 1} can creep for {left:.2g} s in {creep['stroke']:.3g} {unit}, must "
                f"be at least {tried.cruise.duration:.2g} s while axis {i + 1} goes back and "
                "forth: strokes cannot show this coupling; widen the range, or plan a trajectory "
                "(hil plan --kind trajectory)"
            )
        strokes = {j: creep["stroke"], i: partner.stroke}
        return Element(j, i, strokes, _inertia_row(robot, j, i, columns), measure)

    # of the elements with a parameter, the one with the clearest torque: the accelerated axis is
    # fast, and the creeping axis has a small torque limit, so little noise and friction
    mass, pairs = base_parameters(robot).dependencies.mass, []
    for column in columns:
        elements = [(j, i) for j, i in np.argwhere(mass[:, :, column]).tolist() if i != j]
        pairs.append(
            max(elements, key=lambda e: robot.acceleration_limit[e[1]] / robot.torque_limit[e[0]])
        )
    return [element(j, i) for j, i in dict.fromkeys(pairs)]


ELEMENTS: dict[str, Callable[[Robot, list[int]], list[Element]]] = {
    "gravity": gravity_elements,
    "inertia": inertia_elements,
    "coupling": _coupling_elements,
}
"""Functions from base parameters to elements, by kind of measurement."""


def candidates(robot: Robot, element: Element, workspace: Workspace | None) -> Array:
    """Return configurations suitable for measuring `element`, shape (n, n_joints).

    Raises
    ------
    ValueError
        No configuration keeps clear of the workspace's boxes.
    """
    # spread the joints that affect `row` over the ranges; keep the rest at mid-range; of a tree
    # one branch at a time is spread: an element is a sum of terms of each branch
    middle = (robot.q_min + robot.q_max) / 2
    half = RANGE * (robot.q_max - robot.q_min) / 2
    for i, stroke in element.strokes.items():
        beyond = (1 - RANGE) * (robot.q_max[i] - robot.q_min[i]) / 2
        half[i] -= stroke / 2 + max(_turn(robot, i) / 2 - beyond, 0.0)
    # the joints whose angle changes the row
    n = len(middle)
    base = middle + half * halton(16, n)
    moved = np.tile(base, (n + 1, 1, 1))
    for joint in range(n):
        moved[joint, :, joint] -= 0.7 * half[joint]
    rows = element.row(moved.reshape(-1, n)).reshape(n + 1, len(base), -1)
    change = np.abs(rows[:n] - rows[n]).max(axis=(1, 2))
    joints = np.flatnonzero(change > 1e-9 * np.abs(rows[n]).max()).tolist()
    q = np.tile(middle, (CANDIDATES, 1))
    if joints:
        points = halton(CANDIDATES, len(joints))
        q[:, joints] = middle[joints] + (2 * points - 1) * half[joints]
    for number, branch in enumerate(robot.branches):
        others = [joint for joint in joints if joint not in branch]
        q[number :: len(robot.branches), others] = middle[others]
    if workspace is None:
        return q
    # strokes clear of the boxes at any motor angle
    reach = np.zeros(n)
    for i, stroke in element.strokes.items():
        reach[i] = stroke / 2 + _turn(robot, i) / 2
    clear = q[are_clear(robot, workspace, JointBoxes(q - reach, q + reach))]
    if not len(clear):
        axes = " and ".join(str(i + 1) for i in element.strokes)
        raise ValueError(
            f"no configuration with axis {axes} in motion keeps clear of the workspace's boxes;"
            " make boxes or margin smaller"
        )
    return clear


def _inertia_row(robot: Robot, axis: int, accelerated: int, columns: list[int]) -> Row:
    def row(q: Array) -> Array:
        still, unit = np.zeros_like(q), np.zeros_like(q)
        unit[:, accelerated] = 1.0
        moving, at_rest = (regressor(robot, q, still, qdd, joints=[axis]) for qdd in (unit, still))
        return (moving - at_rest)[:, 0, columns]

    return row


def _turn(robot: Robot, axis: int) -> float:
    """Return the range over which motor angles are spread: a turn, if possible."""
    # at most a fifth of the range
    most = 0.2 * float(robot.q_max[axis] - robot.q_min[axis])
    return min(math.tau / float(robot.gear_ratio[axis]), most)
