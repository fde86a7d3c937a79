"""Exported functions of a model, independent of the language: names, arguments, results.

The functions correspond to those of `hil.results.model.Model`, evaluate one sample at a time, and
give the same numbers.

Frames of the robot are expressions, and the Newton-Euler recursion gives the equations. Bodies are
those on which base parameters are placed (`hil.model.base_parameters`): torques are right for any
estimate, even with physically impossible single links.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from hil.export.expressions import Expression, Graph, count
from hil.friction.direction import STEP, STILL
from hil.friction.law import SLOWEST
from hil.friction.terms import BEND, DIRECTED
from hil.friction.warmth import REFERENCE
from hil.model.added_parameters import added_inertias
from hil.model.base_parameters import base_parameters
from hil.model.frames import cos_sin
from hil.model.newton_euler import Joint, rigid_bodies
from hil.results.identified_robot import known_friction
from hil.results.samples import known_warmth

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.export.expressions import Count
    from hil.friction.law import AxisLaw
    from hil.model.robot import Robot
    from hil.results.model import Model


Vector = list[Expression]
At = tuple[int, Expression, Expression, Expression]
"""Axis (from 0) with its position, velocity and load."""


class Function(NamedTuple):
    """Exported function.

    Attributes
    ----------
    purpose : str
        Description, one sentence.
    arguments : dict of str to str
        Names and descriptions; arrays with one value per joint.
    results : tuple of Expression
        One per joint, or the rows of a square matrix one after the other.
    """

    name: str
    purpose: str
    arguments: dict[str, str]
    results: tuple[Expression, ...]


ARGUMENTS = {
    "q": "positions",
    "qd": "velocities",
    "qdd": "accelerations",
    "load": "torques of the rigid bodies",
    "warmth": "warmth of the gears",
    "tau": "torques of the drives",
    "before": "positions of the previous call",
    "turned": "directions of friction",
    "later": "directions of friction by a longer presliding distance",
    "sooner": "directions of friction by a shorter presliding distance",
}
MEMORY = ("before", "turned", "later", "sooner")
"""Arguments of `stateful_dynamics` with values kept between calls; 0 before the first motion."""
PARTS = ("gravity", "rigid_bodies", "friction", "torque")
"""Results of `stateful_dynamics`, one per joint; the new directions follow."""
WEIGHTLESS = (0.0, 0.0, 0.0)


def functions(model: Model) -> tuple[Function, ...]:
    """Return the functions with all required model parts identified."""
    has_friction = len(model.axes_without_friction) < model.robot.n_joints
    lack = ", ".join(map(str, model.axes_without_friction))
    known = f" (unknown and left out for axis {lack})" if lack else ""
    parts = f"rigid bodies, motors{f' and friction{known}' if has_friction else '; no friction'}"
    found = [
        _made(model, "gravity", "Gravity torques g(q), with springs where there are any.", "q"),
        rigid(model),
        _made(
            model, "mass_matrix",
            "Mass matrix M(q) of the rigid bodies, row by row; motors add to its diagonal.", "q",
        ),
    ]  # fmt: skip
    if has_friction:
        purpose = f"Torques of friction{known}; at rest only the offset."
        found.append(_made(model, "friction", purpose, "q", "qd", "load"))
    if has_friction and any(known_warmth(model)):
        purpose = "Torques of friction at a warmth of the gears from 0 cold to 1 warm."
        found.append(_made(model, "friction_at_warmth", purpose, "q", "qd", "load", "warmth"))
        purpose = "Change of the warmth in time [1/s]; 0 where it is not identified. Begin at 0,"
        found.append(_made(model, "warmth_rate", f"{purpose} cold.", "qd", "warmth"))
    found.append(_made(model, "torque", f"Torques of the drives: {parts}.", "q", "qd", "qdd"))
    if shares_of_current(model.robot) is not None:
        found.append(
            _made(model, "current", "Motor currents [A] for torques of the drives.", "tau")
        )
    return tuple(found)


def rigid(model: Model) -> Function:
    """Return the function for the torques of the rigid bodies."""
    purpose = "Torques of the rigid bodies: M(q) qdd + c(q, qd) + g(q)."
    return _made(model, "rigid_bodies", purpose, "q", "qd", "qdd")


def regressor(model: Model) -> Function:
    """Return the function for the derivatives of the torques by the base parameters."""
    purpose = "Torques of the rigid bodies at constant speed per base parameter, axis by axis."
    return _made(model, "regressor", purpose, "q", "qd")


def stateful_dynamics(model: Model) -> Function:
    """Return the function for the `PARTS`, with the direction of friction as a state.

    Presliding is included: called at successive samples of a motion, the function gives the torques
    of `Model.predict` for the whole motion. Results: `PARTS`, then the `MEMORY` of the next call
    without the positions.
    """
    purpose = "Torques of the drives along a motion; friction reverses over its presliding distance"
    return _made(model, "dynamics", f"{purpose}.", "q", "qd", "qdd", *MEMORY)


def _made(model: Model, name: str, purpose: str, *arguments: str) -> Function:
    """Run the equations of a function of `_Equations` with symbols in place of numbers."""
    graph, joint_numbers = Graph(), range(model.robot.n_joints)
    symbols = [[graph.symbol(f"{each}[{k}]") for k in joint_numbers] for each in arguments]
    results = getattr(_Equations(graph, model), name)(*symbols)
    stated = {each: ARGUMENTS[each] for each in arguments}
    return Function(name, purpose, stated, tuple(graph.lift(each) for each in results))


class _Equations:
    """Equations of the functions, one method per function; arguments as in `ARGUMENTS`.

    The equations are those of `hil.model.motors`, `hil.model.added_parameters` and
    `hil.friction.law`, for one sample.
    """

    def __init__(self, graph: Graph, model: Model) -> None:
        robot, n = model.robot, model.robot.n_joints
        standard = base_parameters(robot).placement @ model.values
        self._graph, self._model, self._robot = graph, model, robot
        # parameters of each link equivalent to the base parameters, then the added parameters
        self._bodies: list[list[float]] = standard[: 10 * n].reshape(n, 10).tolist()
        self._added: list[float] = standard[10 * n :].tolist()
        self._constant = np.tensordot(standard[10 * n :], added_inertias(robot), 1).tolist()

    def gravity(self, q: Vector) -> list[Scalar]:
        still = [0.0] * len(q)
        return self.rigid_bodies(q, still, still)

    def rigid_bodies(self, q: Vector, qd: Sequence[Scalar], qdd: Sequence[Scalar]) -> list[Scalar]:
        """Return the torques of the rigid bodies, with rotor inertias and springs."""
        chain = joints(self._graph, self._robot, q)
        found = rigid_bodies(chain, self._bodies, qd, qdd, self._robot.gravity.tolist())
        # springs and counterbalances are the last of the added parameters
        stated = self._robot.file.springs or ()
        springs: list[Scalar] = [0.0] * len(q)
        shapes = {"cosine": "cos", "sine": "sin"}
        first = len(self._added) - len(stated)
        for spring, value in zip(stated, self._added[first:], strict=True):
            at, name = spring.joint - 1, shapes.get(spring.shape)
            springs[at] += value * (q[at] if name is None else self._graph.function(name, q[at]))
        return [
            tau + spring + sum((H * dv for H, dv in zip(row, qdd, strict=True)), start=0.0)
            for tau, spring, row in zip(found, springs, self._constant, strict=True)
        ]

    def regressor(self, q: Vector, qd: Vector) -> list[Scalar]:
        """Return the torques for unit values of single base parameters, without acceleration."""
        still = [0.0] * len(q)
        units = (replace(self._model, values=unit) for unit in np.eye(len(self._model.values)))
        columns = [_Equations(self._graph, each).rigid_bodies(q, qd, still) for each in units]
        return [column[axis] for axis in range(len(q)) for column in columns]

    def mass_matrix(self, q: Vector) -> list[Scalar]:
        n = len(q)
        still, chain = [0.0] * n, joints(self._graph, self._robot, q)
        columns = []
        for j in range(n):
            unit = [float(k == j) for k in range(n)]
            found = rigid_bodies(chain, self._bodies, still, unit, WEIGHTLESS)
            columns.append([value + self._constant[i][j] for i, value in enumerate(found)])
        return [columns[max(i, j)][min(i, j)] for i in range(n) for j in range(n)]

    def friction(
        self,
        q: Vector,
        qd: Vector,
        load: Vector,
        warmth: Vector | None = None,
        directions: Sequence[Vector] | None = None,
    ) -> list[Scalar]:
        """Return friction and ripple.

        `load`: torques of the rigid bodies; `directions`: of friction, by the presliding distance
        and by a longer and a shorter one.
        """
        law, graph = known_friction(self._model), self._graph
        found: list[Scalar] = []
        for axis, own in enumerate(law.axes):
            if own is None:
                found.append(0.0)
                continue
            at = axis, q[axis], qd[axis], load[axis]
            if directions is None or not own.presliding:
                u = qd[axis] * (1.0 / (STILL * own.speed))
                level, other = self._axis(own, at, *2 * (graph.function("direction", u),))
            else:
                one, (turned, later, sooner) = (
                    graph.number(1.0),
                    (each[axis] for each in directions),
                )
                level, other = self._axis(own, at, turned, graph.function("sign", turned))
                level = level + (later - sooner) * (own.bend.value / (2.0 * math.log(STEP)))
                # bounded by its value in sliding, as in `hil.friction.law.friction_torque`
                speed = graph.function("abs", qd[axis])
                slowest = own.speeds[0] if own.speeds else SLOWEST * own.speed
                a, b = (
                    graph.function("abs", self._axis(own, (*at[:2], sliding, at[3]), one, one)[0])
                    for sliding in (speed, self._larger(speed, graph.number(slowest)))
                )
                most = self._larger(a, b)
                above, below = (
                    graph.function("abs", each) for each in (level + most, level - most)
                )
                level = (above - below) * 0.5
            if warmth is not None and own.warmth is not None:
                # clipped to the observed range
                seen = self._clipped(warmth[axis], *own.warmth.seen)
                level = level * (1.0 + own.warmth.slope * (seen - own.warmth.reference))
            found.append(level + other)
        for (motor, joint, ratio), each in zip(self._robot.couplings, law.coupled, strict=True):
            turning = graph.function("sign", ratio * qd[joint] + qd[motor])
            coulomb, viscous = each.coulomb.value * turning, each.viscous.value * ratio
            found[motor] += coulomb + viscous * qd[joint]
            found[joint] += ratio * coulomb + viscous * qd[motor]
        return found

    friction_at_warmth = friction

    def warmth_rate(self, qd: Vector, warmth: Vector) -> list[Scalar]:
        found: list[Scalar] = []
        for each, speed, w in zip(known_friction(self._model).axes, qd, warmth, strict=True):
            if each is None or each.warmth is None:
                found.append(0.0)
                continue
            own, graph = each.warmth, self._graph
            heating = graph.function("abs", speed) * (1.0 / (each.speed * REFERENCE * own.warming))
            found.append((graph.number(1.0) - w) * heating - w * (1.0 / own.cooling))
        return found

    def torque(self, q: Vector, qd: Vector, qdd: Vector) -> list[Scalar]:
        load = [self._graph.lift(each) for each in self.rigid_bodies(q, qd, qdd)]
        reflected = self._robot.reflected_inertia.tolist()
        found = [tau + inertia * dv for tau, inertia, dv in zip(load, reflected, qdd, strict=True)]
        if len(self._model.axes_without_friction) == len(q):
            return list(found)
        rub = self.friction(q, qd, load)
        return [tau + each for tau, each in zip(found, rub, strict=True)]

    def current(self, tau: Vector) -> list[Scalar]:
        rows = shares_of_current(self._robot) or []
        return [sum(k * each for k, each in zip(row, tau, strict=True)) for row in rows]

    def dynamics(self, q: Vector, qd: Vector, qdd: Vector, *memory: Vector) -> list[Scalar]:
        """Return the sum of all `PARTS`, then the friction directions after the step."""
        load = [self._graph.lift(each) for each in self.rigid_bodies(q, qd, qdd)]
        graph, law = self._graph, self._model.friction_law
        directions: list[Vector] = []
        for factor, old in zip((1.0, STEP, 1.0 / STEP), memory[1:], strict=True):
            directions.append([])
            for own, now, then, z in zip(law.axes, q, memory[0], old, strict=True):
                if own is None or not own.presliding:
                    directions[-1].append(graph.number(0.0))
                    continue
                step = now - then
                sign = graph.function("sign", step)
                way = graph.function("abs", step) * (-1.0 / (factor * own.presliding))
                directions[-1].append(sign - (sign - z) * graph.function("exp", way))
        rub = [self._graph.number(0.0)] * len(q)
        if len(self._model.axes_without_friction) < len(q):
            found = self.friction(q, qd, load, directions=directions)
            rub = [self._graph.lift(each) for each in found]
        reflected = self._robot.reflected_inertia.tolist()
        torque = [a + H * dv + b for a, H, dv, b in zip(load, reflected, qdd, rub, strict=True)]
        kept = [each for direction in directions for each in direction]
        return [*self.gravity(q), *load, *rub, *torque, *kept]

    def _larger(self, a: Expression, b: Expression) -> Expression:
        return (a + b + self._graph.function("abs", a - b)) * 0.5

    def _axis(
        self, law: AxisLaw, at: At, direction: Expression, sign: Expression
    ) -> tuple[Expression, Expression]:
        """Return the part of an axis's friction that reverses with the direction, and the rest."""
        (axis, q, qd, load), graph = at, self._graph
        u, level, other = qd * (1.0 / law.speed), graph.number(0.0), graph.number(0.0)
        if law.speeds is not None:
            speed = graph.function("abs", qd)
            known = self._clipped(speed, *law.speeds)
            u = sign * known * (1.0 / law.speed)
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
            if term in shapes:
                shape = shapes[term]()
            else:  # ripple, of an order of the motor's angle
                wave, order = re.fullmatch(r"(cosine|sine) (\d+)", term).groups()  # type: ignore[union-attr]
                ratio = float(np.nan_to_num(self._robot.gear_ratio[axis]))
                angle = q * (ratio * int(order))
                name = {"cosine": "cos", "sine": "sin"}[wave]
                shape = graph.function(name, angle) if ratio else graph.number(0.0)
            if term in DIRECTED:
                level = level + value.value * shape
            else:
                other = other + value.value * shape
        return level, other

    def _clipped(self, x: Expression, low: float, high: float) -> Expression:
        """Return x clipped to [low, high], computed with absolute values alone."""
        above, below = (self._graph.function("abs", x - end) for end in (low, high))
        return (above - below + (low + high)) * 0.5


