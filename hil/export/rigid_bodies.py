"""Frames of a robot as expressions, for generating equations by the Newton-Euler recursion.

Bodies are those on which base parameters are placed (`hil.model.base_parameters`): torques are
right for any estimate, even with physically impossible single links.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.export.expressions import Expression, Graph, count
from hil.model.frames import cos_sin
from hil.model.newton_euler import Joint, rigid_bodies

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.export.expressions import Count
    from hil.model.robot import Robot

Scalar = Expression | float
_RIGHT = {(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)}
"""Cosine and sine of multiples of a right angle."""


def joints(graph: Graph, robot: Robot, q: Sequence[Expression]) -> list[Joint]:
    """Return the frames of a robot at positions q."""
    return [_joint(graph, robot, j, position) for j, position in enumerate(q)]


def _joint(graph: Graph, robot: Robot, j: int, q: Expression) -> Joint:
    ca, sa = cos_sin(float(robot.alpha[j]))
    theta, shift, d = float(robot.theta[j]), float(robot.r[j]), float(robot.d[j])
    revolute = bool(robot.revolute[j])
    length: Scalar = shift if revolute else q + shift
    c, s = _turned(graph, theta, q) if revolute else cos_sin(theta)
    (cg, sg), b = cos_sin(float(robot.gamma[j])), float(robot.b[j])
    x, y, z = d, -sa * length, ca * length
    arm = cg * x - sg * y, sg * x + cg * y, z + b
    return Joint(ca, sa, c, s, arm, revolute, robot.parents[j], cg, sg)


def _turned(graph: Graph, theta: float, q: Expression) -> tuple[Scalar, Scalar]:
    """Return cosine and sine of q + theta; at right angles they are those of q."""
    exact = cos_sin(theta)
    if exact not in _RIGHT:
        return graph.function("cos", q + theta), graph.function("sin", q + theta)
    cosine, sine = graph.function("cos", q), graph.function("sin", q)
    return exact[0] * cosine - exact[1] * sine, exact[0] * sine + exact[1] * cosine


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
