"""Causes that may spoil an identification, each as columns: torque per unit of it.

A cause that is small enters the torque linearly. With tau(q, qd, qdd) = A p + H qdd the torque that
the estimate says, and e_k the axis k, the column of axis i is, per unit of

    zero of k              d tau_i / d q_k: the link stands further on than is read
    position scale of k    (q_k d/dq_k + qd_k d/dqd_k + qdd_k d/dqdd_k) tau_i
    gear ratio of k        minus that of the rigid bodies, and minus their torque where i = k
    torque constant of k   -tau_i where i = k, with the channel's own columns as fitted, since an
                           uncertain part of A p may cancel them; its drift as much times the time
    torques of all axes    -tau_i, likewise
    rotor inertia of k     H qdd_i where i = k
    late torque of k       (tau_i(t - T) - tau_i(t + T)) / 2T where i = k: all motion shifted
    late position of k     (tau_i(t + T) - tau_i(t - T)) / 2T with the motion of k alone shifted
    backlash of k          d tau_i by the displacement of the link within the gap (`backlash`)
    slip of k              d tau_i / d q_k from an instant on
    direction of gravity   d tau_i by a turn about either axis across it
    a load                 the regressor's columns of the last link's parameters that are left out
    spring, torque that repeats with the angle, friction of the load: q_i; sin, cos of n q_i; |A p|
                           times the sign of the speed

A column that the base parameters, the channel's own columns or friction span is *invisible*: the
cause then is part of what they stand for.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.estimation.excluded.backlash import FINER, HALF_GAPS, Driven, displacements
from hil.estimation.excluded.causes import CAUSES, FITTED
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import inverse_dynamics, regressor
from hil.model.motors import motor_torque
from hil.model.robot_file import LINK_PARAMETERS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from hil.arrays import Array
    from hil.estimation.excluded.causes import Key
    from hil.estimation.excluded.evidence import Evidence
    from hil.model.robot import Robot

STEP = 1e-7
"""Of differences, in units of the column: rounding and second derivatives cost some 1e-8 each."""
ORDERS = range(1, 13)
"""How often a turn a torque may repeat: teeth of a bearing or a belt, and the spring of a
counterweight, once."""
INSTANTS = 8
"""Parts of the time between which an axis may slip."""


class Column(NamedTuple):
    """One column: its cause, the axis (from 0; -1 where it concerns none), and which of several."""

    cause: str
    axis: int
    part: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Columns of all causes.

    Attributes
    ----------
    names : tuple of Column
    values : ndarray, shape (n, n_columns)
        Torque per unit of each, which is that of its cause.
    free : sequence of str
        Causes that stay free beside the others.
    """

    names: tuple[Column, ...]
    values: Array
    free: Sequence[str] = FITTED

    @property
    def tests(self) -> dict[Key, list[int]]:
        """Columns of each cause and axis, which are tested together."""
        found: dict[Key, list[int]] = {}
        for k, name in enumerate(self.names):
            found.setdefault((name.cause, name.axis), []).append(k)
        return found

    def gaps(self, axis: int) -> list[int]:
        """Columns of the backlash of an axis, of any gap."""
        return [
            k for k, name in enumerate(self.names)
            if name.axis == axis and name.cause.startswith("play ")
        ]  # fmt: skip

    @property
    def fitted(self) -> list[int]:
        """Those that stay free."""
        return [k for k, name in enumerate(self.names) if name.cause in self.free]


