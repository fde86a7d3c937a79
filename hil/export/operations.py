"""What the recursion of Newton and Euler costs without any knowledge of the robot.

The yardstick of exported code: the same equations, counted in the same way, with any frames and all
ten parameters of every link, as a library computes them that takes a robot description.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.export.expressions import Graph, count
from hil.export.rigid_bodies import Joint, rigid_bodies

if TYPE_CHECKING:
    from hil.export.expressions import Count, Expression
    from hil.model.robot import Robot


def of_whole_links(robot: Robot) -> Count:
    """Operations for a robot with these kinds of joints; functions are sines and cosines."""
    graph, n = Graph(), robot.n_joints

    def symbols(name: str, size: int) -> list[Expression]:
        return [graph.symbol(f"{name}{k}") for k in range(size)]

    chain = []
    for j, revolute in enumerate(robot.revolute.tolist()):
        ca, sa, c, s, x, y, z = symbols(f"frame{j}_", 7)
        chain.append(Joint(ca, sa, c, s, (x, y, z), revolute))
    bodies = [symbols(f"body{j}_", 10) for j in range(n)]
    earth = 0.3, 0.4, -9.8  # in no axis of the base
    found = rigid_bodies(chain, bodies, symbols("qd", n), symbols("qdd", n), earth)
    operations = count([graph.lifted(each) for each in found])
    return operations._replace(functions=2 * int(robot.revolute.sum()))
