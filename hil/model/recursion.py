"""The Newton-Euler recursion, compiled: one pass outwards gives every column of the regressor.

For each sample the pass carries from link to link the motion of the frame (angular velocity w,
angular acceleration u, acceleration a of the origin less gravity) and, seen in that frame, the
axes of the joints before. The wrench about the origin that one unit of a standard parameter needs
to follow that motion is::

    inertia I        n = I u + w x I w    f = 0
    first moment s   n = s x a            f = u x s + w x (w x s)
    mass             n = 0                f = a

and its torque on joint i is the product with that joint's axis (angular z, linear z x arm; for a
prismatic joint linear z alone). So no pass inwards is needed, only the columns of those standard
parameters that carry base parameters are computed, and single rows come cheap. `torques` goes the
same way but weighs the wrenches of a link with given values before the product.

Samples go through in blocks of `LANES`, component by component, so that the compiler can use the
processor's vector units; component k of lane i stands at ``k * LANES + i``.

Compiled code is kept on disk. Numba compiles it anew when its file has changed and does not look at
others: all that is compiled into it stands here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar, cast

import numpy as np
from numba import njit

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.arrays import Array, Integers


LANES = 16
"""Samples a block; 16 is faster than 32 or 64: its intermediate values stay in the first cache."""

L2, L3, L4, L5, L6, L7, L8 = (k * LANES for k in range(2, 9))

F = TypeVar("F", bound="Callable[..., object]")


def compiled(function: F) -> F:
    """Compile `function` at its first call, without fast-math.

    So the same expression gives the same bits wherever it stands, and models built on one recursion
    agree to rounding.
    """
    return cast("F", njit(cache=True, error_model="numpy")(function))


@compiled
def columns(
    state: Array,
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
    state : array, shape (5, n_samples, n_joints)
        Cosine and sine of the angle about each joint's axis, shift along it, velocity,
        acceleration.
    chain : array, shape (n_joints, 4)
        cos(alpha), sin(alpha), d, and 1 for a revolute or 0 for a prismatic joint.
    gravity : array, shape (3,)
        In the base frame [m/s^2].
    kinds, links : int arrays, shape (n_columns,)
        Place in eq. (4) and link of each column; links never decrease.
    rows : int array, shape (n_rows,)
        Joints, rising.
    out : array, shape (n_samples, n_rows, n_columns)
        Is filled.
    """
    motion, wrench, now = np.zeros(9 * LANES), np.zeros(6 * LANES), np.zeros(5 * LANES)
    axes = np.zeros((rows.size, 6 * LANES))
    for first in range(0, state.shape[1], LANES):
        count = min(LANES, state.shape[1] - first)
        _stand_still(gravity, motion)
        column, moving = 0, 0
        for link in range(chain.shape[0]):
            _gather(state, first, count, link, now)
            moving = _enter(chain[link], link, now, rows, moving, motion, axes)
            while column < kinds.size and links[column] == link:
                _unit_wrench(kinds[column], motion, wrench)
                for row in range(moving):
                    axis = axes[row]
                    for i in range(count):
                        out[first + i, row, column] = _power(wrench, axis, i)
                for row in range(moving, rows.size):
                    for i in range(count):
                        out[first + i, row, column] = 0.0
                column += 1


