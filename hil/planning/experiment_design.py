"""Choice of configurations and motions from g(q) and M(q), section 6.2.

What a measurement can tell is one row: that of the axis's gravity torque (and of a torque offset,
which only configurations of different gravity tell apart from it), of its moment of inertia, or of
the coupling inertia with its partner. The rows depend on few joints, found by moving one
joint at a time. Candidates spread these joints over their ranges by a low-discrepancy sequence and
leave the others in the middle; from the candidates of an element those are taken, one after the
other, that add most to the determinant of the group's information matrix (Fedorov's greedy
D-optimal choice). The elements share the number of measurements as their rows hold parameters.

In a guarded workspace only candidates count whose strokes keep clear of the forbidden boxes, and
the order is one in which the travels do (`hil.planning.guarded_tour`).

Every measurement of an axis begins at another angle of its motor, spread by the golden ratio:
torque ripple then averages out over the configurations instead of biasing all of them alike.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import qmc

from hil.model.base_parameters import base_parameters
from hil.model.dynamics import regressor
from hil.planning.clearance import are_clear
from hil.planning.guarded_paths import Strokes
from hil.planning.guarded_tour import guarded_tour
from hil.planning.measurement import Coupling, Gravity, Inertia, Partner
from hil.planning.plan import Plan, PlannedRobot, WarmUp
from hil.planning.timetable import travel_time
from hil.planning.workspace import narrowed

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.planning.workspace import Workspace

    Array = NDArray[np.float64]
    Row = Callable[[Array], Array]
    """Rows (n, n_parameters) at configurations (n, n_joints)."""

COUNTS = (64, 92, 9)
"""Configurations for gravity, diagonal and off-diagonal group: those of section 8."""
TRAVEL = 0.3
"""Share of the limits used between configurations."""

CANDIDATES = 512
RANGE = 0.95
"""Share of each joint's range that configurations use."""
SPACING = 0.06
"""Least distance between configurations in one joint at least, as part of its range."""
LEAST_SHARE = 4
"""Measurements that an element gets at least, however few parameters its row holds."""
GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0

GRAVITY_SPEED, GRAVITY_TIME, GRAVITY_CYCLES = 0.10, 2.0, 3
"""Share of the speed limit, duration of a window [s], back-and-forth motions."""
INERTIA_SPEED, INERTIA_ACCELERATION, INERTIA_RAMP, INERTIA_CYCLES = 0.7, 0.4, 0.15, 5
"""Shares of the limits, shortest ramp [s]."""
LONGEST_STROKE = 1.0
"""So that a measurement stays in the neighbourhood of its configuration [rad]."""
LONGEST_CREEP = 1.7
"""Way of a creeping axis [rad]."""
CREEP_SPEED, CREEP_TIME, CREEP_CYCLES = 0.08, 7.0, 2
RAMP_OF_CREEP = 0.2
"""Duration of a ramp to constant velocity [s]."""


def design(
    robot: Robot,
    counts: tuple[int, int, int] = COUNTS,
    warm_up: float = 0.0,
    workspace: Workspace | None = None,
) -> Plan:
    """Plan a campaign for `robot`.

    Parameters
    ----------
    robot : Robot
    counts : tuple of int
        Number of gravity, inertia and coupling measurements; a kind without parameters is left
        out.

    warm_up : float
        Motion before the first measurement; 0 for none [s].
    workspace : Workspace, optional
        What the arm must keep clear of; the plan carries it.

    Raises
    ------
    ValueError
        A count too small to tell the group's parameters apart, or no clear configurations.
    """
    groups = base_parameters(robot).groups
    for count, (group, columns) in zip(counts, groups.items(), strict=True):
        if count < len(columns):
            raise ValueError(
                f"{count} measurements for the {group} group must be at least {len(columns)}, one"
                f" for each of its parameters; raise that count"
            )
    guarded = narrowed(robot, workspace)
    measurements: list[Measurement] = []
    for choose, count, columns in zip(
        (_gravity, _inertia, _coupling), counts, groups.values(), strict=True
    ):
        measurements += choose(guarded, count, list(columns), workspace)
    if workspace:
        measurements = guarded_tour(guarded, workspace, measurements, TRAVEL)
    return Plan(
        robot=PlannedRobot(name=robot.name, digest=robot.digest),
        travel=TRAVEL,
        warm_up=WarmUp(duration=warm_up) if warm_up else None,
        workspace=workspace,
        measurements=tuple(measurements),
    )


