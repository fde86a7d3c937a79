"""Newton-Euler recursion in any arithmetic: arrays of samples, expressions, numbers.

In frame j, with angular velocity w, angular acceleration u, acceleration a of the origin less
gravity, and U = [u] + [w][w] (brackets: matrices of the cross product), a body with mass m, first
moment s and inertia I about the origin needs::

    f = m a + U s    n = I u + w x I w + s x a

and the origin of a frame carried by it, at p, accelerates by a + U p. Written with the elements of
U, the moment n costs few operations (after Khalil and Kleinfinger, IEEE J. Robotics and Automation
3, 1987: base parameters make most of the rest vanish). An inward pass sums the forces and moments
of the outer links. Links form a tree; a chain is the tree without branches.

A scalar is anything with addition and multiplication. `Exact` values of 0 and 1, from right angles
and joints at rest, are never computed with: for arrays that saves most of the time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

Scalar = Any
Vector = tuple[Scalar, Scalar, Scalar]
Matrix = tuple[Vector, Vector, Vector]


class Exact(float):
    """Constant known in advance: 0 and 1 disappear in sums and products."""

    __slots__ = ()
    __array_ufunc__ = None
    """Disables NumPy's operators, so that arrays defer to `Exact`."""

    def __neg__(self) -> Exact:
        return Exact(-float(self))

    def __mul__(self, other: Scalar) -> Scalar:
        if not self:
            return ZERO
        if isinstance(other, float):
            return Exact(float(self) * float(other))
        if self == 1.0:
            return other
        return -other if self == -1.0 else float(self) * other

    __rmul__ = __mul__

    def __add__(self, other: Scalar) -> Scalar:
        if not self:
            return other
        total = float(self) + other
        return Exact(total) if isinstance(total, float) else total

    __radd__ = __add__

    def __sub__(self, other: Scalar) -> Scalar:
        return self + -other

    def __rsub__(self, other: Scalar) -> Scalar:
        return other + -self if self else other


ZERO, ONE = Exact(0.0), Exact(1.0)
STILL: Vector = (ZERO, ZERO, ZERO)
_ALONG: Vector = (ZERO, ZERO, ONE)


@dataclass(frozen=True, slots=True)
class Joint:
    """Frame of a joint relative to the parent's frame, at the joint's position.

    Attributes
    ----------
    ca, sa : scalar
        Cosine and sine of alpha.
    c, s : scalar
        Cosine and sine of the rotation about the joint's axis.
    arm : vector
        Origin of the frame in the parent's frame [m].
    parent : int
        Index of the parent, lower than the joint's own; -1 for the base.
    cg, sg : scalar
        Cosine and sine of gamma.
    """

    ca: Scalar
    sa: Scalar
    c: Scalar
    s: Scalar
    arm: Vector
    revolute: bool
    parent: int
    cg: Scalar = ONE
    sg: Scalar = ZERO

    @property
    def axis(self) -> tuple[Vector, Vector]:
        """Motion per unit of the joint's rate in the joint's frame: angular and linear."""
        return (_ALONG, STILL) if self.revolute else (STILL, _ALONG)

    def rotate_in(self, x: Vector) -> Vector:
        """Rotate a vector from the parent's frame into the joint's frame."""
        along, across = self.cg * x[0] + self.sg * x[1], self.cg * x[1] - self.sg * x[0]
        h = self.ca * across + self.sa * x[2]
        return (
            self.c * along + self.s * h,
            self.c * h - self.s * along,
            self.ca * x[2] - self.sa * across,
        )

    def rotate_out(self, x: Vector) -> Vector:
        """Rotate a vector from the joint's frame into the parent's frame."""
        h = self.s * x[0] + self.c * x[1]
        along, across = self.c * x[0] - self.s * x[1], self.ca * h - self.sa * x[2]
        return (
            self.cg * along - self.sg * across,
            self.sg * along + self.cg * across,
            self.sa * h + self.ca * x[2],
        )

    def carry(self, axis: tuple[Vector, Vector]) -> tuple[Vector, Vector]:
        """Transform the axis of a joint before, angular and linear, into the joint's frame."""
        turn, slide = axis
        return self.rotate_in(turn), self.rotate_in(plus(slide, cross(turn, self.arm)))


class Motion(NamedTuple):
    """Motion of a frame: w, u, a and U of the module, and products of the components of w."""

    w: Vector
    u: Vector
    a: Vector
    U: Matrix
    squares: Vector
    products: Vector


