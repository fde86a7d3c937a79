"""What drives add to the torque of rigid bodies: springs, friction, current, as expressions.

The same equations as in `hil.model.motors`, `hil.model.added_parameters` and
`hil.friction.law`, for one sample.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, cast

import numpy as np

from hil.friction.direction import STILL
from hil.friction.terms import BEND, DIRECTED
from hil.friction.warmth import REFERENCE
from hil.model.added_parameters import added_inertias
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.export.expressions import Expression, Graph
    from hil.export.rigid_bodies import Scalar
    from hil.friction.law import AxisLaw, FrictionLaw
    from hil.model.robot import Robot
    from hil.results.model import Model


def added_values(model: Model) -> list[float]:
    """Value of each parameter that no link has, as the base parameters place them."""
    standard = base_parameters(model.robot).placement @ model.values
    values: list[float] = standard[10 * model.robot.n_joints :].tolist()
    return values


def identified_inertia(model: Model) -> Array:
    """Constant inertias that were identified beside the links', shape (n_joints, n_joints)."""
    return np.asarray(np.tensordot(added_values(model), added_inertias(model.robot), 1))


def springs(graph: Graph, model: Model, q: Sequence[Expression]) -> list[Scalar]:
    """Torques of springs and counterbalances at positions q."""
    stated = model.robot.file.springs or ()
    values = added_values(model)[-len(stated) :] if stated else []
    found: list[Scalar] = [0.0] * model.robot.n_joints
    shapes = {"cosine": "cos", "sine": "sin"}
    for spring, value in zip(stated, values, strict=True):
        at, name = spring.joint - 1, shapes.get(spring.shape)
        found[at] += value * (q[at] if name is None else graph.function(name, q[at]))
    return found


def friction(
    graph: Graph,
    robot: Robot,
    law: FrictionLaw,
    q: Sequence[Expression],
    qd: Sequence[Expression],
    load: Sequence[Expression],
    warmth: Sequence[Expression] | None = None,
) -> list[Scalar]:
    """Torques of friction and ripple; `load`: those of the rigid bodies."""
    found: list[Scalar] = []
    for axis, own in enumerate(law.axes):
        if own is None:
            found.append(0.0)
            continue
        level, other = _axis(graph, robot, own, axis, q[axis], qd[axis], load[axis])
        if warmth is not None and own.warmth is not None:
            # no further than was seen
            seen = _clipped(graph, warmth[axis], *own.warmth.seen)
            level = level * (1.0 + own.warmth.slope * (seen - own.warmth.reference))
        found.append(level + other)
    for (motor, joint, ratio), each in zip(robot.couplings, law.coupled, strict=True):
        turning = graph.function("sign", ratio * qd[joint] + qd[motor])
        coulomb, viscous = each.coulomb.value * turning, each.viscous.value * ratio
        found[motor] += coulomb + viscous * qd[joint]
        found[joint] += ratio * coulomb + viscous * qd[motor]
    return found


def warmth_rate(
    graph: Graph,
    law: FrictionLaw,
    qd: Sequence[Expression],
    warmth: Sequence[Expression],
) -> list[Scalar]:
    """Change of each axis's warmth in time; 0 where it is not identified."""
    found: list[Scalar] = []
    for each, speed, w in zip(law.axes, qd, warmth, strict=True):
        if each is None or each.warmth is None:
            found.append(0.0)
            continue
        own = each.warmth
        heating = graph.function("abs", speed) * (1.0 / (each.speed * REFERENCE * own.warming))
        found.append((graph.number(1.0) - w) * heating - w * (1.0 / own.cooling))
    return found


def shares_of_current(robot: Robot) -> list[list[float]] | None:
    """What each joint's torque takes of each motor's current [A/(N m)]; None where unknown."""
    if not np.isfinite([robot.torque_constant, robot.gear_ratio]).all():
        return None
    shares = np.linalg.inv(robot.motor_matrix.T) / robot.torque_constant[:, np.newaxis]
    rounded = np.where(np.abs(shares) < 1e-14 * np.abs(shares).max(), 0.0, shares)
    return cast("list[list[float]]", rounded.tolist())


def _axis(
    graph: Graph,
    robot: Robot,
    law: AxisLaw,
    axis: int,
    q: Expression,
    qd: Expression,
    load: Expression,
) -> tuple[Expression, Expression]:
    """Level of an axis's friction, which changes its sign with the direction, and the rest."""
    direction = graph.function("direction", qd * (1.0 / (STILL * law.speed)))
    u, level, other = qd * (1.0 / law.speed), graph.number(0.0), graph.number(0.0)
    if law.speeds is not None:
        speed = graph.function("abs", qd)
        known = _clipped(graph, speed, *law.speeds)
        u = direction * known * (1.0 / law.speed)
        level = direction * (speed - known) * law.slope
    shapes = {
        "offset": lambda: graph.number(1.0),
        "Coulomb": lambda: direction,
        "viscous": lambda: u,
        "asymmetric": lambda: graph.function("abs", u),
        "cube root": lambda: graph.function("cbrt", u),
        "arc tangent": lambda: graph.function("atan", u * (1.0 / BEND)),
        "quadratic": lambda: u * graph.function("abs", u),
        "load": lambda: graph.function("abs", load) * direction,
    }
    for term, value in law.terms.items():
        shape = shapes[term]() if term in shapes else _ripple(graph, robot, axis, term, q)
        if term in DIRECTED:
            level = level + value.value * shape
        else:
            other = other + value.value * shape
    return level, other


def _clipped(graph: Graph, x: Expression, low: float, high: float) -> Expression:
    """Return x within [low, high], of absolute values alone."""
    above, below = graph.function("abs", x - low), graph.function("abs", x - high)
    return (above - below + (low + high)) * 0.5


def _ripple(graph: Graph, robot: Robot, axis: int, term: str, q: Expression) -> Expression:
    """Ripple of one order over the motor's angle; none where that is unknown, as in the law."""
    ratio = float(np.nan_to_num(robot.gear_ratio[axis]))
    wave, order = re.fullmatch(r"(cosine|sine) (\d+)", term).groups()  # type: ignore[union-attr]
    if not ratio:
        return graph.number(0.0)
    name = {"cosine": "cos", "sine": "sin"}[wave]
    return graph.function(name, q * (ratio * int(order)))