def _gravity(
    robot: Robot, count: int, columns: list[int], workspace: Workspace | None
) -> list[Measurement]:
    if not columns:
        return []
    axes = np.flatnonzero(base_parameters(robot).dependencies.gravity.any(axis=1)).tolist()
    rows = {(i, i): _gravity_row(robot, i, axes, columns) for i in axes}
    strokes = {(i, i): {i: _gravity_motion(robot, i)["stroke"]} for i in axes}
    return [
        Gravity(id=f"g{k:02d}", axis=i + 1, q=tuple(q), **_gravity_motion(robot, i))
        for k, ((i, _), q) in enumerate(
            _configurations(robot, rows, strokes, count, workspace), start=1
        )
    ]


def _inertia(
    robot: Robot, count: int, columns: list[int], workspace: Workspace | None
) -> list[Measurement]:
    if not columns:
        return []
    mass = base_parameters(robot).dependencies.mass
    axes = [i for i in range(robot.n_joints) if mass[i, i, columns].any()]
    rows = {(i, i): _inertia_row(robot, i, i, columns) for i in axes}
    strokes = {(i, i): {i: _inertia_motion(robot, i)["stroke"]} for i in axes}
    return [
        Inertia(id=f"i{k:02d}", axis=i + 1, q=tuple(q), **_inertia_motion(robot, i))
        for k, ((i, _), q) in enumerate(
            _configurations(robot, rows, strokes, count, workspace), start=1
        )
    ]


def _coupling(
    robot: Robot, count: int, columns: list[int], workspace: Workspace | None
) -> list[Measurement]:
    if not columns:
        return []
    pairs = _pairs(robot, columns)
    rows = {pair: _inertia_row(robot, *pair, columns) for pair in pairs}
    strokes = {
        (j, i): {j: _creep_motion(robot, j)["stroke"], i: _inertia_motion(robot, i)["stroke"]}
        for j, i in pairs
    }
    return [
        Coupling(
            id=f"c{k:02d}",
            axis=j + 1,
            q=tuple(q),
            partner=_partner(robot, i),
            **_creep_motion(robot, j),
        )
        for k, ((j, i), q) in enumerate(
            _configurations(robot, rows, strokes, count, workspace), start=1
        )
    ]


def _pairs(robot: Robot, columns: list[int]) -> list[tuple[int, int]]:
    """Creeping and accelerated axis for every off-diagonal parameter.

    Of the elements that hold a parameter the one is taken whose torque stands out most: much
    acceleration on one side, little torque range (so little noise and friction) on the other.
    """
    mass = base_parameters(robot).dependencies.mass
    found = []
    for column in columns:
        elements = [(j, i) for j, i in np.argwhere(mass[:, :, column]).tolist() if i != j]
        found.append(
            max(elements, key=lambda e: robot.acceleration_limit[e[1]] / robot.torque_limit[e[0]])
        )
    return list(dict.fromkeys(found))


def _gravity_row(robot: Robot, axis: int, axes: list[int], columns: list[int]) -> Row:
    """Gravity torque, and the offset of each axis that must be told apart from it."""

    def row(q: Array) -> Array:
        still = np.zeros_like(q)
        gravity = regressor(robot, q, still, still)[:, axis, columns]
        offsets = np.zeros((len(q), len(axes)))
        offsets[:, axes.index(axis)] = robot.torque_limit[axis]
        return np.column_stack([gravity, offsets])

    return row


