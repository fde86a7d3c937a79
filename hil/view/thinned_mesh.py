"""A mesh with few enough triangles for a page: vertices that are close together become one."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

FINEST = 1e-4
"""Edge of the cells that vertices are gathered in, at first [m]."""
COARSER = 1.5


class Mesh(NamedTuple):
    """Vertices (n, 3) [m], triangles (m, 3) of their numbers, and the edge of the cells [m]."""

    vertices: Array
    triangles: NDArray[np.intp]
    cell: float


def thinned(corners: Array, most: int) -> Mesh:
    """Gather the corners of triangles (n, 3, 3) in cells until at most `most` triangles are left.

    Triangles that lose a corner that way, and those that occur twice, are left out.
    """
    cell = FINEST
    while True:
        mesh = _gathered(corners, cell)
        if len(mesh.triangles) <= most:
            return mesh
        cell *= COARSER


def _gathered(corners: Array, cell: float) -> Mesh:
    whole = np.rint(corners.reshape(-1, 3) / cell).astype(np.int64)
    cells, numbers = np.unique(whole, axis=0, return_inverse=True)
    triangles = numbers.reshape(-1, 3)
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    _, first = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
    vertices: Array = cells * np.float64(cell)
    return Mesh(vertices, triangles[np.sort(first)], cell)
