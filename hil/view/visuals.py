"""Drawing data of a robot: frames, capsules, limits, visual meshes of a URDF.

A URDF's links have frames of their own; each is fixed in one frame of the robot, or in its base
frame, where the pose follows from the zero configuration. Meshes of unknown format and missing
files are omitted with a remark; such a link keeps its capsule.

Triangle meshes come from files (STL, binary or text; OBJ faces) and simple shapes. Vertices are
merged by distance to limit the size of a page.
"""

from __future__ import annotations

from itertools import pairwise, product
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import unquote

import numpy as np

from hil.errors import FileError, Mismatch
from hil.model.capsules import capsules, link_reaches
from hil.model.frames import inverse
from hil.model.readers.axes_to_frames import difference, find_frames
from hil.model.readers.urdf import UrdfReader
from hil.runs.atomic_file import file_errors
from hil.view.packed import packed

if TYPE_CHECKING:
    from collections.abc import Sequence
    from xml.etree.ElementTree import Element

    from numpy.typing import NDArray

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.workspace import Workspace


_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
FINEST = 1e-4
"""Initial edge of the cells for merging vertices [m]."""


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
                indices = []
                for word in corners:
                    try:
                        number = int(word.partition("/")[0])
                    except ValueError:
                        number = 0
                    # files count from 1, or backwards from the last
                    indices.append(number - 1 if number > 0 else len(vertices) + number)
                    if number == 0 or not 0 <= indices[-1] < len(vertices):
                        raise FileError(
                            f"{path}: a face names vertex {word!r}, and there are {len(vertices)};"
                            " export it anew"
                        )
                # a polygon is a fan of triangles from the first corner
                triangles += [(indices[0], b, c) for b, c in pairwise(indices[1:])]
    faces = np.array(triangles, dtype=int).reshape(-1, 3)
    found: Array = np.array(vertices).reshape(-1, 3)[faces]
    return found


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
        whole = np.rint(corners.reshape(-1, 3) / cell).astype(np.int64)
        cells, numbers = np.unique(whole, axis=0, return_inverse=True)
        triangles = numbers.reshape(-1, 3)
        a, b, c = triangles.T
        triangles = triangles[(a != b) & (b != c) & (c != a)]
        _, first = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
        vertices: Array = cells * np.float64(cell)
        mesh = Mesh(vertices, triangles[np.sort(first)], cell)
        if len(mesh.triangles) <= most:
            return mesh
        cell *= 1.5


def robot_data(robot: Robot, visuals: Sequence[Visual] = ()) -> dict[str, object]:
    """Convert a robot to the page's data; `visuals` replace capsules.

    Two capsules of a swept volume are 0.7 of the smallest radius apart.
    """
    shapes = capsules(robot)
    ways = np.maximum(shapes.reach.max(axis=0), shapes.radii.min())
    # the direction against gravity, or z without gravity
    strength = float(np.linalg.norm(robot.gravity))
    joints = [
        {
            "revolute": bool(robot.revolute[j]),
            "parent": robot.parents[j],
            "before": (robot.zero_pose(j).ravel() + 0.0).tolist(),  # no -0.0
            "lower": float(robot.q_min[j]),
            "upper": float(robot.q_max[j]),
            "velocity": _finite_or_none(robot.velocity_limit[j]),
            "torque": _finite_or_none(robot.torque_limit[j]),
            "unit": robot.position_unit(j),
            "torque_unit": robot.torque_unit(j),
            "capsule": {"ends": shapes.ends[j].tolist(), "radius": float(shapes.radii[j])},
            "step": float(0.7 * shapes.radii.min() / ways[j]),
        }
        for j in range(robot.n_joints)
    ]
    return {
        "name": robot.name,
        "up": ([0.0, 0.0, 1.0] if strength == 0.0 else (-robot.gravity / strength).tolist()),
        "reach": float(link_reaches(robot).max()),
        "joints": joints,
        "meshes": [visual.data() for visual in visuals],
    }


def workspace_data(workspace: Workspace | None) -> dict[str, object] | None:
    """Convert boxes and margin to the page's data."""
    if workspace is None:
        return None
    boxes = [{"name": b.name, "low": b.low, "high": b.high} for b in workspace.boxes]
    return {"margin": workspace.margin, "boxes": boxes}


def _finite_or_none(limit: float) -> float | None:
    return float(limit) if np.isfinite(limit) else None


MOST_TRIANGLES = 40_000
"""Maximum number of triangles in the meshes of a page."""
BASE = -1
"""Link number of the base."""


class Visual(NamedTuple):
    """Mesh in the frame of a link.

    Attributes
    ----------
    link : int
        Index from 0; `BASE` for the base frame.
    """

    link: int
    mesh: Mesh

    def data(self) -> dict[str, object]:
        """Convert to the page's data."""
        return {
            "link": self.link,
            "vertices": packed(self.mesh.vertices, FINEST),
            "triangles": packed(self.mesh.triangles, 1),
        }