def motions(
    tree: Sequence[Joint], qd: Sequence[Scalar], qdd: Sequence[Scalar], gravity: Sequence[float]
) -> Iterator[Motion]:
    """Yield the motion of every link; parameters as in `rigid_bodies`."""
    a: Vector = (Exact(-gravity[0]), Exact(-gravity[1]), Exact(-gravity[2]))
    found = {-1: Motion(STILL, STILL, a, (STILL, STILL, STILL), STILL, STILL)}
    for link, (joint, v, dv) in enumerate(zip(tree, qd, qdd, strict=True)):
        w, u, a, U, _, _ = found[joint.parent]
        a = joint.rotate_in(plus(a, _times(U, joint.arm)))
        w, u = joint.rotate_in(w), joint.rotate_in(u)
        if joint.revolute:
            u = (u[0] + w[1] * v, u[1] - w[0] * v, u[2] + dv)
            w = (w[0], w[1], w[2] + v)
        else:
            a = (a[0] + 2.0 * (w[1] * v), a[1] - 2.0 * (w[0] * v), a[2] + dv)
        found[link] = _motion_from_rates(w, u, a)
        yield found[link]


def rigid_bodies(
    tree: Sequence[Joint],
    bodies: Sequence[Sequence[Scalar]],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    gravity: Sequence[float],
) -> list[Scalar]:
    """Compute the torques on all joints.

    Parameters
    ----------
    tree : sequence of Joint
        Joints after the parents.
    bodies : sequence of ten scalars each, shape (n_joints, 10)
        Parameters of each link in the order of eq. (4).
    qd, qdd : sequence of scalars
        Velocities and accelerations.
    gravity : three floats
        In the base frame [m/s^2].
    """
    moved = motions(tree, qd, qdd, gravity)
    needs = [wrench(body, each) for body, each in zip(bodies, moved, strict=True)]
    needs.append((STILL, STILL))  # of the base, at index -1
    torques: list[Scalar] = []
    for link in reversed(range(len(tree))):
        joint, (force, moment) = tree[link], needs[link]
        torques.append(moment[2] if joint.revolute else force[2])
        force, moment = joint.rotate_out(force), joint.rotate_out(moment)
        moment = plus(moment, cross(joint.arm, force))
        own = needs[joint.parent]
        needs[joint.parent] = plus(own[0], force), plus(own[1], moment)
    return torques[::-1]


def _motion_from_rates(w: Vector, u: Vector, a: Vector) -> Motion:
    xx, yy, zz = w[0] * w[0], w[1] * w[1], w[2] * w[2]
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    U = (
        (-(yy + zz), xy - u[2], xz + u[1]),
        (xy + u[2], -(xx + zz), yz - u[0]),
        (xz - u[1], yz + u[0], -(xx + yy)),
    )
    return Motion(w, u, a, U, (xx, yy, zz), (yz, xz, xy))


def wrench(body: Sequence[Scalar], motion: Motion) -> tuple[Vector, Vector]:
    """Compute force and moment of a link with ten parameters; see the module."""
    xx, xy, xz, yy, yz, zz, sx, sy, sz, m = body
    _, u, a, U, w2, ww = motion
    s: Vector = (sx, sy, sz)
    f = plus((m * a[0], m * a[1], m * a[2]), _times(U, s))
    of_inertia: Vector = (
        xx * u[0] + (zz - yy) * ww[0] - xy * U[2][0] + xz * U[1][0] + yz * (w2[1] - w2[2]),
        yy * u[1] + (xx - zz) * ww[1] + xy * U[2][1] + xz * (w2[2] - w2[0]) - yz * U[0][1],
        zz * u[2] + (yy - xx) * ww[2] + xy * (w2[0] - w2[1]) - xz * U[1][2] + yz * U[0][2],
    )
    return f, plus(of_inertia, cross(s, a))


def plus(x: Vector, y: Vector) -> Vector:
    """Add two vectors."""
    return x[0] + y[0], x[1] + y[1], x[2] + y[2]


def dot(x: Vector, y: Vector) -> Scalar:
    """Compute the dot product of two vectors."""
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


def cross(x: Vector, y: Vector) -> Vector:
    """Compute the cross product of two vectors."""
    return (x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])


def _times(matrix: Matrix, x: Vector) -> Vector:
    return dot(matrix[0], x), dot(matrix[1], x), dot(matrix[2], x)
