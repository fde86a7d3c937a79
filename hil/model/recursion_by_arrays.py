"""The Newton-Euler recursion with NumPy's arrays, without a compiler.

Equations and their order are those of `hil.model.recursion`, so that regressors are the same to the
last bit; torques come from a pass inwards. Loading what is compiled there takes longer than a few
million rows take here: what is zero of a robot, of right angles and of a motion, is not calculated
with. Nothing is shared: what is compiled stands in one file, by which its cache is kept, and
imports the compiler.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Integers

    Component = Any
    """An array of shape (n_samples,), the same number for all samples, or `ZERO`."""
    Vector = tuple[Component, Component, Component]
    Motion = tuple[Vector, Vector, Vector]
    """Of a frame: angular velocity, angular acceleration, acceleration of the origin."""


class _Zero:
    """What need not be calculated: added it changes nothing, and of a product it leaves nothing."""

    __slots__ = ()
    __array_ufunc__ = None
    """Arrays leave operations to it."""

    def __neg__(self) -> _Zero:
        return self

    def __mul__(self, other: Component) -> _Zero:
        return self

    __rmul__ = __mul__

    def __add__(self, other: Component) -> Component:
        return other

    __radd__ = __add__

    def __sub__(self, other: Component) -> Component:
        return -other

    def __rsub__(self, other: Component) -> Component:
        return other


ZERO = _Zero()
_STILL = ZERO, ZERO, ZERO
_ALONG = ZERO, ZERO, 1.0
"""The joint's own axis."""


def columns(
    state: Sequence[Sequence[Component]],
    chain: Array,
    gravity: Array,
    kinds: Integers,
    links: Integers,
    rows: Integers,
    out: Array,
) -> None:
    """Torque on the joints `rows` per unit of standard parameters.

    Parameters
    ----------
    state : sequence
        Of each joint cosine and sine of the angle about its axis, shift along it, velocity and
        acceleration: each an array of shape (n_samples,) or a number.
    chain, gravity, kinds, links, rows, out
        As of `hil.model.recursion.columns`.
    """
    out[:] = 0.0
    for link, motion, axes in _links(state, chain, gravity, rows.tolist()):
        for column in np.flatnonzero(links == link).tolist() if axes else ():
            wrench = _unit_wrench(int(kinds[column]), motion)
            for row, axis in enumerate(axes):
                power = _power(wrench, axis)
                if power is not ZERO:
                    out[:, row, column] = power


def torques(
    state: Sequence[Sequence[Component]],
    chain: Array,
    gravity: Array,
    kinds: Integers,
    links: Integers,
    values: Array,
    out: Array,
) -> None:
    """Torque on all joints with standard parameters of given `values`, shape (n_columns,).

    As `columns`; `out` has the shape (n_samples, n_joints) and must be zero.
    """
    wrenches = []
    for link, motion, _ in _links(state, chain, gravity, ()):
        moment, force = _STILL, _STILL
        for column in np.flatnonzero(links == link).tolist():
            value, unit = float(values[column]), _unit_wrench(int(kinds[column]), motion)
            moment, force = _added(moment, unit[0], value), _added(force, unit[1], value)
        wrenches.append((moment, force))
    moment, force = (
        _STILL,
        _STILL,
    )  # a pass inwards costs less than every joint's axis in every link
    for link, (ca, sa, d, revolute) in reversed(list(enumerate(chain.tolist()))):
        moment, force = _added(wrenches[link][0], moment), _added(wrenches[link][1], force)
        power: Component = (moment if revolute else force)[2]
        if power is not ZERO:
            out[:, link] = power
        c, s, shift, *_ = map(_known, state[link])
        arm, force = _arm(ca, sa, d, shift), _turned_back(ca, sa, c, s, force)
        moment = _added(_turned_back(ca, sa, c, s, moment), _cross(arm, force))


def _links(
    state: Sequence[Sequence[Component]], chain: Array, gravity: Array, rows: Sequence[int]
) -> Iterator[tuple[int, Motion, list[tuple[Vector, Vector]]]]:
    """Yield each link with its motion and the axes (angular, linear) of the joints before."""
    motion: Motion = _STILL, _STILL, tuple(_known(-g) for g in gravity.tolist())
    axes: list[tuple[Vector, Vector]] = []
    for link, (ca, sa, d, revolute) in enumerate(chain.tolist()):
        c, s, shift, qd, qdd = map(_known, state[link])
        arm = _arm(ca, sa, d, shift)
        w, u, a = (_turned(ca, sa, c, s, vector) for vector in _carried(motion, arm))
        motion = _moved(w, u, a, bool(revolute), qd, qdd)
        axes = [
            (_turned(ca, sa, c, s, z), _turned(ca, sa, c, s, _carried_axis(z, v, arm)))
            for z, v in axes
        ]
        if link in rows:
            axes.append((_ALONG, _STILL) if revolute else (_STILL, _ALONG))
        yield link, motion, axes