def shares_of_current(robot: Robot) -> list[list[float]] | None:
    """Return motor currents per unit of joint torque, as a matrix [A/(N m)]; None if unknown."""
    if not np.isfinite([robot.torque_constant, robot.gear_ratio]).all():
        return None
    shares = np.linalg.inv(robot.motor_matrix.T) / robot.torque_constant[:, np.newaxis]
    rounded = np.where(np.abs(shares) < 1e-14 * np.abs(shares).max(), 0.0, shares)
    return cast("list[list[float]]", rounded.tolist())


Scalar = Expression | float
_RIGHT = {(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)}
"""Cosine and sine of multiples of a right angle."""


def joints(graph: Graph, robot: Robot, q: Sequence[Expression]) -> list[Joint]:
    """Return the frames of a robot at positions q."""
    found = []
    for j, position in enumerate(q):
        ca, sa = cos_sin(float(robot.alpha[j]))
        theta, shift, d = float(robot.theta[j]), float(robot.r[j]), float(robot.d[j])
        revolute = bool(robot.revolute[j])
        length: Scalar = shift if revolute else position + shift
        exact = cos_sin(theta)
        c: Scalar = exact[0]
        s: Scalar = exact[1]
        if revolute and exact in _RIGHT:  # those of q + theta follow from those of q
            cosine, sine = graph.function("cos", position), graph.function("sin", position)
            c, s = exact[0] * cosine - exact[1] * sine, exact[0] * sine + exact[1] * cosine
        elif revolute:
            c = graph.function("cos", position + theta)
            s = graph.function("sin", position + theta)
        (cg, sg), b = cos_sin(float(robot.gamma[j])), float(robot.b[j])
        x, y, z = d, -sa * length, ca * length
        arm = cg * x - sg * y, sg * x + cg * y, z + b
        found.append(Joint(ca, sa, c, s, arm, revolute, robot.parents[j], cg, sg))
    return found


def count_whole_links(robot: Robot) -> Count:
    """Count the operations for a robot with general links; functions are sines and cosines."""
    graph, n = Graph(), robot.n_joints

    def symbols(name: str, size: int) -> list[Expression]:
        return [graph.symbol(f"{name}{k}") for k in range(size)]

    tree = []
    for j, revolute in enumerate(robot.revolute.tolist()):
        ca, sa, c, s, x, y, z = symbols(f"frame{j}_", 7)
        tree.append(Joint(ca, sa, c, s, (x, y, z), revolute, robot.parents[j]))
    bodies = [symbols(f"body{j}_", 10) for j in range(n)]
    earth = 0.3, 0.4, -9.8  # along no axis of the base frame
    found = rigid_bodies(tree, bodies, symbols("qd", n), symbols("qdd", n), earth)
    operations = count([graph.lift(each) for each in found])
    return operations._replace(functions=2 * int(robot.revolute.sum()))
