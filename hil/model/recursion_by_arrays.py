"""The Newton-Euler recursion with NumPy's arrays: regressors of few samples, without a compiler.

Equations and their order are those of `hil.model.recursion`, so that the results are the same to
the last bit. Loading what is compiled there takes longer than two hundred thousand rows take here.
Nothing is shared: what is compiled stands in one file, by which its cache is kept, and imports the
compiler.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from hil.arrays import Array, Integers

    Wrench = tuple[list[tuple[int, Array]], list[tuple[int, Array]]]
    """Components that are not zero, with their index: of the moment and of the force."""


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

    Parameters are those of `hil.model.recursion.columns`.
    """
    n, moving = state.shape[1], 0
    motion = np.zeros((3, 3, n))  # component; w, u, a
    motion[:, 2] = -gravity[:, np.newaxis]
    axes = np.zeros((3, 2, rows.size, n))  # component; angular, linear; row
    out[:] = 0.0
    for link, (ca, sa, d, revolute) in enumerate(chain):
        c, s, shift, qd, qdd = state[:, :, link]
        arm = d, -sa * shift, ca * shift
        _carry_motion(motion, arm)
        motion = _turned(ca, sa, c, s, motion)
        _move(motion, revolute, qd, qdd)
        seen = axes[:, :, :moving]
        _carry_axes(seen, arm)
        seen[:] = _turned(ca, sa, c, s, seen)
        if moving < rows.size and rows[moving] == link:
            axes[2, 0, moving], axes[2, 1, moving] = revolute, 1.0 - revolute
            moving += 1
        for column in np.flatnonzero((links == link) & (moving > 0)).tolist():
            wrench = _unit_wrench(int(kinds[column]), motion)
            out[:, :moving, column] = _power(wrench, axes[:, :, :moving]).T


def _carry_motion(motion: Array, arm: tuple[float, Array, Array]) -> None:
    """Add what the origin of the next frame accelerates more, in the axes of the frame before."""
    px, py, pz = arm
    (wx, ux, ax), (wy, uy, ay), (wz, uz, az) = motion
    vx, vy, vz = wy * pz - wz * py, wz * px - wx * pz, wx * py - wy * px
    motion[0, 2] = ax + uy * pz - uz * py + wy * vz - wz * vy
    motion[1, 2] = ay + uz * px - ux * pz + wz * vx - wx * vz
    motion[2, 2] = az + ux * py - uy * px + wx * vy - wy * vx


def _carry_axes(axes: Array, arm: tuple[float, Array, Array]) -> None:
    px, py, pz = arm
    (x, vx), (y, vy), (z, vz) = axes
    axes[0, 1] = vx + y * pz - z * py
    axes[1, 1] = vy + z * px - x * pz
    axes[2, 1] = vz + x * py - y * px


def _turned(ca: float, sa: float, c: Array, s: Array, vectors: Array) -> Array:
    """Turn vectors of frame j-1, shape (3, ..., n_samples), into frame j."""
    x, y, z = vectors
    h = ca * y + sa * z
    return np.stack([c * x + s * h, c * h - s * x, ca * z - sa * y])


def _move(motion: Array, revolute: float, qd: Array, qdd: Array) -> None:
    """Add the joint's own motion."""
    wx, wy = motion[:2, 0]
    spin, slide = revolute * qd, (1.0 - revolute) * 2.0 * qd
    motion[0, 1:] += wy * spin, wy * slide
    motion[1, 1:] -= wx * spin, wx * slide
    motion[2] += spin, revolute * qdd, (1.0 - revolute) * qdd


def _unit_wrench(kind: int, motion: Array) -> Wrench:
    """Moment and force that one unit of a standard parameter needs."""
    if kind < 6:
        return list(enumerate(_inertia_moment(kind, motion))), []
    (wx, ux, ax), (wy, uy, ay), (wz, uz, az) = motion
    if kind == 6:  # sx
        force = -wy * wy - wz * wz, wx * wy + uz, wx * wz - uy
        moment = [(1, -az), (2, ay)]
    elif kind == 7:  # sy
        force = wx * wy - uz, -wx * wx - wz * wz, wy * wz + ux
        moment = [(0, az), (2, -ax)]
    elif kind == 8:  # sz
        force = wx * wz + uy, wy * wz - ux, -wx * wx - wy * wy
        moment = [(0, -ay), (1, ax)]
    else:  # m
        force, moment = (ax, ay, az), []
    return moment, list(enumerate(force))


def _inertia_moment(kind: int, motion: Array) -> tuple[Array, Array, Array]:
    (wx, ux, _), (wy, uy, _), (wz, uz, _) = motion
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


def _power(wrench: Wrench, axes: Array) -> Array:
    """Product of a wrench and the axes, shape (n_rows, n_samples)."""
    moment, force = (
        sum(component * axes[k, part] for k, component in components)
        for part, components in enumerate(wrench)
    )
    return np.asarray(moment + force, dtype=np.float64)
