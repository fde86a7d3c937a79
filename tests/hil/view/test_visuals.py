"""Meshes of a URDF, in the frames of the robot's links."""

from __future__ import annotations

import struct
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest
from urdf_robots import ROBOTS, urdf

from hil.errors import FileError, Mismatch
from hil.model.readers.axes_to_frames import Frames, find_frames
from hil.model.readers.urdf import read_urdf
from hil.model.robot import Robot
from hil.view.visuals import MOST_TRIANGLES, _allowance, merge_corners, read_triangles, visuals

if TYPE_CHECKING:
    from pathlib import Path

TETRAHEDRON = 0.1 * np.array(
    [[[0, 0, 0], [0, 1, 0], [1, 0, 0]], [[0, 0, 0], [1, 0, 0], [0, 0, 1]],
     [[0, 0, 0], [0, 0, 1], [0, 1, 0]], [[1, 0, 0], [0, 1, 0], [0, 0, 1]]]
)  # fmt: skip


def binary_stl(corners: np.ndarray) -> bytes:
    rows = b"".join(struct.pack("<12fH", 0, 0, 0, *each.ravel(), 0) for each in corners)
    return bytes(80) + struct.pack("<I", len(corners)) + rows


def ascii_stl(corners: np.ndarray) -> bytes:
    lines = ["solid made"]
    for each in corners:
        vertices = [f"vertex {x} {y} {z}" for x, y, z in each]
        lines += ["facet normal 0 0 0", "outer loop", *vertices, "endloop", "endfacet"]
    return "\n".join([*lines, "endsolid"]).encode()


def obj(corners: np.ndarray) -> bytes:
    vertices = [f"v {x} {y} {z}" for x, y, z in corners.reshape(-1, 3)]
    last = len(corners)
    faces = [f"f {3 * i + 1}//1 {3 * i + 2}//1 {3 * (i - last) + 2}" for i in range(last)]
    return "\n".join([*vertices, *faces]).encode()


@pytest.fixture
def scara(tmp_path: Path) -> Path:
    """URDF in a package, whose second link has the shape `shape` and whose base has a box."""
    package = tmp_path / "scara_description"
    (package / "meshes").mkdir(parents=True)
    (package / "urdf").mkdir()
    (package / "meshes" / "arm.stl").write_bytes(binary_stl(TETRAHEDRON))
    return package / "urdf" / "scara.urdf"


def write(path: Path, shape: str, origin: str = "") -> None:
    text = urdf("scara", ROBOTS["SCARA"])
    visual = f"<visual>{origin}<geometry>{shape}</geometry></visual>"
    text = text.replace('<link name="link2">', f'<link name="link2">{visual}')
    base = '<visual><geometry><box size="0.2 0.3 0.4"/></geometry></visual>'
    path.write_text(text.replace('<link name="base"/>', f'<link name="base">{base}</link>'))


