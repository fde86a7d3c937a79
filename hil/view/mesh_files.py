"""Triangles of mesh files: STL, binary or as text, and the faces of OBJ."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import FileError
from hil.runs.atomic_file import file_errors

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

LARGEST = 100_000_000
"""Of a mesh file [bytes]."""
_HEADER = 84
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_triangles(path: Path) -> Array:
    """Read the triangles of a mesh file.

    Returns
    -------
    ndarray, shape (n, 3, 3)
        Corners, in the file's unit.

    Raises
    ------
    FileError
        A file that is missing, too large, damaged, or of another format.
    """
    readers = {".stl": _stl, ".obj": _obj}
    if path.suffix.lower() not in readers:
        raise FileError(f"{path}: {path.suffix or 'no suffix'} must be .stl or .obj; convert it")
    with file_errors(path, "read"):
        if not path.is_file():
            raise FileError(f"{path}: is no file; correct the URDF's path or put the mesh there")
        if path.stat().st_size > LARGEST:
            raise FileError(f"{path}: more than {LARGEST / 1e6:.0f} MB; decimate the mesh")
        content = path.read_bytes()
    corners = readers[path.suffix.lower()](content, path)
    if not len(corners) or not np.isfinite(corners).all():
        raise FileError(f"{path}: has no triangles, or corners that are no numbers; export it anew")
    return corners


def _stl(content: bytes, path: Path) -> Array:
    count = int.from_bytes(content[_HEADER - 4 : _HEADER], "little")
    if len(content) >= _HEADER + count * _TRIANGLE.itemsize and count:
        found = np.frombuffer(content, _TRIANGLE, count, _HEADER)["corners"]
        return found.astype(np.float64)
    if content.lstrip()[:5].lower() != b"solid":
        raise FileError(f"{path}: is no STL file, or is cut off; export it anew")
    words = (line.split() for line in content.decode("ascii", "replace").splitlines())
    corners = [_numbers(w[1:4], path) for w in words if w and w[0].lower() == "vertex"]
    if len(corners) % 3:
        raise FileError(f"{path}: {len(corners)} vertices must be three a triangle; export it anew")
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
    """Triangles of a polygon, all with its first corner."""
    for second, third in pairwise(polygon[1:]):
        yield polygon[0], second, third


def _index(word: str, count: int, path: Path) -> int:
    """Index of a vertex, from 0; files count from 1, or back from the last one."""
    try:
        number = int(word.partition("/")[0])
    except ValueError:
        number = 0
    index = number - 1 if number > 0 else count + number
    if number == 0 or not 0 <= index < count:
        raise FileError(f"{path}: a face names vertex {word!r}, and there are {count}; export anew")
    return index


def _numbers(words: list[str], path: Path) -> list[float]:
    try:
        found = [float(word) for word in words]
    except ValueError:
        found = []
    if len(found) != 3:
        raise FileError(f"{path}: {' '.join(words)!r} must be three coordinates; export it anew")
    return found
