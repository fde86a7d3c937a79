"""Triangles of the simple shapes that a URDF may state."""

from __future__ import annotations

from itertools import pairwise, product
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SIDES = 24
"""Of what is round."""


def box(size: Sequence[float]) -> Array:
    """Triangles (12, 3, 3) of a box about the origin with edges `size` (3,) [m]."""
    half = np.asarray(size) / 2
    found = []
    for axis, side in product(range(3), (-1.0, 1.0)):
        u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
        middle = side * np.eye(3)[axis]
        a, b, c, d = (middle + s * u + t * v for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
        found += [[a, b, c], [a, c, d]] if side > 0 else [[a, c, b], [a, d, c]]
    return np.array(found) * half


def cylinder(radius: float, length: float) -> Array:
    """Triangles (n, 3, 3) of a cylinder along z about the origin [m]."""
    return _turned(
        [(0.0, -length / 2), (radius, -length / 2), (radius, length / 2), (0.0, length / 2)]
    )


def sphere(radius: float) -> Array:
    """Triangles (n, 3, 3) of a ball about the origin [m]."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, SIDES // 2 + 1)
    return _turned([(radius * np.cos(a), radius * np.sin(a)) for a in angles.tolist()])


def _turned(outline: Sequence[tuple[float, float]]) -> Array:
    """Triangles of what an outline (distance from z, height) passes by turning about z."""
    angles = np.linspace(0.0, 2 * np.pi, SIDES + 1)
    rings = [
        np.column_stack([r * np.cos(angles), r * np.sin(angles), 0 * angles + z])
        for r, z in outline
    ]
    found = [
        corners
        for low, high in pairwise(rings)
        for i in range(SIDES)
        for corners in ([low[i], low[i + 1], high[i + 1]], [low[i], high[i + 1], high[i]])
    ]
    return np.array(found)
