"""A robot as everything above it sees it, and how it comes to be.

A `Robot` is immutable. It comes by name from those that come along, from a file, from a URDF, or
from values; what one field alone cannot show (names of lengths, ties between parameters) is checked
here. Its digest is that of the content, not of the text: plans keep it, so that no plan moves a
robot that it was not made for.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import yaml
from pydantic import ValidationError

from checked_files.near import did_you_mean
from checked_files.yaml_file import FileError, line_of, parse_yaml, place, problems, read_text
from hil.errors import InvalidValue, UnknownName
from hil.model.drive_train_file import UNKNOWN
from hil.model.readers.robot_draft import robot_as_stated
from hil.model.readers.urdf import read_urdf
from hil.model.robot_arrays import RobotArrays
from hil.model.robot_checks import unknown_for_motion, wrong_names
from hil.model.robot_file import EARTH, RobotFile

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

ROBOTS = Path(__file__).parents[1] / "robots"


@dataclass(frozen=True, eq=False, repr=False)
class Robot(RobotArrays):
    """A robot: what its file says (`RobotArrays`), and where that stands.

    Attributes
    ----------
    source : str
        Where the file stands; `text` is what stands there, to be copied into run folders.
    """

    source: str
    text: str

    @classmethod
    def load(cls, name: str) -> Robot:
        """Load a robot that comes along, by its name; see `available_robots`.

        Raises
        ------
        UnknownName
            No robot of this name comes along.
        """
        return cls.from_file(_of_name(name))

    @classmethod
    def from_file(cls, path: str | Path) -> Robot:
        """Load a robot from its file.

        Raises
        ------
        FileError
            A file that cannot be used: one line for each problem, with its place.
        """
        return parse_robot(read_text(path), str(path))

    @classmethod
    def from_values(
        cls,
        name: str,
        joints: Sequence[Mapping[str, object]],
        gravity: Sequence[float] = EARTH,
        lengths: Mapping[str, float] | None = None,
        ties: Sequence[str] = (),
    ) -> Robot:
        """Make a robot of plain values, named as in a robot file.

        Parameters
        ----------
        name : str
        joints : sequence of mapping
            Of each joint what `hil.model.robot_file.Joint` names: frame, limits, drive.
        gravity : sequence of three floats
            In the base frame [m/s^2].
        lengths : mapping, optional
            Named lengths that frames refer to [m].
        ties : sequence of str
            Such as ``Iyy6 = Ixx6``.

        Raises
        ------
        InvalidValue
            Values that a robot cannot have: one line for each problem, with its key.
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

    def with_limits(self, limits: Mapping[str, Sequence[float]]) -> Robot:
        """Return the same robot with values for limits that its file leaves unknown.

        Parameters
        ----------
        limits : mapping of str to sequence (n_joints,) of float
            By key of the file, such as ``velocity_limit``; those that it states stay.
        """
        joints = tuple(
            joint.model_copy(
                update={
                    key: float(values[axis])
                    for key, values in limits.items()
                    if getattr(joint, key) == UNKNOWN
                }
            )
            for axis, joint in enumerate(self.file.joints)
        )
        return Robot(self.file.model_copy(update={"joints": joints}), self.source, self.text)

    def __repr__(self) -> str:
        return f"<Robot {self.name}: {self.n_joints} joints>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Robot) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the content (not of its layout), in hexadecimal."""
        content = json.dumps(self.file.model_dump(mode="json", exclude_none=True), sort_keys=True)
        return hashlib.sha256(content.encode()).hexdigest()


def load_robot(name_or_path: str | Path) -> Robot:
    """Load a robot that comes along by its name, or any by the path of its file or its URDF.

    Raises
    ------
    UnknownName
        No robot of this name comes along.
    FileError
        A file that cannot be used: one line for each problem, with its place.
    """
    path = Path(name_or_path)
    if path.suffix == ".urdf":
        return robot_from_urdf(path)
    is_path = path.suffix in {".yaml", ".yml"} or len(path.parts) > 1
    return Robot.from_file(path) if is_path else Robot.load(str(name_or_path))


def robot_from_urdf(
    path: Path | str,
    base: str | None = None,
    tip: str | None = None,
    gravity: Sequence[float] = EARTH,
) -> Robot:
    """Make a robot of the chain between two links of a URDF.

    Parameters
    ----------
    path : path
    base, tip : str, optional
        Names of links; by default those of the chain with most joints that move.
    gravity : sequence of three floats
        In the link `base` [m/s^2].

    Raises
    ------
    FileError
        No URDF, no such link, or a chain with a joint that cannot be driven by itself.
    """
    return parse_robot(robot_as_stated(read_urdf(path, base, tip), gravity), str(path))


def refuse_unknown(robot: Robot) -> None:
    """Refuse to move a robot, or to plan motions of it, of which too little is known.

    Raises
    ------
    FileError
        One line for each limit or value of a drive train that its file leaves unknown.
    """
    wrong = [
        f"{robot.source}:{line_of(robot.text, at)}: {place(at)}: {why}"
        for at, why in unknown_for_motion(robot)
    ]
    if wrong and robot.source.endswith(".urdf"):
        raise FileError(
            f"{robot.source}: a URDF states no gears, torque constants and accelerations, which"
            f" motions need; write a robot file from it with: hil robot new --urdf {robot.source}"
            f" -o {Path(robot.source).stem}.yaml"
        )
    if wrong:
        raise FileError("\n".join(wrong))


def parse_robot(text: str, source: str) -> Robot:
    """Make a robot of a robot file's text; `source` names it in messages.

    Raises
    ------
    FileError
        As `load_robot`.
    """
    robot = Robot(parse_yaml(text, RobotFile, source), source, text)
    wrong = [f"{source}:{line_of(text, at)}: {place(at)}: {why}" for at, why in wrong_names(robot)]
    if wrong:
        raise FileError("\n".join(wrong))
    return robot


def available_robots() -> list[str]:
    """Return the names of the robots that come along."""
    return sorted(path.stem for path in ROBOTS.glob("*.yaml") if len(path.suffixes) == 1)


def _of_name(name: str) -> Path:
    if name not in available_robots():
        raise UnknownName(
            f"{name}: unknown robot{did_you_mean(name, available_robots())}; available:"
            f" {', '.join(available_robots())}; or give the path of a robot file ending in .yaml"
        )
    return ROBOTS / f"{name}.yaml"