class _Rows:
    """Rows of the evidence and the torque that base parameters say."""

    def __init__(self, robot: Robot, p: Array, evidence: Evidence) -> None:
        self.robot, self.p, self.evidence = robot, p, evidence
        self.before, (self.q, self.qd, self.qdd), self.after = evidence.motion
        self.bodies = inverse_dynamics(robot, p, self.q, self.qd, self.qdd)
        self.rigid = self._own(self.bodies)
        self.motor = self._own(motor_torque(robot, self.q, self.qd, self.qdd))
        self._of_axis = -1, np.empty((3, 0))

    def _own(self, x: Array) -> Array:
        return np.take_along_axis(x, self.evidence.axis[:, None], axis=1)[:, 0]

    def torque(self, *motion: Array) -> Array:
        """Of the rigid bodies, each row that of its axis."""
        return self._own(inverse_dynamics(self.robot, self.p, *motion))

    def whole(self, *motion: Array) -> Array:
        """With that of the motors."""
        return self.torque(*motion) + self._own(motor_torque(self.robot, *motion))

    def partials(self, axis: int) -> Array:
        """Derivatives of the rigid bodies' torque by motion of an axis, shape (3, n).

        By its position, speed and acceleration; the torque is linear in accelerations.
        """
        if self._of_axis[0] != axis:
            found = []
            for k, step in enumerate((STEP, STEP, 1.0)):
                motion = [x.copy() for x in (self.q, self.qd, self.qdd)]
                motion[k][:, axis] += step
                found.append((self.torque(*motion) - self.rigid) / step)
            self._of_axis = axis, np.array(found)
        return self._of_axis[1]

    def motors_by_position(self, axis: int) -> Array:
        """Derivative of the motors' torque by the position of an axis, shape (n,)."""
        q = self.q.copy()
        q[:, axis] += STEP
        return (self._own(motor_torque(self.robot, q, self.qd, self.qdd)) - self.motor) / STEP

    @cached_property
    def of_own(self) -> Array:
        """Torque of the channels' own columns, fitted to what A p leaves, shape (n,)."""
        e, found = self.evidence, np.zeros(len(self.q))
        left, own = e.without_friction(e.torque - e.X @ self.p), e.without_friction(e.own)
        for channel in np.unique(e.axis):
            at = e.axis == channel
            found[at] = e.own[at] @ np.linalg.lstsq(own[at], left[at], rcond=None)[0]
        return found

    @cached_property
    def _driven(self) -> list[Driven]:
        return Driven.of_all(self.robot, self.p, self.evidence.signals)

    def within_gap(self, axis: int, half_gaps: Sequence[float]) -> list[Array]:
        """Return the change of the torque by the backlash of an axis, of each half gap."""
        e = self.evidence
        if any((each.inertia[:, axis] <= 0.0).any() for each in self._driven):
            return [np.zeros(len(e.axis))] * len(half_gaps)
        order = np.argsort(e.source, kind="stable")
        first = np.searchsorted(e.source[order], range(1, len(e.signals)))
        places = np.split(e.sample[order], first)
        moved = np.empty((len(half_gaps), 3, len(order)))
        moved[..., order] = displacements(e.signals, self._driven, axis, places, half_gaps)
        by_motion = self.partials(axis)
        return [(by_motion * each).sum(axis=0) for each in moved]

    @cached_property
    def by_time(self) -> Array:
        """Change by time of the torque, where all motion is later."""
        later, earlier = self.whole(*self.after), self.whole(*self.before)
        return (later - earlier) / (2.0 * self.evidence.period)

    def by_time_of(self, axis: int) -> Array:
        """The same where the motion of an axis alone is later."""
        sides = []
        for other in (self.after, self.before):
            motion = [x.copy() for x in (self.q, self.qd, self.qdd)]
            for x, y in zip(motion, other, strict=True):
                x[:, axis] = y[:, axis]
            sides.append(self.whole(*motion))
        return (sides[0] - sides[1]) / (2.0 * self.evidence.period)

    def turned(self) -> Array:
        """Derivative by a turn of gravity about either axis across it, shape (n, 2)."""
        across = across_gravity(self.robot) * np.linalg.norm(self.robot.gravity)
        still = np.zeros_like(self.q)
        found = np.zeros((len(self.q), 2))
        for k, direction in enumerate(across):
            for axis in range(self.robot.n_joints):
                rows = self.evidence.axis == axis
                if rows.any():
                    A = regressor(
                        self.robot, self.q[rows], still[rows], still[rows], [axis], direction
                    )
                    found[rows, k] = A[:, 0] @ self._without_springs
        return found

    @property
    def _without_springs(self) -> Array:
        """Base parameters, those that no link has set to zero: springs know no gravity."""
        base = base_parameters(self.robot)
        added = [head in self.robot.added_parameters for head in base.heads]
        return np.where(added, 0.0, self.p)


def columns(robot: Robot, p: Array, evidence: Evidence, free: Sequence[str] = FITTED) -> Columns:
    """Columns of all causes on the rows of the evidence.

    Parameters
    ----------
    p : ndarray, shape (n_base,)
        Base parameters by which torques are calculated.
    """
    return _gathered(_columns(_Rows(robot, p, evidence)), evidence, free)


def finer(robot: Robot, p: Array, evidence: Evidence, every: Columns, key: Key) -> Columns:
    """Return the same with gaps close to that of `key` in place of the other gaps of its axis."""
    axis, microns = key[1], float(key[0].split()[1])
    of_gaps = _of_gaps(_Rows(robot, p, evidence), axis, (1e-6 * microns * FINER).tolist())
    new, at = _gathered(of_gaps, evidence, every.free), every.gaps(axis)
    names, values = list(every.names), every.values.copy()
    for k, name in zip(at, new.names, strict=True):
        names[k] = name
    values[:, at] = new.values
    return Columns(tuple(names), values, every.free)


def _gathered(
    found: Iterable[tuple[Column, Array]], evidence: Evidence, free: Sequence[str]
) -> Columns:
    names, values = zip(*found, strict=True)
    table = np.column_stack(values)
    if evidence.later is not None:
        table *= evidence.later[:, np.newaxis]
    return Columns(names, table, free)


