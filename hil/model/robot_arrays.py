"""Contents of a robot file as arrays indexed by joint: frames, limits, drive trains, parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.model.drive_train_file import NO_DRIVE, UNKNOWN, USUAL_UNCERTAINTY, Drive
from hil.model.frames import ROUNDED_OFF, frame_pose
from hil.model.polynomial import Polynomial, parse
from hil.model.robot_file import LINK_PARAMETERS, Joint, RobotFile, split_tie

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from numpy.typing import NDArray

    from hil.arrays import Array, Mask


_SPRINGS = {"linear": "k", "cosine": "kc", "sine": "ks"}


def _per_joint(value: Callable[[Joint], float | str]) -> cached_property[Array]:
    """Return a property: read-only array of a joint's value, NaN if unknown, shape (n_joints,)."""

    def array(robot: RobotArrays) -> Array:
        stated = [value(joint) for joint in robot.file.joints]
        return read_only([math.nan if each == UNKNOWN else float(each) for each in stated])

    return cached_property(array)


def _per_drive(value: Callable[[Drive], float | str]) -> cached_property[Array]:
    """Return a property for a read-only array of a drive train's value, as `_per_joint`."""
    return _per_joint(lambda joint: value(joint.drive or NO_DRIVE))


def _expressions(key: str) -> cached_property[tuple[Polynomial, ...]]:
    """Return a property: polynomials of a length in the joints' frames, in named lengths."""
    return cached_property(
        lambda robot: tuple(parse(getattr(joint.frame, key) or "0") for joint in robot.file.joints)
    )


def _length(key: str) -> cached_property[Array]:
    """Return a property: read-only array of the values of `_expressions`, shape (n_joints,)."""

    def array(robot: RobotArrays) -> Array:
        expressions = getattr(robot, f"{key}_expressions")
        return read_only([length.evaluate(robot.file.lengths) for length in expressions])

    return cached_property(array)


class MotorCoupling(NamedTuple):
    """Motor also turned by the motion of a second joint.

    Attributes
    ----------
    motor, joint : int
        Indices from 0.
    ratio : float
        Rotation of the motor by the second joint, relative to that by its own joint: the motor
        turns with ``q[motor] + ratio q[joint]``.
    """

    motor: int
    joint: int
    ratio: float


