"""Torques of the rigid bodies as expressions: Newton and Euler's recursion, out and back.

In frame j, with angular velocity w, angular acceleration u, acceleration a of the origin less
gravity, and U = [u] + [w][w] (brackets: matrices of the cross product), a body with mass m, first
moment s and inertia I about the origin needs::

    f = m a + U s    n = I u + w x I w + s x a

and the origin of the next frame, at p, accelerates by a + U p. Written in the elements of U, which
both need, the moments of inertia cost few operations (after Khalil and Kleinfinger, IEEE J.
Robotics and Automation 3, 1987: base parameters make most of the rest vanish). The way back adds
up what the links further out need.

Bodies are those that base parameters place (`hil.model.base_parameters`): torques are right for any
estimate, however impossible as single links the bodies are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hil.export.expressions import Expression, Graph, count
from hil.model.frames import cos_sin

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.export.expressions import Count
    from hil.model.robot import Robot

Scalar = Expression | float
Vector = tuple[Scalar, Scalar, Scalar]
Matrix = tuple[Vector, Vector, Vector]

ZERO: Vector = (0.0, 0.0, 0.0)
_RIGHT = {(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)}
"""Cosine and sine of multiples of a right angle."""


@dataclass(frozen=True, slots=True)
class Joint:
    """A frame in the one before, at the joint's position.

    Attributes
    ----------
    ca, sa : number or Expression
        Cosine and sine of alpha.
    c, s : number or Expression
        Of the turn about the joint's axis.
    arm : vector
        Of the frame's origin, in the frame before [m].
    revolute : bool
    """

    ca: Scalar
    sa: Scalar
    c: Scalar
    s: Scalar
    arm: Vector
    revolute: bool

    def into(self, x: Vector) -> Vector:
        """Turn a vector of the frame before into this one."""
        h = self.ca * x[1] + self.sa * x[2]
        return (
            self.c * x[0] + self.s * h,
            self.c * h - self.s * x[0],
            self.ca * x[2] - self.sa * x[1],
        )

    def out_of(self, x: Vector) -> Vector:
        """Turn a vector of this frame into the frame before."""
        h = self.s * x[0] + self.c * x[1]
        return (
            self.c * x[0] - self.s * x[1],
            self.ca * h - self.sa * x[2],
            self.sa * h + self.ca * x[2],
        )


def joints(graph: Graph, robot: Robot, q: Sequence[Expression]) -> list[Joint]:
    """Frames of a robot at positions q."""
    return [_joint(graph, robot, j, position) for j, position in enumerate(q)]


def rigid_bodies(
    chain: Sequence[Joint],
    bodies: Sequence[Sequence[Scalar]],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    gravity: Sequence[float],
) -> list[Scalar]:
    """Torques on all joints.

    Parameters
    ----------
    chain : sequence of Joint
    bodies : sequence of ten scalars each, shape (n_joints, 10)
        Parameters of each link in the order of eq. (4).
    qd, qdd : sequence of scalars
        Velocities and accelerations; numbers are folded.
    gravity : three floats
        In the base frame [m/s^2].
    """
    w, u, U = ZERO, ZERO, (ZERO, ZERO, ZERO)
    a: Vector = (-gravity[0], -gravity[1], -gravity[2])
    needs: list[tuple[Vector, Vector]] = []
    for joint, body, v, dv in zip(chain, bodies, qd, qdd, strict=True):
        a = joint.into(_plus(a, _times(U, joint.arm)))
        w, u = joint.into(w), joint.into(u)
        if joint.revolute:
            u = (u[0] + w[1] * v, u[1] - w[0] * v, u[2] + dv)
            w = (w[0], w[1], w[2] + v)
        else:
            a = (a[0] + 2.0 * (w[1] * v), a[1] - 2.0 * (w[0] * v), a[2] + dv)
        U = _of_motion(w, u)
        needs.append(_wrench(body, w, u, a, U))
    return _back(chain, needs)


def _joint(graph: Graph, robot: Robot, j: int, q: Expression) -> Joint:
    ca, sa = cos_sin(float(robot.alpha[j]))
    theta, shift, d = float(robot.theta[j]), float(robot.r[j]), float(robot.d[j])
    revolute = bool(robot.revolute[j])
    length: Scalar = shift if revolute else q + shift
    c, s = _turned(graph, theta, q) if revolute else cos_sin(theta)
    return Joint(ca, sa, c, s, (d, -sa * length, ca * length), revolute)


def _turned(graph: Graph, theta: float, q: Expression) -> tuple[Scalar, Scalar]:
    """Cosine and sine of q + theta, by those of q alone at right angles."""
    exact = cos_sin(theta)
    if exact not in _RIGHT:
        return graph.function("cos", q + theta), graph.function("sin", q + theta)
    cosine, sine = graph.function("cos", q), graph.function("sin", q)
    return exact[0] * cosine - exact[1] * sine, exact[0] * sine + exact[1] * cosine


def _of_motion(w: Vector, u: Vector) -> Matrix:
    """U = [u] + [w][w]."""
    xx, yy, zz = w[0] * w[0], w[1] * w[1], w[2] * w[2]
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    return (
        (-(yy + zz), xy - u[2], xz + u[1]),
        (xy + u[2], -(xx + zz), yz - u[0]),
        (xz - u[1], yz + u[0], -(xx + yy)),
    )


def _wrench(
    body: Sequence[Scalar], w: Vector, u: Vector, a: Vector, U: Matrix
) -> tuple[Vector, Vector]:
    """Force and moment that a link needs, see the module."""
    xx, xy, xz, yy, yz, zz, sx, sy, sz, m = body
    s: Vector = (sx, sy, sz)
    f = _plus((m * a[0], m * a[1], m * a[2]), _times(U, s))
    of_inertia: Vector = (
        xx * u[0] + (zz - yy) * (w[1] * w[2]) - xy * U[2][0] + xz * U[1][0]
        + yz * (U[1][1] - U[2][2]),
        yy * u[1] + (xx - zz) * (w[0] * w[2]) + xy * U[2][1] + xz * (U[2][2] - U[0][0])
        - yz * U[0][1],
        zz * u[2] + (yy - xx) * (w[0] * w[1]) + xy * (U[0][0] - U[1][1]) - xz * U[1][2]
        + yz * U[0][2],
    )  # fmt: skip
    return f, _plus(of_inertia, _cross(s, a))


def _back(chain: Sequence[Joint], needs: Sequence[tuple[Vector, Vector]]) -> list[Scalar]:
    """Torques from what each link needs, from the tip to the base."""
    force, moment = ZERO, ZERO
    torques: list[Scalar] = []
    for joint, (f, n) in zip(reversed(chain), reversed(needs), strict=True):
        force, moment = _plus(f, force), _plus(n, moment)
        torques.append(moment[2] if joint.revolute else force[2])
        force, moment = joint.out_of(force), joint.out_of(moment)
        moment = _plus(moment, _cross(joint.arm, force))
    return torques[::-1]


def _plus(x: Vector, y: Vector) -> Vector:
    return x[0] + y[0], x[1] + y[1], x[2] + y[2]


def _times(matrix: Matrix, x: Vector) -> Vector:
    rows = [row[0] * x[0] + row[1] * x[1] + row[2] * x[2] for row in matrix]
    return rows[0], rows[1], rows[2]


def _cross(x: Vector, y: Vector) -> Vector:
    return (
        x[1] * y[2] - x[2] * y[1],
        x[2] * y[0] - x[0] * y[2],
        x[0] * y[1] - x[1] * y[0],
    )


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
