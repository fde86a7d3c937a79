"""Rigid-body dynamics of a serial arm, compiled.

The torques without acceleration follow from Newton-Euler in link coordinates, the mass matrix from
composite rigid bodies, the accelerations from its factors L D L' (Featherstone, *Rigid Body
Dynamics Algorithms*, 2008, chapters 5 and 6). Links are given by the parameters in which the
dynamics are linear: mass, first moment and inertia about the frame's origin; so a set of base
parameters without mass is a valid link. Frames are modified Denavit-Hartenberg: ``Rx(alpha) Tx(d)
Rz(theta) Tz(r)`` takes link i-1 to link i, and each link's vectors are expressed in its own frame;
q adds to theta of a revolute joint, to r of a prismatic one. If all joints are revolute with theta
= 0, `kinds` is None and the compiler omits the code for it.

Joint indices are passed as a tuple because the length of a tuple is part of its type: the compiler
then unrolls all loops for this arm, which saves a third of the time.

Nothing is shared with the model that the identification uses: two derivations, two programs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sim_plant.compiled import compiled, inlined
from sim_plant.physics.trigonometry import sin_cos

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

FRAME = 5
"""Columns of a frame: cos(alpha), sin(alpha) and its origin in the preceding frame (3)."""
BODY = 10
"""Columns of a body: m, sx, sy, sz, Ixx, Iyy, Izz, Ixy, Ixz, Iyz."""
KIND = 2
"""Columns of a joint kind: 1 for prismatic, 0 for revolute; theta at q = 0 [rad]."""
WORK = 8
"""Columns of the scratch array: cos(q), sin(q), force (3), moment (3)."""


@compiled
def bias_and_mass(  # noqa: PLR0915 - one recursion, unrolled to scalars for speed
    joints: tuple[int, ...],
    frames: Array,
    bodies: Array,
    gravity: Array,
    kinds: Array | None,
    q: Array,
    qd: Array,
    bias: Array,
    mass: Array,
    work: Array,
) -> None:
    """Compute torques at zero acceleration and the mass matrix.

    Parameters
    ----------
    joints : tuple of int
        Joint indices, 0..n-1.
    frames : ndarray, shape (n, FRAME)
    bodies : ndarray, shape (n, BODY)
    gravity : ndarray, shape (3,)
        Gravity in the base frame [m/s^2].
    kinds : ndarray, shape (n, KIND), optional
        None if all joints are revolute with theta = 0.
    q, qd : ndarray, shape (n,)
        Positions and velocities [rad or m], [rad/s or m/s].
    bias : ndarray, shape (n,)
        Written: c(q, qd) + g(q) [N m or N].
    mass : ndarray, shape (n, n)
        Written: the lower triangle of M(q) [kg m^2, kg m or kg].
    work : ndarray, shape (n, WORK)
        Scratch.
    """
    n = len(joints)
    if kinds is not None:
        frames = _slid(frames, kinds, q)
    wx = wy = wz = 0.0
    ex = ey = ez = 0.0  # angular acceleration
    ax, ay, az = -gravity[0], -gravity[1], -gravity[2]
    for i in range(n):
        ca, sa = frames[i, 0], frames[i, 1]
        px, py, pz = frames[i, 2], frames[i, 3], frames[i, 4]
        v, angle = qd[i], q[i]
        if kinds is not None:
            angle = kinds[i, 1] + (1.0 - kinds[i, 0]) * angle
            v *= 1.0 - kinds[i, 0]
        s, c = sin_cos(angle)
        work[i, 0] = c
        work[i, 1] = s
        ux = wy * pz - wz * py
        uy = wz * px - wx * pz
        uz = wx * py - wy * px
        lx = ax + ey * pz - ez * py + wy * uz - wz * uy
        ly = ay + ez * px - ex * pz + wz * ux - wx * uz
        lz = az + ex * py - ey * px + wx * uy - wy * ux
        t = ca * ly + sa * lz
        ax, ay, az = c * lx + s * t, c * t - s * lx, ca * lz - sa * ly
        t = ca * wy + sa * wz
        wx, wy, wz = c * wx + s * t, c * t - s * wx, ca * wz - sa * wy
        t = ca * ey + sa * ez
        ex, ey, ez = c * ex + s * t + wy * v, c * t - s * ex - wx * v, ca * ez - sa * ey
        wz += v
        if kinds is not None:
            slide = 2.0 * kinds[i, 0] * qd[i]  # Coriolis
            ax += wy * slide
            ay -= wx * slide
        m, sx, sy, sz = bodies[i, 0], bodies[i, 1], bodies[i, 2], bodies[i, 3]
        ixx, iyy, izz = bodies[i, 4], bodies[i, 5], bodies[i, 6]
        ixy, ixz, iyz = bodies[i, 7], bodies[i, 8], bodies[i, 9]
        ux = wy * sz - wz * sy
        uy = wz * sx - wx * sz
        uz = wx * sy - wy * sx
        work[i, 2] = m * ax + ey * sz - ez * sy + wy * uz - wz * uy
        work[i, 3] = m * ay + ez * sx - ex * sz + wz * ux - wx * uz
        work[i, 4] = m * az + ex * sy - ey * sx + wx * uy - wy * ux
        hx = ixx * wx + ixy * wy + ixz * wz
        hy = ixy * wx + iyy * wy + iyz * wz
        hz = ixz * wx + iyz * wy + izz * wz
        work[i, 5] = ixx * ex + ixy * ey + ixz * ez + wy * hz - wz * hy + sy * az - sz * ay
        work[i, 6] = ixy * ex + iyy * ey + iyz * ez + wz * hx - wx * hz + sz * ax - sx * az
        work[i, 7] = ixz * ex + iyz * ey + izz * ez + wx * hy - wy * hx + sx * ay - sy * ax

    fx = fy = fz = nx = ny = nz = 0.0  # bias wrench of the outer links
    m = sx = sy = sz = 0.0  # composite body of the outer links
    ixx = iyy = izz = ixy = ixz = iyz = 0.0
    for i in range(n - 1, -1, -1):
        fx += work[i, 2]
        fy += work[i, 3]
        fz += work[i, 4]
        nx += work[i, 5]
        ny += work[i, 6]
        nz += work[i, 7]
        bias[i] = nz
        m += bodies[i, 0]
        sx += bodies[i, 1]
        sy += bodies[i, 2]
        sz += bodies[i, 3]
        ixx += bodies[i, 4]
        iyy += bodies[i, 5]
        izz += bodies[i, 6]
        ixy += bodies[i, 7]
        ixz += bodies[i, 8]
        iyz += bodies[i, 9]
        mass[i, i] = izz
        if kinds is not None and kinds[i, 0] > 0.0:
            bias[i], mass[i, i] = fz, m
            _row(frames, kinds, work, i, 0.0, 0.0, m, sy, -sx, 0.0, mass)
        else:
            _row(frames, kinds, work, i, -sy, sx, 0.0, ixz, iyz, izz, mass)

        # carry wrench and composite body over joint i into the frame of link i-1
        ca, sa = frames[i, 0], frames[i, 1]
        px, py, pz = frames[i, 2], frames[i, 3], frames[i, 4]
        c, s = work[i, 0], work[i, 1]
        t = s * fx + c * fy
        fx, fy, fz = c * fx - s * fy, ca * t - sa * fz, sa * t + ca * fz
        t = s * nx + c * ny
        nx, ny, nz = c * nx - s * ny, ca * t - sa * nz, sa * t + ca * nz
        nx += py * fz - pz * fy
        ny += pz * fx - px * fz
        nz += px * fy - py * fx
        t = s * sx + c * sy
        sx, sy, sz = c * sx - s * sy, ca * t - sa * sz, sa * t + ca * sz
        # inertia: about z by q, then about x by alpha, then the parallel-axis terms
        cc, ss, cs = c * c, s * s, c * s
        kxx = cc * ixx + ss * iyy - 2.0 * cs * ixy
        kyy = ss * ixx + cc * iyy + 2.0 * cs * ixy
        kxy = cs * (ixx - iyy) + (cc - ss) * ixy
        kxz = c * ixz - s * iyz
        kyz = s * ixz + c * iyz
        cc, ss, cs = ca * ca, sa * sa, ca * sa
        ixx = kxx
        iyy = cc * kyy + ss * izz - 2.0 * cs * kyz
        iyz = cs * (kyy - izz) + (cc - ss) * kyz
        izz = ss * kyy + cc * izz + 2.0 * cs * kyz
        ixy = ca * kxy - sa * kxz
        ixz = sa * kxy + ca * kxz
        ps = px * sx + py * sy + pz * sz
        pp = px * px + py * py + pz * pz
        ixx += 2.0 * (ps - px * sx) + m * (pp - px * px)
        iyy += 2.0 * (ps - py * sy) + m * (pp - py * py)
        izz += 2.0 * (ps - pz * sz) + m * (pp - pz * pz)
        ixy -= px * sy + py * sx + m * px * py
        ixz -= px * sz + pz * sx + m * px * pz
        iyz -= py * sz + pz * sy + m * py * pz
        sx += m * px
        sy += m * py
        sz += m * pz


@inlined
def _row(
    frames: Array,
    kinds: Array | None,
    work: Array,
    i: int,
    fx: float,
    fy: float,
    fz: float,
    nx: float,
    ny: float,
    nz: float,
    mass: Array,
) -> None:
    """Write row i of M: reaction of the preceding joints to unit acceleration of joint i."""
    for k in range(i, 0, -1):
        ca, sa = frames[k, 0], frames[k, 1]
        px, py, pz = frames[k, 2], frames[k, 3], frames[k, 4]
        c, s = work[k, 0], work[k, 1]
        t = s * fx + c * fy
        fx, fy, fz = c * fx - s * fy, ca * t - sa * fz, sa * t + ca * fz
        t = s * nx + c * ny
        nx, ny, nz = c * nx - s * ny, ca * t - sa * nz, sa * t + ca * nz
        nx += py * fz - pz * fy
        ny += pz * fx - px * fz
        nz += px * fy - py * fx
        mass[i, k - 1] = nz
        if kinds is not None:
            mass[i, k - 1] = fz if kinds[k - 1, 0] > 0.0 else nz


@compiled
def _slid(frames: Array, kinds: Array, q: Array) -> Array:
    """Return the frames with prismatic joints moved to their positions."""
    slid = frames.copy()
    for i in range(frames.shape[0]):
        way = kinds[i, 0] * q[i]
        slid[i, 3] -= frames[i, 1] * way
        slid[i, 4] += frames[i, 0] * way
    return slid


@compiled
def solve_in_place(joints: tuple[int, ...], mass: Array, x: Array) -> None:
    """Solve mass @ x = x by the factors L D L'.

    Parameters
    ----------
    joints : tuple of int
        0..n-1.
    mass : ndarray, shape (n, n)
        Lower triangle of a positive definite matrix [kg m^2]; overwritten: L below the diagonal,
        the reciprocals of D on it, D L' above.
    x : ndarray, shape (n,)
        Right-hand side, overwritten by the solution.
    """
    n = len(joints)
    for j in range(n):
        t = mass[j, j]
        u = x[j]
        for k in range(j):
            t -= mass[k, j] * mass[j, k]
            u -= mass[j, k] * x[k]
        t = 1.0 / t
        mass[j, j] = t
        x[j] = u
        for i in range(j + 1, n):
            u = mass[i, j]
            for k in range(j):
                u -= mass[k, i] * mass[j, k]
            mass[j, i] = u
            mass[i, j] = u * t
    for j in range(n - 1, -1, -1):
        u = x[j] * mass[j, j]
        for k in range(j + 1, n):
            u -= mass[k, j] * x[k]
        x[j] = u


def forward_dynamics(
    joints: tuple[int, ...],
    frames: Array,
    bodies: Array,
    gravity: Array,
    kinds: Array | None,
    motor_inertia: Array,
    q: Array,
    qd: Array,
    tau: Array,
) -> Array:
    """Return the joint accelerations under joint torques.

    Parameters
    ----------
    joints, frames, bodies, gravity, kinds
        See `bias_and_mass`.
    motor_inertia : ndarray, shape (n,)
        Rotor inertias seen at the joints, added to the diagonal of M [kg m^2].
    q, qd, tau : ndarray, shape (n,)
        Positions, velocities and torques [rad or m], [rad/s or m/s], [N m or N].

    Returns
    -------
    ndarray, shape (n,)
        qdd [rad/s^2 or m/s^2].
    """
    n = len(joints)
    bias, mass, work = np.empty(n), np.empty((n, n)), np.empty((n, WORK))
    bias_and_mass(joints, frames, bodies, gravity, kinds, q, qd, bias, mass, work)
    mass[np.diag_indices(n)] += motor_inertia
    qdd: Array = tau - bias
    solve_in_place(joints, mass, qdd)
    return qdd
