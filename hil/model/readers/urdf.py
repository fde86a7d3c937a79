"""Joints of a URDF file, a chain or a tree: axes and limits.

Only the kinematics is read; fixed joints are merged with the next moving one, branches beside the
longest chain are left out. If several chains are as long, all joints form a tree. Joints above the
base link determine the direction of gravity in it. Rounded multiples of a quarter turn (1.5708) are
replaced by the exact multiples, since nearly parallel or perpendicular axes have other base
parameters than exact ones.

The format: wiki.ros.org/urdf/XML. A xacro file must be expanded first: its elements and expressions
are defined outside the file, so a file that contains any is refused.

Links form a tree, each joint with a motor of its own. A loop of links, a link with two parents and
a mimic joint are refused. A parallelogram drive is still a serial chain: its motor turns with two
joints, as stated by `couplings` of a robot file.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from checked_files.xml_file import XmlFile
from checked_files.yaml_file import FileError
from hil.model.frames import cos_sin, cross_matrix, snap_angle
from hil.model.readers.limits import LimitedJoint, drop_placeholders
from hil.model.robot_file import EARTH, MOST_JOINTS

if TYPE_CHECKING:
    from collections.abc import Container, Iterator, Mapping, Sequence
    from xml.etree.ElementTree import Element

    from hil.arrays import Array, Mask
    from hil.model.robot_arrays import RobotArrays


ROUNDED = 1e-3
"""Tolerance for rounding an angle to a multiple of a quarter turn [rad]."""
MOVING = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic"}
OTHER_TYPES = ("fixed", "floating", "planar")
"""Further joint types of the URDF format."""
PARALLELOGRAM = (
    "loops are not modelled. A parallelogram drive is a serial chain whose motor turns with two "
    "joints: omit its crank and rod, and state couplings in a robot file, such as couplings: "
    "[{motor: 3, joint: 2, ratio: 1}]"
)
ENDS = (
    "name the ends with --from and --to, or base and tip of hil.Robot.load; several last links are "
    "separated by commas"
)
XACRO = "a URDF is expanded xacro: write one with: xacro FILE.xacro -o FILE.urdf"


@dataclass(frozen=True, slots=True, eq=False)
class UrdfJoint(LimitedJoint):
    """Joint of a chain or tree; a URDF states no accelerations.

    Attributes
    ----------
    link : str
        Name of the link moved by the joint.
    before : ndarray, shape (4, 4)
        Pose of the frame in that of the joint before, or in the base link, at q = 0.
    axis : ndarray, shape (3,)
        Unit vector in the joint's frame.
    place : str
        File and line of the limits, and name of the joint, for messages.
    """

    link: str
    before: Array
    axis: Array
    place: str = ""

    def motion(self, q: float) -> Array:
        """Compute the transform of a displacement by `q`, shape (4, 4)."""
        moved = np.eye(4)
        if self.type == "prismatic":
            moved[:3, 3] = q * self.axis
        else:
            moved[:3, :3] = _rotation(self.axis, q)
        return moved


@dataclass(frozen=True, slots=True, eq=False)
class UrdfChain:
    """Joints between links of a URDF: a chain, or a tree with several tips.

    Attributes
    ----------
    robot, base, tip : str
        Names of the robot and of the links; several tips are separated by commas.
    parents : tuple of int
        Joints that carry each joint, from 0; -1 for the base.
    rounded : float
        Largest change of an angle by rounding to quarter turns [rad].
    mount : ndarray, shape (3, 3)
        Rotation of the base link in the root, by the joints above the chain at zero.
    tilting : str
        Name of a joint above the chain that tilts the base link as it moves; empty if none does.
    not_taken : tuple of str
        Omitted contents of the file.
    format : str
        Format of the file, with its article.
    """

    robot: str
    base: str
    tip: str
    joints: tuple[UrdfJoint, ...]
    parents: tuple[int, ...]
    rounded: float
    mount: Array
    tilting: str
    not_taken: tuple[str, ...]
    format: ClassVar[str] = "a URDF"

    def further_lines(self) -> tuple[str, ...]:
        """Return lines of a robot file for contents beyond those of its joints."""
        return ()

    def gravity(self, stated: Sequence[float] | None = None) -> Array:
        """Return gravity in the base link, shape (3,) [m/s^2].

        Parameters
        ----------
        stated : sequence of three floats, optional
            Gravity in the base link; by default that of the earth along -z of the URDF's root.

        Raises
        ------
        FileError
            Gravity is not stated, and a joint above the base link tilts the base as it moves.
        """
        if stated is not None:
            return np.array(stated, dtype=float)
        if self.tilting:
            raise FileError(
                f"{self.robot}: joint {self.tilting!r} above {self.base!r} tilts this link in "
                f"motion, so gravity in {self.base!r} is unknown; state it in m/s2: in a map "
                "with robot: {urdf: ..., from: ..., gravity: [X, Y, Z]}, with hil robot new "
                "--gravity X Y Z, or as gravity of hil.Robot.load"
            )
        return np.asarray(self.mount.T @ np.array(EARTH))

    @property
    def revolute(self) -> Mask:
        """Mask of revolute joints, shape (n_joints,)."""
        return np.array([joint.type == "revolute" for joint in self.joints])

    def frames(self, q: Array) -> Array:
        """Compute the frames of the joints in the base link, shape (n_joints, 4, 4)."""
        found: list[Array] = []
        for parent, joint, angle in zip(self.parents, self.joints, q, strict=True):
            here = np.eye(4) if parent < 0 else found[parent]
            found.append(here @ joint.before @ joint.motion(float(angle)))
        return np.array(found)


@dataclass(frozen=True, slots=True, eq=False)
class UrdfEdge:
    """Joint between two links, as an element of the file."""

    element: Element
    parent: str
    child: str


def read_urdf(path: str | Path, base: str | None = None, tip: str | None = None) -> UrdfChain:
    """Read the chain between two links, or the tree between a link and several.

    Parameters
    ----------
    base, tip : str, optional
        Names of links, several tips separated by commas; by default those of the chain with the
        most moving joints, or the whole tree if several chains have as many.

    Raises
    ------
    FileError
        The file is not a URDF, a link does not exist, or a joint cannot be driven independently.
    """
    return UrdfReader(Path(path)).chain(base, split_names(tip))


class UrdfReader:
    """Parsed URDF: `links`, and joints `below` and `above` each link as elements of the `file`."""

    def __init__(self, path: Path) -> None:
        self.file = XmlFile(path)
        self._path = path
        self._rounded = 0.0
        root = self.file.root
        if root.tag != "robot":
            kind = {"mujoco": "an MJCF", "sdf": "an SDF"}.get(root.tag, "no URDF")
            raise self.file.wrong(
                root,
                f"<{root.tag}> must be <robot>: this is {kind}; robots are read from a URDF, an"
                " MJCF (hil.Robot.load, --robot), or a robot file ending in .yaml",
            )
        # refuse elements and expressions of xacro anywhere in the file
        for element in self.file.root.iter():
            if element.tag.startswith("xacro:"):
                raise self.file.wrong(element, f"<{element.tag}> is not expanded; {XACRO}")
            for key, value in element.items():
                if "${" in value or "$(" in value:
                    raise self.file.wrong(
                        element, f"{key} {value!r} of <{element.tag}> is not expanded; {XACRO}"
                    )
        self.links = self.file.named("link")
        self._edges = {name: self._edge(each) for name, each in self.file.named("joint").items()}
        self.below: dict[str, list[UrdfEdge]] = {}
        self.above: dict[str, UrdfEdge] = {}
        for edge in self._edges.values():
            if edge.child in self.above:
                other = self.above[edge.child].element.get("name")
                raise self.file.wrong(
                    edge.element,
                    f"link {edge.child!r} is the child of joint {other!r} already, and joint"
                    f" {edge.element.get('name')!r} closes a loop; {PARALLELOGRAM}",
                )
            self.above[edge.child] = edge
            self.below.setdefault(edge.parent, []).append(edge)

    def chain(self, base: str | None = None, tips: Sequence[str] = ()) -> UrdfChain:
        """Read the chain between two links, or the tree between a link and several."""
        for name in filter(None, (base, *tips)):
            if name not in self.links:
                raise FileError(
                    f"{self._path}: no link {name!r}; links are {', '.join(self.links)}"
                )
        tips = tips or self._longest(base)
        edges = dict.fromkeys(edge for each in tips for edge in self._between(base, each))
        first = next(iter(edges)).parent
        joints: list[UrdfJoint] = []
        parents: list[int] = []
        place = {first: (-1, np.eye(4))}  # of a link: joint that moves it, pose in its frame
        for edge in edges:
            carrier, pose = place[edge.parent]
            before = pose @ self.origin(edge.element)
            place[edge.child] = carrier, before
            if edge.element.get("type") != "fixed":
                place[edge.child] = len(joints), np.eye(4)
                joints.append(self._joint(edge, before))
                parents.append(carrier)
        if not 1 <= len(joints) <= MOST_JOINTS:
            raise FileError(
                f"{self._path}: {len(joints)} moving joints from {base or 'the root'} to"
                f" {', '.join(tips)} must be 1 to {MOST_JOINTS}; {ENDS}"
            )
        mount, tilting = self._mount(first)
        limited, notes = drop_placeholders(joints)
        return UrdfChain(
            robot=self.file.root.get("name") or self._path.stem,
            base=first,
            tip=", ".join(tips),
            joints=limited,
            parents=tuple(parents),
            rounded=self._rounded,
            mount=mount,
            tilting=tilting,
            not_taken=notes,
        )

    def tips_of(self, robot: RobotArrays) -> list[str]:
        """Return the links moved by the joints with the names of a robot's, in its order."""
        return [self._edges[name].child for name in robot.joint_names if name in self._edges]

    def _mount(self, base: str) -> tuple[Array, str]:
        """Return the rotation of a link in the root, and a tilting joint above, if any."""
        turned, tilting = np.eye(3), ""
        for edge in self._between(None, base) if base in self.above else ():
            turned = turned @ self.origin(edge.element)[:3, :3]
            kind = edge.element.get("type")
            # rotation about the vertical leaves gravity unchanged
            upright = MOVING.get(str(kind)) == "revolute" and (
                abs((turned @ self._axis(edge.element))[2]) > math.cos(ROUNDED)
            )
            if kind not in ("fixed", "prismatic") and not upright:
                tilting = str(edge.element.get("name"))
        return turned, tilting

    def _between(self, base: str | None, tip: str) -> list[UrdfEdge]:
        edges: list[UrdfEdge] = []
        here = tip
        while here != base and here in self.above:
            edges.insert(0, self.above[here])
            here = edges[0].parent
            if len(edges) > len(self.links):
                raise self.file.wrong(
                    edges[0].element,
                    f"link {here!r} is above itself: joint {edges[0].element.get('name')!r} closes"
                    f" a loop; {PARALLELOGRAM}",
                )
        if base is not None and here != base:
            raise FileError(
                f"{self._path}: {tip!r} is below {here!r}, not below {base!r}; name a link above "
                "it with --from"
            )
        if not edges:
            raise FileError(f"{self._path}: no joint between {base!r} and {tip!r}")
        return edges

    def _longest(self, base: str | None) -> list[str]:
        """Return the last link of the longest chain, or all last links if several are as long."""
        chains, following = {}, []
        for tip in self.links:
            above = self.above.get(tip)
            if above is None or above.element.get("type") not in MOVING:
                continue
            edges = self._between(None, tip)
            if base is not None:
                starts = [k for k, edge in enumerate(edges) if edge.parent == base]
                edges = edges[starts[0] :] if starts else []
            own = [e for e in edges if e.element.get("type") in MOVING]
            mimics = [e.element for e in own if e.element.find("mimic") is not None]
            if mimics:
                following.append((len(own) - len(mimics), mimics[0]))
            elif own:
                chains[tip] = (len(own), edges)
        most = max((n for n, _ in chains.values()), default=0)
        longest = {str(e.element.get("name")) for n, edges in chains.values() if n == most
                   for e in edges}  # fmt: skip
        for n, mimic in following:
            # a joint at the end of the arm that follows one of the arm's joints moves with the arm
            if n > most or (n == most and _followed(mimic) in longest):
                raise self._mimics(mimic)
        if not chains:
            raise FileError(
                f"{self._path}: no chain of joints that move: it has {len(self._edges)} joints,"
                f" none of them {', '.join(MOVING)}"
            )
        best = [tip for tip, (n, _) in chains.items() if n == most]
        if len(best) == 1:
            return best
        return self._last(chains, following)

    def _last(
        self,
        chains: Mapping[str, tuple[int, list[UrdfEdge]]],
        following: Sequence[tuple[int, Element]],
    ) -> list[str]:
        """Return the last links of a tree, whose joints follow no others."""
        if following:
            raise self._mimics(following[0][1])
        carriers = {edge.parent for _, edges in chains.values() for edge in edges}
        return [tip for tip in chains if tip not in carriers]

    def _mimics(self, element: Element) -> FileError:
        """Return the error for a mimic joint in the chain."""
        parent = element.find("parent")
        before = None if parent is None else parent.get("link")
        return self.file.wrong(
            element,
            f"joint {element.get('name')!r} mimics another one, {_followed(element)!r}, and has no"
            f" motor of its own, which is not modelled: end the chain before it with --to {before},"
            f" in a map by robot: {{urdf: {self._path.name}, to: {before}}}, for a draft by that "
            "--robot; the last links of a tree are separated by commas. If a motor turns it,"
            " remove <mimic>; if that motor turns with two joints, as in a parallelogram drive,"
            " state couplings in a robot file, too",
        )

    def _joint(self, edge: UrdfEdge, before: Array) -> UrdfJoint:
        element = edge.element
        name, stated = element.get("name", ""), element.get("type", "")
        if element.find("mimic") is not None:
            raise self._mimics(element)
        if stated not in MOVING:
            raise self.file.wrong(
                element,
                f"joint {name!r}: type {stated!r} must be revolute, continuous, prismatic or"
                " fixed; choose another chain with --from and --to",
            )
        kind: Literal["revolute", "prismatic"]
        kind = "prismatic" if stated == "prismatic" else "revolute"
        limit = element.find("limit")
        ranged = limit if stated != "continuous" else None
        at = self.file.line(element if limit is None else limit)
        return UrdfJoint(
            place=f"{self._path}:{at}: joint {name!r}",
            name=name,
            link=edge.child,
            type=kind,
            before=before,
            axis=self._axis(element),
            lower=self._number(ranged, "lower"),
            upper=self._number(ranged, "upper"),
            velocity=self._greatest(limit, "velocity"),
            acceleration=math.nan,
            effort=self._greatest(limit, "effort"),
        )

    def _axis(self, element: Element) -> Array:
        """Return the unit vector of a joint's axis in its frame, shape (3,)."""
        stands = element.find("axis")
        axis = np.array([1.0, 0.0, 0.0])
        if stands is not None:
            axis = np.array(self.file.numbers(stands, "xyz", 3) or axis)
        length = float(np.linalg.norm(axis))
        if not length > 0:
            name = element.get("name", "")
            raise self.file.wrong(element, f"joint {name!r}: axis 0 0 0 must have a direction")
        return axis / length

    def find_attached(
        self, link: str, pose: Array, chain: Container[str] | None = None
    ) -> Iterator[tuple[str, Array]]:
        """Yield a link at `pose` and links attached by fixed joints, with poses.

        Given the links of a chain, other joints below are taken as fixed at position 0.
        """
        yield link, pose
        for edge in self.below.get(link, ()):
            held = chain is not None and edge.child not in chain
            if held or edge.element.get("type") == "fixed":
                yield from self.find_attached(edge.child, pose @ self.origin(edge.element), chain)

    def origin(self, element: Element) -> Array:
        """Compute the transform of a joint's <origin>."""
        found, origin = np.eye(4), element.find("origin")
        if origin is None:
            return found
        roll, pitch, yaw = (
            self._angle(angle) for angle in self.file.numbers(origin, "rpy", 3) or (0.0, 0.0, 0.0)
        )
        about = np.eye(3)
        found[:3, :3] = (
            _rotation(about[2], yaw) @ _rotation(about[1], pitch) @ _rotation(about[0], roll)
        )
        found[:3, 3] = self.file.numbers(origin, "xyz", 3) or np.zeros(3)
        return found

    def _angle(self, stated: float) -> float:
        """Round an angle to a multiple of a quarter turn, within the tolerance."""
        exact = snap_angle(stated, ROUNDED)
        self._rounded = max(self._rounded, abs(stated - exact))
        return exact

    def _edge(self, element: Element) -> UrdfEdge:
        name, stated = element.get("name"), element.get("type")
        if stated not in (known := (*MOVING, *OTHER_TYPES)):
            raise self.file.wrong(
                element, f"joint {name!r}: type {stated!r} must be one of {', '.join(known)}"
            )
        ends = []
        for tag in ("parent", "child"):
            found = element.find(tag)
            name = None if found is None else found.get("link")
            if name not in self.links:
                raise self.file.wrong(element, f"{tag} {name!r} is not a link of this file")
            ends.append(name)
        return UrdfEdge(element, *ends)

    def _greatest(self, element: Element | None, key: str) -> float:
        """Read a limit of speed or effort; 0 means no limit."""
        stated = self._number(element, key)
        return stated if stated > 0 else math.nan

    def _number(self, element: Element | None, key: str) -> float:
        found = None if element is None else self.file.numbers(element, key, 1)
        return math.nan if found is None else found[0]


def split_names(stated: str | None) -> list[str]:
    """Split names separated by commas."""
    return [name for each in (stated or "").split(",") if (name := each.strip())]


def _followed(element: Element) -> str | None:
    """Return the name of the joint that a joint mimics."""
    mimic = element.find("mimic")
    return None if mimic is None else mimic.get("joint")


def _rotation(axis: Array, angle: float) -> Array:
    """Compute a rotation matrix by Rodrigues' formula, exact for quarter turns."""
    c, s = cos_sin(angle)
    return np.eye(3) * c + s * cross_matrix(axis) + (1.0 - c) * np.outer(axis, axis)
