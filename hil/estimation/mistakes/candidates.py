"""All mistakes that can be made, each as a family of readings with few unknowns.

A sign or an exchange has no unknown, an angle, a ratio or a gain has one, the direction of gravity
has two. Unknowns are zero where nothing is wrong. Large ones are searched from several starts,
since torques are sinusoids of angles.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations
from math import degrees
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.mistakes.mistake import MistakeName
from hil.estimation.mistakes.reading import Added, GainDrift, Slip
from hil.model.base_parameters import base_parameters
from hil.model.robot import Robot
from hil.model.robot_file import LINK_PARAMETERS, split_tie

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from hil.arrays import Array
    from hil.estimation.mistakes.reading import Reading

    Family = Callable[[Array], Reading]

ANGLES = tuple(np.radians(np.arange(45.0, 360.0, 45.0)))
"""From which a zero is searched [rad]."""
SLIDES = (-0.2, -0.05, 0.05, 0.2)
"""The same of an axis that slides [m]."""
RATIOS = tuple(np.log([0.5, 0.8, 1.25, 2.0]))
"""From which a gear ratio is searched: logarithms of true over stated ratio."""
WARMED = 0.01
"""Drift of a torque constant that is none: magnets of NdFeB lose 0.11 % of their flux per kelvin
(their usual reversible coefficient), and ten kelvins are warmth as any motor has."""
INSTANTS = 8
"""At which a slip is tried first."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """One mistake, as readings of the recordings.

    Attributes
    ----------
    name : MistakeName
    axes : tuple of int
        From 0.
    reading : callable
        From the unknowns, shape (k,), to the reading.
    words : callable
        From unknowns and their standard errors to what the mistake is.
    k : int
        Unknowns.
    starts : sequence of tuple
        From which unknowns are searched beside zero.
    least : float
        Size below which nobody would call it a mistake.
    step : float
        For differences.
    more : int
        Base parameters that the reading adds.
    """

    name: MistakeName
    axes: tuple[int, ...]
    reading: Family
    words: Callable[[Array, Array], str]
    k: int = 0
    starts: Sequence[tuple[float, ...]] = field(default=())
    least: float = 0.0
    step: float = 1e-3
    more: int = 0

    @property
    def unknowns(self) -> int:
        """What a candidate leaves open; base parameters that it adds count twice.

        A zero is likelier to be off than a link parameter that does what the zero would do.
        """
        return self.k + 2 * self.more


def of_signs(stated: Reading) -> Iterator[Candidate]:
    """Signs of position, torque, or both."""
    robot = stated.robot
    for axis in range(robot.n_joints):
        for name, reading, words in (
            (MistakeName.DIRECTION, stated.at(axis, sign_q=-1.0, sign_tau=-1.0),
             "counts the other way round, position and torque alike"),
            (MistakeName.POSITION_SIGN, stated.at(axis, sign_q=-1.0),
             "its position has the wrong sign"),
            (MistakeName.TORQUE_SIGN, stated.at(axis, sign_tau=-1.0),
             "its torque has the wrong sign"),
        ):  # fmt: skip
            yield Candidate(name, (axis,), partial(_fixed, reading), partial(_said, words))


def of_order(stated: Reading) -> Iterator[Candidate]:
    """Every two axes of a kind exchanged."""
    robot = stated.robot
    for i, j in combinations(range(robot.n_joints), 2):
        if robot.revolute[i] == robot.revolute[j]:
            order = list(stated.order)
            order[i], order[j] = order[j], order[i]
            reading = replace(stated, order=tuple(order))
            words = partial(_said, "each has the recordings of the other")
            yield Candidate(MistakeName.EXCHANGED, (i, j), partial(_fixed, reading), words)


def of_sizes(stated: Reading) -> Iterator[Candidate]:
    """What has a size: zeros, gear ratios, torque constants, gravity."""
    robot = stated.robot
    for axis in range(robot.n_joints):
        turns = bool(robot.revolute[axis])
        starts = ANGLES if turns else SLIDES
        yield Candidate(
            MistakeName.ZERO, (axis,), partial(_zero, stated, axis), partial(_angle, turns), 1,
            [(each,) for each in starts], least=np.radians(0.3) if turns else 1e-3,
        )  # fmt: skip
        yield Candidate(
            MistakeName.GEAR, (axis,), partial(_gear, stated, axis),
            partial(_ratio, float(robot.gear_ratio[axis])), 1,
            [(each,) for each in RATIOS], least=0.003,
        )  # fmt: skip
        yield Candidate(
            MistakeName.TORQUE_CONSTANT, (axis,), partial(_gain, stated, axis), _torque, 1,
            least=0.03,
        )  # fmt: skip
    if robot.gravity.any():
        yield Candidate(
            MistakeName.GRAVITY, (), partial(_gravity, stated), partial(_tilt, stated), 2,
            [(1.5, 0.0), (-1.5, 0.0), (0.0, 1.5), (0.0, -1.5), (3.0, 0.0)],
            least=np.radians(0.5),
        )  # fmt: skip


def of_slips(stated: Reading, instants: Sequence[float]) -> Iterator[Candidate]:
    """An axis whose link stands elsewhere from some instant on."""
    robot = stated.robot
    for axis in range(robot.n_joints):
        turns = bool(robot.revolute[axis])
        for instant in instants:
            yield Candidate(
                MistakeName.SLIP, (axis,), partial(_slip, stated, axis, instant),
                partial(_slipped, turns, instant), 1, least=np.radians(0.3) if turns else 1e-3,
            )  # fmt: skip


def of_drifts(stated: Reading, first: float, last: float) -> Iterator[Candidate]:
    """A torque constant that changes evenly between two instants [s]."""
    for axis in range(stated.robot.n_joints):
        yield Candidate(
            MistakeName.DRIFT, (axis,), partial(_drift, stated, axis, first, last),
            partial(_drifted, last - first), 1, least=WARMED,
        )  # fmt: skip


def of_spring(stated: Reading, axis: int, size: float) -> Candidate:
    """A linear spring; where it is slack is an offset, which is fitted anyway.

    The unknown is in multiples of a torque of a usual `size` [N m].
    """
    units = stated.robot.torque_unit(axis), stated.robot.position_unit(axis)
    return Candidate(
        MistakeName.SPRING, (axis,), partial(_added, stated, axis, _straight, size),
        partial(_spring, size, "/".join(units)), 1,
    )  # fmt: skip


def of_period(stated: Reading, axis: int, order: int, size: float) -> Candidate:
    """A torque that repeats so many times a turn; unknowns as those of a spring."""
    return Candidate(
        MistakeName.PERIODIC, (axis,),
        partial(_added, stated, axis, partial(waves, order=order), size),
        partial(_repeats, size, stated.robot.torque_unit(axis), order), 2,
    )  # fmt: skip


def waves(q: Array, order: int) -> Array:
    """Sine and cosine of so many times an angle, shape (n, 2)."""
    return np.column_stack([np.sin(order * q), np.cos(order * q)])


def of_missing_parameters(stated: Reading) -> Iterator[Candidate]:
    """All ten parameters of the last link, which a load changes."""
    robot = stated.robot
    complete = _with_whole_link(robot, robot.n_joints - 1)
    more = len(base_parameters(complete)) - len(base_parameters(robot))
    if more > 0:
        words = partial(
            _said, "a load on it, or more than its link parameters in the robot file say"
        )
        yield Candidate(
            MistakeName.LEFT_OUT, (robot.n_joints - 1,),
            partial(_fixed, replace(stated, robot=complete)), words, more=more,
        )  # fmt: skip


def _with_whole_link(robot: Robot, link: int) -> Robot:
    """The robot with all ten parameters of a link, free of ties."""
    joints = list(robot.file.joints)
    joints[link] = joints[link].model_copy(update={"parameters": LINK_PARAMETERS})
    own = {f"{name}{link + 1}" for name in LINK_PARAMETERS}
    ties = tuple(tie for tie in robot.file.ties if not own & set(split_tie(tie)))
    file = robot.file.model_copy(update={"joints": tuple(joints), "ties": ties})
    return Robot(file, robot.source, robot.text)


def _fixed(reading: Reading, theta: Array) -> Reading:
    del theta
    return reading


def _zero(stated: Reading, axis: int, theta: Array) -> Reading:
    return stated.at(axis, zero=float(theta[0]))


def _gear(stated: Reading, axis: int, theta: Array) -> Reading:
    """theta: logarithm of true over stated gear ratio."""
    ratio = float(np.exp(theta[0]))
    return stated.at(axis, scale=1.0 / ratio, gain=1.0 / ratio)


def _gain(stated: Reading, axis: int, theta: Array) -> Reading:
    """theta: logarithm of true over stated torque constant."""
    return stated.at(axis, gain=float(np.exp(-theta[0])))


def _gravity(stated: Reading, theta: Array) -> Reading:
    """theta: rotation about two axes square to the stated direction [rad]."""
    size = float(np.linalg.norm(stated.gravity))
    down = stated.gravity / size
    across = np.linalg.svd(down[np.newaxis])[2][1:]
    angle = float(np.linalg.norm(theta))
    aside = theta @ across / angle if angle else np.zeros(3)
    return replace(stated, gravity=size * (np.cos(angle) * down + np.sin(angle) * aside))


def _slip(stated: Reading, axis: int, instant: float, theta: Array) -> Reading:
    return replace(stated, slip=Slip(axis, instant, float(theta[0])))


def _drift(stated: Reading, axis: int, first: float, last: float, theta: Array) -> Reading:
    middle, duration = (first + last) / 2, last - first
    return replace(stated, drift=GainDrift(axis, middle, duration, float(theta[0])))


def _added(
    stated: Reading, axis: int, shapes: Callable[[Array], Array], size: float, theta: Array
) -> Reading:
    return replace(stated, added=Added(axis, shapes, size * theta))


def _straight(q: Array) -> Array:
    return q[:, np.newaxis]


def _said(words: str, theta: Array, error: Array) -> str:
    del theta, error
    return words


def _angle(turns: bool, theta: Array, error: Array) -> str:
    return f"its zero is off by {_length(turns, theta, error)}"


def _slipped(turns: bool, instant: float, theta: Array, error: Array) -> str:
    return (
        f"position and link slipped by {_length(turns, theta, error)} after some"
        f" {instant / 60:.0f} min"
    )


def _length(turns: bool, theta: Array, error: Array) -> str:
    if not turns:
        return f"{1e3 * theta[0]:.1f} ± {1e3 * error[0]:.1f} mm"
    around = (theta[0] + np.pi) % (2 * np.pi) - np.pi
    return f"{degrees(around):.1f} ± {degrees(error[0]):.1g} degrees"


def _ratio(stated: float, theta: Array, error: Array) -> str:
    ratio = float(np.exp(theta[0]))
    sizes = f": {stated * ratio:.5g} for {stated:g}" if np.isfinite(stated) else ""
    return f"its gear ratio is {ratio:.4g} ± {ratio * error[0]:.1g} times the stated one{sizes}"


def _torque(theta: Array, error: Array) -> str:
    factor = float(np.exp(theta[0]))
    return f"its torques are {factor:.3g} ± {factor * error[0]:.1g} times those stated"


def _drifted(duration: float, theta: Array, error: Array) -> str:
    return (
        f"its torques change by {100 * theta[0]:.1f} ± {100 * error[0]:.1g} % within"
        f" {duration / 60:.0f} min, as of a torque constant that drifts"
    )


def _spring(size: float, unit: str, theta: Array, error: Array) -> str:
    return (
        f"a torque grows with its position by {size * theta[0]:.3g} ± {size * error[0]:.1g} {unit},"
        " as that of a spring"
    )


def _repeats(size: float, unit: str, order: int, theta: Array, error: Array) -> str:
    height = size * float(np.hypot(*theta))
    often = "once" if order == 1 else f"{order} times"
    return f"a torque of {height:.2g} ± {size * error.max():.1g} {unit} repeats {often} a turn"


def _tilt(stated: Reading, theta: Array, error: Array) -> str:
    direction = ", ".join(f"{g:.2f}" for g in _gravity(stated, theta).gravity)
    angle = degrees(float(np.linalg.norm(theta)))
    return (
        f"gravity is off by {angle:.1f} ± {degrees(float(error.max())):.1g} degrees: [{direction}]"
        " m/s² in the base frame"
    )