@pytest.mark.parametrize(("name", "content"), [
    ("a.stl", binary_stl(TETRAHEDRON)), ("b.STL", ascii_stl(TETRAHEDRON)),
    ("c.obj", obj(TETRAHEDRON)),
])  # fmt: skip
def test_each_format_gives_the_same_triangles(name: str, content: bytes, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    np.testing.assert_allclose(read_triangles(tmp_path / name), TETRAHEDRON, atol=1e-7)


@pytest.mark.parametrize(("name", "content", "message"), [
    ("a.dae", b"<COLLADA/>", r"\.dae must be \.stl or \.obj; convert it"),
    ("a.stl", binary_stl(TETRAHEDRON)[:-10], "truncated"),
    ("a.stl", b"solid made", "no triangles"),
    ("a.stl", b"solid made\nvertex 1 2\n", "three coordinates"),
    ("a.obj", b"v 0 0 0\nf 1 2 3", "a face names vertex '2'"),
    ("a.obj", b"v 0 0 0\nf 0 1 1", "a face names vertex '0'"),
    ("a.stl", binary_stl(np.full((1, 3, 3), np.nan)), "not numbers"),
])  # fmt: skip
def test_a_file_that_cannot_be_read_is_refused(
    name: str, content: bytes, message: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileError, match=message):
        read_triangles(tmp_path / name)


def test_a_mesh_stands_in_the_frame_of_its_link(scara: Path) -> None:
    """Corners of the mesh have the positions of the URDF's own kinematics in any configuration."""
    write(scara, '<mesh filename="package://scara_description/meshes/arm.stl" scale="2 2 2"/>',
          '<origin xyz="0.1 0 0.2" rpy="0.3 0.2 0.1"/>')  # fmt: skip
    robot, chain = Robot.load(scara), read_urdf(scara)
    found = visuals(scara, robot)
    assert not found.left_out
    base, arm = found.visuals
    assert (base.link, arm.link) == (-1, 1)
    q = np.array([0.4, -0.7, 0.1, 0.2])
    base_frame = find_frames(chain).base
    lengths = robot.alpha, robot.d, robot.theta, robot.r, robot.gamma, robot.b
    frames = Frames(*lengths, robot.parents, base_frame)
    shown = _placed(frames.poses(q, robot.revolute)[1], arm.mesh.vertices)
    origin = np.eye(4)
    roll, pitch, yaw = 0.3, 0.2, 0.1
    turns = [
        [[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]],
        [[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]],
        [[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]],
    ]
    origin[:3, :3] = np.linalg.multi_dot(np.array(turns))
    origin[:3, 3] = 0.1, 0.0, 0.2
    wanted = _placed(chain.frames(q)[1] @ origin, 2 * np.unique(TETRAHEDRON.reshape(-1, 3), axis=0))
    assert len(shown) == len(wanted) == 4
    for corner in wanted:
        assert np.linalg.norm(shown - corner, axis=1).min() < 2e-4
    still = _placed(find_frames(chain).base, base.mesh.vertices)
    np.testing.assert_allclose(still.max(axis=0), [0.1, 0.15, 0.2], atol=2e-4)


def test_what_cannot_be_shown_is_left_out_and_stated(scara: Path) -> None:
    write(scara, '<mesh filename="package://scara_description/meshes/arm.dae"/>')
    found = visuals(scara, Robot.load(scara))
    assert [visual.link for visual in found.visuals] == [-1]
    assert len(found.left_out) == 1
    assert "arm.dae: .dae must be .stl or .obj; convert it; left out" in found.left_out[0]


@pytest.mark.parametrize(
    "stated",
    ["../../arm.stl", "{}/arm.stl", "file://{}/arm.stl", "package://scara_description/../arm.stl",
     "package://../arm.stl", "linked.stl"],
)  # fmt: skip
def test_a_mesh_outside_of_the_package_is_read_where_its_folder_is_named(
    scara: Path, tmp_path: Path, stated: str
) -> None:
    (tmp_path / "arm.stl").write_bytes(binary_stl(TETRAHEDRON))
    (scara.parent / "linked.stl").symlink_to(tmp_path / "arm.stl")
    write(scara, f'<mesh filename="{stated.format(tmp_path)}"/>')
    found = visuals(scara, Robot.load(scara))
    assert [visual.link for visual in found.visuals] == [-1]
    assert "is outside of" in found.left_out[0]
    assert "--meshes" in found.left_out[0]
    if not stated.startswith("package://.."):  # no name of a package
        named = visuals(scara, Robot.load(scara), tmp_path)
        assert [visual.link for visual in named.visuals] == [-1, 1]


def test_meshes_beside_the_urdf_are_its_package_s_where_there_is_a_package_xml(
    scara: Path,
) -> None:
    write(scara, '<mesh filename="../meshes/arm.stl"/>')
    assert visuals(scara, Robot.load(scara)).left_out
    (scara.parents[1] / "package.xml").write_text("<package/>")
    assert not visuals(scara, Robot.load(scara)).left_out


def test_a_urdf_of_another_robot_is_refused(scara: Path, tmp_path: Path) -> None:
    write(scara, '<sphere radius="0.1"/>')
    other = tmp_path / "other.urdf"
    other.write_text(urdf("other", ROBOTS["Panda"]))
    with pytest.raises(Mismatch, match="the URDF of the robot file"):
        visuals(scara, Robot.load(other))


def test_a_fine_mesh_is_thinned_within_the_cell_that_is_stated() -> None:
    angles = np.linspace(0.0, 2 * np.pi, 201)
    ring = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(201)])
    fan = np.array([[np.zeros(3), a, b] for a, b in pairwise(ring)])
    mesh = merge_corners(fan, 60)
    assert 20 <= len(mesh.triangles) <= 60
    off = [np.linalg.norm(mesh.vertices - corner, axis=1).min() for corner in ring]
    assert max(off) <= mesh.cell * np.sqrt(3) / 2


def _placed(pose: np.ndarray, points: np.ndarray) -> np.ndarray:
    return points @ pose[:3, :3].T + pose[:3, 3]


def test_small_meshes_leave_their_share_of_triangles_to_large_ones() -> None:
    assert _allowance([12, 24, 50_000]) == MOST_TRIANGLES - 36
    assert _allowance([30_000, 30_000]) == MOST_TRIANGLES // 2
    assert _allowance([12, 24]) >= 24
    assert _allowance([]) > 0
