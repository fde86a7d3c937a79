"""Columns of causes that may spoil an identification: torque per unit of each cause.

A small cause enters the torque linearly. With tau(q, qd, qdd) = A p + H qdd, the torque of the
estimate, the column of axis i is, per unit of

    joint offset of k      d tau_i / d q_k: the link is further on than its reading
    position scale of k    (q_k d/dq_k + qd_k d/dqd_k + qdd_k d/dqdd_k) tau_i
    gear ratio of k        minus position scale of the rigid bodies, minus their torque where i = k
    torque constant of k   -tau_i where i = k, with the channel's own columns as fitted, since an
                           uncertain part of A p may cancel them; for its drift, times the time
    torques of all axes    -tau_i, with the channel's own columns
    rotor inertia of k     H qdd_i where i = k
    torque delay of k      (tau_i(t - T) - tau_i(t + T)) / 2T where i = k: all motion shifted
    position delay of k    (tau_i(t + T) - tau_i(t - T)) / 2T with the motion of k alone shifted
    compliance of k        d tau_i by the twist of a gear that is fitted as soft, per 1 % of twist
    backlash of k          d tau_i by the displacement of the link within the gap (`backlash`)
    slip of k              d tau_i / d q_k from an instant on
    direction of gravity   d tau_i by a rotation about either axis across gravity
    a load                 the regressor's columns of the last link's parameters that are left out
    spring, torque ripple over the angle, friction of the load: q_i; sin, cos of n q_i; |A p| times
                           the sign of the speed

A column within the span of the base parameters, the channel's own columns or friction is
*invisible*: these absorb the cause.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.estimation.excluded.backlash import FINER, HALF_GAPS, Driven, displacements
from hil.estimation.excluded.causes import CAUSES, FITTED
from hil.estimation.signals import derivatives
from hil.least_squares.solving import IDENTIFIABLE, inverse
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import inverse_dynamics, inverse_dynamics_at, regressor
from hil.model.motors import motor_torque
from hil.model.robot_file import LINK_PARAMETERS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from hil.arrays import Array
    from hil.estimation.excluded.causes import Key
    from hil.estimation.excluded.evidence import Evidence
    from hil.model.robot import Robot

STEP = 1e-7
"""Step of differences, in units of the column: rounding and second derivatives cost some 1e-8 each.
"""
ORDERS = range(1, 13)
"""Orders of torque ripple per turn: 1 for the spring of a counterweight, more for teeth of a
bearing or a belt.
"""
INSTANTS = 8
"""Number of intervals of time; an axis may slip between two of them."""


class Column(NamedTuple):
    """Column of a cause: name, axis (from 0; -1 for no axis), and part, if any."""

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
        Torque per unit of each column; the unit is that of the cause.
    free : sequence of str
        Causes fitted together with every tested cause.
    instead : dict of int to ndarray
        Columns of backlash for the transmitted torque by the parameters of all recordings with what
        these leave, shape (n,), if a change is tested.
    """

    names: tuple[Column, ...]
    values: Array
    free: Sequence[str] = FITTED
    instead: dict[int, Array] = field(default_factory=dict)

    @property
    def tests(self) -> dict[Key, list[int]]:
        """Indices of columns by cause and axis, tested together."""
        found: dict[Key, list[int]] = {}
        for k, name in enumerate(self.names):
            found.setdefault((name.cause, name.axis), []).append(k)
        return found

    def gaps(self, axis: int) -> list[int]:
        """Return the indices of the columns of an axis's backlash, for all gaps."""
        return [
            k for k, name in enumerate(self.names)
            if name.axis == axis and name.cause.startswith("backlash ")
        ]  # fmt: skip

    @property
    def fitted(self) -> list[int]:
        """Indices of the columns of free causes."""
        return [k for k, name in enumerate(self.names) if name.cause in self.free]


