"""Robot model, loaded from a robot file, a URDF, an MJCF or values.

A `Robot` is immutable. Conditions across fields (names of lengths, ties between parameters) are
checked here. The digest covers the content, not the text: plans store it, so that a plan only moves
the robot that it was made for.
"""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import yaml
from pydantic import ValidationError

from checked_files.near import did_you_mean
from checked_files.xml_file import XmlFile
from checked_files.yaml_file import FileError, parse_yaml, place, problems, read_text, refuse
from hil.errors import InvalidValue, UnknownName
from hil.model.drive_train_file import UNKNOWN
from hil.model.readers.robot_draft import NOT_TAKEN, robot_as_stated
from hil.model.readers.urdf import read_urdf
from hil.model.robot_arrays import RobotArrays
from hil.model.robot_file import EARTH, LINK_PARAMETERS, RobotFile, split_tie

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from hil.model.readers.urdf import UrdfChain

    Problem = tuple[tuple[str | int, ...], str]

ROBOTS = Path(__file__).parents[1] / "robots"
DESCRIPTIONS = (".urdf", ".xml", ".xacro")
"""Endings of URDF and MJCF files."""
_NEEDED = "is unknown; state it: needed for motions"
_TIE = re.compile(r"^\s*(\w+)\s*=\s*(\w+)\s*$")