def _carried(motion: Motion, arm: Vector) -> Motion:
    """Motion of the next frame's origin, in the axes of the frame before."""
    (wx, wy, wz), (ux, uy, uz), (ax, ay, az) = motion
    px, py, pz = arm
    vx, vy, vz = _cross(motion[0], arm)
    return (
        motion[0],
        motion[1],
        (
            ax + uy * pz - uz * py + wy * vz - wz * vy,
            ay + uz * px - ux * pz + wz * vx - wx * vz,
            az + ux * py - uy * px + wx * vy - wy * vx,
        ),
    )


def _arm(ca: float, sa: float, d: float, shift: Component) -> Vector:
    """Origin of the next frame in the frame before."""
    return _known(d), _scaled(-sa, shift), _scaled(ca, shift)


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _added(a: Vector, b: Vector, times: float = 1.0) -> Vector:
    return tuple(x + _scaled(times, y) for x, y in zip(a, b, strict=True))


def _carried_axis(angular: Vector, linear: Vector, arm: Vector) -> Vector:
    (x, y, z), (vx, vy, vz), (px, py, pz) = angular, linear, arm
    return vx + y * pz - z * py, vy + z * px - x * pz, vz + x * py - y * px


def _turned(ca: float, sa: float, c: Component, s: Component, vector: Vector) -> Vector:
    """Turn a vector of frame j-1 into frame j."""
    x, y, z = vector
    h = _scaled(ca, y) + _scaled(sa, z)
    return c * x + s * h, c * h - s * x, _scaled(ca, z) - _scaled(sa, y)


def _turned_back(ca: float, sa: float, c: Component, s: Component, vector: Vector) -> Vector:
    """Turn a vector of frame j into frame j-1."""
    x, y, z = vector
    h = s * x + c * y
    return c * x - s * y, _scaled(ca, h) - _scaled(sa, z), _scaled(sa, h) + _scaled(ca, z)


def _moved(
    w: Vector, u: Vector, a: Vector, revolute: bool, qd: Component, qdd: Component
) -> Motion:
    """Add the joint's own motion."""
    (wx, wy, wz), (ux, uy, uz), (ax, ay, az) = w, u, a
    if revolute:
        return (wx, wy, wz + qd), (ux + wy * qd, uy - wx * qd, uz + qdd), a
    slide = 2.0 * qd
    return w, u, (ax + wy * slide, ay - wx * slide, az + qdd)


def _unit_wrench(kind: int, motion: Motion) -> tuple[Vector, Vector]:
    """Moment and force that one unit of a standard parameter needs."""
    (wx, wy, wz), (ux, uy, uz), (ax, ay, az) = motion
    if kind < 6:
        return _inertia_moment(kind, motion), _STILL
    if kind == 6:  # sx
        return (ZERO, -az, ay), (-wy * wy - wz * wz, wx * wy + uz, wx * wz - uy)
    if kind == 7:  # sy
        return (az, ZERO, -ax), (wx * wy - uz, -wx * wx - wz * wz, wy * wz + ux)
    if kind == 8:  # sz
        return (-ay, ax, ZERO), (wx * wz + uy, wy * wz - ux, -wx * wx - wy * wy)
    return _STILL, motion[2]  # m


def _inertia_moment(kind: int, motion: Motion) -> Vector:
    (wx, wy, wz), (ux, uy, uz), _ = motion
    if kind == 0:  # Ixx
        return ux, wx * wz, -wx * wy
    if kind == 1:  # Ixy
        return uy - wx * wz, ux + wy * wz, wx * wx - wy * wy
    if kind == 2:  # Ixz
        return uz + wx * wy, wz * wz - wx * wx, ux - wy * wz
    if kind == 3:  # Iyy
        return -wy * wz, uy, wx * wy
    if kind == 4:  # Iyz
        return wy * wy - wz * wz, uz - wx * wy, uy + wx * wz
    return wy * wz, -wx * wz, uz


def _power(wrench: tuple[Vector, Vector], axis: tuple[Vector, Vector]) -> Component:
    """Product of a wrench and a joint's axis."""
    moment, force = (
        part[0] * along[0] + part[1] * along[1] + part[2] * along[2]
        for part, along in zip(wrench, axis, strict=True)
    )
    return moment + force


def _known(component: Component) -> Component:
    """Zeros that are known as such."""
    return ZERO if isinstance(component, float) and component == 0.0 else component


def _scaled(factor: float, component: Component) -> Component:
    """Product with what is 0 or 1 at right angles."""
    if factor == 0.0:
        return ZERO
    return component if factor == 1.0 else factor * component