class Visuals(NamedTuple):
    """Displayable meshes, and descriptions of omissions."""

    visuals: tuple[Visual, ...]
    left_out: tuple[str, ...]


def visuals(urdf: Path, robot: Robot, meshes: Path | None = None) -> Visuals:
    """Read the visual meshes of the URDF that `robot` was made from.

    Parameters
    ----------
    meshes : Path, optional
        Additional folder for meshes; other files outside of the URDF's own folder and package are
        skipped.

    Raises
    ------
    FileError
        The file is not a URDF.
    Mismatch
        Joints different from those of the robot.
    """
    reader = UrdfReader(urdf)
    chain = reader.chain()
    # refuse a URDF with frames different from the robot file
    if difference(chain, robot):
        raise Mismatch(
            f"{urdf}: its joints from {chain.base} to {chain.tip} differ in position from those "
            f"of {robot.name}; give the URDF of the robot file"
        )
    # the poses of links in the robot's frames
    frames, at_zero = find_frames(chain), np.zeros(len(chain.joints))
    of_urdf, of_robot = chain.frames(at_zero), frames.poses(at_zero, chain.revolute)
    hung = [(BASE, chain.base, inverse(frames.base))]
    for number, joint in enumerate(chain.joints):
        hung.append((number, joint.link, inverse(of_robot[number]) @ of_urdf[number]))
    attached = [
        (number, pose, reader.links[name])
        for number, link, place in hung
        for name, pose in reader.find_attached(link, place)
    ]
    shapes: list[tuple[int, Array]] = []
    left_out = []
    for link, pose, element in attached:
        for visual in element.findall("visual"):
            try:
                corners = _triangles(reader, visual, urdf, meshes)
            except FileError as error:
                left_out.append(f"{error}; left out")
                continue
            place = pose @ reader.origin(visual)
            shapes.append((link, corners @ place[:3, :3].T + place[:3, 3]))
    most = _allowance([len(corners) for _, corners in shapes])
    found = [Visual(link, merge_corners(corners, most)) for link, corners in shapes]
    cell = max((visual.mesh.cell for visual in found), default=FINEST)
    if cell > FINEST:
        left_out.append(f"meshes are coarser than their files, by up to {1000 * cell:.1f} mm")
    return Visuals(tuple(v for v in found if len(v.mesh.triangles)), tuple(left_out))


def _allowance(sizes: list[int]) -> int:
    """Compute the maximum number of triangles per mesh; small meshes leave more for large ones."""
    left, most = MOST_TRIANGLES, MOST_TRIANGLES
    for number, size in enumerate(sorted(sizes)):
        most = left // (len(sizes) - number)
        if size > most:
            break
        left -= size
    return most


def _triangles(reader: UrdfReader, visual: Element, urdf: Path, meshes: Path | None) -> Array:
    """Return triangles (n, 3, 3) of a visual in the visual's frame [m]."""
    geometry = visual.find("geometry")
    shape = geometry[0] if geometry is not None and len(geometry) else None
    if shape is None:
        raise reader.file.wrong(visual, "a visual without a shape")
    numbers = reader.file.numbers
    if shape.tag == "box":
        return box(numbers(shape, "size", 3) or [0.0] * 3)
    if shape.tag in {"cylinder", "capsule"}:
        return cylinder(
            (numbers(shape, "radius", 1) or [0.0])[0], (numbers(shape, "length", 1) or [0.0])[0]
        )
    if shape.tag == "sphere":
        return sphere((numbers(shape, "radius", 1) or [0.0])[0])
    if shape.tag != "mesh":
        raise reader.file.wrong(shape, f"<{shape.tag}> is not a displayable shape")
    scale = np.array(numbers(shape, "scale", 3) or [1.0] * 3)
    # the path of a mesh; refuse a user's file named by a stranger's URDF
    path, root = _file(shape.get("filename", ""), urdf)
    allowed = [each.resolve() for each in (root, meshes) if each is not None]
    if not any(path.resolve().is_relative_to(each) for each in allowed):
        raise FileError(
            f"{path}: is outside of {root}, the folder of the URDF or of its package; name its"
            " folder: --meshes"
        )
    corners: Array = read_triangles(path) * scale
    return corners


def _file(stated: str, urdf: Path) -> tuple[Path, Path]:
    """Return the path of a mesh, and the permitted folder: the URDF's or the package's.

    A package's folder is at or above the URDF, by its name or by its package.xml.
    """
    name = unquote(stated.removeprefix("file://"))
    above = urdf.resolve().parents
    if not name.startswith("package://"):
        own = next((each for each in above if (each / "package.xml").is_file()), urdf.parent)
        return urdf.parent / name, own
    package, *rest = Path(name.removeprefix("package://")).parts or ("",)
    for folder in above if package not in {"", ".."} else ():
        for root in (folder / package, *([folder] if folder.name == package else [])):
            if (found := root.joinpath(*rest)).is_file():
                return found, root
    return urdf.parent.joinpath(package, *rest), urdf.parent
