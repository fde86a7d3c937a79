"""Drawing data of a robot: frames, capsules, limits, visual meshes of a URDF.

A URDF's links have frames of their own; each is fixed in one frame of the robot, or in its base
frame, where the pose follows from the zero configuration. Meshes of unknown format and missing
files are omitted with a remark; such a link keeps its capsule.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import unquote

import numpy as np

from hil.errors import FileError, Mismatch
from hil.model.capsules import capsules, link_reaches
from hil.model.frames import inverse
from hil.model.readers.axes_to_frames import difference, find_frames
from hil.model.readers.urdf import UrdfReader
from hil.view.meshes import FINEST, box, cylinder, merge_corners, read_triangles, sphere
from hil.view.packed import packed

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from xml.etree.ElementTree import Element

    from hil.arrays import Array
    from hil.model.readers.urdf import UrdfChain
    from hil.model.robot import Robot
    from hil.planning.workspace import Workspace
    from hil.view.meshes import Mesh


def robot_data(robot: Robot, visuals: Sequence[Visual] = ()) -> dict[str, object]:
    """Convert a robot to the page's data; `visuals` replace capsules.

    Two capsules of a swept volume are 0.7 of the smallest radius apart.
    """
    shapes = capsules(robot)
    ways = np.maximum(shapes.reach.max(axis=0), shapes.radii.min())
    return {
        "name": robot.name,
        "up": _up(robot.gravity),
        "reach": float(link_reaches(robot).max()),
        "joints": [
            _joint(robot, j) | {"step": float(0.7 * shapes.radii.min() / ways[j])}
            for j in range(robot.n_joints)
        ],
        "meshes": [visual.data() for visual in visuals],
    }


def workspace_data(workspace: Workspace | None) -> dict[str, object] | None:
    """Convert boxes and margin to the page's data."""
    if workspace is None:
        return None
    boxes = [{"name": b.name, "low": b.low, "high": b.high} for b in workspace.boxes]
    return {"margin": workspace.margin, "boxes": boxes}


def _joint(robot: Robot, joint: int) -> dict[str, object]:
    shapes = capsules(robot)
    return {
        "revolute": bool(robot.revolute[joint]),
        "parent": robot.parents[joint],
        "before": (robot.zero_pose(joint).ravel() + 0.0).tolist(),  # no -0.0
        "lower": float(robot.q_min[joint]),
        "upper": float(robot.q_max[joint]),
        "velocity": _finite_or_none(robot.velocity_limit[joint]),
        "torque": _finite_or_none(robot.torque_limit[joint]),
        "unit": robot.position_unit(joint),
        "torque_unit": robot.torque_unit(joint),
        "capsule": {
            "ends": shapes.ends[joint].tolist(),
            "radius": float(shapes.radii[joint]),
        },
    }


def _finite_or_none(limit: float) -> float | None:
    return float(limit) if np.isfinite(limit) else None


def _up(gravity: Array) -> list[float]:
    """Return the direction against gravity, or z without gravity."""
    strength = float(np.linalg.norm(gravity))
    return [0.0, 0.0, 1.0] if strength == 0.0 else (-gravity / strength).tolist()


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
    mesh : Mesh
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
    urdf : Path
    robot : Robot
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
    _refuse_other(chain, robot, urdf)
    shapes: list[tuple[int, Array]] = []
    left_out = []
    for link, pose, element in _attached_links(reader, chain):
        for visual in element.findall("visual"):
            try:
                corners = _triangles(reader, visual, urdf, meshes)
            except FileError as error:
                left_out.append(f"{error}; left out")
                continue
            shapes.append((link, _transform(corners, pose @ reader.origin(visual))))
    most = _allowance([len(corners) for _, corners in shapes])
    found = [Visual(link, merge_corners(corners, most)) for link, corners in shapes]
    return Visuals(tuple(v for v in found if len(v.mesh.triangles)), (*left_out, *_coarse(found)))


def _allowance(sizes: list[int]) -> int:
    """Compute the maximum number of triangles per mesh; small meshes leave more for large ones."""
    left, most = MOST_TRIANGLES, MOST_TRIANGLES
    for number, size in enumerate(sorted(sizes)):
        most = left // (len(sizes) - number)
        if size > most:
            break
        left -= size
    return most


def _coarse(found: list[Visual]) -> Iterator[str]:
    cell = max((visual.mesh.cell for visual in found), default=FINEST)
    if cell > FINEST:
        yield f"meshes are coarser than their files, by up to {1000 * cell:.1f} mm"


def _refuse_other(chain: UrdfChain, robot: Robot, urdf: Path) -> None:
    """Refuse a URDF with frames different from the robot file."""
    if difference(chain, robot):
        raise Mismatch(
            f"{urdf}: its joints from {chain.base} to {chain.tip} differ in position from those "
            f"of {robot.name}; give the URDF of the robot file"
        )


def _attached_links(reader: UrdfReader, chain: UrdfChain) -> Iterator[tuple[int, Array, Element]]:
    """Yield links attached to the chain: number, pose in the robot's frame, element."""
    frames = find_frames(chain)
    at_zero = np.zeros(len(chain.joints))
    of_urdf, of_robot = chain.frames(at_zero), frames.poses(at_zero, chain.revolute)
    hung = [(BASE, chain.base, inverse(frames.base))]
    for number, joint in enumerate(chain.joints):
        hung.append((number, joint.link, inverse(of_robot[number]) @ of_urdf[number]))
    for number, link, place in hung:
        for name, pose in reader.find_attached(link, place):
            yield number, pose, reader.links[name]


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
    corners: Array = read_triangles(_inside(_file(shape.get("filename", ""), urdf), meshes)) * scale
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


def _inside(found: tuple[Path, Path], meshes: Path | None) -> Path:
    """Return the path of a mesh inside the permitted folders.

    Raises
    ------
    FileError
        A file elsewhere: a user's file named by a stranger's URDF.
    """
    path, root = found
    allowed = [each.resolve() for each in (root, meshes) if each is not None]
    if not any(path.resolve().is_relative_to(each) for each in allowed):
        raise FileError(
            f"{path}: is outside of {root}, the folder of the URDF or of its package; name its"
            " folder: --meshes"
        )
    return path


def _transform(corners: Array, pose: Array) -> Array:
    moved: Array = corners @ pose[:3, :3].T + pose[:3, 3]
    return moved