@dataclass(frozen=True, eq=False, repr=False)
class Robot(RobotArrays):
    """Robot: arrays from the robot file (`RobotArrays`), with the source of the file.

    Attributes
    ----------
    source : str
        Path of the file. The property `text` is its content, copied into run folders.

    Examples
    --------
    >>> robot = hil.Robot.load("manutec-r15")
    >>> robot, robot.joint_names[0]
    (<Robot manutec-r15: 6 joints>, 'joint 1')
    """

    source: str
    text: str

    @property
    def not_taken(self) -> tuple[str, ...]:
        """Contents of a URDF or an MJCF that the robot file omits."""
        lines = (line.partition(f"# {NOT_TAKEN}") for line in self.text.splitlines())
        return tuple(note for before, mark, note in lines if mark and not before)

    @classmethod
    def load(
        cls,
        path: str | Path,
        base: str | None = None,
        tip: str | None = None,
        gravity: Sequence[float] | None = None,
    ) -> Robot:
        """Load a robot file, a URDF, an MJCF, or a built-in robot by its name.

        Units are SI, joint side. Values missing in a URDF or an MJCF, such as rotor inertias, are
        unknown and are identified if the recordings permit. MJCF needs MuJoCo. SDF is not read.

        Parameters
        ----------
        path : str or Path
            Robot file (``.yaml``), URDF (``.urdf``, ``.xml``), MJCF (``.xml``), or one of
            `available_robots`.
        base, tip : str, optional
            First and last link of the URDF, or body of the MJCF; by default those of the chain with
            the most moving joints, or all of a tree with several such chains. Several last links
            are separated by commas.
        gravity : sequence of three floats, optional
            Gravity in the link `base` of the URDF [m/s^2], by default that of the earth along -z of
            its root; or in the world of the MJCF, by default that of the file.

        Raises
        ------
        UnknownName
            No built-in robot has this name.
        FileError
            The file cannot be used; the message has one line per problem, with its place.
        InvalidValue
            `base`, `tip` or `gravity` for another source than a URDF or MJCF.

        Examples
        --------
        >>> hil.Robot.load("manutec-r15")
        <Robot manutec-r15: 6 joints>
        """
        path = Path(path)
        if path.suffix.lower() in DESCRIPTIONS:
            return load_description(path, base, tip, gravity)
        if path.suffix not in {".yaml", ".yml"} and len(path.parts) == 1 and not path.is_file():
            path = _find_built_in(str(path))
        if (text := read_text(path)).lstrip().startswith("<"):
            # XML in a file with another ending
            return load_description(path, base, tip, gravity)
        if any(each is not None for each in (base, tip, gravity)):
            raise InvalidValue(
                f"{path}: is not a URDF, and states its chain itself; omit base, tip and gravity"
            )
        return parse_robot(text, str(path))

    @classmethod
    def create(
        cls,
        name: str,
        joints: Sequence[Mapping[str, object]],
        gravity: Sequence[float] = EARTH,
        lengths: Mapping[str, float] | None = None,
        ties: Sequence[str] = (),
    ) -> Robot:
        """Create a robot from plain values, named as in a robot file.

        Parameters
        ----------
        name : str
        joints : sequence of mapping
            Values of each joint, named as in `hil.model.robot_file.Joint`: frame, limits, drive.
        gravity : sequence of three floats
            Gravity in the base frame [m/s^2].
        lengths : mapping, optional
            Named lengths for the frames [m].
        ties : sequence of str
            Ties between parameters, such as ``Iyy6 = Ixx6``.

        Raises
        ------
        InvalidValue
            Impossible values; the message has one line per problem, with its key.

        Examples
        --------
        >>> joint = {"frame": {"alpha": "pi/2"}, "parameters": ["sx", "sy", "Izz"]}
        >>> limits = {"q_min": -1.5, "q_max": 1.5, "velocity_limit": 2.0}
        >>> limits |= {"acceleration_limit": 10.0, "torque_limit": 80.0}
        >>> hil.Robot.create("pendulum", [joint | limits])
        <Robot pendulum: 1 joints>
        """
        values = {
            "name": name,
            "gravity": tuple(gravity),
            "lengths": dict(lengths or {}),
            "joints": tuple(dict(joint) for joint in joints),
            "ties": tuple(ties),
        }
        try:
            file = RobotFile.model_validate(values)
        except ValidationError as error:
            raise InvalidValue("\n".join(f"{name}: {line}" for line in problems(error))) from error
        content = file.model_dump(mode="json", exclude_none=True)
        robot = cls(file, name, yaml.safe_dump(content, sort_keys=False, width=200))
        wrong = [f"{name}: {place(at)}: {why}" for at, why in wrong_names(robot)]
        if wrong:
            raise InvalidValue("\n".join(wrong))
        return robot

    def save(self, path: str | Path) -> None:
        """Write the robot file.

        Raises
        ------
        FileError
            An existing file, or a write error.
        """
        path = Path(path)
        if path.exists():
            raise FileError(f"{path}: already exists; choose another name")
        try:
            path.write_text(self.text, encoding="utf-8")
        except OSError as error:
            raise FileError(f"{path}: cannot be written: {error.strerror}") from error

    def fill_limits(self, limits: Mapping[str, Sequence[float]]) -> Robot:
        """Return the robot with values for limits unknown in the robot file.

        Parameters
        ----------
        limits : mapping of str to sequence (n_joints,) of float
            Limits by key of the file, such as ``velocity_limit``; stated limits are not changed.

        Examples
        --------
        >>> robot = hil.Robot.load("emps").fill_limits({"velocity_limit": [0.5]})
        >>> robot.file.joints[0].velocity_limit
        0.5
        """
        return self.replace_joints({
            axis: {
                key: float(values[axis])
                for key, values in limits.items()
                if getattr(joint, key) == UNKNOWN
            }
            for axis, joint in enumerate(self.file.joints)
        })  # fmt: skip

    def free_links(self, links: Iterable[int] | None = None) -> Robot:
        """Return the robot with all ten parameters of `links` (from 0; default all), untied.

        Examples
        --------
        >>> freed = hil.Robot.load("manutec-r15").free_links()
        >>> len(hil.base_parameters(freed).names)
        36
        """
        whole = set(range(self.n_joints) if links is None else links)
        own = {f"{name}{link + 1}" for name in LINK_PARAMETERS for link in whole}
        ties = tuple(tie for tie in self.file.ties if not own & set(split_tie(tie)))
        joints = {link: {"parameters": LINK_PARAMETERS} for link in whole}
        return self.replace_joints(joints).changed(ties=ties)

    def replace_joints(self, changes: Mapping[int, Mapping[str, object]]) -> Robot:
        """Return the robot with changed keys of some joints, by index from 0."""
        joints = enumerate(self.file.joints)
        return self.changed(
            joints=tuple(joint.model_copy(update=changes.get(axis, {})) for axis, joint in joints)
        )

    def changed(self, **keys: object) -> Robot:
        """Return the robot with changed keys of the robot file, unchecked; the digest differs."""
        return replace(self, file=self.file.model_copy(update=keys))

    def __repr__(self) -> str:
        return f"<Robot {self.name}: {self.n_joints} joints>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Robot) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the content (without layout and joint names), in hexadecimal."""
        names = {"joints": {"__all__": {"name"}}}
        content = self.file.model_dump(mode="json", exclude_none=True, exclude=names)
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


