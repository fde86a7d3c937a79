"""Triangle meshes from files (STL, binary or text; OBJ faces) and of simple shapes.

Vertices are merged by distance to limit the size of a page.
"""

from __future__ import annotations

from itertools import pairwise, product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.errors import FileError
from hil.runs.atomic_file import file_errors

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from hil.arrays import Array


_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_triangles(path: Path, largest: int = 100_000_000) -> Array:
    """Read the triangles of a mesh file of at most `largest` bytes.

    Returns
    -------
    ndarray, shape (n, 3, 3)
        Corners, in the file's unit.

    Raises
    ------
    FileError
        The file is missing, too large, damaged, or of another format.
    """
    readers = {".stl": _stl, ".obj": _obj}
    if path.suffix.lower() not in readers:
        raise FileError(f"{path}: {path.suffix or 'no suffix'} must be .stl or .obj; convert it")
    with file_errors(path, "read"):
        if not path.is_file():
            raise FileError(f"{path}: is not a file; correct the URDF's path or put the mesh there")
        if path.stat().st_size > largest:
            raise FileError(f"{path}: more than {largest / 1e6:.0f} MB; decimate the mesh")
        content = path.read_bytes()
    corners = readers[path.suffix.lower()](content, path)
    if not len(corners) or not np.isfinite(corners).all():
        raise FileError(
            f"{path}: has no triangles, or corners that are not numbers; export it anew"
        )
    return corners


def _stl(content: bytes, path: Path) -> Array:
    header = 84  # header size; its last four bytes are the number of triangles
    count = int.from_bytes(content[header - 4 : header], "little")
    if len(content) >= header + count * _TRIANGLE.itemsize and count:
        found = np.frombuffer(content, _TRIANGLE, count, header)["corners"]
        return found.astype(np.float64)
    if content.lstrip()[:5].lower() != b"solid":
        raise FileError(f"{path}: is not an STL file, or is truncated; export it anew")
    words = (line.split() for line in content.decode("ascii", "replace").splitlines())
    corners = [_numbers(w[1:4], path) for w in words if w and w[0].lower() == "vertex"]
    if len(corners) % 3:
        raise FileError(f"{path}: {len(corners)} vertices must be a multiple of 3; export it anew")
    return np.array(corners).reshape(-1, 3, 3)


def _obj(content: bytes, path: Path) -> Array:
    vertices: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    for line in content.decode("utf-8", "replace").splitlines():
        match line.split():
            case ["v", *numbers]:
                vertices.append(_numbers(numbers[:3], path))
            case ["f", *corners]:
                triangles += _fan([_index(word, len(vertices), path) for word in corners])
    faces = np.array(triangles, dtype=int).reshape(-1, 3)
    found: Array = np.array(vertices).reshape(-1, 3)[faces]
    return found


def _fan(polygon: list[int]) -> Iterator[tuple[int, int, int]]:
    """Yield the triangles of a polygon as a fan from the first corner."""
    for second, third in pairwise(polygon[1:]):
        yield polygon[0], second, third


def _index(word: str, count: int, path: Path) -> int:
    """Parse the index of a vertex, from 0; files count from 1, or backwards from the last."""
    try:
        number = int(word.partition("/")[0])
    except ValueError:
        number = 0
    index = number - 1 if number > 0 else count + number
    if number == 0 or not 0 <= index < count:
        raise FileError(
            f"{path}: a face names vertex {word!r}, and there are {count}; export it anew"
        )
    return index


def _numbers(words: list[str], path: Path) -> list[float]:
    try:
        found = [float(word) for word in words]
    except ValueError:
        found = []
    if len(found) != 3:
        raise FileError(f"{path}: {' '.join(words)!r} must be three coordinates; export it anew")
    return found


def box(size: Sequence[float]) -> Array:
    """Return triangles (12, 3, 3) of a box about the origin with edges `size` (3,) [m]."""
    half = np.asarray(size) / 2
    found = []
    for axis, side in product(range(3), (-1.0, 1.0)):
        u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
        middle = side * np.eye(3)[axis]
        a, b, c, d = (middle + s * u + t * v for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
        found += [[a, b, c], [a, c, d]] if side > 0 else [[a, c, b], [a, d, c]]
    return np.array(found) * half


def cylinder(radius: float, length: float) -> Array:
    """Return triangles (n, 3, 3) of a cylinder along z about the origin [m]."""
    return _revolve(
        [(0.0, -length / 2), (radius, -length / 2), (radius, length / 2), (0.0, length / 2)]
    )


def sphere(radius: float, sides: int = 24) -> Array:
    """Return triangles (n, 3, 3) of a sphere about the origin [m]."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, sides // 2 + 1)
    return _revolve([(radius * np.cos(a), radius * np.sin(a)) for a in angles.tolist()])


def _revolve(outline: Sequence[tuple[float, float]], sides: int = 24) -> Array:
    """Return triangles of the surface of revolution of an outline (radius, height) about z."""
    angles = np.linspace(0.0, 2 * np.pi, sides + 1)
    rings = [
        np.column_stack([r * np.cos(angles), r * np.sin(angles), 0 * angles + z])
        for r, z in outline
    ]
    found = [
        corners
        for low, high in pairwise(rings)
        for i in range(sides)
        for corners in ([low[i], low[i + 1], high[i + 1]], [low[i], high[i + 1], high[i]])
    ]
    return np.array(found)


FINEST = 1e-4
"""Initial edge of the cells for merging vertices [m]."""


class Mesh(NamedTuple):
    """Vertices (n, 3) [m], triangles (m, 3) of vertex indices, and edge of the cells [m]."""

    vertices: Array
    triangles: NDArray[np.intp]
    cell: float


def merge_corners(corners: Array, most: int) -> Mesh:
    """Merge the corners of triangles (n, 3, 3) in cells, down to at most `most` triangles.

    Degenerate and duplicate triangles are removed.
    """
    cell = FINEST
    while True:
        mesh = _merge(corners, cell)
        if len(mesh.triangles) <= most:
            return mesh
        cell *= 1.5


def _merge(corners: Array, cell: float) -> Mesh:
    whole = np.rint(corners.reshape(-1, 3) / cell).astype(np.int64)
    cells, numbers = np.unique(whole, axis=0, return_inverse=True)
    triangles = numbers.reshape(-1, 3)
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    _, first = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
    vertices: Array = cells * np.float64(cell)
    return Mesh(vertices, triangles[np.sort(first)], cell)
