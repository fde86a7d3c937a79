"""A robot as everything above it sees it: frames, limits and drive trains as arrays.

A `Robot` is immutable. It comes by name from those that come along, from a file, or from values;
what one field alone cannot show (names of lengths, ties between parameters) is checked here. Its
digest is that of the content, not of the text: plans keep it, so that no plan moves a robot that it
was not made for.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import yaml
from pydantic import ValidationError

from checked_files.yaml_file import FileError, line_of, parse_yaml, place, problems, read_text
from hil.errors import InvalidValue, UnknownName
from hil.model.added_parameters import added_names
from hil.model.polynomial import Polynomial, parse
from hil.model.robot_checks import split_tie, unknown_for_motion, wrong_names
from hil.model.robot_file import LINK_PARAMETERS, NO_DRIVE, UNKNOWN, Drive, Joint, RobotFile

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

ROBOTS = Path(__file__).parents[1] / "robots"


class MotorCoupling(NamedTuple):
    """A motor that the motion of a second joint turns as well.

    Attributes
    ----------
    motor, joint : int
        Indices from 0.
    ratio : float
        Turn of the second joint that moves the motor as far as one turn of its own joint, inverted:
        the motor turns with ``q[motor] + ratio q[joint]``.
    """

    motor: int
    joint: int
    ratio: float


@dataclass(frozen=True, eq=False, repr=False)
class Robot:
    """A robot; all arrays are read-only and indexed by joint, from 0.

    Attributes
    ----------
    file : RobotFile
        What its file says.
    source : str
        Where the file stands; `text` is what stands there, to be copied into run folders.
    """

    file: RobotFile
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
        gravity: Sequence[float] = (0.0, 0.0, -9.81),
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

    def __repr__(self) -> str:
        return f"<Robot {self.name}: {self.n_joints} joints>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Robot) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self.file.name

    @property
    def n_joints(self) -> int:
        """Number of joints and links."""
        return len(self.file.joints)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the content (not of its layout), in hexadecimal."""
        content = json.dumps(self.file.model_dump(mode="json", exclude_none=True), sort_keys=True)
        return hashlib.sha256(content.encode()).hexdigest()

    @cached_property
    def gravity(self) -> NDArray[np.float64]:
        """Acceleration of free fall in the base frame, shape (3,) [m/s^2]."""
        return _read_only(self.file.gravity)

    @cached_property
    def revolute(self) -> NDArray[np.bool_]:
        """Which joints turn; the others slide. Shape (n_joints,)."""
        return _read_only_flags([joint.type == "revolute" for joint in self.file.joints])

    def position_unit(self, axis: int) -> str:
        """Unit of q of a joint (from 0): rad or m."""
        return "rad" if self.revolute[axis] else "m"

    def torque_unit(self, axis: int) -> str:
        """Unit of the torque, or force, of a joint (from 0): N m or N."""
        return "N m" if self.revolute[axis] else "N"

    @property
    def torque_units(self) -> str:
        """Unit of a column of torques of all joints: N m, N, or both."""
        units = dict.fromkeys(self.torque_unit(axis) for axis in range(self.n_joints))
        return " or ".join(units)

    @property
    def position_units(self) -> str:
        """Unit of a column of positions of all joints: rad, m, or both."""
        units = dict.fromkeys(self.position_unit(axis) for axis in range(self.n_joints))
        return " or ".join(units)

    @cached_property
    def alpha(self) -> NDArray[np.float64]:
        """Angles between successive axes [rad]."""
        return self._array(lambda joint: joint.frame.alpha)

    @cached_property
    def theta(self) -> NDArray[np.float64]:
        """Angles about the axes; q adds to those of revolute joints [rad]."""
        return self._array(lambda joint: joint.frame.theta)

    @cached_property
    def d(self) -> NDArray[np.float64]:
        """Distances between successive axes [m]."""
        return _read_only([length.evaluate(self.file.lengths) for length in self.d_expressions])

    @cached_property
    def r(self) -> NDArray[np.float64]:
        """Shifts along the axes; q adds to those of prismatic joints [m]."""
        return _read_only([length.evaluate(self.file.lengths) for length in self.r_expressions])

    @cached_property
    def d_expressions(self) -> tuple[Polynomial, ...]:
        """`d` in the names of lengths."""
        return tuple(parse(joint.frame.d) for joint in self.file.joints)

    @cached_property
    def r_expressions(self) -> tuple[Polynomial, ...]:
        """`r` in the names of lengths."""
        return tuple(parse(joint.frame.r) for joint in self.file.joints)

    @cached_property
    def q_min(self) -> NDArray[np.float64]:
        """Lower ends of the joints' ranges [rad]."""
        return self._array(lambda joint: joint.q_min)

    @cached_property
    def q_max(self) -> NDArray[np.float64]:
        """Upper ends of the joints' ranges [rad]."""
        return self._array(lambda joint: joint.q_max)

    @cached_property
    def velocity_limit(self) -> NDArray[np.float64]:
        """Greatest speeds [rad/s]; NaN where the file leaves them unknown."""
        return self._array(lambda joint: joint.velocity_limit)

    @cached_property
    def acceleration_limit(self) -> NDArray[np.float64]:
        """Greatest accelerations [rad/s^2]; NaN where unknown."""
        return self._array(lambda joint: joint.acceleration_limit)

    @cached_property
    def torque_limit(self) -> NDArray[np.float64]:
        """Greatest joint torques [N m]; NaN where unknown."""
        return self._array(lambda joint: joint.torque_limit)

    @cached_property
    def gear_ratio(self) -> NDArray[np.float64]:
        """Motor turns per joint turn; NaN where unknown."""
        return self._drives(lambda drive: drive.gear_ratio)

    @cached_property
    def rotor_inertia(self) -> NDArray[np.float64]:
        """Motor inertias, motor side [kg m^2]; NaN where unknown."""
        return self._drives(lambda drive: drive.rotor_inertia)

    @cached_property
    def rotor_inertia_unknown(self) -> NDArray[np.bool_]:
        """Which motors' inertia is to be identified, shape (n_joints,)."""
        return _read_only_flags(np.isnan(self.rotor_inertia).tolist())

    @cached_property
    def reflected_inertia(self) -> NDArray[np.float64]:
        """Known motor inertias as the joints feel them [kg m^2]; 0 where unknown."""
        return _read_only(np.nan_to_num(self.gear_ratio**2 * self.rotor_inertia))

    @cached_property
    def torque_constant(self) -> NDArray[np.float64]:
        """Motor torque per current [N m/A]; NaN where unknown."""
        return self._drives(lambda drive: drive.torque_constant)

    @cached_property
    def encoder_resolution(self) -> NDArray[np.float64]:
        """Increments per turn of the motors; NaN where they are not stated."""
        return self._drives(lambda drive: drive.encoder_resolution or UNKNOWN)

    @cached_property
    def rotor_inertia_uncertainty(self) -> NDArray[np.float64]:
        """Relative standard deviations of `rotor_inertia`."""
        return self._drives(lambda drive: drive.rotor_inertia_uncertainty)

    @cached_property
    def torque_constant_uncertainty(self) -> NDArray[np.float64]:
        """Relative standard deviations of `torque_constant`."""
        return self._drives(lambda drive: drive.torque_constant_uncertainty)

    @cached_property
    def couplings(self) -> tuple[MotorCoupling, ...]:
        """Motors that a second joint turns as well."""
        stated = self.file.couplings or ()
        return tuple(MotorCoupling(c.motor - 1, c.joint - 1, c.ratio) for c in stated)

    @cached_property
    def motor_matrix(self) -> NDArray[np.float64]:
        """Motors' angles per joint angle, shape (n_joints, n_joints).

        So motors turn by ``R q``, and joints feel ``R.T`` times the motors' torques. NaN in the
        rows of motors whose gear ratio is unknown.
        """
        turns = np.eye(self.n_joints)
        for motor, joint, ratio in self.couplings:
            turns[motor, joint] += ratio
        return _read_only(self.gear_ratio[:, np.newaxis] * turns)

    @cached_property
    def link_parameters(self) -> tuple[str, ...]:
        """Names of all ten parameters of every link, eq. (5): ``Ixx1`` to ``m<n>``."""
        links = range(1, self.n_joints + 1)
        return tuple(f"{parameter}{link}" for link in links for parameter in LINK_PARAMETERS)

    @cached_property
    def added_parameters(self) -> tuple[str, ...]:
        """Names of unknowns that no link has (`hil.model.added_parameters`)."""
        return added_names(self)

    @property
    def standard_parameters(self) -> tuple[str, ...]:
        """Names of the links' parameters, and of unknown ones of drive trains and springs."""
        return (*self.link_parameters, *self.added_parameters)

    @cached_property
    def present(self) -> tuple[str, ...]:
        """Standard parameters that are present (Table 1), those tied to others included."""
        joints = enumerate(self.file.joints, start=1)
        links = (f"{name}{link}" for link, joint in joints for name in joint.parameters)
        return (*links, *self.added_parameters)

    @cached_property
    def ties(self) -> dict[str, str]:
        """From each tied standard parameter to the one whose value it has."""
        return dict(split_tie(tie) for tie in self.file.ties)

    def _array(self, value: Callable[[Joint], float | str]) -> NDArray[np.float64]:
        return _read_only([_number(value(joint)) for joint in self.file.joints])

    def _drives(self, value: Callable[[Drive], float | str]) -> NDArray[np.float64]:
        return self._array(lambda joint: value(joint.drive or NO_DRIVE))


def _number(stated: float | str) -> float:
    return math.nan if stated == UNKNOWN else float(stated)


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
        from hil.model.urdf_robot import robot_from_urdf  # noqa: PLC0415 - makes a robot itself

        return robot_from_urdf(path)
    is_path = path.suffix in {".yaml", ".yml"} or len(path.parts) > 1
    return Robot.from_file(path) if is_path else Robot.load(str(name_or_path))


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
            f"{name}: unknown robot; available: {', '.join(available_robots())};"
            " or give the path of a robot file ending in .yaml"
        )
    return ROBOTS / f"{name}.yaml"


def _read_only(values: object) -> NDArray[np.float64]:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def _read_only_flags(values: list[bool]) -> NDArray[np.bool_]:
    array = np.array(values, dtype=np.bool_)
    array.setflags(write=False)
    return array