load_robot = Robot.load
"""Deprecated name of `Robot.load`, from before version 0.2."""


def load_description(
    path: Path, base: str | None, tip: str | None, gravity: Sequence[float] | None
) -> Robot:
    """Create a robot from a URDF or an MJCF, according to the root of the file.

    Parameters and errors are those of `Robot.load`.
    """
    chain = read_description(path, base, tip)
    try:
        robot = parse_robot(robot_as_stated(chain, gravity), str(path))
        if robot.weighed_slides:
            text = robot_as_stated(chain, gravity, robot.weighed_slides)
            robot = parse_robot(text, str(path))
    except FileError as error:
        raise FileError(
            "\n".join(_locate_in_urdf(chain, line) for line in str(error).split("\n"))
        ) from error
    return robot


def read_description(path: Path, base: str | None = None, tip: str | None = None) -> UrdfChain:
    """Read the joints of a URDF or an MJCF; parameters and errors are those of `Robot.load`."""
    if XmlFile(path).root.tag != "mujoco":
        return read_urdf(path, base, tip)
    from hil.model.readers.mjcf import read_mjcf  # noqa: PLC0415 - MuJoCo is an extra

    return read_mjcf(path, base, tip)


def _locate_in_urdf(chain: UrdfChain, problem: str) -> str:
    """Locate a robot-file problem in the original URDF."""
    found = re.match(r".*?:\d+: joints\.(\d+)\.(\w+): (.*)", problem)
    return f"{chain.joints[int(found[1])].place}: {found[2]}: {found[3]}" if found else problem


def refuse_unknown(robot: Robot) -> None:
    """Refuse motions of a robot with unknown limits or drive trains.

    Raises
    ------
    FileError
        One line for each unknown limit or value of a drive train.
    """
    wrong = list(unknown_for_motion(robot))
    if wrong and robot.source.lower().endswith(DESCRIPTIONS):
        raise FileError(
            f"{robot.source}: no URDF or MJCF states gears, torque constants and accelerations,"
            " which motions need; write a robot file from it with: hil robot new --urdf "
            f"{robot.source} -o {Path(robot.source).stem}.yaml"
        )
    refuse(robot.source, robot.text, wrong)


def parse_robot(text: str, source: str) -> Robot:
    """Create a robot from a robot file's text; messages name `source`.

    Raises
    ------
    FileError
        See `Robot.load`.
    """
    try:
        file = _parsed(text)
    except FileError:
        file = parse_yaml(text, RobotFile, source)
    robot = Robot(file, source, text)
    refuse(source, text, wrong_names(robot))
    return robot


@lru_cache(maxsize=8)
def _parsed(text: str) -> RobotFile:
    """Parse a robot file, with a cache for the models of a fleet."""
    return parse_yaml(text, RobotFile, "")


def available_robots() -> list[str]:
    """Return the names of the built-in robots.

    Examples
    --------
    >>> hil.available_robots()
    ['emps', 'manutec-r15', 'staubli-tx40']
    """
    return sorted(path.stem for path in ROBOTS.glob("*.yaml") if len(path.suffixes) == 1)


def _find_built_in(name: str) -> Path:
    if name not in available_robots():
        raise UnknownName(
            f"{name}: unknown robot{did_you_mean(name, available_robots())}; available:"
            f" {', '.join(available_robots())}; or give the path of a robot file ending in .yaml,"
            " or of a URDF ending in .urdf"
        )
    return ROBOTS / f"{name}.yaml"