class EvidenceRows:
    """Rows of the evidence, with the torque predicted by base parameters."""

    def __init__(
        self, robot: Robot, p: Array, evidence: Evidence, whole: Evidence | None = None
    ) -> None:
        self.robot, self.p, self.evidence = robot, p, evidence
        self.whole_evidence = evidence if whole is None else whole
        """Evidence that contains the rows."""
        self.before, (self.q, self.qd, self.qdd), self.after = evidence.motion
        self.bodies = inverse_dynamics(robot, p, self.q, self.qd, self.qdd)
        self.rigid = self._own(self.bodies)
        self.motor = self._own(motor_torque(robot, self.q, self.qd, self.qdd))
        self._of_axis = -1, np.empty((3, 0))
        self._rest: Array | None = None

    def include_rest(self, p: Array) -> EvidenceRows:
        """Return the rows with the residual of `p` in the transmitted torque."""
        e, found = self.evidence.project_out_own(), copy(self)
        found.__dict__.pop("_driven", None)
        found._rest = e.project_out_friction(e.torque - e.X @ p) + e.X @ (p - self.p)
        return found

    def accelerated(self, joint: int) -> EvidenceRows:
        """Return the rows with the acceleration of a joint increased by one unit."""
        motion = self.evidence.motion.copy()
        motion[:, 2, :, joint] += 1.0
        moved = replace(self.evidence, motion=motion)
        return EvidenceRows(self.robot, self.p, moved, self.whole_evidence)

    def _own(self, x: Array) -> Array:
        return np.take_along_axis(x, self.evidence.axis[:, None], axis=1)[:, 0]

    def torque(self, *motion: Array) -> Array:
        """Return the torque of the rigid bodies on the axis of the row."""
        return self._own(inverse_dynamics(self.robot, self.p, *motion))

    def whole(self, *motion: Array) -> Array:
        """Return the torque of rigid bodies and motors on the axis of the row."""
        return self.torque(*motion) + self._own(motor_torque(self.robot, *motion))

    def partials(self, axis: int) -> Array:
        """Return derivatives of the rigid bodies' torque by motion of an axis, shape (3, n).

        Derivatives by position, speed and acceleration; the torque is linear in accelerations.
        """
        if self._of_axis[0] != axis:
            q, qd, qdd = (x.copy() for x in (self.q, self.qd, self.qdd))
            for x, step in zip((q, qd, qdd), (STEP, STEP, 1.0), strict=True):
                x[:, axis] += step
            by_rates = inverse_dynamics_at(
                self.robot, self.p, self.q, [(qd, self.qdd), (self.qd, qdd)]
            )
            moved = self.torque(q, self.qd, self.qdd), *map(self._own, by_rates)
            self._of_axis = axis, (np.array(moved) - self.rigid) / [[STEP], [STEP], [1.0]]
        return self._of_axis[1]

    def motors_by_position(self, axis: int) -> Array:
        """Return the derivative of the motors' torque by an axis's position, shape (n,)."""
        q = self.q.copy()
        q[:, axis] += STEP
        return (self._own(motor_torque(self.robot, q, self.qd, self.qdd)) - self.motor) / STEP

    @cached_property
    def own_torque(self) -> Array:
        """Torque of the channels' own columns, fitted to the residual of A p, shape (n,)."""
        e, found = self.evidence, np.zeros(len(self.q))
        left, own = e.project_out_friction(e.torque - e.X @ self.p), e.project_out_friction(e.own)
        for channel in np.unique(e.axis):
            at = e.axis == channel
            # what friction takes of a column, it cannot show
            whole = np.sum(e.own[at] ** 2, axis=0)
            N_inverse = inverse(own[at].T @ own[at], IDENTIFIABLE, whole)
            found[at] = e.own[at] @ (N_inverse @ (own[at].T @ left[at]))
        return found

    @cached_property
    def total(self) -> Array:
        """Torque of rigid bodies, motors and channels' own columns, shape (n,)."""
        return self.rigid + self.motor + self.own_torque

    @cached_property
    def _driven(self) -> list[Driven]:
        e, found = self.evidence, Driven.compute(self.robot, self.p, self.evidence.signals)
        for (source, driven), axis in product(enumerate(found), range(self.robot.n_joints)):
            rows = np.flatnonzero((e.source == source) & (e.axis == axis))
            if self._rest is not None and len(rows):
                at = np.arange(len(driven.torque))
                driven.torque[:, axis] += np.interp(at, e.sample[rows], self._rest[rows])
        return found

    def backlash_torque(self, axis: int, half_gaps: Sequence[float]) -> list[Array]:
        """Return the change of the torque by the backlash of an axis, by half gap."""
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

    def twist(self, axis: int) -> Array:
        """Return twist of an axis's gear and its two derivatives, smoothed, shape (3, n)."""
        e, found = self.evidence, np.zeros((3, len(self.evidence.axis)))
        for k, s in enumerate(e.signals):
            if s.twist is not None:
                own = s.twist[:, axis]
                each = np.column_stack([own, *derivatives(own[:, None], s.period)])
                found[:, e.source == k] = s.smoothed(each)[e.sample[e.source == k]].T
        return found

    @cached_property
    def time_derivative(self) -> Array:
        """Return the time derivative of the torque along the motion."""
        later, earlier = self.whole(*self.after), self.whole(*self.before)
        return (later - earlier) / (2.0 * self.evidence.period)

    def axis_time_derivative(self, axis: int) -> Array:
        """Return the time derivative of the torque along the motion of a single axis."""
        sides = []
        for other in (self.after, self.before):
            motion = [x.copy() for x in (self.q, self.qd, self.qdd)]
            for x, y in zip(motion, other, strict=True):
                x[:, axis] = y[:, axis]
            sides.append(self.whole(*motion))
        return (sides[0] - sides[1]) / (2.0 * self.evidence.period)

    def turned(self) -> Array:
        """Return derivatives by rotation of gravity about two horizontal axes, shape (n, 2)."""
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
                    found[rows, k] = A[:, 0] @ self._rigid_parameters
        return found

    @property
    def _rigid_parameters(self) -> Array:
        """Base parameters with springs set to zero, since gravity does not act on springs."""
        base = base_parameters(self.robot)
        added = [head in self.robot.added_parameters for head in base.heads]
        return np.where(added, 0.0, self.p)