def _inertia_row(robot: Robot, axis: int, accelerated: int, columns: list[int]) -> Row:
    def row(q: Array) -> Array:
        still, unit = np.zeros_like(q), np.zeros_like(q)
        unit[:, accelerated] = 1.0
        moving = regressor(robot, q, still, unit) - regressor(robot, q, still, still)
        return moving[:, axis, columns]

    return row


def _configurations(
    robot: Robot,
    rows: dict[tuple[int, int], Row],
    strokes: dict[tuple[int, int], dict[int, float]],
    count: int,
    workspace: Workspace | None,
) -> list[tuple[tuple[int, int], list[float]]]:
    """Axes (torque read, accelerated) and configuration of `count` measurements, in order."""
    candidates = {axes: _candidates(robot, strokes[axes], row) for axes, row in rows.items()}
    if workspace:
        candidates = {
            axes: _clear(robot, workspace, strokes[axes], q) for axes, q in candidates.items()
        }
    weighted = {axes: rows[axes](candidates[axes]) / robot.torque_limit[axes[0]] for axes in rows}
    scale = np.sqrt(np.mean(np.concatenate(list(weighted.values())) ** 2, axis=0))
    covariance = 1e3 * np.eye(len(scale))
    chosen: list[tuple[tuple[int, int], list[float]]] = []
    for axes, share in _shares(weighted, count).items():
        places = _places(robot, candidates[axes])
        picked = _greedy(weighted[axes] / scale, places, covariance, share)
        for k, index in enumerate(picked, start=1):
            q = candidates[axes][index].copy()
            for i in set(axes):
                q[i] += (k * GOLDEN % 1.0 - 0.5) * math.tau / robot.gear_ratio[i]
            chosen.append((axes, q.tolist()))
    return _tour(robot, chosen)


