"""Frames in modified Denavit-Hartenberg notation, and transformations between frames.

Frame j results from its parent's frame by a rotation alpha and shift d about x, then a rotation
theta and shift r about z (Khalil and Kleinfinger 1986); joint j moves about or along z of frame j.
In a tree the x axis of the parent's frame leads to one child; other frames start with a rotation
gamma and a shift b about the parent's z. The pose determines the maps of velocities (angular,
linear) and of a body's ten standard parameters. Entries are numbers or, for readable expressions,
polynomials in named lengths.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hil.model.polynomial import Polynomial

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import NDArray

    from hil.arrays import Array


QUARTER = math.pi / 2
ROUNDED_OFF = 1e-9
"""Numeric tolerance, relative to the largest value or absolute for angles [rad] and lengths [m]:
rounding causes some 1e-15 of a sum, times the condition of a chain of some ten frames, with six
orders to spare; values in robot files have some six digits."""


def parameter_map(pose: NDArray[Any]) -> NDArray[Any]:
    """Return the map of a body's parameters from a frame to the outer frame, shape (10, 10).

    `pose` is that of the frame, shape (4, 4), of floats or polynomials. The pseudo-inertia
    [[tr(I)/2 - I, s], [s', m]] transforms by congruence.
    """
    columns = [body_parameters(pose @ body @ pose.T) for body in UNIT_PSEUDO_INERTIAS]
    return np.array(columns, dtype=pose.dtype).T


def snap_angle(angle: float, within: float) -> float:
    """Return the nearest multiple of a quarter turn if at most `within` away, else the angle."""
    exact = round(angle / QUARTER) * QUARTER
    return exact if abs(angle - exact) <= within else angle


def cos_sin(angle: float) -> tuple[float, float]:
    """Compute cosine and sine, exactly 0 and +-1 at right angles."""
    quarters = round(angle / QUARTER)
    if abs(angle - quarters * QUARTER) < ROUNDED_OFF:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarters % 4]
    return math.cos(angle), math.sin(angle)


def frame_pose(
    alpha: float, d: Any, theta: float, r: Any, gamma: float = 0.0, b: Any = 0.0
) -> NDArray[Any]:
    """Compute the pose of a frame in the parent's frame; lengths may be polynomials."""
    ca, sa = cos_sin(alpha)
    ct, st = cos_sin(theta)
    rows = [
        [ct, -st, 0.0, d],
        [ca * st, ca * ct, -sa, r * -sa],
        [sa * st, sa * ct, ca, r * ca],
        [0.0, 0.0, 0.0, 1.0],
    ]
    pose = np.array(rows, dtype=object if isinstance(d, Polynomial) else np.float64)
    return frame_pose(0.0, 0.0 * d, gamma, b) @ pose if gamma or b else pose


def joint_motion(revolute: bool) -> tuple[Array, Array]:
    """Return generator (4, 4) and twist (6,) of a joint's motion, in the joint's frame."""
    generator, axis = np.zeros((4, 4)), np.zeros(6)
    if revolute:
        generator[1, 0], generator[0, 1], axis[2] = 1.0, -1.0, 1.0
    else:
        generator[2, 3], axis[5] = 1.0, 1.0
    return generator, axis


def inverse(pose: Array) -> Array:
    """Return the inverse of a pose."""
    rotation, position = pose[:3, :3], pose[:3, 3]
    result = np.eye(4)
    result[:3, :3] = rotation.T
    result[:3, 3] = -rotation.T @ position
    return result


def cross_matrix(v: NDArray[Any]) -> NDArray[Any]:
    """Return the matrix of the cross product with `v`, shape (..., 3) to (..., 3, 3)."""
    x, y, z = np.moveaxis(v, -1, 0)
    o = np.zeros_like(x)
    rows = [np.stack(row, axis=-1) for row in ((o, -z, y), (z, o, -x), (-y, x, o))]
    return np.stack(rows, axis=-2)


def adjoint(pose: Array) -> Array:
    """Return the map of (angular, linear) velocities from a frame to the outer frame of `pose`."""
    result = np.zeros((6, 6))
    result[:3, :3] = result[3:, 3:] = pose[:3, :3]
    result[3:, :3] = cross_matrix(pose[:3, 3]) @ pose[:3, :3]
    return result


def adjoint_rate(generator: Array) -> Array:
    """Compute the derivative of `adjoint` along the motion of `generator`, at the identity."""
    result = np.zeros((6, 6))
    result[:3, :3] = result[3:, 3:] = generator[:3, :3]
    result[3:, :3] = cross_matrix(generator[:3, 3])
    return result


def parameter_rate(generator: Array) -> Array:
    """Compute the derivative of `parameter_map` along the motion of `generator` at the identity."""
    bodies = [generator @ body + body @ generator.T for body in UNIT_PSEUDO_INERTIAS]
    return np.array([body_parameters(body) for body in bodies]).T


def body_parameters(body: NDArray[Any]) -> list[Any]:
    """Return the ten parameters of a pseudo-inertia."""
    xx, yy, zz = body[0, 0], body[1, 1], body[2, 2]
    inertia = [yy + zz, -body[0, 1], -body[0, 2], xx + zz, -body[1, 2], xx + yy]
    return [*inertia, body[0, 3], body[1, 3], body[2, 3], body[3, 3]]


def pseudo_inertia(parameters: Array) -> Array:
    """Return [[tr(I)/2 - I, s], [s', m]] of a body's ten parameters, shape (4, 4).

    The matrix is the second moment of the mass in homogeneous coordinates, positive definite
    exactly for bodies with some density in space (Wensing, Kim and Slotine, IEEE Robotics and
    Automation Letters 3 (2018) 60-67).
    """
    xx, xy, xz, yy, yz, zz, sx, sy, sz, m = parameters
    half = (xx + yy + zz) / 2
    return np.array(
        [
            [half - xx, -xy, -xz, sx],
            [-xy, half - yy, -yz, sy],
            [-xz, -yz, half - zz, sz],
            [sx, sy, sz, m],
        ]
    )


def _spatial_inertia(parameters: Array) -> Array:
    xx, xy, xz, yy, yz, zz = parameters[:6]
    inertia = np.zeros((6, 6))
    inertia[:3, :3] = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    inertia[:3, 3:] = cross_matrix(parameters[6:9])
    inertia[3:, :3] = inertia[:3, 3:].T
    inertia[3:, 3:] = parameters[9] * np.eye(3)
    return inertia


UNIT_PSEUDO_INERTIAS = [pseudo_inertia(unit) for unit in np.eye(10)]
UNIT_INERTIAS = np.array([_spatial_inertia(unit) for unit in np.eye(10)])