def columns(
    robot: Robot,
    p: Array,
    evidence: Evidence,
    free: Sequence[str] = FITTED,
    both: Array | None = None,
) -> Columns:
    """Return the columns of all causes on the rows of the evidence.

    Parameters
    ----------
    p : ndarray, shape (n_base,)
        Base parameters for the torques.
    both : ndarray, shape (n_base,), optional
        Other base parameters, for `Columns.instead`.
    """
    rows = EvidenceRows(robot, p, evidence)
    every: list[tuple[Column, Array]] = []
    for axis in np.unique(evidence.axis).tolist():
        every += columns_of(rows, axis)
        every += _gap_columns(rows, axis, HALF_GAPS)
    every += columns_of(rows, -1)
    for axis in range(robot.n_joints if "soft gears" in free else 0):
        moved = rows.twist(axis)
        if moved.any():
            # per 1 % of the twist
            slope = (rows.partials(axis) * moved).sum(axis=0)
            every.append((Column("soft gears", axis), -0.01 * slope))
    found = _gathered(every, evidence, free)
    if both is None:
        return found
    rest = rows.include_rest(both)
    instead: dict[int, Array] = {}
    for axis in np.unique(evidence.axis).tolist():
        gaps = _gathered(_gap_columns(rest, axis, HALF_GAPS), evidence, free).values
        instead.update(zip(found.gaps(axis), gaps.T, strict=True))
    return replace(found, instead=instead)


def finer(
    robot: Robot, p: Array, evidence: Evidence, every: Columns, key: Key, both: Array | None = None
) -> Columns:
    """Replace the gaps of an axis by gaps close to `key`; return the new columns."""
    axis, half_gaps = key[1], (1e-6 * float(key[0].split()[1]) * FINER).tolist()
    rows, at = EvidenceRows(robot, p, evidence), every.gaps(axis)
    new, *instead = (
        _gathered(_gap_columns(each, axis, half_gaps), evidence, every.free)
        for each in (rows, *([] if both is None else [rows.include_rest(both)]))
    )
    names, values = list(every.names), every.values.copy()
    for k, name in zip(at, new.names, strict=True):
        names[k] = name
    values[:, at] = new.values
    again = {k: x for other in instead for k, x in zip(at, other.values.T, strict=True)}
    return Columns(tuple(names), values, every.free, every.instead | again)


def _gathered(
    found: Iterable[tuple[Column, Array]], evidence: Evidence, free: Sequence[str]
) -> Columns:
    names, values = zip(*found, strict=True)
    table = np.column_stack(values)
    if evidence.later is not None:
        table *= evidence.later[:, np.newaxis]
    return Columns(names, table, free)