def late(robot: Robot, p: Array, evidence: Evidence) -> Array:
    """Return the torque of each row per ms by which it is late."""
    return -1e-3 * _Rows(robot, p, evidence).by_time


def instants(evidence: Evidence) -> list[float]:
    """Instants at which an axis may slip [s]."""
    times = np.quantile(evidence.time, np.arange(1, INSTANTS) / INSTANTS)
    return [float(each) for each in times]


def across_gravity(robot: Robot) -> Array:
    """Two directions square to gravity and to each other, shape (2, 3); the base's, if they are."""
    down = np.array(robot.gravity) / np.linalg.norm(robot.gravity)
    first = np.eye(3)[np.argmin(np.abs(down))]
    first = first - (first @ down) * down
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(down, first)])


def _columns(rows: _Rows) -> Iterator[tuple[Column, Array]]:
    robot, evidence = rows.robot, rows.evidence
    total, time = rows.rigid + rows.motor + rows.of_own, evidence.time / 3600.0
    hours = time - time.mean()
    for axis in range(robot.n_joints):
        mine = evidence.axis == axis
        if not mine.any():
            continue
        at = {name: Column(name, axis) for name in CAUSES}
        turns = bool(robot.revolute[axis])
        q, qd, qdd = (x[:, axis] for x in (rows.q, rows.qd, rows.qdd))
        unit = np.pi / 180 if turns else 1e-3
        by_motion = rows.partials(axis)
        by_position = unit * (by_motion[0] + rows.motors_by_position(axis))
        scale = (by_motion * (q, qd, qdd)).sum(axis=0)
        yield at["zero"], by_position
        yield at["position scale"], 0.01 * (scale + mine * rows.motor)
        yield at["gear ratio"], -0.01 * (scale + mine * rows.rigid)
        yield at["torque constant"], -0.01 * mine * total
        yield at["drift of torque constant"], -0.01 * mine * total * hours
        yield at["rotor inertia"], 0.01 * mine * rows.motor
        yield at["late torque"], -1e-3 * mine * rows.by_time
        yield at["late position"], 1e-3 * rows.by_time_of(axis)
        yield from _of_gaps(rows, axis, HALF_GAPS)
        for instant in instants(evidence):
            part = f"{instant:.0f}"
            yield Column("slip", axis, part), by_position * (evidence.time >= instant)
        yield at["spring"], mine * q
        yield at["friction of the load"], 0.01 * mine * np.abs(rows.rigid) * np.sign(qd)
        if turns:
            for order in ORDERS:
                cause = f"repeats {order}"
                yield Column(cause, axis, "sine"), mine * np.sin(order * q)
                yield Column(cause, axis, "cosine"), mine * np.cos(order * q)
    if np.ptp(evidence.axis):
        yield Column("torques of all axes", -1), -0.01 * total
    if np.any(robot.gravity):
        for part, column in zip("xy", rows.turned().T, strict=True):
            yield Column("gravity", -1, part), np.pi / 180 * column
    yield from _load(rows)


def _of_gaps(rows: _Rows, axis: int, half_gaps: Sequence[float]) -> Iterator[tuple[Column, Array]]:
    unit = np.pi / 180 if rows.robot.revolute[axis] else 1e-3
    for half_gap, column in zip(half_gaps, rows.within_gap(axis, half_gaps), strict=True):
        yield Column(f"play {1e6 * half_gap:.0f}", axis), unit / half_gap * column


def _load(rows: _Rows) -> Iterator[tuple[Column, Array]]:
    """Parameters of the last link: those that the robot file leaves out, all if it came later."""
    robot, evidence = rows.robot, rows.evidence
    complete = robot.free_links([robot.n_joints - 1])
    stated, all_of_it = base_parameters(robot), base_parameters(complete)
    names = [head for head in all_of_it.heads if head not in stated.heads]
    directions = np.eye(len(all_of_it))[:, [all_of_it.heads.index(name) for name in names]]
    if evidence.later is not None:
        names = [f"{name}{robot.n_joints}" for name in LINK_PARAMETERS]
        every = [complete.standard_parameters.index(name) for name in names]
        directions = all_of_it.matrix[:, every]
    values = np.zeros((len(rows.q), len(names)))
    for axis in range(robot.n_joints):
        mine = evidence.axis == axis
        if names and mine.any():
            q, qd, qdd = (x[mine] for x in (rows.q, rows.qd, rows.qdd))
            values[mine] = regressor(complete, q, qd, qdd, [axis])[:, 0] @ directions
    for name, column in zip(names, values.T, strict=True):
        yield Column("load", -1, name), column