@dataclass(frozen=True, eq=False, repr=False)
class RobotArrays:
    """Robot in numbers; the arrays are read-only and indexed by joint, from 0.

    Attributes
    ----------
    file : RobotFile
        Content of the robot file.
    """

    file: RobotFile

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self.file.name

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of `q`; numbers for unnamed joints."""
        return tuple(j.name or f"joint {n}" for n, j in enumerate(self.file.joints, start=1))

    @property
    def n_joints(self) -> int:
        """Number of joints and links."""
        return len(self.file.joints)

    @cached_property
    def gravity(self) -> Array:
        """Acceleration of free fall in the base frame, shape (3,) [m/s^2]."""
        return read_only(self.file.gravity)

    @cached_property
    def revolute(self) -> Mask:
        """Mask of revolute joints, shape (n_joints,)."""
        return read_only([joint.type == "revolute" for joint in self.file.joints], bool)

    def position_unit(self, axis: int) -> str:
        """Return the unit of q of a joint (from 0): rad or m."""
        return "rad" if self.revolute[axis] else "m"

    def torque_unit(self, axis: int) -> str:
        """Return the unit of a joint's torque or force (from 0): N m or N."""
        return "N m" if self.revolute[axis] else "N"

    @property
    def torque_units(self) -> str:
        """Unit of a table column with torques of the joints: N m, N, or both."""
        units = dict.fromkeys(self.torque_unit(axis) for axis in range(self.n_joints))
        return " or ".join(units)

    @property
    def position_units(self) -> str:
        """Unit of a table column with positions of the joints: rad, m, or both."""
        units = dict.fromkeys(self.position_unit(axis) for axis in range(self.n_joints))
        return " or ".join(units)

    @cached_property
    def parents(self) -> tuple[int, ...]:
        """Indices of the joints that carry each joint, from 0; -1 for the base."""
        stated = (joint.parent for joint in self.file.joints)
        return tuple((n if each is None else each) - 1 for n, each in enumerate(stated))

    @property
    def is_chain(self) -> bool:
        """True if no link carries two joints."""
        return self.parents == tuple(range(-1, self.n_joints - 1))

    def path(self, link: int) -> tuple[int, ...]:
        """Return the links from the base to a link, itself included, from 0."""
        parent = self.parents[link]
        return (*self.path(parent), link) if parent >= 0 else (link,)

    def next_link(self, link: int) -> int | None:
        """Return the first link that a link carries (from 0), or None."""
        return self.parents.index(link) if link in self.parents else None

    @property
    def last_links(self) -> tuple[int, ...]:
        """Links that carry no other, from 0."""
        return tuple(link for link in range(self.n_joints) if self.next_link(link) is None)

    @property
    def branches(self) -> tuple[tuple[int, ...], ...]:
        """Links from the base to each last link, from 0; a chain is its only branch."""
        return tuple(self.path(last) for last in self.last_links)

    gamma = _per_joint(lambda joint: joint.frame.gamma or 0.0)
    """Angles about the parents' z axes, before those about x [rad]."""
    alpha = _per_joint(lambda joint: joint.frame.alpha)
    """Angles between successive axes [rad]."""
    theta = _per_joint(lambda joint: joint.frame.theta)
    """Angles about the axes; offsets of revolute joints' q [rad]."""

    d, d_expressions = _length("d"), _expressions("d")
    """Distances between successive axes [m]; polynomials in named lengths."""
    r, r_expressions = _length("r"), _expressions("r")
    """Shifts along the axes; offsets of prismatic joints' q [m]; polynomials in named lengths."""
    b, b_expressions = _length("b"), _expressions("b")
    """Shifts along the parents' z axes [m]; polynomials in named lengths."""

    q_min = _per_joint(lambda joint: joint.q_min)
    """Lower ends of the joints' ranges [rad or m]."""
    q_max = _per_joint(lambda joint: joint.q_max)
    """Upper ends of the joints' ranges [rad or m]."""
    velocity_limit = _per_joint(lambda joint: joint.velocity_limit)
    """Maximum speeds [rad/s or m/s]; NaN if unknown."""
    acceleration_limit = _per_joint(lambda joint: joint.acceleration_limit)
    """Maximum accelerations [rad/s^2 or m/s^2]; NaN if unknown."""
    torque_limit = _per_joint(lambda joint: joint.torque_limit)
    """Maximum joint torques [N m or N]; NaN if unknown."""

    @property
    def limits_known(self) -> bool:
        """True if the file states speeds, accelerations and torques of every joint."""
        limits = self.velocity_limit, self.acceleration_limit, self.torque_limit
        return all(np.isfinite(limit).all() for limit in limits)

    gear_ratio = _per_drive(lambda drive: drive.gear_ratio)
    """Motor angle over joint coordinate [1, or rad/m]; NaN where unknown."""
    rotor_inertia = _per_drive(lambda drive: drive.rotor_inertia)
    """Motor inertias, motor side [kg m^2]; NaN where unknown."""

    @cached_property
    def rotor_inertia_unknown(self) -> Mask:
        """Mask of motors with an inertia to be identified, shape (n_joints,)."""
        return read_only(np.isnan(self.rotor_inertia), bool)

    @cached_property
    def reflected_inertia(self) -> Array:
        """Known motor inertias reflected to the joints [kg m^2]; 0 if unknown."""
        return read_only(np.nan_to_num(self.gear_ratio**2 * self.rotor_inertia))

    torque_constant = _per_drive(lambda drive: drive.torque_constant)
    """Motor torque per current [N m/A]; NaN where unknown."""
    encoder_resolution = _per_drive(lambda drive: drive.encoder_resolution or UNKNOWN)
    """Increments per turn of the motors; NaN if unknown."""
    rotor_inertia_uncertainty = _per_drive(lambda drive: drive.rotor_inertia_uncertainty)
    """Relative standard deviations of `rotor_inertia`."""
    torque_constant_uncertainty = _per_drive(lambda drive: drive.torque_constant_uncertainty)
    """Relative standard deviations of `torque_constant`."""

    @cached_property
    def stated_uncertainty(self) -> Array:
        """Relative standard deviations of torque constants, then rotor inertias: (2 n_joints,)."""
        return read_only([*self.torque_constant_uncertainty, *self.rotor_inertia_uncertainty])

    @cached_property
    def usual_uncertainty(self) -> Array:
        """Relative standard deviations by common tolerances, for values without uncertainty.

        The order is that of `stated_uncertainty`; values are 0 if the file states an uncertainty or
        no value.
        """
        values = np.concatenate([self.torque_constant, self.rotor_inertia])
        alone = (np.nan_to_num(values) > 0) & (self.stated_uncertainty == 0)
        return read_only(np.where(alone, USUAL_UNCERTAINTY, 0.0))

    @cached_property
    def couplings(self) -> tuple[MotorCoupling, ...]:
        """Motors also turned by a second joint."""
        stated = self.file.couplings or ()
        return tuple(MotorCoupling(c.motor - 1, c.joint - 1, c.ratio) for c in stated)

    @cached_property
    def motor_matrix(self) -> Array:
        """Motors' angles per joint angle, shape (n_joints, n_joints).

        Motor angles are ``R q``, and joint torques are ``R.T`` times the motors' torques. Rows of
        motors with unknown gear ratio are NaN.
        """
        turns = np.eye(self.n_joints)
        for motor, joint, ratio in self.couplings:
            turns[motor, joint] += ratio
        return read_only(self.gear_ratio[:, np.newaxis] * turns)

    def link_pose(self, joint: int) -> Array:
        """Return the pose of frame j in the parent's at q_j = -theta_j, or 0 if prismatic."""
        return self._pose(joint, self.d[joint], self.r[joint], self.b[joint])

    def symbolic_link_pose(self, joint: int) -> NDArray[np.object_]:
        """Return `link_pose` with polynomials in named lengths as entries."""
        lengths = self.d_expressions, self.r_expressions, self.b_expressions
        pose = self._pose(joint, *(each[joint] for each in lengths))
        lifted = [x if isinstance(x, Polynomial) else Polynomial.constant(x) for x in pose.flat]
        return np.array(lifted, dtype=object).reshape(4, 4)

    def zero_pose(self, joint: int) -> Array:
        """Return the pose of frame j in the parent's at q_j = 0, shape (4, 4)."""
        return self.pose_at(joint, 0.0)

    def pose_at(self, joint: int, q: float) -> Array:
        """Return the pose of frame j in the parent's at q_j, shape (4, 4)."""
        turn, shift = (q, 0.0) if self.revolute[joint] else (0.0, q)
        theta, r = self.theta[joint] + turn, self.r[joint] + shift
        about_z = self.gamma[joint], self.b[joint]
        return frame_pose(self.alpha[joint], self.d[joint], theta, r, *about_z)

    @cached_property
    def weighed_slides(self) -> tuple[int, ...]:
        """Slides along which gravity is constant, from 0.

        There the rotor inertia takes any share of the moved mass, and the offset of friction any
        share of the weight, with the same torques.
        """
        weights = []
        for q in np.random.default_rng(22).uniform(-np.pi, np.pi, (3, self.n_joints)):
            turns: list[Array] = []
            for joint, parent in enumerate(self.parents):
                turn = self.pose_at(joint, q[joint])[:3, :3]
                turns.append(turns[parent] @ turn if parent >= 0 else turn)
            weights.append([float(self.gravity @ turn[:, 2]) for turn in turns])
        least = ROUNDED_OFF * np.linalg.norm(self.gravity)
        constant = (np.ptp(weights, axis=0) <= least) & (np.abs(weights[0]) > least)
        return tuple(np.flatnonzero(constant & ~self.revolute).tolist())

    def _pose(self, joint: int, d: Any, r: Any, b: Any) -> NDArray[Any]:
        theta = 0.0 if self.revolute[joint] else self.theta[joint]
        return frame_pose(self.alpha[joint], d, theta, r, self.gamma[joint], b)

    @cached_property
    def link_parameters(self) -> tuple[str, ...]:
        """Names of the ten parameters of every link, eq. (5): ``Ixx1`` to ``m<n>``."""
        links = range(1, self.n_joints + 1)
        return tuple(f"{parameter}{link}" for link in links for parameter in LINK_PARAMETERS)

    @cached_property
    def added_parameters(self) -> tuple[str, ...]:
        """Names of unknowns of drives and springs (`hil.model.added_parameters`)."""
        own = (f"Ia{j + 1}" for j in np.flatnonzero(self.rotor_inertia_unknown))
        shared = (f"Iam{each.motor + 1}" for each in self.couplings)
        springs = (f"{_SPRINGS[each.shape]}{each.joint}" for each in self.file.springs or ())
        return (*own, *shared, *springs)

    @property
    def standard_parameters(self) -> tuple[str, ...]:
        """Names of the links' parameters, and of unknown parameters of drive trains and springs."""
        return (*self.link_parameters, *self.added_parameters)

    @cached_property
    def present(self) -> tuple[str, ...]:
        """Present standard parameters (Table 1), tied parameters included."""
        joints = enumerate(self.file.joints, start=1)
        links = (f"{name}{link}" for link, joint in joints for name in joint.parameters)
        return (*links, *self.added_parameters)

    @cached_property
    def ties(self) -> dict[str, str]:
        """Map from tied standard parameters to the parameters with equal value."""
        return dict(split_tie(tie) for tie in self.file.ties)


def read_only(values: object, kind: type = float) -> NDArray[Any]:
    """Return values as a read-only array."""
    array: NDArray[Any] = np.array(values, dtype=kind)
    array.setflags(write=False)
    return array
