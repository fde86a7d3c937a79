"""The law of friction of a model: what friction each axis's drive has to overcome, and how surely.

A sum of terms of velocity and load (`hil.estimation.free_motion.friction_terms`) for each axis,
whatever was identified. Two things are uncertain of it. The terms are, from the recordings they
were found in; and friction itself changes with temperature and lubricant, which no term knows:
while strokes were measured it had another level in each of them. How far it wandered there, as a
share of the level, is kept and counts in every interval: an axis that has rested is at one end of
what the campaign has seen, not at its mean. Where the warmth of the gear explains a part of that
(`hil.estimation.friction.warmth`), the level can be that of a stated warmth.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import FileModel
from hil.estimation.free_motion.bristles import (
    Direction,
    are_successive,
    at_once,
    bent,
    friction_direction,
)
from hil.estimation.free_motion.columns import coupled_friction, motor_angle
from hil.estimation.free_motion.friction_terms import TERMS, friction_columns
from hil.estimation.free_motion.result import AxisFriction, CoupledFriction
from hil.estimation.friction.warmth import Warmth  # noqa: TC001 - a field of the file

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.free_motion.result import FreeMotionFit
    from hil.model.robot import Robot

    Array = NDArray[np.float64]

DIRECTED = ("Coulomb", "viscous", "cube root", "arc tangent", "quadratic", "load")
"""Terms that change their sign with the direction: the level of friction."""


class AxisLaw(AxisFriction):
    """Friction of one axis, with its uncertainty.

    Attributes
    ----------
    wander : float
        Greatest difference of the level in one measurement from the law, as a share of it. It
        counts as one standard deviation: in a measurement the level is a mean already.
    speeds : tuple of two floats, optional
        Slowest and fastest samples that the law was found from [rad/s or m/s].
    measurements : int, optional
        That the law was found from, each of which counts as one draw; None of free motions, and in
        files of earlier versions.
    warmth : Warmth, optional
        What the level depends on besides, where that is identified; the terms are those at its
        reference. `wander` is of the law alone: the warmth of a motion may be unknown.
    """

    wander: float = 0.0
    speeds: tuple[float, float] | None = None
    measurements: int | None = None
    warmth: Warmth | None = None

    @property
    def values(self) -> Array:
        """Coefficients, shape (n_terms,)."""
        return np.array([each.value for each in self.terms.values()])

    @property
    def directed(self) -> NDArray[np.bool_]:
        """Terms of the level, which change their sign with the direction, shape (n_terms,)."""
        return np.isin(list(self.terms), DIRECTED)

    @property
    def slope(self) -> float:
        """Of the plainest law, Coulomb and viscous friction [N m s/rad or N s/m]."""
        return self.plain["viscous"].value / self.speed

    def known(self, speed: Array) -> Array:
        """Speeds at which the law is taken: those that it was found from, or the nearest of them.

        A sum of terms may go anywhere else; slower and faster the law goes on with `slope`.
        """
        return speed if self.speeds is None else np.clip(speed, *self.speeds)

    @property
    def uncertainty(self) -> Array:
        """Covariance of the coefficients, shape (n_terms, n_terms)."""
        if self.covariance:
            return np.array(self.covariance)
        return np.diag([each.standard_error**2 for each in self.terms.values()])


class FrictionLaw(FileModel):
    """Friction of all axes.

    Attributes
    ----------
    axes : tuple of AxisLaw or None
        None where nothing recorded showed an axis's friction.
    coupled : tuple of CoupledFriction
    """

    axes: tuple[AxisLaw | None, ...]
    coupled: tuple[CoupledFriction, ...] = ()

    @classmethod
    def of_free_motions(cls, fit: FreeMotionFit) -> FrictionLaw:
        """Law that was found together with the base parameters."""
        axes = (
            AxisLaw.model_validate(law.model_dump() | {"wander": _spread(law)}) for law in fit.axes
        )
        return cls(axes=tuple(axes), coupled=fit.coupled)

    @property
    def unknown(self) -> tuple[int, ...]:
        """Axes, from 1, whose friction nothing showed."""
        return tuple(axis for axis, law in enumerate(self.axes, start=1) if law is None)


def _spread(law: AxisFriction) -> float:
    """Greatest difference of the level from its mean, as a share of it."""
    return max((abs(level - 1.0) for level in law.level), default=0.0)


def friction_torque(
    robot: Robot,
    law: FrictionLaw,
    q: Array,
    qd: Array,
    load: Array,
    directions: Sequence[Direction] | None = None,
    warmth: Array | None = None,
) -> Array:
    """Torque of friction and ripple of all axes, shape of `q` [N m or N].

    Zero for an axis whose friction is unknown.

    Parameters
    ----------
    q, qd : ndarray, shape (n, n_joints) or (n_joints,)
        [rad or m, and per s].
    load : ndarray, shape of `q`
        Torque of the rigid bodies [N m or N].
    directions : sequence (n_joints,) of Direction, optional
        Of each axis's friction; by default that along the rows, where these are successive samples
        of a motion, and else the sign of the velocity.
    warmth : ndarray, shape of `q`, optional
        Of the gears; by default that at which each law stands. Without effect on axes whose
        warmth is not identified.
    """
    q_rows, qd_rows, loads = (np.reshape(x, (-1, robot.n_joints)) for x in (q, qd, load))
    if directions is None:
        directions = _directions(law, q_rows, qd_rows)
    found = np.zeros(q_rows.shape)
    for axis, each in enumerate(law.axes):
        if each is not None:
            columns = law_columns(robot, each, q_rows, qd_rows, loads, axis, directions[axis])
            speed = np.abs(qd_rows[:, axis])
            beyond = directions[axis].sign * each.slope * (speed - each.known(speed))
            bend = each.bend.value * directions[axis].bend
            level = columns[:, each.directed] @ each.values[each.directed] + bend + beyond
            other = columns[:, ~each.directed] @ each.values[~each.directed]
            found[:, axis] = other + _factor(each, warmth, axis) * level
    shared = [part for each in law.coupled for part in (each.viscous.value, each.coulomb.value)]
    for axis in range(robot.n_joints if shared else 0):
        found[:, axis] += coupled_friction(robot, qd_rows, axis) @ np.array(shared)
    return found.reshape(np.shape(q))


def friction_variance(
    robot: Robot,
    law: FrictionLaw,
    q: Array,
    qd: Array,
    load: Array,
    warmth: Array | None = None,
) -> Array:
    """Variance of `friction_torque`, shape of `q` [(N m)^2 or N^2]; parameters as there."""
    q_rows, qd_rows, loads = (np.reshape(x, (-1, robot.n_joints)) for x in (q, qd, load))
    found = np.zeros(q_rows.shape)
    for axis, each in enumerate(law.axes):
        if each is not None:
            direction = at_once(qd_rows[:, axis], each.speed)
            columns = law_columns(robot, each, q_rows, qd_rows, loads, axis, direction)
            level = columns[:, each.directed] @ each.values[each.directed]
            factor = np.reshape(_factor(each, warmth, axis), (-1, 1))
            columns = np.where(each.directed, factor * columns, columns)
            found[:, axis] = np.einsum("nk,kl,nl->n", columns, each.uncertainty, columns)
            found[:, axis] += (_wander(each, warmth, axis) * level) ** 2
    shared = [part for each in law.coupled for part in (each.viscous, each.coulomb)]
    for axis in range(robot.n_joints if shared else 0):
        errors = coupled_friction(robot, qd_rows, axis) * [part.standard_error for part in shared]
        found[:, axis] += np.sum(errors**2, axis=1)
    return found.clip(0.0).reshape(np.shape(q))


def _factor(law: AxisLaw, warmth: Array | None, axis: int) -> Array:
    """What warmth multiplies the level of an axis by, shape (n,) or ()."""
    if law.warmth is None or warmth is None:
        return np.ones(())
    return law.warmth.factor(np.reshape(warmth, (-1, np.shape(warmth)[-1]))[:, axis])


def _wander(law: AxisLaw, warmth: Array | None, axis: int) -> Array:
    """Standard deviation of the level as a share of the law's, shape (n,) or ()."""
    if law.warmth is None or warmth is None:
        return np.asarray(law.wander)
    own = np.reshape(warmth, (-1, np.shape(warmth)[-1]))[:, axis]
    return law.warmth.deviation(own)