def late(robot: Robot, p: Array, evidence: Evidence) -> Array:
    """Return the change of torque per ms of delay, by row."""
    return -1e-3 * EvidenceRows(robot, p, evidence).time_derivative


def instants(evidence: Evidence) -> list[float]:
    """Return the possible instants of a slip [s]."""
    times = np.quantile(evidence.time, np.arange(1, INSTANTS) / INSTANTS)
    return [float(each) for each in times]


def across_gravity(robot: Robot) -> Array:
    """Return two orthogonal directions across gravity, shape (2, 3).

    They are axes of the base, if gravity is along an axis of the base.
    """
    down = np.array(robot.gravity) / np.linalg.norm(robot.gravity)
    first = np.eye(3)[np.argmin(np.abs(down))]
    first = first - (first @ down) * down
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(down, first)])


def columns_of(rows: EvidenceRows, axis: int) -> Iterator[tuple[Column, Array]]:
    """Yield the columns of an axis, without those of backlash; -1 for the causes of all axes."""
    if axis < 0:
        yield from _common_columns(rows)
        return
    evidence, mine = rows.evidence, rows.evidence.axis == axis
    hours = (evidence.time - rows.whole_evidence.time.mean()) / 3600.0
    at = {name: Column(name, axis) for name in CAUSES}
    turns = bool(rows.robot.revolute[axis])
    q, qd, qdd = (x[:, axis] for x in (rows.q, rows.qd, rows.qdd))
    unit = np.pi / 180 if turns else 1e-3
    by_motion = rows.partials(axis)
    by_position = unit * (by_motion[0] + rows.motors_by_position(axis))
    scale = (by_motion * (q, qd, qdd)).sum(axis=0)
    yield at["joint offset"], by_position
    yield at["position scale"], 0.01 * (scale + mine * rows.motor)
    yield at["gear ratio"], -0.01 * (scale + mine * rows.rigid)
    yield at["torque constant"], -0.01 * mine * rows.total
    yield at["drift of torque constant"], -0.01 * mine * rows.total * hours
    yield at["rotor inertia"], 0.01 * mine * rows.motor
    yield at["torque delay"], -1e-3 * mine * rows.time_derivative
    yield at["position delay"], 1e-3 * rows.axis_time_derivative(axis)
    for instant in instants(rows.whole_evidence):
        part = f"{instant:.0f}"
        yield Column("slip", axis, part), by_position * (evidence.time >= instant)
    yield at["spring"], mine * q
    yield at["friction of the load"], 0.01 * mine * np.abs(rows.rigid) * np.sign(qd)
    if turns:
        for order in ORDERS:
            cause = f"torque ripple {order}"
            yield Column(cause, axis, "sine"), mine * np.sin(order * q)
            yield Column(cause, axis, "cosine"), mine * np.cos(order * q)


def _common_columns(rows: EvidenceRows) -> Iterator[tuple[Column, Array]]:
    robot, evidence = rows.robot, rows.evidence
    if np.ptp(evidence.axis):
        yield Column("torques of all axes", -1), -0.01 * rows.total
    if np.any(robot.gravity):
        for part, column in zip("xy", rows.turned().T, strict=True):
            yield Column("gravity", -1, part), np.pi / 180 * column
    yield from _load(rows)


def _gap_columns(
    rows: EvidenceRows, axis: int, half_gaps: Sequence[float]
) -> Iterator[tuple[Column, Array]]:
    unit = np.pi / 180 if rows.robot.revolute[axis] else 1e-3
    for half_gap, column in zip(half_gaps, rows.backlash_torque(axis, half_gaps), strict=True):
        yield Column(f"backlash {1e6 * half_gap:.0f}", axis), unit / half_gap * column


def _load(rows: EvidenceRows) -> Iterator[tuple[Column, Array]]:
    """Yield columns of the last links' missing parameters; of all parameters for a later load."""
    robot, evidence = rows.robot, rows.evidence
    complete = robot.free_links(robot.last_links)
    stated, all_of_it = base_parameters(robot), base_parameters(complete)
    names = [head for head in all_of_it.heads if head not in stated.heads]
    directions = np.eye(len(all_of_it))[:, [all_of_it.heads.index(name) for name in names]]
    if evidence.later is not None:
        names = [f"{name}{link + 1}" for link in robot.last_links for name in LINK_PARAMETERS]
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