@compiled
def torques(
    state: Array,
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
    motion, wrench, now = np.zeros(9 * LANES), np.zeros(6 * LANES), np.zeros(5 * LANES)
    total, rows = np.zeros(6 * LANES), np.arange(chain.shape[0])
    axes = np.zeros((rows.size, 6 * LANES))
    for first in range(0, state.shape[1], LANES):
        count = min(LANES, state.shape[1] - first)
        _stand_still(gravity, motion)
        column, moving = 0, 0
        for link in range(chain.shape[0]):
            _gather(state, first, count, link, now)
            moving = _enter(chain[link], link, now, rows, moving, motion, axes)
            total[:] = 0.0
            while column < kinds.size and links[column] == link:
                _unit_wrench(kinds[column], motion, wrench)
                for i in range(6 * LANES):
                    total[i] += values[column] * wrench[i]
                column += 1
            for row in range(moving):
                axis = axes[row]
                for i in range(count):
                    out[first + i, row] += _power(total, axis, i)


@compiled
def _stand_still(gravity: Array, motion: Array) -> None:
    """Motion of the base: it rests, which feels like an acceleration against gravity."""
    motion[:] = 0.0
    for k in range(3):
        motion[(6 + k) * LANES : (7 + k) * LANES] = -gravity[k]


@compiled
def _gather(state: Array, first: int, count: int, link: int, now: Array) -> None:
    for k in range(5):
        for i in range(count):
            now[k * LANES + i] = state[k, first + i, link]


@compiled
def _enter(
    joint: Array, link: int, now: Array, rows: Integers, moving: int, motion: Array, axes: Array
) -> int:
    """Go from link to link: turn motion and axes into its frame, add the joint's own."""
    ca, sa, d, revolute = joint
    _carry_motion(ca, sa, d, revolute, now, motion)
    for row in range(moving):
        _carry_axis(ca, sa, d, now, axes[row])
    if moving < rows.size and rows[moving] == link:
        axis = axes[moving]
        axis[:] = 0.0
        axis[L2:L3] = revolute
        axis[L5:L6] = 1.0 - revolute
        return moving + 1
    return moving


@compiled
def _carry_motion(
    ca: float, sa: float, d: float, revolute: float, now: Array, motion: Array
) -> None:
    for i in range(LANES):
        c, s, shift, qd, qdd = now[i], now[LANES + i], now[L2 + i], now[L3 + i], now[L4 + i]
        wx, wy, wz = motion[i], motion[LANES + i], motion[L2 + i]
        ux, uy, uz = motion[L3 + i], motion[L4 + i], motion[L5 + i]
        px, py, pz = d, -sa * shift, ca * shift
        xx, yy, zz, xy, xz, yz = wx * wx, wy * wy, wz * wz, wx * wy, wx * wz, wy * wz
        ax = motion[L6 + i] + (-(yy + zz) * px + (xy - uz) * py + (xz + uy) * pz)
        ay = motion[L7 + i] + ((xy + uz) * px - (xx + zz) * py + (yz - ux) * pz)
        az = motion[L8 + i] + ((xz - uy) * px + (yz + ux) * py - (xx + yy) * pz)
        wx, wy, wz = _turn(ca, sa, c, s, wx, wy, wz)
        ux, uy, uz = _turn(ca, sa, c, s, ux, uy, uz)
        ax, ay, az = _turn(ca, sa, c, s, ax, ay, az)
        spin, slide = revolute * qd, (1.0 - revolute) * 2.0 * qd
        motion[i], motion[LANES + i], motion[L2 + i] = wx, wy, wz + spin
        motion[L3 + i], motion[L4 + i] = ux + wy * spin, uy - wx * spin
        motion[L5 + i] = uz + revolute * qdd
        motion[L6 + i], motion[L7 + i] = ax + wy * slide, ay - wx * slide
        motion[L8 + i] = az + (1.0 - revolute) * qdd


@compiled
def _carry_axis(ca: float, sa: float, d: float, now: Array, axis: Array) -> None:
    for i in range(LANES):
        c, s, shift = now[i], now[LANES + i], now[L2 + i]
        px, py, pz = d, -sa * shift, ca * shift
        x, y, z = axis[i], axis[LANES + i], axis[L2 + i]
        vx = axis[L3 + i] + (y * pz - z * py)
        vy = axis[L4 + i] + (z * px - x * pz)
        vz = axis[L5 + i] + (x * py - y * px)
        axis[i], axis[LANES + i], axis[L2 + i] = _turn(ca, sa, c, s, x, y, z)
        axis[L3 + i], axis[L4 + i], axis[L5 + i] = _turn(ca, sa, c, s, vx, vy, vz)


@compiled
def _turn(
    ca: float, sa: float, c: float, s: float, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Turn a vector of frame j-1 into frame j."""
    h = ca * y + sa * z
    return c * x + s * h, c * h - s * x, ca * z - sa * y


@compiled
def _unit_wrench(kind: int, motion: Array, wrench: Array) -> None:
    """Moment and force that one unit of a standard parameter needs, see the module."""
    for i in range(LANES):
        wx, wy, wz = motion[i], motion[LANES + i], motion[L2 + i]
        ux, uy, uz = motion[L3 + i], motion[L4 + i], motion[L5 + i]
        ax, ay, az = motion[L6 + i], motion[L7 + i], motion[L8 + i]
        nx = ny = nz = fx = fy = fz = 0.0
        if kind < 6:
            nx, ny, nz = _inertia_moment(kind, wx, wy, wz, ux, uy, uz)
        elif kind == 6:  # sx
            ny, nz = -az, ay
            fx, fy, fz = -wy * wy - wz * wz, wx * wy + uz, wx * wz - uy
        elif kind == 7:  # sy
            nx, nz = az, -ax
            fx, fy, fz = wx * wy - uz, -wx * wx - wz * wz, wy * wz + ux
        elif kind == 8:  # sz
            nx, ny = -ay, ax
            fx, fy, fz = wx * wz + uy, wy * wz - ux, -wx * wx - wy * wy
        else:  # m
            fx, fy, fz = ax, ay, az
        wrench[i], wrench[LANES + i], wrench[L2 + i] = nx, ny, nz
        wrench[L3 + i], wrench[L4 + i], wrench[L5 + i] = fx, fy, fz


@compiled
def _inertia_moment(
    kind: int, wx: float, wy: float, wz: float, ux: float, uy: float, uz: float
) -> tuple[float, float, float]:
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


@compiled
def _power(wrench: Array, axis: Array, i: int) -> float:
    """Product of a wrench and a joint's axis in lane i."""
    moment = (
        wrench[i] * axis[i] + wrench[LANES + i] * axis[LANES + i] + wrench[L2 + i] * axis[L2 + i]
    )
    force = (
        wrench[L3 + i] * axis[L3 + i]
        + wrench[L4 + i] * axis[L4 + i]
        + wrench[L5 + i] * axis[L5 + i]
    )
    product: float = moment + force
    return product