def level_at(law: AxisLaw, speed: float) -> tuple[float, float]:
    """Level of friction at one of the speeds that a law was found from, and its standard error.

    [rad/s or m/s], [N m or N]; at no load and without ripple, half of what forward and backward
    differ by.
    """
    qd, none = np.array([speed, -speed]), np.zeros(2)
    columns = friction_columns(qd / law.speed, at_once(qd, law.speed), none, none, none)
    forward, back = columns[:, [TERMS.index(term) for term in law.terms]]
    row = (forward - back) / 2
    return float(row @ law.values), float(np.sqrt(max(row @ law.uncertainty @ row, 0.0)))


def _directions(law: FrictionLaw, q: Array, qd: Array) -> list[Direction]:
    """Directions of friction along rows of samples; at once for axes of unknown friction."""
    successive, found = are_successive(q, qd), []
    for each, positions, velocities in zip(law.axes, q.T, qd.T, strict=True):
        if successive and each is not None and each.presliding:
            found.append(bent(partial(friction_direction, positions), each.presliding))
        else:
            found.append(at_once(velocities, 0.0 if each is None else each.speed))
    return found


def law_columns(
    robot: Robot,
    law: AxisLaw,
    q: Array,
    qd: Array,
    load: Array,
    axis: int,
    direction: Direction,
) -> Array:
    """Columns of the terms of an axis's law, shape (n, n_terms)."""
    angle, slow = motor_angle(robot, q, axis), np.zeros(len(qd))
    v = qd[:, axis]
    if law.speeds is not None:
        v = direction.sign * law.known(np.abs(v))
    columns = friction_columns(v / law.speed, direction, load[:, axis], angle, slow)
    return np.asarray(columns[:, [TERMS.index(term) for term in law.terms]])