def _shares(rows: dict[tuple[int, int], Array], count: int) -> dict[tuple[int, int], int]:
    """Divide `count` among the elements in proportion to the parameters that their rows hold."""
    held = {i: max(1, int(np.any(np.abs(r) > 1e-12, axis=0).sum())) for i, r in rows.items()}
    least = min(LEAST_SHARE, count // len(held))
    spare = count - least * len(held)
    total = sum(held.values())
    exact = {i: spare * h / total for i, h in held.items()}
    shares = {i: least + int(e) for i, e in exact.items()}
    for i in sorted(exact, key=lambda j: int(exact[j]) - exact[j])[: count - sum(shares.values())]:
        shares[i] += 1
    return shares


def _greedy(rows: Array, places: Array, covariance: Array, count: int) -> list[int]:
    """Choose `count` rows, each the one that then adds most to det(information).

    Candidates close to a chosen one are passed over while there are others, so that the
    measurements show a dependence on the configuration that the model lacks. `covariance`, the
    inverse of the information so far, is updated in place.
    """
    left = np.ones(len(rows), dtype=bool)
    picked: list[int] = []
    for _ in range(count):
        if not left.any():
            left[:] = True
        gain = np.einsum("ij,jk,ik->i", rows, covariance, rows)
        best = int(np.argmax(np.where(left, gain, -1.0)))
        direction = covariance @ rows[best]
        covariance -= np.outer(direction, direction) / (1.0 + gain[best])
        left &= np.abs(places - places[best]).max(axis=1, initial=0.0) > SPACING
        picked.append(best)
    return picked


def _places(robot: Robot, candidates: Array) -> Array:
    """Configurations in parts of the joints' ranges, without the joints that all share."""
    varied = np.ptp(candidates, axis=0) > 0
    places: Array = (candidates / (robot.q_max - robot.q_min))[:, varied]
    return places


def _candidates(robot: Robot, strokes: dict[int, float], row: Row) -> Array:
    """Spread the joints that `row` depends on over their ranges, the others stay in the middle."""
    middle = (robot.q_min + robot.q_max) / 2
    half = RANGE * (robot.q_max - robot.q_min) / 2
    for i, stroke in strokes.items():
        half[i] = max(half[i] - stroke / 2, 0.0)
    joints = _influencing(row, middle, half)
    q = np.tile(middle, (CANDIDATES, 1))
    if joints:
        points = qmc.Halton(len(joints), scramble=False).random(CANDIDATES + 1)[1:]
        q[:, joints] = middle[joints] + (2 * points - 1) * half[joints]
    return q


def _clear(robot: Robot, workspace: Workspace, strokes: dict[int, float], q: Array) -> Array:
    """Candidates whose strokes keep clear of all boxes, whatever the motors' angles."""
    half = np.zeros(robot.n_joints)
    for i, stroke in strokes.items():
        half[i] = stroke / 2 + math.pi / robot.gear_ratio[i]
    clear = q[are_clear(robot, workspace, Strokes(q - half, q + half))]
    if not len(clear):
        axes = " and ".join(str(i + 1) for i in strokes)
        raise ValueError(
            f"no configuration with axis {axes} in motion keeps clear of the workspace's boxes;"
            " make boxes or margin smaller"
        )
    return clear


def _influencing(row: Row, middle: Array, half: Array) -> list[int]:
    """Joints whose angle changes the row."""
    n = len(middle)
    base = middle + half * qmc.Halton(n, scramble=False).random(17)[1:]
    before = row(base)
    scale = np.abs(before).max()
    found = []
    for joint in range(n):
        moved = base.copy()
        moved[:, joint] -= 0.7 * half[joint]
        if np.abs(row(moved) - before).max() > 1e-9 * scale:
            found.append(joint)
    return found


def _tour(
    robot: Robot, chosen: Sequence[tuple[tuple[int, int], list[float]]]
) -> list[tuple[tuple[int, int], list[float]]]:
    """Order by nearest neighbour in travel time, beginning nearest to the middle of the ranges."""
    here: list[float] = ((robot.q_min + robot.q_max) / 2).tolist()
    left, tour = list(chosen), []
    while left:
        nearest = min(left, key=lambda item: travel_time(robot, here, item[1], TRAVEL))
        left.remove(nearest)
        tour.append(nearest)
        here = nearest[1]
    return tour


def _gravity_motion(robot: Robot, axis: int) -> dict[str, Any]:
    velocity = GRAVITY_SPEED * float(robot.velocity_limit[axis])
    return {
        "stroke": min(velocity * GRAVITY_TIME, LONGEST_STROKE),
        "velocity": velocity,
        "acceleration": velocity / RAMP_OF_CREEP,
        "cycles": GRAVITY_CYCLES,
    }


def _inertia_motion(robot: Robot, axis: int) -> dict[str, Any]:
    velocity = INERTIA_SPEED * float(robot.velocity_limit[axis])
    limit = INERTIA_ACCELERATION * float(robot.acceleration_limit[axis])
    acceleration = min(limit, velocity / INERTIA_RAMP)
    ramp = velocity**2 / (2 * acceleration)
    return {
        "stroke": min(3 * ramp, LONGEST_STROKE),
        "velocity": velocity,
        "acceleration": acceleration,
        "cycles": INERTIA_CYCLES,
    }


def _partner(robot: Robot, axis: int) -> Partner:
    motion = _inertia_motion(robot, axis)
    return Partner(
        axis=axis + 1,
        stroke=motion["stroke"],
        velocity=motion["velocity"],
        acceleration=motion["acceleration"],
    )


def _creep_motion(robot: Robot, axis: int) -> dict[str, Any]:
    velocity = CREEP_SPEED * float(robot.velocity_limit[axis])
    return {
        "stroke": min(velocity * CREEP_TIME, LONGEST_CREEP),
        "velocity": velocity,
        "acceleration": velocity / RAMP_OF_CREEP,
        "cycles": CREEP_CYCLES,
    }