def wrong_names(robot: RobotArrays) -> Iterator[Problem]:
    """Yield problems of names in a robot file: place and description."""
    yield from _wrong_parents(robot)
    yield from _unknown_lengths(robot)
    yield from _wrong_ties(robot)
    yield from _wrong_couplings(robot)
    yield from _wrong_springs(robot)


def unknown_for_motion(robot: RobotArrays) -> Iterator[Problem]:
    """Yield the unknown values needed for motion; rotor inertias are not."""
    limits = ("velocity_limit", "acceleration_limit", "torque_limit")
    for j, joint in enumerate(robot.file.joints):
        for key in limits:
            if np.isnan(getattr(robot, key)[j]):
                yield ("joints", j, key), _NEEDED
        if joint.drive is None:
            yield (("joints", j), "drive is not stated; motions need its gear_ratio")
            continue
        for key in ("gear_ratio", "torque_constant"):
            if np.isnan(getattr(robot, key)[j]):
                yield ("joints", j, "drive", key), _NEEDED


def _wrong_parents(robot: RobotArrays) -> Iterator[Problem]:
    for index, parent in enumerate(robot.parents):
        if not -1 <= parent < index:
            yield (
                ("joints", index, "parent"),
                f"{parent + 1} must be in 0..{index}: 0 for the base, or a joint stated before",
            )


def _unknown_lengths(robot: RobotArrays) -> Iterator[Problem]:
    known = robot.file.lengths
    for index in range(robot.n_joints):
        for key in ("b", "d", "r"):
            expression = getattr(robot, f"{key}_expressions")[index]
            for name in sorted(expression.names - set(known)):
                names = f"known are {', '.join(known)}" if known else "none are named"
                yield ("joints", index, "frame", key), f"{name} is not a length; {names} in lengths"


def _wrong_ties(robot: RobotArrays) -> Iterator[Problem]:
    valid = [tie for tie in robot.file.ties if _TIE.match(tie)]
    left = [split_tie(tie)[0] for tie in valid]
    for index, tie in enumerate(robot.file.ties):
        at = ("ties", index)
        if tie not in valid:
            yield at, f"{tie!r} must read as in: Iyy6 = Ixx6"
            continue
        tied, value = split_tie(tie)
        absent = [name for name in (tied, value) if name not in robot.present]
        if absent:
            yield at, f"{absent[0]} is not present; add it to its joint's parameters"
        elif tied == value or left.count(tied) > 1:
            yield at, f"{tied} is tied twice or to itself; remove this tie"
        elif value in left:
            yield at, f"{value} is tied itself; tie {tied} to what {value} is tied to"
        elif tied[0] != value[0]:
            yield at, f"{tied} and {value} have different units; tie inertia to inertia"


def _wrong_couplings(robot: RobotArrays) -> Iterator[Problem]:
    stated = robot.file.couplings or ()
    for index, coupling in enumerate(stated):
        for key in ("motor", "joint"):
            number = getattr(coupling, key)
            if number > robot.n_joints:
                yield (
                    ("couplings", index, key),
                    f"{number} must be one of the {robot.n_joints} joints",
                )
        if coupling.motor in [other.motor for other in stated[:index]]:
            yield (
                ("couplings", index, "motor"),
                f"motor {coupling.motor} is coupled already; at most one joint besides its own "
                "allowed",
            )


def _wrong_springs(robot: RobotArrays) -> Iterator[Problem]:
    stated = robot.file.springs or ()
    for index, spring in enumerate(stated):
        if spring.joint > robot.n_joints:
            at = ("springs", index, "joint")
            yield at, f"{spring.joint} must be one of the {robot.n_joints} joints"
        elif spring in stated[:index]:
            yield ("springs", index), "is stated twice; remove one"
        elif spring.shape != "linear" and not robot.revolute[spring.joint - 1]:
            at = ("springs", index, "shape")
            yield at, f"{spring.shape} must be linear at a prismatic joint"
